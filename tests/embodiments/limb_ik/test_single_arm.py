"""One frame at a time gives what a batch gives, only faster."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot


@pytest.mark.parametrize("name", ["pepper", "nao"])
@pytest.mark.parametrize("kind", ["reachable", "anywhere"])
def test_single_frames_agree_with_the_batch(name: str, kind: str) -> None:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    solver, rng = LimbIK(robot), np.random.default_rng(3)
    poses = robot.clamp(rng.uniform(robot.lower, robot.upper, (80, robot.n_features)))
    reachable = np.diff(robot.arm_points(poses), axis=2)
    directions = reachable if kind == "reachable" else rng.normal(size=reachable.shape)
    batch = solver.solve(directions)
    single = np.concatenate([solver.solve(one[None]) for one in directions])
    assert not robot.violations(single).any()
    points, expected = robot.arm_points(single), robot.arm_points(batch)
    tolerance = 1e-9 if kind == "reachable" else 1e-4  # a refined pose may lie in a flat valley
    assert np.abs(points - expected).max() < tolerance
