"""The transferability of the paper, with the constants behind its Tables 2 and 5.

Source: Stanley, Jung, Bowman, Tao, Zhang, "Transferability-based Chain Motion Mapping from Humans to Humanoids for
Teleoperation", section 3.3.1, Eq. 7 to 10. The figures of the tables follow from choices that the text does not tell,
and that differ from its equations in places: L is symmetric (Eq. 7 is not), S is divided by the bounding box of A's
workspace (Eq. 8: by the workspace), and Pepper is an idealised arm with its own joint ranges.

This definition is kept to reproduce the paper. It is not well posed: D >= 0.5 always; S jumps where M_A is close to
M_B; a body transfers to itself with T = 0.5 or less; cells that B cannot reach enter through an arbitrary 1e-6; and
the ranking of the paper's two chains turns around with 5 mm of the kid's elbow, or with Eq. 7's own L. Use the
``general`` definition to decide anything.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError
from syda_gym.files import fingerprint
from syda_gym.routes.workspace.arms import canonical_chain, human_arm
from syda_gym.routes.workspace.sampling import Workspace, chain_fingerprint, grid_angles, workspace_from_angles
from syda_gym.routes.workspace.store import MEMORY, WorkspaceStore

__all__ = ["CELL", "PAPER_ALPHA", "PAPER_LENGTHS", "PaperArm", "PaperTerms", "compare", "paper_arm", "paper_human",
           "paper_workspace"]  # fmt: skip

CELL = 0.1
"""Edge of a cell in arm lengths."""

PAPER_LENGTHS: dict[str, tuple[float, float]] = {
    "adult": (0.3097219, 0.2995953),
    "kid": (0.2337146, 0.2336531),
    "pepper": (0.181820, 0.153547),
}
"""Upper arm and forearm [m] that the paper's figures were computed with."""

PAPER_ALPHA: dict[frozenset[str], float] = {frozenset(("kid", "pepper")): 0.76}
"""Noise coefficients of Table 2; 1 for every pair that is not listed."""

_HUMAN_POINTS = (24, 19, 16, 16)
_ROBOT_POINTS = (25, 25, 10, 22, 10)
_ROBOT_DEGREES = ((-120, 120), (-120, 120), (-90, 0), (-105, 105), (0, 90))
_ROBOT_COLUMNS = (0, 1, 2, 3)  # theta5 is swept, its column of the Jacobian left out
_PRESENT = 1e-6
_EPSILON = 1e-6
_PEPPER_AXES: FloatArray = np.eye(3)[[1, 2, 0, 2, 0]]  # pitch, roll, elbow yaw, elbow roll, wrist yaw


@dataclass(frozen=True, eq=False)
class PaperArm:
    """A body as the paper's metric sees it: one right arm, sampled on a grid.

    Attributes:
        chain: the arm in the paper's frame (x right, y forward, z up).
        points: grid points per joint.
        columns: joints whose Jacobian columns count; ``None`` for all.
        lengths: upper arm and forearm [m].
    """

    chain: ArmChain
    points: tuple[int, ...]
    columns: tuple[int, ...] | None
    lengths: tuple[float, float]


@dataclass(frozen=True)
class PaperTerms:
    """Terms of Eq. 8 and 9: S, the divergence KL, D = sigmoid(KL), and how many cells they rest on."""

    S: float
    KL: float
    D: float
    coverage: float
    lacking_cells: int


def paper_arm(body: Embodiment) -> PaperArm:
    """The paper's arm model of a body.

    The adult, the kid and Pepper of the catalog have the lengths that the tables were computed with. Another human is
    the same model with its own lengths and joint limits; another robot is the paper's Pepper with its own lengths,
    provided that its five joints turn about the axes of Pepper's.

    Raises:
        EmbodimentError: a robot with another arm.
    """
    known = body.name in PAPER_LENGTHS and body.name in catalog.names() and body == catalog.get(body.name)
    upper, fore = PAPER_LENGTHS[body.name] if known else (float(x) for x in body.arm_lengths.mean(axis=0))
    if isinstance(body, HumanSkeleton):
        return PaperArm(human_arm(upper, fore, body.joint_limits), _HUMAN_POINTS, None, (upper, fore))
    if isinstance(body, Robot) and all(_is_like_pepper(chain) for chain in body.chains):
        return PaperArm(_pepper_like(upper, fore), _ROBOT_POINTS, _ROBOT_COLUMNS, (upper, fore))
    raise EmbodimentError(
        f"definition='paper' knows the arms of humans and of robots built like Pepper (pitch, roll, elbow yaw, elbow "
        f"roll, wrist yaw); {body.name!r} has another arm. Use definition='general', which takes any"
    )


