"""Sampling arms: positions, manipulability, cells."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError
from syda_gym.routes.general import Sampling, general_workspace
from syda_gym.routes.workspace.arms import canonical_arms, canonical_chain, human_arm, zero_pose_chain
from syda_gym.routes.workspace.sampling import (
    arm_length,
    cell_index,
    chain_fingerprint,
    generic_rank,
    grid_angles,
    sample_tip,
    sobol_angles,
    workspace_from_angles,
)
from syda_gym.routes.workspace.store import WorkspaceStore


def random_chain(seed: int, joints: int, side: str = "right") -> ArmChain:
    """A serial arm with arbitrary frames, axes, offsets and limits."""
    rng = np.random.default_rng(seed)
    rotations = np.linalg.qr(rng.normal(size=(joints, 3, 3)))[0]
    rotations *= np.sign(np.linalg.det(rotations))[:, None, None]
    axes = rng.normal(size=(joints, 3))
    lower = rng.uniform(-2.0, 0.0, joints)
    points = rng.normal(scale=0.2, size=(4, 3))
    return ArmChain(
        side="left" if side == "left" else "right",
        joints=tuple(f"j{i}" for i in range(joints)),
        rotations=rotations,
        offsets=rng.normal(scale=0.3, size=(joints, 3)),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        lower=lower,
        upper=lower + rng.uniform(0.1, 3.0, joints),
        point_joints=(0, joints // 2, joints - 1, joints - 1),
        point_offsets=points,
    )


chains = st.builds(random_chain, st.integers(0, 10_000), st.integers(2, 7), st.sampled_from(["left", "right"]))


def gram_of(rows: np.ndarray) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = rows
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


@settings(deadline=None, max_examples=40)
@given(chain=chains)
def test_tip_and_gram_matrix_agree_with_the_jacobians_of_the_chain(chain: ArmChain) -> None:
    q = np.random.default_rng(1).uniform(chain.lower, chain.upper, (50, chain.n_joints))
    position, gram = sample_tip(chain, q.T)
    points, jacobians = chain.jacobians(q)
    length = arm_length(chain)
    np.testing.assert_allclose(position.T, (points[:, 3] - chain.offsets[0]) / length, atol=1e-12)
    jacobian = jacobians[:, 3] / length
    expected = np.linalg.eigvalsh(jacobian @ np.swapaxes(jacobian, 1, 2))
    np.testing.assert_allclose(np.linalg.eigvalsh(gram_of(gram)), expected, atol=1e-12)


@settings(deadline=None, max_examples=40)
@given(chain=chains)
def test_zero_pose_form_moves_the_tip_alike(chain: ArmChain) -> None:
    other = zero_pose_chain(chain)
    q = np.random.default_rng(2).uniform(chain.lower, chain.upper, (20, chain.n_joints))
    sign = np.where(np.isclose(other.lower, chain.lower), 1.0, -1.0)
    np.testing.assert_allclose(other.points(q * sign), chain.points(q), atol=1e-12)


@settings(deadline=None, max_examples=20)
@given(chain=chains)
def test_a_mirrored_arm_reaches_the_mirrored_places(chain: ArmChain) -> None:
    other = canonical_chain(chain)
    q = np.random.default_rng(3).uniform(other.lower, other.upper, (20, chain.n_joints))
    reflect = np.array([1.0, -1.0 if chain.side == "left" else 1.0, 1.0])
    sign = np.where(np.isclose(other.lower, chain.lower), 1.0, -1.0)
    np.testing.assert_allclose(other.points(q), chain.points(q * sign) * reflect, atol=1e-12)


@pytest.mark.parametrize("name", ["adult", "pepper", "nao"])
def test_both_arms_of_a_symmetric_body_are_one_arm(name: str) -> None:
    left, right = canonical_arms(catalog.get(name)).values()
    assert chain_fingerprint(left) == chain_fingerprint(right)


def test_scale_alone_does_not_change_an_arm() -> None:
    assert chain_fingerprint(human_arm(0.3, 0.2)) == chain_fingerprint(human_arm(0.6, 0.4))
    assert chain_fingerprint(human_arm(0.3, 0.2)) != chain_fingerprint(human_arm(0.2, 0.3))


def test_where_a_model_puts_its_first_origin_does_not_matter() -> None:
    """Baxter's first joint sits 0.27 m below the shoulder, on the same axis."""
    arm = random_chain(7, 5)
    axis = arm.rotations[0] @ arm.axes[0]
    down = np.array([1.0, 0.0, 0.0, 0.0, 0.0])[:, None] * 0.27 * axis
    after = np.array([0.0, 1.0, 0.0, 0.0, 0.0])[:, None] * 0.27 * arm.axes[0]
    riding = np.array([1.0, 0.0, 0.0, 0.0])[:, None] * 0.27 * arm.axes[0]
    moved = replace(arm, offsets=arm.offsets - down + after, point_offsets=arm.point_offsets + riding)
    assert chain_fingerprint(zero_pose_chain(moved)) == chain_fingerprint(zero_pose_chain(arm))
    q = np.random.default_rng(0).uniform(arm.lower, arm.upper, (5, 5))
    np.testing.assert_allclose(moved.points(q), arm.points(q), atol=1e-12)


