"""Limits and speeds hold in every command, whatever is wanted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError
from syda_gym.teleoperation.safety.limiter import CommandLimiter
from syda_gym.teleoperation.safety.one_euro import OneEuroFilter


@pytest.mark.parametrize("name", ["pepper", "nao"])
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), wild=st.floats(0.1, 50.0), dt=st.floats(1e-4, 0.2))
def test_random_walks_break_no_limit_and_no_speed(name: str, seed: int, wild: float, dt: float) -> None:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    limiter, rng = CommandLimiter(robot), np.random.default_rng(seed)
    before = limiter.start(rng.normal(scale=wild, size=robot.n_features))
    walk = [before]
    for _ in range(60):
        walk.append(limiter.move(walk[-1], walk[-1] + rng.normal(scale=wild, size=robot.n_features), dt))
    path = np.array(walk)
    assert not robot.violations(path).any()
    assert (np.abs(np.diff(path, axis=0)) <= robot.speed * dt).all()


def test_the_elbow_waits_for_its_roll_where_the_roll_is_slow(pepper: Robot) -> None:
    slow = CommandLimiter(pepper)
    roll = pepper.joint_names.index("LElbowRoll")
    yaw = pepper.joint_names.index("LElbowYaw")
    slow.speed = slow.speed.copy()
    slow.speed[roll] = 0.01
    start = pepper.rest.copy()
    start[yaw], start[roll] = 0.5, -1.56
    wanted = start.copy()
    wanted[yaw] = -1.5  # there the elbow may bend to -1.36 only
    pose = slow.start(start)
    for _ in range(200):
        after = slow.move(pose, wanted, 1 / 30)
        assert not pepper.violations(after[None]).any()
        assert abs(after[roll] - pose[roll]) <= 0.01 / 30
        pose = after
    assert pose[yaw] > -1.0, "the yaw is held back until the roll has made room"


def test_a_wish_within_reach_is_granted_exactly_up_to_rounding(pepper: Robot) -> None:
    limiter = CommandLimiter(pepper)
    before = limiter.start(pepper.rest)
    wanted = before + 0.01
    assert np.abs(limiter.move(before, wanted, 1 / 30) - wanted).max() < 1e-15
    assert (limiter.move(before, wanted, 0.0) == before).all(), "without time nothing moves"
    assert (limiter.move(before, wanted, -1.0) == before).all()


def test_the_speed_fraction_is_checked(pepper: Robot) -> None:
    for bad in (0.0, 1.1, float("nan")):
        with pytest.raises(OptionError, match="speed fraction"):
            CommandLimiter(pepper, bad)


def test_the_filter_smooths_noise_and_follows_motion() -> None:
    rng, smooth = np.random.default_rng(0), OneEuroFilter(1.0, 2.0)
    noisy = rng.normal(scale=0.02, size=(300, 3))
    calm = np.array([smooth(row, 1 / 30).copy() for row in noisy])
    assert calm[50:].std() < 0.5 * noisy[50:].std()
    smooth.reset(np.zeros(3))
    ramp = np.outer(np.arange(60) / 30 * 3.0, np.ones(3))
    lag = ramp[-1] - np.array([smooth(row, 1 / 30).copy() for row in ramp])[-1]
    assert (lag < 0.25).all(), "at 3 rad/s it is less than 80 ms behind"
    assert (smooth(np.full(3, 9.0), 0.0) != 9.0).all(), "no time, no news"
    with pytest.raises(OptionError, match="cutoffs"):
        OneEuroFilter(0.0)
