"""Clearances save looks at pairs of shapes and change no answer."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.simulation.collision.self_collision import SelfCollision


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_answers_are_the_same_with_and_without_a_measurement(name: str) -> None:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    measured, plain = SelfCollision(robot), SelfCollision(robot)
    rng, pose, touching, spared = np.random.default_rng(3), robot.rest, 0, 0
    for _ in range(150):
        measured.measure(pose)
        for size in (0.02, 0.06, 0.2, 1.0):
            goal = robot.clamp(pose + rng.normal(scale=size, size=pose.shape))[0]
            assert measured.touches(goal) == plain.touches(goal)
            touching += plain.touches(goal)
            spared += measured._clearance.suspects(goal) == []
            if not plain.touches(pose):
                assert measured.free_path(pose, goal) == plain.free_path(pose, goal)
            for one, other in zip(measured.near(goal, 0.1), plain.near(goal, 0.1), strict=True):
                assert one.tobytes() == other.tobytes()
        pose = robot.clamp(pose + rng.normal(scale=0.2, size=pose.shape))[0]
    assert touching > 30, "some of these poses do touch"
    assert spared > 100, "often there is nothing to look at"
