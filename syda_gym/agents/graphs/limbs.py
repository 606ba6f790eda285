"""LimbGraph: the inverse kinematics on limb directions as a graph, equal to ``SingleArmIK`` frame by frame."""

from __future__ import annotations

import warnings
from typing import Any

import torch
from torch import Tensor, nn

from syda_gym.agents.graphs.arithmetic import angle_of, constant, cosine, cross, dot, norm, wrapped
from syda_gym.agents.graphs.arm import ArmKinematics
from syda_gym.agents.graphs.limits import Clamp
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.limb_ik.single_arm import EXACT, FLAT, STEPS, SingleArmIK

__all__ = ["LimbGraph"]

_FAR = 1e9  # farther from rest than any pose


class LimbGraph(nn.Module):
    """Joint angles ``(B, n)`` [rad] of one arm for unit directions of upper arm and forearm ``(B, 3)`` each.

    The closed form and the choice among its solutions are those of ``SingleArmIK``; where the limits forbid all of
    them, a loop of the graph takes the same projected Levenberg-Marquardt steps until every row has ended.

    Args:
        chain: kinematics of the arm.
        solver: whose results it gives.
    """

    def __init__(self, chain: ArmChain, solver: SingleArmIK) -> None:
        super().__init__()
        self.solver = solver
        self.kinematics = ArmKinematics(chain, solver.movers)
        self.clamp = Clamp(solver.lower, solver.upper, solver.couplings)
        self.rest = constant(solver.rest)
        self.middle = constant(solver.middle)
        self.axes = [constant(solver.axes[joint]) for joint in solver.movers]
        self.zero = (constant(solver.upper_zero), constant(solver.fore_zero))
        self.joints = chain.n_joints
        self.loop = _loop(_Step(self.kinematics, self.clamp), chain.n_joints, len(solver.movers))

    def forward(self, upper: Tensor, fore: Tensor) -> Tensor:
        """The angles."""
        elbow = self.solver.lengths[0] * upper
        goal = torch.cat([elbow, elbow + self.solver.lengths[1] * fore], dim=1)
        candidates = self._candidates(upper, fore)
        # All candidates pass the kinematics together, one block of rows after the other.
        inside = self.clamp(torch.cat([angles for angles, _ in candidates]))
        error = norm(self.kinematics.relative(inside) - goal.repeat(len(candidates), 1))
        inside = inside.reshape(len(candidates), -1, self.joints)
        error = error.reshape(len(candidates), -1, 1)
        far = _FAR + 0.0 * upper[:, :1]
        solved, best, least, score = candidates[0][0], inside[0], far, far
        for index, (angles, real) in enumerate(candidates):
            value = error[index] + self._pull(inside[index])
            better = value < score
            best, score = torch.where(better, inside[index], best), torch.where(better, value, score)
            if self.solver.exact:
                fits = (inside[index] - angles).abs().sum(dim=1, keepdim=True) == 0.0
                pull = self._pull(angles)
                better = fits & real & (pull < least)
                solved, least = torch.where(better, angles, solved), torch.where(better, pull, least)
        found = least < _FAR
        residual, columns = self.kinematics.jacobian(best)
        residual = residual - goal
        cost = dot(residual, residual)
        active = (~found & (torch.sqrt(cost) > EXACT)).to(torch.float64)
        refined = self.loop(best, residual, columns, cost, 1e-4 + 0.0 * cost, active, goal)
        return torch.where(found, solved, refined)

    def _pull(self, angles: Tensor) -> Tensor:
        return 1e-6 * (angles - self.rest).abs().sum(dim=1, keepdim=True)

    def _candidates(self, upper: Tensor, fore: Tensor) -> list[tuple[Tensor, Tensor]]:
        """The four solutions without regard to limits, and whether each is one rather than the nearest to one."""
        w0, w1, w2, w3 = self.axes
        found = []
        for first in (1.0, -1.0):
            a0, a1, real_upper = _subproblem_two(w0, w1, self.zero[0], upper, first)
            turned = _turned(w1, -a1, _turned(w0, -a0, fore))
            for second in (1.0, -1.0):
                a2, a3, real_fore = _subproblem_two(w2, w3, self.zero[1], turned, second)
                by_joint = dict(zip(self.solver.movers, (a0, a1, a2, a3), strict=True))
                columns = [
                    wrapped(by_joint[joint], self.middle[joint]) if joint in by_joint else self.rest[joint] + 0.0 * a0
                    for joint in range(self.joints)
                ]
                found.append((torch.cat(columns, dim=1), real_upper & real_fore))
        return found


