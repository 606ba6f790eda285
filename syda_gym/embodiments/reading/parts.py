"""What a URDF holds, as plain values: joints with limits and followers, shapes, masses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["JOINT_TYPES", "Joint", "Limit", "Mimic", "Shape"]

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


@dataclass(frozen=True)
class Limit:
    """Limits of a joint as the file states them; ``None`` where it states none, or a placeholder such as -1 or 1e9."""

    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: its angle is ``multiplier * leader + offset``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint.

    Attributes:
        name: its name.
        type: one of ``JOINT_TYPES``.
        parent: the link that it hangs on.
        child: the link that it moves.
        axis: unit vector in its own frame ``(3,)``.
        limit: as stated.
        mimic: the joint that it follows, if any.
        line: where it stands in the file, 0 if unknown.
    """

    name: str
    type: str
    parent: str
    child: str
    axis: NDArray[np.float64]
    limit: Limit | None
    mimic: Mimic | None
    line: int = 0


@dataclass(frozen=True, eq=False)
class Shape:
    """One visual or collision shape in the frame of its link.

    Attributes:
        role: ``visual`` or ``collision``.
        kind: ``box``, ``sphere``, ``cylinder``, ``capsule`` or ``mesh``.
        size: sides of a box; radius of a sphere; radius and length of a cylinder; scale of a mesh [m].
        placement: ``(4, 4)``.
        mesh: the file of a mesh; ``None`` where it is not there.
        color: red, green, blue, alpha, or ``None``.
    """

    role: str
    kind: str
    size: tuple[float, ...]
    placement: NDArray[np.float64]
    mesh: Path | None = None
    color: tuple[float, float, float, float] | None = None

    @property
    def missing(self) -> bool:
        """Whether it is a mesh whose file is not there."""
        return self.kind == "mesh" and self.mesh is None
