"""record_session: the robot plays prompts, a person mimics it and can stop it, and a paired data set comes out."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MotionError, OptionError, TeleoperationError, nearest_name
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.motions.clip import MotionClip, Motions, Take
from syda_gym.motions.loading import load_motions
from syda_gym.motions.pairing.alignment import Alignment, pair_quality, pair_recordings
from syda_gym.motions.pairing.recorded_session import Session
from syda_gym.teleoperation.calibration import Calibration, Calibrator
from syda_gym.teleoperation.ending import Ending
from syda_gym.teleoperation.incoming.frame_clock import FrameClock
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.outgoing.sinks import Sink
from syda_gym.teleoperation.safety.limiter import CommandLimiter
from syda_gym.teleoperation.safety.watchdog import Ease
from syda_gym.teleoperation.tick import Decision, State

__all__ = ["RecordingOptions", "choose_prompts", "record_session"]

_LEAST = 8  # operator frames without which a prompt counts as missed
_REPEATS = 5  # how often a stop is sent, for a network that loses packets


@dataclass(frozen=True)
class RecordingOptions:
    """How prompts are played.

    Attributes:
        rate: commands per second.
        calibration: seconds of standing before the first prompt.
        axes: the source's axes, see ``calibration.AXES``.
        countdown: seconds in the first pose of a prompt before it begins.
        tail: seconds for which recording goes on after a prompt, for people who are behind.
        max_lag: largest shift in time between person and robot [s].
        patience: seconds to wait for a calibration before giving up.
        ease: share of the speed limits on the way to a prompt's first pose.
    """

    rate: float = 30.0
    calibration: float = 2.0
    axes: str = "kinect"
    countdown: float = 2.0
    tail: float = 1.0
    max_lag: float = 1.0
    patience: float = 60.0
    ease: float = 0.3


def record_session(
    source: Source,
    sink: Sink,
    prompts: Sequence[MotionClip],
    operator: Embodiment,
    *,
    options: RecordingOptions | None = None,
    name: str = "recorded",
    tell: Callable[[str], None] | None = None,
) -> Session:
    """Plays prompts to a person who mimics them and pairs what both did.

    It is the paper's way of recording: the human follows the robot, so that every frame of the robot is exact. The
    person's frames are calibrated to ``operator`` and aligned in time with the commands, by the clock first and by
    limb directions then.

    The robot moves, so it obeys meanwhile, within a tick: ``stop`` is an emergency stop and ends the session, ``pause``
    holds the robot until ``resume`` and plays the prompt again from its beginning, ``rest``, the end of the source and
    a signal (Ctrl-C, SIGTERM, SIGHUP) end the session by way of the rest pose, a second signal there is a stop. Takes
    that are complete are kept.

    Args:
        source: delivers the person's frames and requests; started.
        sink: shows the robot to the person; open.
        prompts: motions of one robot.
        operator: the body that the person counts as.
        options: how prompts are played.
        name: of the data set.
        tell: called with what the person should do now.

    Returns:
        Takes, alignments and quality per action, ready for ``write_dataset`` and ``fit``; prompts during which too few
        frames came are left out with the reason.

    Raises:
        MotionError: no prompts, prompts of several robots, or not one usable take.
        TeleoperationError: nobody could be calibrated.
    """
    robots = {clip.body.name for clip in prompts}
    if len(robots) != 1 or not isinstance(prompts[0].body, Robot):
        raise MotionError(f"prompts must be motions of one robot, got {sorted(robots) or 'none'}")
    chosen, say = options or RecordingOptions(), tell or (lambda text: None)
    takes: list[Take] = []
    alignments: dict[str, Alignment] = {}
    left_out: dict[str, str] = {}
    why = "no prompt was played"
    with Ending() as ending:
        stage = _Stage(source, sink, prompts[0].body, operator, chosen, ending)
        try:
            say("stand still with hanging arms")
            stage.calibrate()
            for number, prompt in enumerate(prompts, start=1):
                label = f"{prompt.recording}#{number}" if prompt.recording in alignments else prompt.recording
                person, robot = _played(stage, prompt, f"{number} of {len(prompts)}", say)
                say("thank you")
                try:
                    takes.append(_paired(person, robot, prompt, label, operator, chosen, alignments))
                except MotionError as error:
                    left_out[label] = str(error)
                if source.inbox.closed:
                    break
            stage.home()
        except _Ended:
            why = "the session was ended"
            say("the robot goes home")
            try:
                stage.home()
            except _Stopped:
                say("STOPPED")
        except _Stopped:
            why = "the robot was stopped"
            say("STOPPED")
    if not takes:
        raise MotionError(f"no usable take: {next(iter(left_out.values()), why)}")
    motions = Motions(name, tuple(takes), {operator.name: operator, prompts[0].body.name: prompts[0].body})
    quality = pair_quality(motions.pair(operator.name, prompts[0].body.name), max_lag=chosen.max_lag)
    return Session(motions, alignments, quality, left_out)


def _played(stage: _Stage, prompt: MotionClip, number: str, say: Callable[[str], None]) -> tuple[_Track, _Track]:
    """What the person and the robot did; from the beginning again after a pause."""
    while True:
        try:
            say(f"{number}: {prompt.action}, take the robot's pose")
            stage.approach(prompt.frames[0])
            say("mimic the robot now")
            return stage.play(prompt)
        except _Again:
            say("once more from the beginning")


class _Again(Exception):  # noqa: N818 - no error
    """Somebody paused the robot and goes on."""


class _Ended(Exception):  # noqa: N818 - no error
    """Somebody wants to end."""


class _Stopped(Exception):  # noqa: N818 - no error
    """Somebody stopped the robot."""


@dataclass
class _Track:
    """Frames and when they came or went."""

    times: list[float] = field(default_factory=list)
    frames: list[FloatArray] = field(default_factory=list)


class _Stage:
    """Moves the robot tick by tick and listens to the person meanwhile."""

    def __init__(
        self,
        source: Source,
        sink: Sink,
        robot: Robot,
        operator: Embodiment,
        options: RecordingOptions,
        ending: Ending,
    ) -> None:
        self.source, self.sink, self.robot, self.options = source, sink, robot, options
        self.operator = operator
        self.calibration: Calibration | None = None
        self._limiter = CommandLimiter(robot)
        where = sink.angles()
        self._command = self._limiter.start(robot.rest if where is None else where)
        self._last = source.clock()
        self._ending, self._signals = ending, 0

    def calibrate(self) -> None:
        calibrator = Calibrator(self.operator, self.options.calibration, self.options.axes)
        stream = FrameClock()
        end = self.source.clock() + self.options.patience
        while self.calibration is None:
            received = self.source.take(0.1)
            self._obey(received.controls)
            if received.packet is not None and received.packet.frame is not None:
                stream.advance(received.arrived, received.packet.sent)
                self.calibration = calibrator.add(stream.time, received.packet.frame)
            elif self.source.clock() > end or self.source.inbox.closed:
                raise TeleoperationError(
                    f"nobody stood still in front of the source: {calibrator.message or 'no frames came'}"
                )

    def approach(self, pose: FloatArray) -> None:
        """Goes to a pose without haste and waits there for the countdown."""
        now = self.source.clock()
        ease = Ease(self._command, self.robot.clamp(pose)[0], self.options.ease * self._limiter.speed, now)
        end = now + ease.duration + self.options.countdown
        while (now := self.source.clock()) < end:
            self._send(now, ease.at(now))
            self._listen(now + 1.0 / self.options.rate, None)
            if self.source.inbox.closed:
                raise _Ended

    def home(self) -> None:
        """Goes to rest; whoever pauses there goes on home, a stop is a stop."""
        self._signals = self._ending.asked
        while True:
            self.source.inbox.reopen()
            try:
                self.approach(self.robot.rest)
                return
            except _Again:
                pass
            except _Ended:
                if self._ending.asked > self._signals:
                    self._stop()

    def play(self, prompt: MotionClip) -> tuple[_Track, _Track]:
        """Plays a prompt at its own speed; returns what the person and the robot did."""
        person, robot = _Track(), _Track()
        begun = self.source.clock()
        end = begun + (len(prompt) - 1) / prompt.fps
        while (now := self.source.clock()) < end + self.options.tail and not self.source.inbox.closed:
            if now <= end:
                self._send(now, _at(prompt, now - begun))
                robot.times.append(now)
                robot.frames.append(self._command)
            self._listen(now + 1.0 / self.options.rate, person)
        return person, robot

    def _send(self, now: float, wanted: FloatArray, state: State = State.FOLLOWING) -> None:
        self._command = self._limiter.move(self._command, wanted, min(now - self._last, 0.1))
        self._last = now
        self.sink.send(Decision(now, state, self._command))

    def _listen(self, until: float, track: _Track | None) -> None:
        """Takes what arrives until the next command is due."""
        while (left := until - self.source.clock()) > 0.0:
            received = self.source.take(left)
            self._obey(received.controls)
            if received.packet is None or received.packet.frame is None or self.calibration is None:
                if self.source.inbox.closed:
                    return
                continue
            frame = received.packet.frame
            if track is not None and not self.calibration.implausible(frame):
                track.times.append(received.arrived)
                track.frames.append(self.calibration.apply(frame))

    def _obey(self, controls: Sequence[str]) -> None:
        if "stop" in controls:
            self._stop()
        if self._ending.asked > self._signals or "rest" in controls:
            raise _Ended
        if "pause" in controls:
            self._hold()

    def _hold(self) -> None:
        """Stands where the robot is until somebody wants to go on."""
        while True:
            now = self.source.clock()
            self._send(now, self._command, State.PAUSED)
            while (left := now + 1.0 / self.options.rate - self.source.clock()) > 0.0:
                controls = self.source.take(left).controls
                self._obey([control for control in controls if control != "pause"])
                if self.source.inbox.closed:
                    raise _Ended
                if "resume" in controls:
                    raise _Again

    def _stop(self) -> None:
        """Emergency stop: first the robot's own, then the command that it stands, more than once."""
        problem = ""
        try:
            self.sink.stop()
        except Exception as error:  # the command that it stands goes out all the same
            problem = f"the robot's own stop failed: {error!r}; USE THE ROBOT'S SWITCH"
        for _ in range(_REPEATS):
            now = self.source.clock()
            self._send(now, self._command, State.STOPPED)
            self.source.take(1.0 / self.options.rate)
        if problem:
            raise TeleoperationError(problem)
        raise _Stopped


