"""Unknown dynamics: a robot is drawn for every episode, changes within it, and all of it follows from the seed."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import play_streams
from syda_gym.envs.task.disturbances import Disturbances
from syda_gym.envs.task.dynamics import motor_plan
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.envs.vector import SydaTeleopVectorEnv
from syda_gym.errors import OptionError
from syda_gym.simulation.backend import MotorConditions
from syda_gym.simulation.motor_plan import NEVER, MotorPlan

DT = 1.0 / 30.0
OFTEN = {"motor_gain": (0.4, 1.0), "payload": (0.0, 0.6), "friction": (0.0, 0.3), "changes": 4.0}


def plan_of(seed: int, steps: int = 300, level: str = "train") -> MotorPlan:
    disturbed = Disturbances.preset("dynamics", level)
    return motor_plan(disturbed, disturbed.draw(np.random.default_rng(seed)), steps, DT)


def test_a_robot_is_drawn_within_the_ranges_and_changes_one_thing_at_a_time() -> None:
    plans = [plan_of(seed) for seed in range(200)]
    every = [conditions for plan in plans for conditions in plan.conditions]
    for name, low, high in (("gain", 0.65, 1.0), ("speed", 0.65, 1.0), ("payload", 0.0, 0.6), ("friction", 0.0, 0.3)):
        values = np.array([getattr(conditions, name) for conditions in every])
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high
    changes = [
        frozenset(name for name in vars(before) if getattr(before, name) != getattr(after, name))
        for plan in plans
        for before, after in zip(plan.conditions[:-1], plan.conditions[1:], strict=True)
    ]
    single = ({"gain", "speed"}, {"payload"}, {"friction"})
    assert all(sum(change == one for change in changes) > 0.25 * len(changes) for one in single)
    assert sum(change in single for change in changes) > 0.95 * len(changes)  # two may fall into one step
    mean = np.mean([len(plan.steps) - 1 for plan in plans]) / (300 * DT)
    assert mean == pytest.approx(0.6, abs=0.08)  # half way between 0.2 and 1.0 a second


def test_a_plan_follows_from_the_draw_and_a_longer_episode_only_goes_on() -> None:
    short, long = plan_of(7, 120, "harsh"), plan_of(7, 400, "harsh")
    assert len(long.steps) > len(short.steps) > 1
    assert long.steps[: len(short.steps)] == short.steps
    assert long.conditions[: len(short.steps)] == short.conditions
    assert plan_of(8, 400, "harsh") != long


def test_a_plan_knows_what_holds_when_and_what_comes_next() -> None:
    weak = MotorConditions(gain=0.5)
    plan = MotorPlan((MotorConditions(), weak), (0, 5))
    assert (plan.at(4), plan.at(5), plan.at(99)) == (MotorConditions(), weak, weak)
    assert (plan.next_change(0), plan.next_change(5)) == (5, NEVER)
    np.testing.assert_array_equal(plan.gains(7), [1, 1, 1, 1, 1, 0.5, 0.5])
    for steps in ((0,), (1, 5), (0, 0)):
        with pytest.raises(OptionError, match="rising from 0"):
            MotorPlan((MotorConditions(), weak), steps)


def test_older_presets_draw_what_they_always_drew() -> None:
    drawn = Disturbances.preset("full", "train").draw(np.random.default_rng(3))
    rng = np.random.default_rng(3)
    assert drawn.noise == pytest.approx(0.004 + rng.random(16)[0] * 0.016)
    assert drawn.changes == 0.0
    after = np.random.default_rng(3)
    Disturbances.preset("dynamics").draw(after)
    assert after.random() == rng.random()


@pytest.mark.parametrize("physics", ["servo", "bullet"])
def test_the_motors_change_within_the_episode_in_both_kinds_of_physics(cheap, physics: str) -> None:
    options = {**cheap, "physics": physics}
    env = SydaTeleopEnv(**options, disturbances=OFTEN)
    still = SydaTeleopEnv(**options, disturbances={**OFTEN, "changes": 0.0})
    moved = []
    for one in (env, still):
        _, info = one.reset(seed=4, options={"motion": 0})
        moved.append([info["q"]] + [one.step(np.zeros(10))[4]["q"] for _ in range(50)])
    plan = env._fleet._plans[0]
    assert plan.changes
    first = plan.steps[1]
    assert first < 50
    np.testing.assert_array_equal(moved[0][: first + 1], moved[1][: first + 1])
    assert np.abs(np.array(moved[0]) - moved[1])[first + 1 :].max() > 1e-4


def test_one_robot_and_many_and_a_pickled_one_go_the_same_way(cheap) -> None:
    env = SydaTeleopEnv(**cheap, disturbances=OFTEN)
    many = SydaTeleopVectorEnv(2, **cheap, disturbances=OFTEN)
    env.reset(seed=6)
    many.reset(seed=5)
    for step in range(40):
        alone = env.step(np.zeros(10))[4]["q"]
        together = many.step(np.zeros((2, 10)))[4]["q"]
        np.testing.assert_array_equal(alone, together[1])
        if step == 25:
            assert env._fleet._plans[0].steps[1] < 25
            env = pickle.loads(pickle.dumps(env))


def test_streams_hold_the_same_robots_as_the_environment(cheap) -> None:
    options = {**cheap, "physics": "servo", "disturbances": OFTEN}
    ground = Ground(options)
    streams = ground.record(2, clips=[0, 1], seed=9)
    played = play_streams(BaseAlone(ground.interface), streams, ground.rates)
    env = SydaTeleopEnv(**options)
    for episode in range(2):
        env._np_random = np.random.default_rng([9, episode])
        env.reset(options={"motion": episode})
        assert env._fleet._plans[0] == streams.motors[episode]
        for step in range(40):
            info = env.step(np.zeros(10))[4]
            np.testing.assert_allclose(info["q"], played[episode, step], atol=1e-9)
    joined = streams.rows([1])
    assert joined.motors == (streams.motors[1],)
    assert streams.changing[0, list(streams.motors[0].steps[1:])].all()