class _Step(nn.Module):
    """One projected Levenberg-Marquardt step of every row that is still active."""

    def __init__(self, kinematics: ArmKinematics, clamp: Clamp) -> None:
        super().__init__()
        self.kinematics, self.clamp = kinematics, clamp
        self.movers = list(kinematics.movers)
        self.unit = torch.eye(len(self.movers), dtype=torch.float64)
        joints = len(clamp.lower)
        self.spread = torch.eye(joints, dtype=torch.float64)[self.movers]

    def forward(
        self,
        angles: Tensor,
        residual: Tensor,
        columns: Tensor,
        cost: Tensor,
        damping: Tensor,
        active: Tensor,
        goal: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor]:
        lower, upper = self.clamp.limits(angles)
        slope = (residual[:, None] @ columns)[:, 0]
        moving = angles[:, self.movers]
        at_lower = (moving <= lower[..., self.movers] + 1e-12) & (slope > 0.0)
        at_upper = (moving >= upper[..., self.movers] - 1e-12) & (slope < 0.0)
        free = 1.0 - (at_lower | at_upper).to(torch.float64)
        gradient = slope * free
        alive = (active > 0.5) & (dot(gradient, gradient) >= FLAT)
        local = columns * free[:, None]
        step = self._solve(local.transpose(1, 2) @ local + damping[:, :, None] * self.unit, -gradient)
        promised = -0.5 * dot(gradient, step)
        trial = self.clamp(angles + step @ self.spread)
        new_residual, new_columns = self.kinematics.jacobian(trial)
        new_residual = new_residual - goal
        new_cost = dot(new_residual, new_residual)
        gain = cost - new_cost
        alive = alive & ((gain > 1e-12) | (damping <= 10.0))
        factor = torch.where(gain > promised.clamp(min=0.0), 0.2 + 0.0 * gain, 5.0 + 0.0 * gain)
        damping = torch.where(alive, (damping * factor).clamp(1e-7, 1e2), damping)
        taken = alive & (gain > 0.0)
        return (
            torch.where(taken, trial, angles),
            torch.where(taken, new_residual, residual),
            torch.where(taken[:, :, None], new_columns, columns),
            torch.where(taken, new_cost, cost),
            damping,
            alive.to(torch.float64),
        )

    def _solve(self, matrix: Tensor, right: Tensor) -> Tensor:
        """Solves positive definite systems ``(B, k, k)`` by Gauss-Jordan elimination, which needs no pivots there."""
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
        residual: Tensor,
        columns: Tensor,
        cost: Tensor,
        damping: Tensor,
        active: Tensor,
        goal: Tensor,
    ) -> Tensor:
        count = 0
        going = bool(active.sum() > 0.5)
        while going and count < self.most:
            angles, residual, columns, cost, damping, active = self.step(
                angles, residual, columns, cost, damping, active, goal
            )
            going = bool(active.sum() > 0.5)
            count += 1
        return angles


def _loop(step: _Step, joints: int, movers: int) -> Any:
    rows = 2
    example = tuple(
        torch.zeros(rows, *shape, dtype=torch.float64)
        for shape in ((joints,), (6,), (6, movers), (1,), (1,), (1,), (6,))
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # remarks of the tracer about constants, and of newer versions about its age
        traced = torch.jit.trace(step, example, check_trace=False)  # type: ignore[no-untyped-call]
        return torch.jit.script(_Loop(traced, STEPS))


def _subproblem_two(
    first: Tensor, second: Tensor, start: Tensor, goal: Tensor, sign: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Angles ``(..., 1)`` with R(first, a) R(second, b) start = goal ``(..., 3)``, and whether there is a solution."""
    c = dot(first, second)
    across = cross(first, second)
    span = dot(across, across)
    along_second = dot(second, start)
    along_first = dot(goal, first)
    alpha = (along_first - c * along_second) / span
    beta = (along_second - c * along_first) / span
    square = (1.0 - alpha * alpha - beta * beta - 2.0 * alpha * beta * c) / span
    middle = alpha * first + beta * second + sign * torch.sqrt(square.clamp(min=0.0)) * across
    return _angle_about(first, middle, goal), _angle_about(second, start + 0.0 * middle, middle), square >= 0.0


def _angle_about(axis: Tensor, start: Tensor, goal: Tensor) -> Tensor:
    """Angle ``(..., 1)`` about ``axis`` that turns ``start`` towards ``goal``."""
    return angle_of(dot(cross(start, goal), axis), dot(start, goal) - dot(start, axis) * dot(goal, axis))


def _turned(axis: Tensor, angle: Tensor, vector: Tensor) -> Tensor:
    """Rotates ``vector`` ``(..., 3)`` about ``axis``."""
    c, s = cosine(angle), torch.sin(angle)
    return vector * c + cross(axis + 0.0 * vector, vector) * s + axis * dot(axis + 0.0 * vector, vector) * (1.0 - c)