def _paired(
    person: _Track,
    robot: _Track,
    prompt: MotionClip,
    label: str,
    operator: Embodiment,
    options: RecordingOptions,
    alignments: dict[str, Alignment],
) -> Take:
    """One take, evenly spaced and aligned."""
    if len(person.frames) < _LEAST or len(robot.frames) < _LEAST:
        raise MotionError(f"only {len(person.frames)} frames of the person came while {label} was played")
    clips = [
        MotionClip(
            body,
            np.array(track.frames),
            (len(track.times) - 1) / max(track.times[-1] - track.times[0], 1e-3),
            prompt.action,
            label,
            timestamps=np.array(track.times),
        )
        for body, track in ((operator, person), (prompt.body, robot))
    ]
    take, found = pair_recordings(clips[0], clips[1], fps=prompt.fps, max_lag=options.max_lag, same_clock=True)
    alignments[label] = found
    return Take(label, prompt.action, take.fps, take.frames, filled=take.filled)


def _at(prompt: MotionClip, seconds: float) -> FloatArray:
    """The prompt's pose at a time, linear between frames."""
    place = min(max(seconds * prompt.fps, 0.0), len(prompt) - 1.0)
    before = min(int(place), len(prompt) - 2) if len(prompt) > 1 else 0
    after = min(before + 1, len(prompt) - 1)
    share = place - before
    blended: FloatArray = (1.0 - share) * prompt.frames[before] + share * prompt.frames[after]
    return blended


def choose_prompts(
    motions: str | os.PathLike[str] | Motions,
    robot: str,
    operator: str,
    *,
    actions: Sequence[str] = (),
    takes: int = 1,
) -> tuple[list[MotionClip], Embodiment]:
    """The prompts of a session and the body that the person counts as.

    A robot without motions of its own gets those of another robot, carried over by limb directions.

    Args:
        motions: where the prompts come from.
        robot: who plays them.
        operator: the person's body, from the motions or the catalog.
        actions: which actions; all if empty.
        takes: prompts per action.

    Raises:
        OptionError: an action that does not exist.
        MotionError: no robot's motions to take prompts from.
        EmbodimentError: unknown names.
    """
    data = load_motions(motions)
    leader = data.bodies[operator] if operator in data.bodies else catalog.get(operator)
    clips = _robot_clips(data, robot)
    known = list(dict.fromkeys(clip.action for clip in clips))
    for action in actions:
        if action not in known:
            raise OptionError(f"no action {action!r} in {data.name}; {nearest_name(action, known)}")
    chosen = [clip for action in (actions or known) for clip in [c for c in clips if c.action == action][:takes]]
    return chosen, leader


def _robot_clips(data: Motions, robot: str) -> list[MotionClip]:
    follower = data.bodies[robot] if robot in data.bodies else catalog.get(robot)
    if not isinstance(follower, Robot):
        raise MotionError(f"{robot!r} is a {follower.kind}; prompts are played by a robot")
    if robot in data.bodies:
        return [clip for clip in data.clips(robot) if not clip.mirrored]
    others = [name for name, body in data.bodies.items() if isinstance(body, Robot)]
    if not others:
        raise MotionError(f"{data.name} holds no robot's motions to take prompts from; name others with --motions")
    carry = unfitted(data.bodies[others[0]], follower)
    return [
        MotionClip(follower, carry.sequence(clip.frames, clip.fps), clip.fps, clip.action, clip.recording)
        for clip in data.clips(others[0])
        if not clip.mirrored
    ]
