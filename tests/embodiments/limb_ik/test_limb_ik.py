import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.errors import EmbodimentError

SEEDS = st.integers(0, 2**32 - 1)


def reachable(robot, seed, count=20):
    q = robot.clamp(np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, robot.n_features)))
    return q, np.diff(robot.arm_points(q), axis=2)


@pytest.mark.parametrize("name", ["pepper", "nao"])
@settings(max_examples=25, deadline=None)
@given(seed=SEEDS)
def test_reachable_directions_are_met_exactly(name, seed):
    robot = catalog.get(name)
    q, directions = reachable(robot, seed)
    solved = LimbIK(robot).solve(directions * 3.7)  # length does not matter
    np.testing.assert_allclose(robot.landmarks(solved), robot.landmarks(q), atol=1e-7)
    assert not robot.violations(solved).any()


@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_any_direction_gives_a_pose_within_limits_and_no_worse_than_nearby_poses(seed):
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(4, 2, 2, 3))
    pepper = catalog.get("pepper")
    assert not pepper.violations(LimbIK(pepper).solve(directions)).any()
    # NAO has no coupled arm limits, so a local optimum over a box is well defined.
    nao = catalog.get("nao")
    solved = LimbIK(nao).solve(directions)
    assert not nao.violations(solved).any()

    def miss(frames):
        unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        goal = np.cumsum(unit * nao.arm_lengths[None, :, :, None], axis=2)
        points = nao.arm_points(frames)
        return np.sum((points[:, :, 1:] - points[:, :, :1] - goal) ** 2, axis=(1, 2, 3))

    best = miss(solved)
    for _ in range(20):
        assert (miss(nao.clamp(solved + rng.normal(scale=0.02, size=solved.shape))) > best - 1e-6).all()


@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_mirrored_directions_give_mirrored_poses(seed):
    pepper = catalog.get("pepper")
    _, directions = reachable(pepper, seed, 5)
    ik = LimbIK(pepper)
    mirrored = directions[:, ::-1] * np.array([1.0, -1.0, 1.0])
    np.testing.assert_allclose(
        pepper.landmarks(ik.solve(mirrored)), pepper.landmarks(pepper.mirror(ik.solve(directions))), atol=1e-6
    )


def test_wrong_directions_are_refused():
    ik = LimbIK(catalog.get("pepper"))
    with pytest.raises(EmbodimentError, match="expected"):
        ik.solve(np.ones((2, 2, 3)))
    with pytest.raises(EmbodimentError, match="longer than zero"):
        ik.solve(np.zeros((2, 2, 2, 3)))
    with pytest.raises(EmbodimentError, match="finite"):
        ik.solve(np.full((2, 2, 2, 3), np.nan))