def paper_human(name: str) -> HumanSkeleton:
    """The adult or kid of the catalog with the arm lengths that the paper's figures were computed with.

    The catalog's bodies hold the link medians of the recordings with Pepper, which differ by up to 5 %.

    Raises:
        EmbodimentError: neither ``adult`` nor ``kid``.
    """
    body = catalog.get(name)
    if not isinstance(body, HumanSkeleton) or name not in PAPER_LENGTHS:
        raise EmbodimentError(f"the paper's humans are 'adult' and 'kid', not {name!r}")
    spec = {**body.spec(), "upper_arm": PAPER_LENGTHS[name][0], "forearm": PAPER_LENGTHS[name][1]}
    return HumanSkeleton(**{key: value for key, value in spec.items() if key != "kind"})


def paper_workspace(arm: PaperArm, store: WorkspaceStore = MEMORY) -> Workspace:
    """Mean manipulability per cell of the paper's grid (116,736 samples for a human, 1,375,000 for a robot)."""
    key = fingerprint("paper", chain_fingerprint(arm.chain), repr((arm.points, arm.columns, CELL)))
    samples = int(np.prod(arm.points))
    angles = grid_angles(arm.chain, arm.points)
    return store.get(key, lambda: workspace_from_angles(arm.chain, angles, samples, CELL, columns=arm.columns))


def compare(a: Workspace, b: Workspace) -> PaperTerms:
    """S and D of Eq. 8 and 9, as behind Table 2.

    Args:
        a: the source's workspace.
        b: the target's workspace on the same grid.
    """
    box = _bounding_box(a)
    m_a = np.where(a.manipulability > _PRESENT, a.manipulability, 0.0)[box]
    m_b = b.manipulability[box]
    reached = m_a > 0.0
    sufficient = reached & (m_b > m_a)
    lack = m_a > m_b
    divergence = _divergence(m_a[lack], m_b[lack])
    return PaperTerms(
        S=float(sufficient.sum() / m_a.size),
        KL=divergence,
        D=float(1.0 / (1.0 + np.exp(-divergence))),
        coverage=float((m_b[reached] > 0.0).mean()),
        lacking_cells=int(lack.sum()),
    )


def _divergence(m_a: FloatArray, m_b: FloatArray) -> float:
    """Kullback-Leibler divergence of M_A from M_B, each divided by its sum, zeros replaced by 1e-6."""
    if not m_a.size:
        return 0.0  # nothing lacks, for example a body against itself
    p, q = m_a / m_a.sum(), m_b / max(float(m_b.sum()), np.finfo(np.float64).tiny)
    p, q = np.where(p == 0.0, _EPSILON, p), np.where(q == 0.0, _EPSILON, q)
    return float(np.sum(p * np.log(p / q)))


def _bounding_box(workspace: Workspace) -> tuple[slice, ...]:
    cells = np.argwhere(workspace.present)
    return tuple(slice(int(low), int(high) + 1) for low, high in zip(cells.min(0), cells.max(0), strict=True))


def _pepper_like(upper: float, fore: float) -> ArmChain:
    """The paper's Pepper: p = Rx(t1) Ry(t2) Rz(t3) [(0, l1, 0) + Rx(t4) Rz(t5) (0, l2, 0)]."""
    eye = np.eye(3)
    lower, higher = np.radians(np.array(_ROBOT_DEGREES, dtype=np.float64)).T
    zero, elbow, hand = np.zeros(3), np.array([0.0, upper, 0.0]), np.array([0.0, fore, 0.0])
    return ArmChain(
        side="right",
        joints=("t1", "t2", "t3", "t4", "t5"),
        rotations=np.repeat(eye[None], 5, axis=0),
        offsets=np.array([zero, zero, zero, elbow, zero]),
        axes=eye[[0, 1, 2, 0, 2]],
        lower=lower,
        upper=higher,
        point_joints=(2, 3, 4, 4),
        point_offsets=np.array([zero, zero, hand, hand]),
    )


def _is_like_pepper(chain: ArmChain) -> bool:
    axes = canonical_chain(chain).axes
    return axes.shape == _PEPPER_AXES.shape and bool(np.all(np.sum(axes * _PEPPER_AXES, axis=1) > np.cos(0.3)))
