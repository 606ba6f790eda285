"""Joint limits as modules, coupled ones included."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, cat, maximum, minimum, nn, relu

from syda_gym.agents.graphs.arithmetic import constant
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.limb_ik import kernel
from syda_gym.embodiments.limb_ik.arm import Arm
from syda_gym.embodiments.robot import Robot

__all__ = ["ArmLimits", "Clamp", "CoupledRange", "robot_clamp"]

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

    def slopes(self, angles: Tensor) -> tuple[Tensor, Tensor]:
        """How both limits move with the governing joint, ``(B, 1)`` each."""
        angle = angles[:, self.by : self.by + 1]
        past = ((angle >= self.at) & (angle < self.ends[1]) & (angle > self.ends[0])).to(angle.dtype)
        low, high = ((past * bends).sum(dim=1, keepdim=True) for _, bends in self.values)
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


class ArmLimits(nn.Module):
    """Limits of one arm as ``limb_ik.kernel`` keeps them, within a box of each row.

    Args:
        arm: the arm.
    """

    def __init__(self, arm: Arm) -> None:
        super().__init__()
        self.joints = len(arm.lower)
        self.governed = [int(joint) for joint in arm.governed]
        self.governors = [int(joint) for joint in arm.governors]
        tables = [arm.table[a:b] for a, b in zip(arm.rows[:-1], arm.rows[1:], strict=True)]
        self.each = [
            CoupledRange((joint, by, table[:, 0], table[:, 1], table[:, 2]))
            for joint, by, table in zip(self.governed, self.governors, tables, strict=True)
        ]
        self.ranges = nn.ModuleList(self.each)

    def box(self, angles: Tensor, lower: Tensor, upper: Tensor) -> tuple[Tensor, Tensor, list[tuple[Tensor, Tensor]]]:
        """What the coupled limits leave of a box, and how its sides move with the governors."""
        slopes = []
        for joint, coupled in zip(self.governed, self.each, strict=True):
            own = slice(joint, joint + 1)
            (low, high), (rise, climb) = coupled(angles), coupled.slopes(angles)
            slopes.append((
                torch.where(low >= lower[:, own], rise, 0.0 * rise),
                torch.where(high <= upper[:, own], climb, 0.0 * climb),
            ))  # fmt: skip
            lower = _put(lower, joint, maximum(lower[:, own], low))
            upper = _put(upper, joint, minimum(upper[:, own], high))
        return lower, upper, slopes

    def tie(
        self,
        angles: Tensor,
        low: Tensor,
        high: Tensor,
        slopes: list[tuple[Tensor, Tensor]],
        matrix: Tensor,
        slope: Tensor,
        movers: list[int],
    ) -> tuple[Tensor, Tensor, list[Tensor]]:
        """Joints at coupled limits go along with their governors; matrix, slope, and how much they do."""
        ties = []
        for joint, by, (rise, climb) in zip(self.governed, self.governors, slopes, strict=True):
            tie = 0.0 * rise
            if joint in movers and by in movers:
                j, g, own = movers.index(joint), movers.index(by), slice(joint, joint + 1)
                push = slope[:, j : j + 1]
                at_low = (angles[:, own] <= low[:, own] + kernel.SLACK) & (push > 0.0)
                at_high = (angles[:, own] >= high[:, own] - kernel.SLACK) & (push < 0.0)
                tie = torch.where(at_low, rise, torch.where(at_high, climb, tie))
                slope = _put(slope, g, slope[:, g : g + 1] + tie * push)
                matrix = _put(matrix, g, matrix[:, g : g + 1] + tie[:, :, None] * matrix[:, j : j + 1])
                turned = matrix.transpose(1, 2)
                turned = _put(turned, g, turned[:, g : g + 1] + tie[:, :, None] * turned[:, j : j + 1])
                matrix = turned.transpose(1, 2)
            ties.append(tie)
        return matrix, slope, ties

    def tied(self, angles: Tensor, trial: Tensor, ties: list[Tensor]) -> Tensor:
        """A trial pose whose tied joints go along with their governors."""
        for joint, by, tie in zip(self.governed, self.governors, ties, strict=True):
            along = tie * (trial - angles)[:, by : by + 1]
            trial = _put(trial, joint, trial[:, joint : joint + 1] + along)
        return trial

    def project(self, angles: Tensor, lower: Tensor, upper: Tensor, allowed: Tensor) -> Tensor:
        """``kernel._project``: into the box and the coupled limits, governors held back where need be."""
        angles = minimum(maximum(angles, lower), upper)
        for joint, by, coupled in zip(self.governed, self.governors, self.each, strict=True):
            own, lead = slice(joint, joint + 1), slice(by, by + 1)
            low, high = coupled(angles)
            held = maximum(low, lower[:, own]) > minimum(high, upper[:, own])
            start, goal = allowed[:, lead], angles[:, lead]
            share, width = 0.0 * start, 1.0
            for _ in range(kernel.HALVINGS):
                width *= 0.5
                low, high = coupled(_put(angles, by, start + (share + width) * (goal - start)))
                fits = maximum(low, lower[:, own]) <= minimum(high, upper[:, own])
                share = torch.where(fits, share + width, share)
            angles = _put(angles, by, torch.where(held, start + share * (goal - start), goal))
            low, high = coupled(angles)
            low, high = maximum(low, lower[:, own]), minimum(high, upper[:, own])
            none = low > high
            low, high = torch.where(none, allowed[:, own], low), torch.where(none, allowed[:, own], high)
            angles = _put(angles, joint, minimum(maximum(angles[:, own], low), high))
        for joint, coupled in zip(self.governed, self.each, strict=True):
            angle = angles[:, joint : joint + 1]
            low, high = coupled(angles)
            angles = torch.where((angle < low - 1e-12) | (angle > high + 1e-12), allowed, angles)
        return angles


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


def _put(rows: Tensor, column: int, value: Tensor) -> Tensor:
    """``(B, n, ...)`` with another column ``(B, 1, ...)``."""
    return cat([rows[:, :column], value, rows[:, column + 1 :]], dim=1)


def _bends(at: FloatArray, values: FloatArray) -> FloatArray:
    """Changes of slope, so that ``values[0] + sum(bends * relu(x - at[:-1]))`` interpolates linearly."""
    slopes = np.diff(values) / np.diff(at)
    return np.diff(slopes, prepend=0.0)
