"""TeleoperationLoop: calibrate, doubt, map, filter, move within limits; one tick in, one decision out."""

from __future__ import annotations

import copy
import math

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError, SydaError, TeleoperationError, nearest_name
from syda_gym.mappings.mapping import Mapping
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.teleoperation.calibration import Calibration, Calibrator
from syda_gym.teleoperation.guarded import GuardedMapping
from syda_gym.teleoperation.incoming.frame_clock import FrameClock
from syda_gym.teleoperation.safety.homing import WayHome
from syda_gym.teleoperation.safety.limiter import CommandLimiter
from syda_gym.teleoperation.safety.motion import Motion
from syda_gym.teleoperation.safety.one_euro import OneEuroFilter
from syda_gym.teleoperation.safety.plausibility import Plausibility
from syda_gym.teleoperation.safety.trust import ConfidencePolicy
from syda_gym.teleoperation.safety.watchdog import Watch, Watchdog
from syda_gym.teleoperation.tick import CONTROLS, Decision, LoopSettings, State, Tick

__all__ = ["TeleoperationLoop"]

_GENTLE = 0.2  # speed factor at the beginning of a soft start
_ARRIVED = 1e-3  # rad
_TO_FULL_SPEED = 0.2  # s; from a standstill, where no acceleration is given
_STALL = 2.0  # periods without a step after which the start is gentle again
_SHORTEST = 1e-3  # s; frames that arrive together are taken to be so far apart


