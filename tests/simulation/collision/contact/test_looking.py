"""The closed forms say what coal says, and their gradients what differences say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.simulation.collision.self_collision import SelfCollision

CASES = Path(__file__).parents[3] / "embodiments" / "discovery" / "cases"
GJK = 3e-6  # m; how far coal's search may be off


def pair_of_checks(robot: Robot) -> tuple[SelfCollision, SelfCollision]:
    """One by closed forms, one by coal alone."""
    ours, theirs = SelfCollision(robot), SelfCollision(robot)
    assert ours._arrays is not None
    theirs._arrays = None
    return ours, theirs


def poses(robot: Robot, count: int) -> FloatArray:
    rng = np.random.default_rng(0)
    wide = rng.uniform(robot.lower, robot.upper, (count // 2, robot.n_features))
    return robot.clamp(np.concatenate([wide, robot.rest + rng.normal(0.0, 0.3, (count // 2, robot.n_features))]))


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_distances_and_contacts_are_those_of_coal(name: str) -> None:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    (ours, theirs), touching = pair_of_checks(robot), 0
    for pose in poses(robot, 60):
        mine, other = ours._distances(pose), theirs._distances(pose)
        near = (other > GJK) & (other < 0.2)
        np.testing.assert_allclose(mine[near], other[near], atol=GJK)
        assert (mine <= other + GJK).all(), "a bound is never above the distance"
        if np.abs(other - ours.margin).min() > GJK:
            assert ours.touches(pose) == theirs.touches(pose)
            touching += ours.touches(pose)
        assert ours.overlaps(pose).keys() == theirs.overlaps(pose).keys()
    assert 5 < touching < 55


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_near_pairs_are_those_of_coal_and_gradients_are_differences(name: str) -> None:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    (ours, theirs), compared = pair_of_checks(robot), 0
    for pose in poses(robot, 16):
        distances, gradients = ours.near(pose, 0.1)
        others, _ = theirs.near(pose, 0.1)
        assert len(distances) == len(others)
        np.testing.assert_allclose(distances[others > GJK], others[others > GJK], atol=GJK)
        pairs = np.flatnonzero(ours._distances(pose) < 0.1)
        if len(pairs) != len(distances):
            continue  # a bound among them
        for joint in range(robot.n_features):
            step = 1e-6 * np.eye(robot.n_features)[joint]
            slope = (ours._distances(pose + step) - ours._distances(pose - step))[pairs] / 2e-6
            smooth = (distances > 0.0) & (np.abs(slope - gradients[:, joint]) < 1e-3)
            assert smooth[distances > 0.01].mean() > 0.95  # where the nearest points jump, there is no slope
            compared += int(smooth.sum())
    assert compared > 500


def test_boxes_and_joints_with_a_links_name_are_looked_at_too(tmp_path: Path) -> None:
    text = (CASES / "wide_limits.urdf").read_text()
    for side in ("left", "right"):
        text = text.replace(f"{side}_upper_arm_link", f"{side}_elbow_pitch").replace(
            f"{side}_elbow_link", f"{side}_shoulder_roll"
        )
    (tmp_path / "named.urdf").write_text(text)
    robot = Robot(discover(tmp_path / "named.urdf"))
    measured, plain, touching = SelfCollision(robot), SelfCollision(robot), 0
    assert "left_elbow_pitch" not in plain._model.names, "the model has another name for it"
    measured.measure(robot.rest)
    joint = robot.joint_names.index("left_shoulder_roll")
    for angle in np.linspace(robot.lower[joint], robot.upper[joint], 40):
        pose = robot.rest.copy()
        pose[joint] = angle  # no other joint moves, so that this one alone can raise a suspicion
        assert measured.touches(pose) == plain.touches(pose)
        touching += plain.touches(pose)
    assert 3 < touching < 37
