"""Figures: the few numbers that say how well a motion was tracked, and the one objective made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import AgentError

__all__ = ["JOINT_WEIGHT", "OBJECTIVE", "Figures", "episode_figures", "figures_of_points", "mean_figures"]

JOINT_WEIGHT = 0.05
"""Weight of a milliradian of joint error against a millimetre of landmark error in the objective."""

OBJECTIVE = (
    f"J = landmark error [mm] + {JOINT_WEIGHT:g} x joint error [mrad] + jitter [mm/frame³]; less of each is better."
)
"""What ``J`` is, for below a table."""


@dataclass(frozen=True)
class Figures:
    """How one episode, or the mean of many, was tracked.

    Attributes:
        landmark_mm: mean distance of elbows and wrists from where they should be [mm].
        joint_mrad: mean absolute joint error [mrad].
        jitter: mean length of the landmarks' third difference [mm/frame^3].
        contact_steps: share of control steps with a contact.
    """

    landmark_mm: float
    joint_mrad: float
    jitter: float
    contact_steps: float = 0.0

    @property
    def objective(self) -> float:
        """``J = landmark_mm + 0.05 joint_mrad + jitter``; smaller is better.

        Error and jitter trade against each other, so agents are compared by this one number or at matched jitter.
        """
        return self.landmark_mm + JOINT_WEIGHT * self.joint_mrad + self.jitter

    def as_dict(self) -> dict[str, float]:
        """The figures and the objective under ``J``."""
        return {**asdict(self), "J": self.objective}


def episode_figures(robot: Robot, q: ArrayLike, reference: ArrayLike, contacts: ArrayLike | None = None) -> Figures:
    """Figures of one episode.

    Args:
        robot: who moved.
        q: joint angles after each control step ``(T, n)`` [rad].
        reference: where they should have been ``(T, n)`` [rad].
        contacts: contacts in each step ``(T,)``; none if left out.

    Raises:
        AgentError: shapes differ or there are fewer than four frames (a third difference needs four).
    """
    moved, wanted = np.asarray(q, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if moved.shape != wanted.shape or moved.ndim != 2 or len(moved) < 4:
        raise AgentError(f"expected two arrays (T, n) with T >= 4, got {moved.shape} and {wanted.shape}")
    return figures_of_points(moved, wanted, robot.landmarks(moved), robot.landmarks(wanted), contacts)


def figures_of_points(
    q: FloatArray, reference: FloatArray, points: FloatArray, targets: FloatArray, contacts: ArrayLike | None = None
) -> Figures:
    """``episode_figures`` where the landmarks are known already.

    Args:
        q: joint angles after each control step ``(T, n)`` [rad].
        reference: where they should have been ``(T, n)`` [rad].
        points: landmarks of ``q`` ``(T, P, 3)`` [m].
        targets: landmarks of ``reference`` ``(T, P, 3)`` [m].
        contacts: contacts in each step ``(T,)``; none if left out.
    """
    return Figures(
        landmark_mm=1e3 * float(np.linalg.norm(points - targets, axis=-1).mean()),
        joint_mrad=1e3 * float(np.abs(q - reference).mean()),
        jitter=jitter(points),
        contact_steps=0.0 if contacts is None else float((np.asarray(contacts) > 0).mean()),
    )


def jitter(points: FloatArray) -> float:
    """Mean length of the third difference of points ``(T, P, 3)`` [m], in mm/frame^3."""
    return 1e3 * float(np.linalg.norm(np.diff(points, n=3, axis=0), axis=-1).mean())


def mean_figures(figures: Sequence[Figures]) -> Figures:
    """The mean over episodes.

    Raises:
        AgentError: no episodes.
    """
    if not figures:
        raise AgentError("no episodes to average; play at least one")
    return Figures(*(float(np.mean([getattr(f, name) for f in figures])) for name in asdict(figures[0])))
