"""What the loop does with a stream: start, follow, slow, hold, go home, stop; and never a forbidden command."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError, OptionError, TeleoperationError
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import Decision, LoopSettings, State, Tick
from tests.teleoperation.conftest import LimbMapping

DT = 1 / 30
Wave = Callable[[float], FloatArray]


class Stage:
    """Feeds a loop tick by tick and remembers what it decided."""

    def __init__(self, mapping: LimbMapping, **settings: float) -> None:
        self.loop = TeleoperationLoop(mapping, LoopSettings(**settings))  # type: ignore[arg-type]
        self.now = 0.0
        self.decisions: list[Decision] = []

    def feed(self, frame: FloatArray | None = None, *controls: str, tracking: float = 1.0) -> Decision:
        self.now += DT
        self.decisions.append(self.loop.step(Tick(self.now, frame, self.now, tracking, controls)))
        return self.decisions[-1]

    def calibrated(self, adult: HumanSkeleton) -> Stage:
        for _ in range(70):
            self.feed(adult.standing())
        assert self.loop.calibration is not None
        return self

    def run(self, wave: Wave, seconds: float) -> Stage:
        for index in range(int(seconds / DT)):
            self.feed(wave(index * DT))
        return self

    @property
    def path(self) -> FloatArray:
        return np.array([decision.command for decision in self.decisions])

    def check(self, robot: Robot) -> None:
        times = np.array([decision.now for decision in self.decisions])
        assert not robot.violations(self.path, 0.0).any()
        velocity = np.diff(self.path, axis=0) / np.diff(times)[:, None]
        assert (np.abs(velocity) <= robot.speed * (1 + 1e-9)).all()
        change = np.abs(np.diff(velocity, axis=0)) / (0.5 * (np.diff(times)[1:] + np.diff(times)[:-1]))[:, None]
        stopped = np.array([decision.state is State.STOPPED for decision in self.decisions[2:]])
        assert (change[~stopped] <= self.loop.acceleration * (1 + 1e-6)).all()


def test_it_waits_for_the_calibration_then_starts_gently(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave
) -> None:
    stage = Stage(mapping)
    stage.run(wave, 1.0)
    assert {decision.state for decision in stage.decisions} == {State.CALIBRATING}
    assert (stage.path == mapping.target.rest).all(), "nobody stands there, nothing moves"
    stage = Stage(mapping).calibrated(adult)
    first = next(decision for decision in stage.decisions if decision.state is State.FOLLOWING)
    assert first.factor == pytest.approx(0.2), "a soft start"
    assert stage.feed(adult.standing()).state is State.FOLLOWING


def test_it_follows_within_all_limits(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot) -> None:
    stage = Stage(mapping).calibrated(adult).run(wave, 8.0)
    stage.check(pepper)
    wanted = np.array([mapping(wave(index * DT)) for index in range(240)])
    error = np.linalg.norm(pepper.landmarks(stage.path[-150:]) - pepper.landmarks(wanted[-150:]), axis=-1)
    assert error.mean() < 0.04, "the filter costs little"


def test_no_command_touches_the_robot_s_own_body(mapping: LimbMapping, adult: HumanSkeleton, pepper: Robot) -> None:
    stage = Stage(mapping, cutoff=0.0).calibrated(adult)
    check = stage.loop._collision
    assert check is not None
    rng, held = np.random.default_rng(2), 0
    for _ in range(60):
        mapping.fixed = pepper.clamp(rng.uniform(pepper.lower, pepper.upper))[0]
        for count in range(20):
            decision = stage.feed(adult.standing() + 1e-4 * count)
            held += "self-collision: held back" in decision.reasons
            assert not check.touches(decision.command)
    assert held > 5, "some of these poses do touch"
    stage.check(pepper)


def test_silence_holds_then_eases_to_rest_then_frames_wake_it(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot
) -> None:
    stage = Stage(mapping).calibrated(adult).run(wave, 2.0)
    states = [stage.feed().state for _ in range(300)]
    order = list(dict.fromkeys(states))
    assert order == [State.FOLLOWING, State.HOLDING, State.EASING, State.RESTING]
    assert states.count(State.HOLDING) == pytest.approx(30, abs=2)
    assert np.abs(stage.path[-1] - pepper.rest).max() < 1e-3
    steps = np.abs(np.diff(stage.path[-250:], axis=0)) / DT
    assert (steps <= 0.2 * pepper.speed + 1e-9).all(), "the way home is slow"
    awake = stage.feed(wave(2.0))
    assert awake.state is State.FOLLOWING
    assert awake.factor < 0.3
    stage.check(pepper)


def test_a_large_error_bound_slows_then_holds_then_eases(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave
) -> None:
    stage = Stage(mapping).calibrated(adult).run(wave, 2.0)
    assert stage.decisions[-1].factor == 1.0
    mapping.bound = mapping.target.reach
    slowed = stage.feed(wave(2.0))
    assert slowed.factor == pytest.approx(1 - 0.85 * 0.5, abs=0.01)
    assert "confidence: slowed" in slowed.reasons
    mapping.bound = 2.0
    held = stage.feed(wave(2.0))
    assert held.state is State.HOLDING
    assert held.factor == 0.0
    assert "confidence: held" in held.reasons
    for _ in range(45):
        last = stage.feed(wave(2.0))
    assert last.state is State.EASING
    mapping.bound = 0.05
    assert stage.feed(wave(2.0)).state is State.FOLLOWING


def test_poor_tracking_and_unfamiliar_poses_slow_it(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave) -> None:
    stage = Stage(mapping).calibrated(adult).run(wave, 2.0)
    assert stage.feed(wave(2.0), tracking=0.4).factor < 0.8
    mapping.strange = True
    for _ in range(3):  # a look at every third frame
        strange = stage.feed(wave(2.0))
    assert strange.factor == 0.5
    assert "unfamiliar: slowed" in strange.reasons
    assert stage.feed(wave(2.0), tracking=0.1).factor == 0.0


def test_pause_stop_and_rest(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot) -> None:
    stage = Stage(mapping).calibrated(adult).run(wave, 2.0)
    assert stage.feed(wave(2.0), "pause").state is State.PAUSED
    for _ in range(8):  # it brakes as it accelerates
        paused = stage.feed(wave(2.0))
    assert all((stage.feed(wave(2 + i * DT)).command == paused.command).all() for i in range(60)), "a pause has no end"
    waiting = stage.feed(None, "resume")
    assert waiting.state is State.HOLDING, "nobody moves yet"
    assert (waiting.command == paused.command).all()
    assert stage.feed(wave(4.0)).state is State.FOLLOWING
    stopped = stage.feed(wave(4.0), "stop")
    for control in ("resume", "rest", "pause", "calibrate"):
        after = stage.feed(wave(4.0), control)
        assert after.state is State.STOPPED, "only a release ends an emergency stop"
        assert (after.command == stopped.command).all()
    assert stage.feed(wave(4.0), "release").state is State.PAUSED
    stage.feed(wave(4.0), "resume")
    stage.feed(wave(4.0), "rest")
    for _ in range(200):
        last = stage.feed(wave(4.0))
    assert last.state is State.RESTING, "asked to rest, it does not follow"
    assert stage.feed(wave(4.0), "resume").state is State.FOLLOWING
    assert stage.feed(wave(4.0), "calibrate").state is State.CALIBRATING
    stage.check(pepper)
    with pytest.raises(OptionError, match="did you mean 'pause'"):
        stage.feed(None, "paus")


@pytest.mark.parametrize("error", [MappingError("no"), ValueError("bad"), ZeroDivisionError(), FloatingPointError()])
def test_a_mapping_that_fails_is_a_silent_one(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, error: Exception
) -> None:
    stage = Stage(mapping).calibrated(adult).run(wave, 1.0)
    mapping.broken = error
    states = [stage.feed(wave(1.0)).state for _ in range(60)]
    assert states[-1] is State.EASING
    assert any(reason.startswith("mapping: ") for reason in stage.decisions[-1].reasons)


def test_garbage_frames_never_reach_the_robot(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot
) -> None:
    stage = Stage(mapping).calibrated(adult).run(wave, 1.0)
    before = stage.decisions[-1].command
    glitch = wave(1.0)
    glitch[6:9] += 0.6
    for frame in (np.full(18, np.nan), np.zeros(18), np.zeros(3), glitch, np.full(18, 1e300)):
        decision = stage.feed(frame)
        assert not decision.frame_used
        assert any(reason.startswith("frame:") for reason in decision.reasons)
    assert np.abs(stage.decisions[-1].command - before).max() < 0.2
    stage.check(pepper)


def test_a_sender_whose_clock_stands_still_is_followed_all_the_same(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave
) -> None:
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.0))
    for index in range(60):
        decision = loop.step(Tick(index * DT, wave(index * DT), sent=0.0))
    assert np.abs(decision.command - mapping.target.rest).max() > 0.3


def test_random_frames_at_random_times_break_nothing(mapping: LimbMapping, adult: HumanSkeleton, pepper: Robot) -> None:
    loop, rng = TeleoperationLoop(mapping, LoopSettings(calibration=0.0)), np.random.default_rng(5)
    now, before, last = 0.0, loop.command, 0.0
    for _ in range(300):
        now += float(rng.choice([0.0, 1e-4, DT, 0.2, 2.0], p=[0.1, 0.2, 0.6, 0.07, 0.03]))
        frame = adult.frames_from_points(rng.normal(size=(1, 2, 3, 3)))[0] if rng.random() < 0.8 else None
        decision = loop.step(Tick(now, frame, now))
        assert not pepper.violations(decision.command, 0.0).any()
        assert (np.abs(decision.command - before) <= pepper.speed * (now - last)).all()
        before, last = decision.command, now


def test_the_clock_must_not_go_back_and_the_target_must_be_a_robot(mapping: LimbMapping, adult: HumanSkeleton) -> None:
    loop = TeleoperationLoop(mapping)
    loop.step(Tick(1.0))
    with pytest.raises(TeleoperationError, match="monotonic"):
        loop.step(Tick(0.5))
    mapping.target = adult  # type: ignore[assignment]
    with pytest.raises(TeleoperationError, match="ends at 'adult', which is no robot"):
        TeleoperationLoop(mapping)


def test_a_robot_can_be_the_operator_of_another(pepper: Robot) -> None:
    nao = catalog.get("nao")
    assert isinstance(nao, Robot)
    loop = TeleoperationLoop(LimbMapping(nao, pepper), LoopSettings(soft_start=0.0))
    raised = nao.rest.copy()
    raised[0] = 0.0
    for index in range(60):
        decision = loop.step(Tick(index * DT, raised))
    assert decision.state is State.FOLLOWING, "no standing is asked of a robot"
    assert abs(decision.command[0]) < 0.3


def test_settings_are_checked() -> None:
    with pytest.raises(OptionError, match="speed must be between"):
        LoopSettings(speed=2.0)
    with pytest.raises(OptionError, match="did you mean 'silence'"):
        LoopSettings.from_json({"silense": 1.0})
    assert LoopSettings.from_json(LoopSettings(rate=60.0).to_json()) == LoopSettings(rate=60.0)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_it_gets_home_from_wherever_it_was_led(
    mapping: LimbMapping, adult: HumanSkeleton, pepper: Robot, seed: int
) -> None:
    stage = Stage(mapping, cutoff=0.0, soft_start=0.0, calibration=0.0)
    check = stage.loop._collision
    assert check is not None
    rng, barred = np.random.default_rng(seed), False
    for _ in range(40):
        mapping.fixed = pepper.clamp(rng.uniform(pepper.lower, pepper.upper))[0]
        for _ in range(15):
            stage.feed(adult.standing())
        barred = not check.free_path(stage.loop.command, pepper.rest)
        if barred:
            break
    assert barred, "from here the straight way home leads through the body"
    for _ in range(3000):
        last = stage.feed()
        if last.state is State.RESTING:
            break
    assert last.state is State.RESTING
    assert not any(check.touches(command) for command in stage.path[::7])
    stage.check(pepper)