class TeleoperationLoop:
    """Turns a stream of operator frames into commands that a robot can always execute.

    Whatever comes in, every command lies within the joint limits (coupled ones included), no joint is faster or
    accelerates more than it may between two commands, and no command touches the robot's own body where the one before
    did not. An emergency stop alone brakes harder. The loop knows no network, no clock and no randomness: the same
    ticks give the same decisions, bit for bit.

    Args:
        mapping: from the operator's body to a robot; a chain will do.
        settings: see ``LoopSettings``.
        start: joint angles that the robot has now ``(n,)`` [rad]; its rest pose if not given.
        confidence: overrides the thresholds of the settings.

    Attributes:
        robot: the mapping's target.
        state: what the loop is doing.
        calibration: the operator's, once there is one.
        notices: what a person should know: no error bound, no collision shapes, centimetres for metres.

    Raises:
        TeleoperationError: the mapping does not end at a robot.
        OptionError: a setting is out of range.
    """

    def __init__(
        self,
        mapping: Mapping,
        settings: LoopSettings | None = None,
        start: FloatArray | None = None,
        confidence: ConfidencePolicy | None = None,
    ) -> None:
        self.settings = settings or LoopSettings()
        self.mapping = mapping
        self._guarded = GuardedMapping(mapping)
        self.robot = self._guarded.robot
        self._policy = confidence or _policy(self.settings, self.robot.reach)
        limiter = CommandLimiter(self.robot, self.settings.speed)
        self._collision = (
            SelfCollision(self.robot, self.settings.self_collision) if self.settings.self_collision >= 0.0 else None
        )
        self._watchdog = Watchdog(self.settings.silence, self.settings.hold)
        self._presence = Watchdog(self.settings.silence, self.settings.hold)  # of anybody, while calibrating anew
        self._filter = OneEuroFilter(self.settings.cutoff, self.settings.beta) if self.settings.cutoff > 0.0 else None
        self._calibrator = Calibrator(mapping.source, self.settings.calibration, self.settings.axes)
        self.calibration: Calibration | None = None
        self._plausibility: Plausibility | None = None
        self.notices = list(self._guarded.notices)
        if self._collision is not None and self._collision.why:
            self.notices.append(self._collision.why)
        self._motion = _motion(self.settings, limiter, self._collision, start)
        self._target = self._motion.command
        self._last: float | None = None
        self._frame: FloatArray | None = None
        self._standing = FrameClock()  # of the frames that the calibration takes
        self._seen = FrameClock()  # of all frames of a calibrated person
        self._targets = FrameClock()  # of those that moved the target
        self._trust = 0.0
        self._following_since = 0.0
        self._home = WayHome(self.robot.rest, self.settings.ease * limiter.speed, self._collision)
        self._speed = limiter.speed
        self._held_back = False
        self._ease_asked = False
        self._has_moved = False
        self.state = State.CALIBRATING

    @property
    def command(self) -> FloatArray:
        """The last command ``(n,)`` [rad]."""
        return self._motion.command.copy()

    @property
    def acceleration(self) -> FloatArray:
        """Greatest acceleration of the joints ``(n,)`` [rad/s^2]."""
        return _acceleration(self.settings, self._speed)

    @property
    def target(self) -> FloatArray:
        """Where the mapping, or the way home, asks the robot to be ``(n,)`` [rad]; for whoever shows it."""
        return self._target

    @property
    def frame(self) -> FloatArray | None:
        """The operator's last frame ``(F,)`` in the mapping's unit and axes, or ``None``; for whoever shows it."""
        frame, calibration = self._frame, self.calibration
        return None if frame is None or calibration is None else calibration.apply(frame)

    @property
    def calibration_message(self) -> str:
        """Why the operator is not calibrated yet; empty if nothing was refused."""
        return self._calibrator.message

    def step(self, tick: Tick) -> Decision:
        """Decides on the next command.

        Args:
            tick: time, and a frame or requests if there are any.

        Raises:
            TeleoperationError: the clock went back, or an unknown request.
        """
        self._advance(tick)
        for control in tick.controls:
            self._request(control, tick)
        reasons: list[str] = []
        bound, used = float("nan"), False
        if tick.frame is not None and self.state is not State.STOPPED:
            bound, used = self._take(tick, reasons)
        factor = self._choose(tick.now, reasons)
        self._move(factor, reasons)
        return Decision(tick.now, self.state, self.command, bound, factor, tuple(reasons), used)

    def rehearse(self) -> None:
        """Goes through a step with the last frame once more and changes nothing.

        What a processor has just done it does several times faster than what it did a thirtieth of a second ago.
        """
        if self._frame is None or self.calibration is None or self._last is None:
            return
        twin = copy.copy(self)
        # Whatever a step changes must be the twin's own; the rest is never written to.
        twin._watchdog, twin._guarded = copy.copy(self._watchdog), copy.copy(self._guarded)
        twin._standing = copy.copy(self._standing)
        twin._presence, twin._seen = copy.copy(self._presence), copy.copy(self._seen)
        twin._filter, twin._targets = copy.copy(self._filter), copy.copy(self._targets)
        twin._plausibility = None if self._plausibility is None else self._plausibility.twin()
        twin._calibrator, twin.notices = Calibrator(self.mapping.source, 0.0, self.settings.axes), []
        twin._home = WayHome(self.robot.rest, self.settings.ease * self._speed, self._collision)
        twin._motion = self._motion.twin()
        twin.step(Tick(self._last + 1.0 / self.settings.rate, self._frame))

    def settle(self) -> None:
        """Work that can wait until the command is out; without it the next steps take longer and decide the same."""
        if self._collision is not None:
            self._collision.measure(self._motion.command)

    def _advance(self, tick: Tick) -> None:
        now = tick.now
        if not math.isfinite(now) or (self._last is not None and now < self._last):
            raise TeleoperationError(f"the loop's clock went from {self._last} to {now}; use a monotonic clock")
        longest = max(_STALL / self.settings.rate, self.settings.silence)
        if self._last is not None and now - self._last > longest and self.state is State.FOLLOWING:
            # The process stood still, for example in a suspended laptop: nobody knows what the person did meanwhile.
            self.state = State.HOLDING
        self._last = now
        self._motion.begin(now, tick.left, tick.leaving)

    def _request(self, control: str, tick: Tick) -> None:
        if control not in CONTROLS:
            raise OptionError(f"unknown control {control!r}; {nearest_name(control, CONTROLS)}")
        if control == "stop":
            self.state = State.STOPPED
        elif self.state is State.STOPPED:
            if control == "release":  # nothing else ends an emergency stop
                self._release(tick.position)
        elif control == "pause":
            self._enter_pause()
        elif control == "resume" and (self.state is State.PAUSED or self._ease_asked):
            self._ease_asked = False
            self._watchdog.wake(tick.now)
            self._presence.wake(tick.now)
            self.state = State.HOLDING if self.calibration else State.CALIBRATING
        elif control == "calibrate":
            self._forget_person(tick.now)
        elif control == "rest":
            self._ease_asked = True
            self._home.begin(self._motion.command, tick.now)

    def _release(self, position: FloatArray | None) -> None:
        """Ends an emergency stop: paused, and where the robot says it is."""
        if position is not None:
            self._motion.place(self.robot.check(position)[0])
            self._target = self._motion.command
        self._enter_pause()

    def _enter_pause(self) -> None:
        self.state = State.PAUSED
        self._home.end()

    def _forget_person(self, now: float) -> None:
        """Calibrates anew; a paused robot stays paused."""
        self.calibration = self._plausibility = None
        self._calibrator = Calibrator(self.mapping.source, self.settings.calibration, self.settings.axes)
        self._presence.wake(now)
        if self.state is not State.PAUSED:
            self.state = State.CALIBRATING

    def _take(self, tick: Tick, reasons: list[str]) -> tuple[float, bool]:
        """Calibrates with the frame or maps it; returns the error bound and whether the target moved."""
        frame = tick.frame
        assert frame is not None  # the caller looked; for the type checker
        if frame.shape != (self.mapping.source.n_features,) or not math.isfinite(sum(frame.tolist())):
            reasons.append("frame: wrong shape or not finite")
            return float("nan"), False
        self._presence.feed(tick.now)
        if self.calibration is None:
            self._calibrate(tick, frame, reasons)
        if self.calibration is None or self.state is State.PAUSED:
            return float("nan"), False
        self._frame = frame
        doubted = self._doubt(tick, frame, reasons)
        if doubted is None:
            return float("nan"), False
        frame, trust = doubted
        passed, anew = self._passed(tick)
        try:
            mapped = self._guarded(self.calibration.apply(frame), passed)
        except (SydaError, ArithmeticError, ValueError) as error:  # a robot in motion must survive any mapping
            reasons.append(f"mapping: {' '.join(str(error).split())[:200] or type(error).__name__}")
            return float("nan"), False
        trust = min(trust, self._policy.factor(mapped.bound if self._guarded.bounded else 0.0, tick.tracking))
        if trust == 0.0:
            reasons.append("confidence: held")
            self._trust = 0.0
            return mapped.bound, False
        if trust < 1.0 and not any(reason.startswith("person") for reason in reasons):
            reasons.append("confidence: slowed")
        if mapped.unfamiliar:
            reasons.append("unfamiliar: slowed")
            trust = min(trust, self.settings.unfamiliar)
        self._trust = trust
        self._aim(mapped.angles, tick, passed, anew)
        return mapped.bound, True

    def _doubt(self, tick: Tick, frame: FloatArray, reasons: list[str]) -> tuple[FloatArray, float] | None:
        """The frame, mended if need be, and how far it is trusted; ``None`` if it is dropped."""
        assert self.calibration is not None  # the caller looked; for the type checker
        odd = self.calibration.implausible(frame)
        if odd:
            reasons.append(f"frame: {odd}")
            return None
        if self._plausibility is None:
            return frame, 1.0
        verdict = self._plausibility.judge(frame, self._seen.advance(tick.now, tick.sent))
        if verdict.reason:
            reasons.append(f"person: {verdict.reason}")
        if verdict.lost:
            self._calibrate(tick, frame, reasons)  # whoever stands still with hanging arms is the operator
        if verdict.thawed and self.state is State.FOLLOWING:
            self.state = State.HOLDING  # the start is gentle
        return None if verdict.frame is None else (verdict.frame, verdict.trust)

    def _calibrate(self, tick: Tick, frame: FloatArray, reasons: list[str]) -> None:
        self._standing.advance(tick.now, tick.sent)
        found = self._calibrator.add(self._standing.time, frame)
        if found is None:
            if self.calibration is None:
                reasons.append("calibrating")
            return
        self.calibration = found
        self._plausibility = Plausibility(found) if found.measured else None
        self._calibrator = Calibrator(self.mapping.source, self.settings.calibration, self.settings.axes)
        self.notices.extend(notice for notice in found.notices if notice not in self.notices)
        if self.state is State.CALIBRATING or self.state is State.FOLLOWING:
            self.state = State.HOLDING

    def _passed(self, tick: Tick) -> tuple[float, bool]:
        """Time since the frame before [s], and whether that one is not the operator's past any more."""
        passed = self._targets.advance(tick.now, tick.sent)
        anew = self._watchdog.verdict(tick.now) is not Watch.FOLLOW or not 0.0 <= passed < 1.0
        if anew:
            self._guarded.reset()
        return max(passed, _SHORTEST), anew

    def _aim(self, angles: FloatArray, tick: Tick, passed: float, anew: bool) -> None:
        """Filters the mapped angles into the target and feeds the watchdog."""
        self._watchdog.feed(tick.now)
        if self._filter is None:
            self._target = angles
            return
        if anew:
            self._filter.reset(angles)
        self._target = self._filter(angles, passed)

    def _choose(self, now: float, reasons: list[str]) -> float:
        """Moves the state on; returns the speed factor, 0 to stand still."""
        if self.state in (State.STOPPED, State.PAUSED):
            return 0.0
        if self._ease_asked:
            return self._on_the_way_home(now)
        if self.calibration is None:
            if not self._has_moved or self._presence.verdict(now) is not Watch.EASE:
                self.state = State.CALIBRATING
                return 0.0
            return self._on_the_way_home(now)
        verdict = self._watchdog.verdict(now)
        if verdict is Watch.FOLLOW and self._trust > 0.0:
            if self.state is not State.FOLLOWING:
                self.state, self._following_since = State.FOLLOWING, now
                self._has_moved = True
                self._home.end()
            self._home.remember(self._motion.command)
            return self._trust * self._soft_start(now)
        if verdict is not Watch.EASE:
            self.state = State.HOLDING
            if verdict is Watch.HOLD:
                reasons.append("watchdog: no good frame")
            return 0.0
        return self._on_the_way_home(now)

    def _on_the_way_home(self, now: float) -> float:
        command = self._motion.command
        self._target = self._home.target(command, now, not self._held_back)
        arrived = float(np.max(np.abs(command - self.robot.rest))) < _ARRIVED
        self.state = State.RESTING if arrived else State.EASING
        return self.settings.ease

    def _soft_start(self, now: float) -> float:
        if self.settings.soft_start <= 0.0:
            return 1.0
        return min(1.0, _GENTLE + (1.0 - _GENTLE) * (now - self._following_since) / self.settings.soft_start)

    def _move(self, factor: float, reasons: list[str]) -> None:
        self._held_back = False
        if self.state is State.STOPPED:
            self._motion.freeze()
        elif factor <= 0.0:
            self._motion.brake()
        else:
            moved = self._motion.follow(self._target, factor)
            self._held_back = moved.held_back
            if self._motion.slowed:
                reasons.append("timing: slowed")
            if moved.detour:
                reasons.append("self-collision: detour")
            elif moved.held_back:
                reasons.append("self-collision: held back")


def _motion(
    settings: LoopSettings, limiter: CommandLimiter, collision: SelfCollision | None, start: FloatArray | None
) -> Motion:
    robot = limiter.robot
    return Motion(
        limiter,
        collision,
        1.0 / settings.rate,
        _acceleration(settings, limiter.speed),
        None if settings.jerk is None else np.full(robot.n_features, settings.jerk),
        robot.rest if start is None else robot.check(start)[0],
    )


def _acceleration(settings: LoopSettings, speed: FloatArray) -> FloatArray:
    if settings.acceleration is not None:
        return np.full(len(speed), settings.acceleration)
    result: FloatArray = speed / _TO_FULL_SPEED
    return result


def _policy(settings: LoopSettings, reach: float) -> ConfidencePolicy:
    default = ConfidencePolicy.for_reach(reach)
    return ConfidencePolicy(
        slow=default.slow if settings.bound_slow is None else settings.bound_slow,
        hold=default.hold if settings.bound_hold is None else settings.bound_hold,
    )
