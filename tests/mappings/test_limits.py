from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.errors import OptionError
from syda_gym.mappings.limits import SpeedLimiter, limit_speed, speed_violations, step_towards


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_any_sequence_comes_out_within_position_and_speed_limits(seed):
    robot = catalog.get("pepper")
    rng = np.random.default_rng(seed)
    wild = rng.uniform(robot.lower - 1.0, robot.upper + 1.0, (40, 10))
    limited = limit_speed(robot, wild, 30.0)
    assert not robot.violations(limited).any()
    assert not speed_violations(robot, limited, 30.0).any()


def test_a_motion_within_the_limits_is_untouched():
    robot = catalog.get("pepper")
    time = np.linspace(0.0, 2.0, 61)[:, None]
    slow = robot.clamp(robot.rest + 0.3 * np.sin(time))
    assert not speed_violations(robot, slow, 30.0).any()
    assert np.array_equal(limit_speed(robot, slow, 30.0), slow)


def test_a_jump_is_followed_at_full_speed_and_reached():
    robot = catalog.get("pepper")
    jump = np.repeat(robot.rest[None], 40, axis=0)
    jump[1:, 0] -= 1.5
    limited = limit_speed(robot, jump, 30.0)
    assert np.isclose(limited[0, 0] - limited[1, 0], robot.speed[0] / 30.0)
    assert np.array_equal(limited[-1], jump[-1])


def test_a_limiter_can_start_where_the_robot_is():
    robot = catalog.get("pepper")
    limiter = SpeedLimiter(robot, 30.0)
    limiter.reset(robot.rest)
    goal = robot.clamp(robot.rest - 1.0)[0]
    assert (np.abs(limiter(goal) - robot.rest) <= robot.speed / 30.0 + 1e-9).all()
    with pytest.raises(OptionError, match="fps"):
        SpeedLimiter(robot, 0.0)


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_clips_equal_their_frames_bit_for_bit(name):
    robot = catalog.get(name)
    wild = np.cumsum(np.random.default_rng(0).normal(0.0, 0.2, (3, 60, robot.n_features)), axis=1)
    limited = limit_speed(robot, wild, 30.0)
    for clip, found in zip(wild, limited, strict=True):
        frame = robot.clamp(clip[:1])
        assert np.array_equal(found[:1], frame)
        for k in range(1, 60):
            frame = step_towards(robot, frame, robot.clamp(clip[k : k + 1]), 30.0)
            assert np.array_equal(found[k], frame[0])
    assert not np.array_equal(limited, wild)
