"""Axes as lines in space: where two of them come nearest, and how far points lie from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["Line"]

_PARALLEL = 0.2  # sine of the angle below which two axes say nothing about where they meet


@dataclass(frozen=True, eq=False)
class Line:
    """A joint axis: a point on it ``(3,)`` [m] and a unit direction ``(3,)``. Where the point lies means nothing."""

    point: FloatArray
    direction: FloatArray

    def foot(self, other: Line) -> FloatArray | None:
        """The point of this line that is nearest to another one; ``None`` if they are about parallel."""
        across = np.cross(self.direction, other.direction)
        square = float(across @ across)
        if square < _PARALLEL**2:
            return None
        along = float(np.cross(other.point - self.point, other.direction) @ across) / square
        return self.point + along * self.direction

    def nearest(self, point: FloatArray) -> FloatArray:
        """The point of this line that is nearest to a point."""
        return self.point + float((point - self.point) @ self.direction) * self.direction

    def distance(self, point: FloatArray) -> float:
        """Lever of a point: its distance from this line [m]."""
        return float(np.linalg.norm(point - self.nearest(point)))

    def gap(self, other: Line) -> float:
        """Distance between two lines [m]."""
        foot = self.foot(other)
        return other.distance(self.point if foot is None else foot)
