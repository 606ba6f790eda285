"""Joint limits as modules, coupled ones included."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from torch import Tensor, cat, maximum, minimum, nn, relu

from syda_gym.agents.graphs.arithmetic import constant
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot

__all__ = ["Clamp", "CoupledRange", "robot_clamp"]

Coupling = tuple[int, int, ArrayLike, ArrayLike, ArrayLike]
"""Joint, governing joint, angles of the rows, lower and upper limits."""


class CoupledRange(nn.Module):
    """A joint's limits that depend on another joint, linear between rows; written as a sum of ramps."""

    def __init__(self, coupling: Coupling) -> None:
        super().__init__()
        _, self.by, at, lower, upper = coupling
        rows = np.asarray(at, dtype=np.float64)
        self.ends = (float(rows[0]), float(rows[-1]))
        self.at = constant(rows[:-1])
        sides = (np.asarray(side, dtype=np.float64) for side in (lower, upper))
        self.values = [(float(side[0]), constant(_bends(rows, side))) for side in sides]

    def forward(self, angles: Tensor) -> tuple[Tensor, Tensor]:
        """Lower and upper limit ``(B, 1)`` at the angles ``(B, n)`` of all joints."""
        ramps = relu(angles[:, self.by : self.by + 1].clamp(*self.ends) - self.at)
        low, high = (first + (ramps * bends).sum(dim=1, keepdim=True) for first, bends in self.values)
        return low, high


class Clamp(nn.Module):
    """``Robot.clamp``: joint limits, then coupled limits at the clamped angles.

    Args:
        lower: ``(n,)`` [rad].
        upper: ``(n,)`` [rad].
        couplings: limits that depend on another joint.
    """

    def __init__(self, lower: ArrayLike, upper: ArrayLike, couplings: Sequence[Coupling]) -> None:
        super().__init__()
        self.lower, self.upper = constant(lower), constant(upper)
        self.couplings = nn.ModuleList(CoupledRange(coupling) for coupling in couplings)
        self.governed = [coupling[0] for coupling in couplings]

    def limits(self, angles: Tensor) -> tuple[Tensor, Tensor]:
        """Lower and upper limits at angles ``(B, n)``; without couplings ``(n,)``."""
        lower, upper = self.lower, self.upper
        for joint, coupling in zip(self.governed, self.couplings, strict=True):
            low, high = coupling(angles)
            lower = _replaced(lower, angles, joint, low, maximum)
            upper = _replaced(upper, angles, joint, high, minimum)
        return lower, upper

    def forward(self, angles: Tensor) -> Tensor:
        """Angles ``(B, n)`` within the limits."""
        inside = minimum(maximum(angles, self.lower), self.upper)
        if not len(self.couplings):
            return inside
        lower, upper = self.limits(inside)
        return minimum(maximum(inside, lower), upper)


def robot_clamp(robot: Robot) -> Clamp:
    """The limits of a whole robot."""
    names = robot.joint_names
    couplings: list[Coupling] = [
        (names.index(c.joint), names.index(c.by), c.at, c.lower, c.upper)
        for c in robot.description.coupled_limits
        if c.joint in names and c.by in names
    ]
    return Clamp(robot.lower, robot.upper, couplings)


def _replaced(
    limit: Tensor, angles: Tensor, joint: int, value: Tensor, tighter: Callable[[Tensor, Tensor], Tensor]
) -> Tensor:
    """The limits ``(B, n)`` with a tighter one for one joint."""
    rows = limit + 0.0 * angles
    inner = tighter(rows[:, joint : joint + 1], value)
    return cat([rows[:, :joint], inner, rows[:, joint + 1 :]], dim=1)


def _bends(at: FloatArray, values: FloatArray) -> FloatArray:
    """Changes of slope, so that ``values[0] + sum(bends * relu(x - at[:-1]))`` interpolates linearly."""
    slopes = np.diff(values) / np.diff(at)
    return np.diff(slopes, prepend=0.0)
