"""Recording a pair live: the robot prompts, somebody mimics, a data set comes out."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MotionError, TeleoperationError
from syda_gym.mappings.fitting.fit import fit
from syda_gym.motions import read_dataset, validate_dataset, write_dataset
from syda_gym.motions.clip import MotionClip
from syda_gym.teleoperation.incoming.inbox import Inbox, Received
from syda_gym.teleoperation.incoming.packets import Packet
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.outgoing.sinks import MemorySink
from syda_gym.teleoperation.setup.record_session import RecordingOptions, record_session
from syda_gym.teleoperation.tick import Decision, State

QUICK = RecordingOptions(calibration=0.4, countdown=0.2, tail=0.4, max_lag=0.5, patience=3.0, ease=1.0)


class SimulatedInbox(Inbox):
    """Its waiting moves a simulated clock on, so that a session takes no time and never a frame is late."""

    def __init__(self, source: Mimic) -> None:
        super().__init__()
        self.source = source

    def take(self, timeout: float) -> Received:
        source = self.source
        if source.asks:
            return Received(None, 0.0, (source.asks.pop(0),))
        if source.due > source.now + timeout:
            source.now += timeout
            return Received(None, 0.0, ())
        source.now = source.due
        source.due += 0.03
        return Received(Packet(source.number, source.now, source.frame()), source.now, ())


class Mimic(Source):
    """Somebody 1.3 times the adult's size who stands for a second and then does what the robot did 0.15 s ago."""

    def __init__(self, body: HumanSkeleton, robot: Robot, sink: MemorySink, lag: float = 0.15) -> None:
        super().__init__(body, clock=lambda: self.now)
        self.robot, self.sink, self.lag = robot, sink, lag
        self.now, self.due, self.number = 0.0, 0.0, 0
        self.asks: list[str] = []
        self.inbox = SimulatedInbox(self)

    def frame(self) -> FloatArray:
        assert isinstance(self.body, HumanSkeleton)
        self.number += 1
        seen = [d for d in list(self.sink.decisions) if d.now <= self.now - self.lag]
        if not seen or self.now < 0.7:
            return 1.3 * self.body.standing()
        limbs = np.diff(self.robot.arm_points(seen[-1].command), axis=2)[0]
        limbs *= self.body.arm_lengths[..., None] / np.linalg.norm(limbs, axis=-1, keepdims=True)
        points = self.body.arm_points(self.body.standing())[0]
        points[:, 1] = points[:, 0] + limbs[:, 0]
        points[:, 2] = points[:, 1] + limbs[:, 1]
        return 1.3 * self.body.frames_from_points(points[None])[0]

    def _run(self) -> None:
        """Frames come when they are asked for."""


@pytest.fixture
def prompts(pepper: Robot) -> list[MotionClip]:
    rng = np.random.default_rng(0)
    clips = []
    for action in ("wave", "reach"):
        goal = pepper.clamp(pepper.rest + rng.uniform(-1.0, 1.0, pepper.n_features))[0]
        swing = 0.5 * (1.0 - np.cos(np.linspace(0.0, 2.0 * np.pi, 45)))[:, None]
        clips.append(MotionClip(pepper, pepper.clamp(pepper.rest + swing * (goal - pepper.rest)), 30.0, action, action))
    return clips


def test_a_recorded_session_can_be_fitted(
    adult: HumanSkeleton, pepper: Robot, prompts: list[MotionClip], tmp_path: Path
) -> None:
    sink, said = MemorySink(), list[str]()
    with Mimic(adult, pepper, sink) as source:
        session = record_session(source, sink, prompts, adult, options=QUICK, name="mine", tell=said.append)
    assert said[0] == "stand still with hanging arms"
    assert "1 of 2: wave, take the robot's pose" in said
    assert not session.left_out
    assert [quality.action for quality in session.quality] == ["reach", "wave"]
    assert {quality.verdict for quality in session.quality} == {"good"}
    for found in session.alignments.values():
        assert found.lag == pytest.approx(0.15, abs=0.12), "the person's lag is found"
    folder = write_dataset(session.motions, tmp_path / "mine")
    assert not [finding for finding in validate_dataset(folder) if finding.level == "error"]
    pair = read_dataset(folder).pair("adult", "pepper")
    mapping = fit(pair, method="ridge")
    assert np.linalg.norm(pepper.landmarks(mapping(pair.source)) - pepper.landmarks(pair.target), axis=-1).mean() < 0.05
    reach = np.linalg.norm(np.diff(adult.arm_points(pair.source), axis=2), axis=-1).sum(axis=-1)
    assert np.median(reach) == pytest.approx(adult.reach, rel=0.02), "the person is calibrated to the adult"
    path = np.array([decision.command for decision in sink.decisions])
    times = np.array([decision.now for decision in sink.decisions])
    assert not pepper.violations(path, 0.0).any()
    assert (np.abs(np.diff(path, axis=0)) <= pepper.speed * np.diff(times)[:, None]).all()


def test_a_person_who_leaves_and_nobody_at_all(adult: HumanSkeleton, pepper: Robot, prompts: list[MotionClip]) -> None:
    class Leaver(Mimic):
        def frame(self) -> FloatArray:
            self.number += 1
            if self.number == 25:
                self.due = np.inf
            return self.body.standing()  # type: ignore[attr-defined, no-any-return]

    sink = MemorySink()
    with Leaver(adult, pepper, sink) as source, pytest.raises(MotionError, match="no usable take: only"):
        record_session(source, sink, prompts[:1], adult, options=QUICK)

    class Nobody(Mimic):
        def _run(self) -> None:
            self.due = np.inf
            self.inbox.close()

    with Nobody(adult, pepper, sink) as source, pytest.raises(TeleoperationError, match="no frames came"):
        record_session(source, sink, prompts, adult, options=QUICK)
    with pytest.raises(MotionError, match="motions of one robot"):
        record_session(source, sink, [], adult)


class Watched(MemorySink):
    """Does something after some commands, and remembers its stops."""

    def __init__(self, then: dict[int, Callable[[], object]]) -> None:
        super().__init__()
        self.then, self.stops = then, list[int]()

    def send(self, decision: Decision) -> None:
        super().send(decision)
        self.then.pop(len(self.decisions), lambda: None)()

    def stop(self) -> None:
        self.stops.append(len(self.decisions))


@pytest.mark.parametrize("moment", [3, 40, 70, 120])  # on the way to a prompt, while it is played, in the second one
def test_a_person_who_records_can_stop_the_robot_at_once(
    adult: HumanSkeleton, pepper: Robot, prompts: list[MotionClip], moment: int
) -> None:
    sink = Watched({moment: lambda: source.asks.append("stop")})
    said: list[str] = []
    with Mimic(adult, pepper, sink) as source:
        if moment < 100:
            with pytest.raises(MotionError, match="the robot was stopped"):
                record_session(source, sink, prompts, adult, options=QUICK, tell=said.append)
        else:
            session = record_session(source, sink, prompts, adult, options=QUICK, tell=said.append)
            assert [take.action for take in session.motions.takes] == ["wave"], "what is complete is kept"
    path, states = [d.command for d in sink.decisions], [d.state for d in sink.decisions]
    assert sink.stops == [moment], "before any other command"
    assert states[moment:] == [State.STOPPED] * len(states[moment:])
    assert len(states) > moment + 3, "said more than once"
    assert all((command == path[moment - 1]).all() for command in path[moment:]), "not one step further"
    assert said[-1] == "STOPPED"


def test_a_stop_whose_robot_fails_is_told(adult: HumanSkeleton, pepper: Robot, prompts: list[MotionClip]) -> None:
    class Deaf(Watched):
        def stop(self) -> None:
            raise OSError("no route")

    sink = Deaf({40: lambda: source.asks.append("stop")})
    with Mimic(adult, pepper, sink) as source, pytest.raises(TeleoperationError, match="USE THE ROBOT'S SWITCH"):
        record_session(source, sink, prompts, adult, options=QUICK)
    assert sink.decisions[-1].state is State.STOPPED


def test_a_pause_holds_the_robot_and_plays_the_prompt_again(
    adult: HumanSkeleton, pepper: Robot, prompts: list[MotionClip]
) -> None:
    sink = Watched({70: lambda: source.asks.append("pause"), 90: lambda: source.asks.append("resume")})
    said: list[str] = []
    with Mimic(adult, pepper, sink) as source:
        session = record_session(source, sink, prompts, adult, options=QUICK, tell=said.append)
    held = [d for d in sink.decisions if d.state is State.PAUSED]
    assert len(held) >= 15
    assert all((d.command == held[0].command).all() for d in held)
    assert "once more from the beginning" in said
    assert [take.action for take in session.motions.takes] == ["wave", "reach"]
    assert {quality.verdict for quality in session.quality} == {"good"}


@pytest.mark.parametrize("how", ["rest", "quit", "signal"])
def test_the_end_of_a_session_is_the_rest_pose_and_can_be_stopped_on_the_way(
    adult: HumanSkeleton, pepper: Robot, prompts: list[MotionClip], how: str
) -> None:
    def end() -> None:
        if how == "signal":
            os.kill(os.getpid(), signal.SIGTERM)
        elif how == "rest":
            source.asks.append("rest")
        else:
            source.inbox.close()

    for stopped in (False, True):
        sink = Watched({140: end, **({150: lambda: source.asks.append("stop")} if stopped else {})})
        with Mimic(adult, pepper, sink) as source:
            session = record_session(source, sink, prompts, adult, options=QUICK)
        assert session.motions.takes[0].action == "wave"
        last = sink.decisions[-1]
        if stopped:
            assert sink.stops == [150]
            assert last.state is State.STOPPED
        else:
            assert not sink.stops
            assert np.abs(last.command - pepper.rest).max() < 1e-3
