"""Descent: the refinement of ``limb_ik.kernel`` as a loop of a graph, all rows at once."""

from __future__ import annotations

import warnings
from typing import Any

import torch
from torch import Tensor, nn

from syda_gym.agents.graphs.arithmetic import dot, norm
from syda_gym.agents.graphs.arm import ArmKinematics
from syda_gym.agents.graphs.limits import ArmLimits
from syda_gym.embodiments.limb_ik import kernel

__all__ = ["Descent", "miss_of"]


def miss_of(found: Tensor, target: Tensor) -> Tensor:
    """Mean length of the two differences of unit vectors ``(B, 1)``."""
    away = found - target
    return 0.5 * (norm(away[:, :3]) + norm(away[:, 3:]))


class Descent(nn.Module):
    """``kernel.refine``: projected Levenberg-Marquardt steps until every active row has ended.

    Args:
        kinematics: of the arm, with its movers.
        limits: of the arm.
        joints: how many the arm has.
    """

    def __init__(self, kinematics: ArmKinematics, limits: ArmLimits, joints: int) -> None:
        super().__init__()
        self.kinematics = kinematics
        self.cost = _Cost(kinematics)
        self.loop = _scripted(_Step(kinematics, limits, self.cost), joints, len(kinematics.movers))

    def forward(
        self,
        start: Tensor,
        target: Tensor,
        lower: Tensor,
        upper: Tensor,
        anchor: Tensor,
        hold: Tensor,
        firm: Tensor,
        active: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Angles ``(B, n)`` and misses ``(B, 1)``; rows that are not active stay where they start."""
        turning = self.kinematics.limbs(anchor)[2]
        found, columns, _ = self.kinematics.limbs(start)
        cost = self.cost(found, target, start, anchor, hold, firm, turning)
        damping = kernel.DAMPING + 0.0 * cost
        still = (target, lower, upper, anchor, hold, firm, turning)
        angles, found = self.loop(start, found, columns, cost, damping, active.to(torch.float64), *still)
        return angles, miss_of(found, target)


class _Cost(nn.Module):
    """``kernel._cost``."""

    def __init__(self, kinematics: ArmKinematics) -> None:
        super().__init__()
        self.movers = list(kinematics.movers)

    def forward(
        self, found: Tensor, target: Tensor, angles: Tensor, anchor: Tensor, hold: Tensor, firm: Tensor, turning: Tensor
    ) -> Tensor:
        away = found - target
        total = sum(
            2.0 * kernel.BLUR * (torch.sqrt(dot(limb, limb) + kernel.BLUR * kernel.BLUR) - kernel.BLUR)
            for limb in (away[:, :3], away[:, 3:])
        )
        moved = (angles - anchor)[:, self.movers]
        turn = dot(turning, moved)
        result: Tensor = total + hold * dot(moved, moved) + firm * turn * turn
        return result


class _Step(nn.Module):
    """One step of every row that is still active."""

    def __init__(self, kinematics: ArmKinematics, limits: ArmLimits, cost: _Cost) -> None:
        super().__init__()
        self.kinematics, self.limits, self.cost = kinematics, limits, cost
        self.movers = list(kinematics.movers)
        self.unit = torch.eye(len(self.movers), dtype=torch.float64)
        self.spread = torch.eye(limits.joints, dtype=torch.float64)[self.movers]

    def forward(
        self,
        angles: Tensor,
        found: Tensor,
        columns: Tensor,
        cost: Tensor,
        damping: Tensor,
        active: Tensor,
        target: Tensor,
        lower: Tensor,
        upper: Tensor,
        anchor: Tensor,
        hold: Tensor,
        firm: Tensor,
        turning: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor]:
        away = found - target
        limbs = [kernel.BLUR / torch.sqrt(dot(x, x) + kernel.BLUR * kernel.BLUR) for x in (away[:, :3], away[:, 3:])]
        weights = torch.cat([limbs[0].repeat(1, 3), limbs[1].repeat(1, 3)], dim=1)
        moved = (angles - anchor)[:, self.movers]
        weighted = columns * weights[:, None]
        slope = hold * moved + firm * dot(turning, moved) * turning + (weighted @ away[:, :, None])[:, :, 0]
        matrix = firm[:, :, None] * turning[:, :, None] * turning[:, None] + weighted @ columns.transpose(1, 2)
        matrix = matrix + (hold + damping)[:, :, None] * self.unit
        low, high, slopes = self.limits.box(angles, lower, upper)
        matrix, slope, ties = self.limits.tie(angles, low, high, slopes, matrix, slope, self.movers)
        own = angles[:, self.movers]
        at_lower = (own <= low[:, self.movers] + kernel.SLACK) & (slope > 0.0)
        at_upper = (own >= high[:, self.movers] - kernel.SLACK) & (slope < 0.0)
        free = 1.0 - (at_lower | at_upper).to(torch.float64)
        gradient = slope * free
        alive = (active > 0.5) & (dot(gradient, gradient) >= kernel.FLAT)
        both = free[:, :, None] * free[:, None]
        step = self._solved(matrix * both + (1.0 - both) * self.unit, -gradient)
        promised = -dot(slope, step)
        alive = alive & (promised >= kernel.LEAST_GAIN)
        trial = self.limits.tied(angles, angles + step @ self.spread, ties)
        trial = self.limits.project(trial, lower, upper, anchor)
        ahead, after, _ = self.kinematics.limbs(trial)
        reached = self.cost(ahead, target, trial, anchor, hold, firm, turning)
        gain = cost - reached
        alive = alive & ((gain > kernel.LEAST_GAIN) | (damping <= 10.0))
        factor = torch.where(gain > (0.5 * promised).clamp(min=0.0), 0.2 + 0.0 * gain, 5.0 + 0.0 * gain)
        damping = torch.where(alive, (damping * factor).clamp(1e-7, 1e2), damping)
        taken = alive & (gain > 0.0)
        return (
            torch.where(taken, trial, angles),
            torch.where(taken, ahead, found),
            torch.where(taken[:, :, None], after, columns),
            torch.where(taken, reached, cost),
            damping,
            alive.to(torch.float64),
        )

    def _solved(self, matrix: Tensor, right: Tensor) -> Tensor:
        """Solves positive definite systems ``(B, m, m)`` by Gauss-Jordan elimination, which needs no pivots there."""
        whole = torch.cat([matrix, right[:, :, None]], dim=2)
        for index in range(len(self.movers)):
            row = whole[:, index : index + 1] / whole[:, index : index + 1, index : index + 1]
            whole = whole - (whole[:, :, index : index + 1] - self.unit[index][None, :, None]) * row
        return whole[:, :, -1]


class _Loop(nn.Module):
    """Repeats a step while any row is active; scripted, so that it becomes a loop of the graph."""

    def __init__(self, step: Any, most: int) -> None:
        super().__init__()
        self.step = step
        self.most = most

    def forward(
        self,
        angles: Tensor,
        found: Tensor,
        columns: Tensor,
        cost: Tensor,
        damping: Tensor,
        active: Tensor,
        target: Tensor,
        lower: Tensor,
        upper: Tensor,
        anchor: Tensor,
        hold: Tensor,
        firm: Tensor,
        turning: Tensor,
    ) -> tuple[Tensor, Tensor]:
        count = 0
        going = bool(active.sum() > 0.5)
        while going and count < self.most:
            angles, found, columns, cost, damping, active = self.step(
                angles, found, columns, cost, damping, active, target, lower, upper, anchor, hold, firm, turning
            )
            going = bool(active.sum() > 0.5)
            count += 1
        return angles, found


def _scripted(step: _Step, joints: int, movers: int) -> Any:
    rows = 2
    widths = (
        (joints,),
        (6,),
        (movers, 6),
        (1,),
        (1,),
        (1,),
        (6,),
        (joints,),
        (joints,),
        (joints,),
        (1,),
        (1,),
        (movers,),
    )
    example = tuple(torch.zeros(rows, *shape, dtype=torch.float64) for shape in widths)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # remarks of the tracer about constants, and of newer versions about its age
        traced = torch.jit.trace(step, example, check_trace=False)  # type: ignore[no-untyped-call]
        return torch.jit.script(_Loop(traced, kernel.STEPS))