def test_length_is_the_farthest_reach() -> None:
    pepper = catalog.get("pepper")
    assert isinstance(pepper, Robot)
    assert arm_length(pepper.chains[0]) == pytest.approx(0.3318, abs=1e-4)
    chain = random_chain(5, 6)
    position, _ = sample_tip(chain, sobol_angles(chain, 2**12, 0)(0, 2**12))
    assert np.linalg.norm(position, axis=0).max() <= 1.0


def test_cells_round_half_away_from_zero() -> None:
    position = np.array([[0.05, -0.05, 0.15 - 1e-13, 0.149, -0.25]])
    assert cell_index(position, 0.1).tolist() == [[1, -1, 2, 1, -3]]


def test_grids_hold_both_ends() -> None:
    arm = human_arm(0.3, 0.3)
    angles = grid_angles(arm, (3, 2, 2, 2))
    whole = angles(0, 24)
    np.testing.assert_allclose(whole.min(axis=1), arm.lower)
    np.testing.assert_allclose(whole.max(axis=1), arm.upper)
    np.testing.assert_array_equal(whole[:, 7:19], angles(7, 19))
    assert len(np.unique(whole.T, axis=0)) == 24


def test_mean_manipulability_per_cell_is_the_plain_average() -> None:
    chain = random_chain(11, 4)
    angles = sobol_angles(chain, 2**12, 3)
    workspace = workspace_from_angles(chain, angles, 2**12, 0.2)
    position, gram = sample_tip(chain, angles(0, 2**12))
    measure = np.sqrt(np.maximum(np.linalg.det(gram_of(gram)), 0.0))
    half = (workspace.counts.shape[0] - 1) // 2
    cells, inverse = np.unique(cell_index(position, 0.2).T + half, axis=0, return_inverse=True)
    assert workspace.counts.sum() == 2**12
    assert workspace.present.sum() == len(cells)
    for index, cell in enumerate(cells):
        mean = measure[inverse == index].mean()
        assert workspace.manipulability[tuple(cell)] == pytest.approx(mean, rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(workspace.centres(workspace.present), (cells - half) * 0.2)


def test_rank_tells_planar_arms() -> None:
    assert generic_rank(human_arm(0.3, 0.3)) == 3
    planar = random_chain(0, 3)
    eye = np.repeat(np.eye(3)[None], 3, axis=0)
    flat = {"rotations": eye, "axes": eye[:, 2], "offsets": planar.offsets * [1, 1, 0]}
    planar = replace(planar, **flat, point_offsets=planar.point_offsets * [1, 1, 0])
    assert generic_rank(planar) == 2
    workspace = workspace_from_angles(planar, sobol_angles(planar, 2**12, 0), 2**12, 0.1, rank=2)
    assert workspace.manipulability[workspace.present].max() > 0.0
    half = (workspace.counts.shape[0] - 1) // 2
    assert workspace.present[:, :, half].sum() == workspace.present.sum()


def test_no_length_and_no_motion_are_told() -> None:
    chain = random_chain(0, 3)
    point = replace(chain, offsets=np.zeros((3, 3)), point_offsets=np.zeros((4, 3)))
    with pytest.raises(EmbodimentError, match="zero length"):
        arm_length(point)
    along = {"axes": np.eye(3)[[0, 0, 0]], "rotations": np.repeat(np.eye(3)[None], 3, axis=0)}
    line = replace(chain, **along, offsets=np.eye(3)[[0, 0, 0]], point_offsets=np.zeros((4, 3)))
    with pytest.raises(EmbodimentError, match="moves its tip"):
        generic_rank(line)


def test_workspaces_are_kept_on_disk_and_damage_is_survived(tmp_path: Path) -> None:
    arm, sampling = human_arm(0.3, 0.3), Sampling(samples=2**12)
    first = general_workspace(arm, sampling, 0, 3, WorkspaceStore(tmp_path))
    (file,) = tmp_path.glob("*.npz")
    calls: list[int] = []
    store = WorkspaceStore(tmp_path)
    again = store.get(file.name.removesuffix("-v1.npz"), lambda: calls.append(1) or first)  # type: ignore[func-returns-value]
    assert not calls
    np.testing.assert_array_equal(again.manipulability, first.manipulability)
    file.write_bytes(b"damaged")
    rebuilt = general_workspace(arm, sampling, 0, 3, WorkspaceStore(tmp_path))
    np.testing.assert_array_equal(rebuilt.counts, first.counts)


def test_memory_is_bounded() -> None:
    store = WorkspaceStore(limit=1)
    arm = human_arm(0.3, 0.3)
    workspaces = [general_workspace(arm, Sampling(samples=2**10, seed=seed), 0, 3, store) for seed in (0, 5, 0)]
    assert workspaces[0] is not workspaces[2]  # dropped and made again, with the same bits
    np.testing.assert_array_equal(workspaces[0].counts, workspaces[2].counts)
