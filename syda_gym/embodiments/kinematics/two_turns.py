"""TwoTurns: two turns about given axes that bring one direction onto another, in plain floats.

The second Paden-Kahan subproblem (Murray, Li, Sastry, *A Mathematical Introduction to Robotic Manipulation*, 1994,
section 3.2) with everything worked out beforehand that does not depend on the goal.
"""

from __future__ import annotations

import math

__all__ = ["TwoTurns", "Vector", "turned_back"]

Vector = tuple[float, float, float]


class TwoTurns:
    """Angles with R(first, a) R(second, b) start = goal (Murray et al., 3.2) for one pair of axes and one start.

    The vector between the two turns is alpha first + beta second ± gamma (first x second). Seen along each axis it, the
    start and the goal are directions in a plane, so that both angles are differences of arc tangents.

    Args:
        first: unit axis of the outer turn.
        second: unit axis of the inner turn, not parallel to ``first``.
        start: unit vector that is turned.
    """

    __slots__ = ("_across", "_beside", "_cosine", "_first", "_offset", "_span", "_start")

    def __init__(self, first: Vector, second: Vector, start: Vector) -> None:
        across = _cross(first, second)
        self._span = _dot(across, across)
        root = math.sqrt(self._span)
        self._cosine = _dot(first, second)
        self._first = first
        self._start = _dot(second, start)
        self._across = _scaled(across, 1.0 / root)
        self._beside = _cross(self._across, first)
        beside_second = _cross(second, self._across)
        self._offset = math.atan2(-_dot(start, self._across), _dot(start, beside_second))

    def solve(self, goal: Vector) -> tuple[bool, tuple[tuple[float, float], tuple[float, float]]]:
        """Whether there is a solution, and both; without one they bring start as near to goal as the axes allow."""
        x, y, z = goal
        fx, fy, fz = self._first
        bx, by, bz = self._beside
        ax, ay, az = self._across
        along, cosine, span = x * fx + y * fy + z * fz, self._cosine, self._span
        alpha = (along - cosine * self._start) / span
        beta = (self._start - cosine * along) / span
        square = (1.0 - alpha * alpha - beta * beta - 2.0 * alpha * beta * cosine) / span
        gamma = math.sqrt(square) if square > 0.0 else 0.0
        aim = math.atan2(x * ax + y * ay + z * az, x * bx + y * by + z * bz)
        outer, inner = math.atan2(gamma, beta), math.atan2(gamma, alpha)
        return square >= 0.0, (
            (aim - outer, -inner - self._offset),
            (aim + outer, inner - self._offset),
        )


def turned_back(first: Vector, second: Vector, a: float, b: float, vector: Vector) -> Vector:
    """Undoes a turn by ``a`` about ``first``, then one by ``b`` about ``second``."""
    x, y, z = vector
    for (u, v, w), angle in ((first, a), (second, b)):
        c, s = math.cos(angle), math.sin(angle)
        along = (u * x + v * y + w * z) * (1.0 - c)
        x, y, z = (
            x * c + (y * w - z * v) * s + u * along,
            y * c + (z * u - x * w) * s + v * along,
            z * c + (x * v - y * u) * s + w * along,
        )
    return x, y, z


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _scaled(a: Vector, factor: float) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor
