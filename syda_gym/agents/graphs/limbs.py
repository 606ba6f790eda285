"""LimbGraph: the limb solver of one arm as a graph, equal to ``limb_ik.kernel`` frame by frame."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from syda_gym.agents.graphs.arithmetic import angle_of, constant, cosine, cross, dot, norm, wrapped
from syda_gym.agents.graphs.arm import ArmKinematics
from syda_gym.agents.graphs.descent import Descent, miss_of
from syda_gym.agents.graphs.limits import ArmLimits
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.limb_ik import kernel
from syda_gym.embodiments.limb_ik.arm import Arm

__all__ = ["LimbGraph"]


class LimbGraph(nn.Module):
    """What ``LimbIK.follow`` does for one arm of ``B`` robots, with the state of ``limb_ik.kernel.follow_arm``.

    Args:
        chain: kinematics of the arm.
        arm: the same as the solver has it.
        dt: time between frames [s].

    Attributes:
        state_size: numbers of the state.
    """

    def __init__(self, chain: ArmChain, arm: Arm, dt: float) -> None:
        super().__init__()
        self.arm, self.dt, self.joints = arm, dt, chain.n_joints
        self.state_size = 2 * self.joints + 3
        self.kinematics = ArmKinematics(chain, [int(joint) for joint in arm.movers], arm.twisting)
        self.limits = ArmLimits(arm)
        self.descent = Descent(self.kinematics, self.limits, self.joints)
        self.lower, self.upper = constant(arm.lower), constant(arm.upper)
        self.rest, self.reach = constant(arm.rest), constant(arm.speed * dt * kernel.WITHIN)
        self.speed = constant(arm.speed)
        self.bends = torch.arange(self.joints) == int(arm.hinge)
        self.seeds = [constant(seed) for seed in arm.seeds]
        self.turns = constant(arm.turns)
        self.hold = arm.habits.glue * kernel.FRAME / dt

    def forward(self, target: Tensor, state: Tensor, fresh: Tensor) -> tuple[Tensor, Tensor]:
        """Angles ``(B, n)`` [rad] and the next state, for unit upper arm and forearm ``(B, 6)``.

        Args:
            target: wanted directions.
            state: ``(B, state_size)``; not read where ``fresh``.
            fresh: ``(B, 1)``, 1 in the first frame of a sequence.
        """
        n, begun = self.joints, fresh < 0.5
        before = torch.where(begun, state[:, :n], self.rest + 0.0 * state[:, :n])
        goal = torch.where(begun, state[:, n : 2 * n], before)
        patience, going = state[:, 2 * n : 2 * n + 1], begun & (state[:, 2 * n + 1 : 2 * n + 2] > 0.5)
        flexion = norm(cross(target[:, :3], target[:, 3:]))
        bend = state[:, 2 * n + 2 :]
        bend = torch.minimum(flexion, bend + (flexion - bend) * (self.dt / (self.dt + self.arm.habits.opening)))
        bend = torch.where(begun, bend, flexion)
        lower = torch.maximum(self.lower + 0.0 * before, before - self.reach)
        upper = torch.minimum(self.upper + 0.0 * before, before + self.reach)
        firm = (self.arm.habits.stiff / (bend * bend * bend * bend + 1e-12)).clamp(max=self.arm.habits.firm) * (
            kernel.FRAME / self.dt
        )
        hold = self.hold + 0.0 * firm
        near, miss = self.descent(before, target, lower, upper, before, hold, firm, begun & ~going)
        calm = begun & ~going & (miss < self.arm.habits.calm)
        whole = self.lower + 0.0 * before, self.upper + 0.0 * before
        along, reached = self.descent(goal, target, *whole, goal, kernel.REST + 0.0 * hold, 0.0 * firm, begun & ~calm)
        other, best = self._solve(target, before, ~calm)
        patience = (patience + (reached - best - self.arm.habits.margin) * self.dt).clamp(min=0.0)
        patience = torch.where(~calm & begun, patience, 0.0 * best)
        switch = patience > self._crossing(before, other, target, reached).clamp(min=self.arm.habits.patience)
        goal = torch.where(switch | ~begun, other, torch.where(calm, near, along))
        patience = torch.where(switch, 0.0 * patience, patience)
        going = (going | switch) & begun
        straight = self.limits.project(goal, lower, upper, before)
        # The elbow bends as the limbs want it while the other joints are on their way.
        fixed = (torch.where(self.bends, lower, straight), torch.where(self.bends, upper, straight))
        crossed, miss = self.descent(straight, target, *fixed, straight, hold, 0.0 * firm, going)
        angles = torch.where(begun, torch.where(going, crossed, near), other)
        left = (crossed - goal).abs().sum(dim=1, keepdim=True) > kernel.SAME
        going = (going & left & (miss >= self.arm.habits.calm)).to(torch.float64)
        return angles, torch.cat([angles, goal, patience, going, bend], dim=1)

    def _crossing(self, start: Tensor, goal: Tensor, target: Tensor, staying: Tensor) -> Tensor:
        """``kernel._crossing``."""
        way = goal - start
        poses = torch.cat([start + (stop + 1.0) / (kernel.WAY + 1.0) * way for stop in range(kernel.WAY)])
        bent = torch.where(self.bends, start.repeat(kernel.WAY, 1), poses)
        found = self.kinematics.directions(torch.cat([poses, bent]))
        misses = miss_of(found, target.repeat(2 * kernel.WAY, 1)).reshape(2, kernel.WAY, -1, 1)
        total = (torch.minimum(misses[0], misses[1]) - staying).clamp(min=0.0).sum(dim=0)
        longest = (way.abs() / self.speed).max(dim=1, keepdim=True)[0]
        return longest * total / kernel.WAY

    def _solve(self, target: Tensor, near: Tensor, wanted: Tensor) -> tuple[Tensor, Tensor]:
        """``kernel.solve_arm`` for the rows that want it: angles and misses."""
        closed = self._closed_form(target) if len(self.arm.closed) else []
        seeds = [seed + 0.0 * target[:, :1] for seed in self.seeds]
        count, rows = len(closed) + len(seeds), target.shape[0]
        lower, upper = ((limit + 0.0 * target[:, :1]).repeat(count, 1) for limit in (self.lower, self.upper))
        anchor = near.repeat(count, 1)
        starts = self.limits.project(torch.cat([*closed, *seeds]), lower, upper, self.rest + 0.0 * anchor)
        misses = miss_of(self.kinematics.directions(starts), target.repeat(count, 1)).reshape(count, -1)
        starts = starts.reshape(count, -1, self.joints)
        best, least, miss = starts[0], self._score(misses[0, :, None], starts[0], near), misses[0, :, None]
        for index in range(1, count):
            # Where the closed form has an answer the seeds are not asked.
            asked = miss >= kernel.NEAR if index >= len(closed) else miss >= 0.0
            score = self._score(misses[index, :, None], starts[index], near)
            better = asked & (score < least)
            best, least = torch.where(better, starts[index], best), torch.where(better, score, least)
            miss = torch.where(better, misses[index, :, None], miss)
        some = min(kernel.STARTS, count)
        order = torch.topk(misses, some, dim=0, largest=False, sorted=True)[1]
        chosen = torch.gather(starts, 0, order[:, :, None].repeat(1, 1, self.joints)).reshape(-1, self.joints)
        active = (wanted & (miss >= kernel.NEAR)).repeat(some, 1)
        box = [limit[: some * rows] for limit in (lower, upper, anchor)]
        still = 0.0 * chosen[:, :1]
        found, reached = self.descent(
            chosen, target.repeat(some, 1), box[0], box[1], box[2], kernel.REST + still, still, active
        )
        found, reached = found.reshape(some, -1, self.joints), reached.reshape(some, -1, 1)
        refined, least, value = found[0], self._score(reached[0], found[0], near), reached[0]
        for index in range(1, some):
            score = self._score(reached[index], found[index], near)
            better = score < least
            refined, least = torch.where(better, found[index], refined), torch.where(better, score, least)
            value = torch.where(better, reached[index], value)
        exact = miss < kernel.NEAR
        return torch.where(exact, best, refined), torch.where(exact, miss, value)

    def _score(self, miss: Tensor, angles: Tensor, near: Tensor) -> Tensor:
        return miss + kernel.PULL * (angles - near).abs().sum(dim=1, keepdim=True)

    def _closed_form(self, target: Tensor) -> list[Tensor]:
        """The four solutions without regard to limits."""
        found = []
        for first in (-1.0, 1.0):
            a0, a1 = _two_turns(self.turns[0], target[:, :3], first)
            turned = _turned(self.turns[0, 1], -a1, _turned(self.turns[0, 0], -a0, target[:, 3:]))
            for second in (-1.0, 1.0):
                a2, a3 = _two_turns(self.turns[1], turned, second)
                by_joint = dict(zip([int(joint) for joint in self.arm.closed], (a0, a1, a2, a3), strict=True))
                middle = 0.5 * (self.lower + self.upper)
                columns = [
                    wrapped(by_joint[joint], middle[joint]) if joint in by_joint else self.rest[joint] + 0.0 * a0
                    for joint in range(self.joints)
                ]
                found.append(torch.cat(columns, dim=1))
        return found


def _two_turns(turn: Tensor, goal: Tensor, sign: float) -> tuple[Tensor, Tensor]:
    """Angles ``(B, 1)`` about two axes that bring a direction onto ``goal`` ``(B, 3)``, as in ``kernel``."""
    first, beside, across = turn[0], turn[2], turn[3]
    cosine_, start, offset = turn[4, 0], turn[4, 1], turn[4, 2]
    span = 1.0 - cosine_ * cosine_
    along = dot(goal, first)
    alpha, beta = (along - cosine_ * start) / span, (start - cosine_ * along) / span
    square = (1.0 - alpha * alpha - beta * beta - 2.0 * alpha * beta * cosine_) / span
    gamma, root = torch.sqrt((square * span).clamp(min=0.0)), torch.sqrt(span)
    aim = angle_of(dot(goal, across), dot(goal, beside))
    outer, inner = angle_of(gamma, beta * root), angle_of(gamma, alpha * root)
    return aim + sign * outer, sign * inner - offset


def _turned(axis: Tensor, angle: Tensor, vector: Tensor) -> Tensor:
    """Rotates ``vector`` ``(..., 3)`` about ``axis``."""
    c, s = cosine(angle), torch.sin(angle)
    return vector * c + cross(axis + 0.0 * vector, vector) * s + axis * dot(axis + 0.0 * vector, vector) * (1.0 - c)
