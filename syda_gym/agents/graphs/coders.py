"""Coders as modules: frames ``(B, F)`` to codes ``(B, K, D)``, and back with what a sequence remembers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from syda_gym.agents.graphs.arithmetic import angle_of, constant, dot, norm
from syda_gym.agents.graphs.arm import ArmKinematics
from syda_gym.agents.graphs.limbs import LimbGraph
from syda_gym.agents.graphs.limits import robot_clamp
from syda_gym.embodiments.embodiment import Side
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.errors import AgentError
from syda_gym.mappings.coding.arm_coders import HUMAN_WIDTH, HumanArmCoder, RobotArmCoder
from syda_gym.mappings.coding.coders import Coder, PositionCoder, QuaternionCoder

__all__ = ["CODERS", "decoder_of", "encoder_of"]

_SHORTEST = 1e-6  # m, as in arm_coders
_FLAT = 0.02  # m; shoulders above each other tell no heading
_MIRROR = ((1.0, 1.0, 1.0), (1.0, -1.0, 1.0))


def encoder_of(coder: Coder) -> nn.Module:
    """The module that encodes.

    Raises:
        AgentError: this kind of code has no graph.
    """
    return _modules(coder)[0](coder)


def decoder_of(coder: Coder, dt: float) -> tuple[nn.Module, int]:
    """The module that decodes frames ``dt`` [s] apart, and the size of its state.

    It makes frames and the next state of ``(codes, state, fresh)``.

    Raises:
        AgentError: this kind of code has no graph.
    """
    kind = _modules(coder)[1]
    if isinstance(coder, RobotArmCoder):
        arms = _DecodeRobotArms(coder, dt)
        return arms, arms.state_size
    return _Stateless(kind(coder)), 0


def _modules(coder: Coder) -> tuple[type[nn.Module], type[nn.Module]]:
    if type(coder) not in CODERS:
        raise AgentError(
            f"the code {coder.kind!r} of {coder.body.name!r} cannot be written as a graph; "
            f"{', '.join(kind.kind for kind in CODERS)} can; export the agent alone and map with the numpy runner"
        )
    return CODERS[type(coder)]


class _Stateless(nn.Module):
    """A decoder that remembers nothing."""

    def __init__(self, decoder: nn.Module) -> None:
        super().__init__()
        self.decoder = decoder

    def forward(self, codes: Tensor, state: Tensor, fresh: Tensor) -> tuple[Tensor, Tensor]:
        return self.decoder(codes), state


class _Encode(nn.Module):
    """Positions as they are."""

    def __init__(self, coder: PositionCoder) -> None:
        super().__init__()

    def forward(self, frames: Tensor) -> Tensor:
        return frames[:, None]


class _Decode(nn.Module):
    """Positions as they are."""

    def __init__(self, coder: PositionCoder) -> None:
        super().__init__()

    def forward(self, codes: Tensor) -> Tensor:
        return codes[:, 0]


class _EncodeQuaternions(nn.Module):
    def __init__(self, coder: QuaternionCoder) -> None:
        super().__init__()
        n, self.width = coder.body.n_features, coder.width
        self.fixed = constant(coder.encode(np.zeros((1, n))).reshape(n, 4))
        self.axes = constant(np.concatenate([chain.axes for chain in coder.robot.chains]))

    def forward(self, frames: Tensor) -> Tensor:
        half = 0.5 * frames[..., None]
        turn = torch.cat([torch.sin(half) * self.axes, torch.sin(half + math.pi / 2.0)], dim=-1)
        return _multiply(self.fixed + 0.0 * turn, turn).reshape(-1, 1, self.width)


class _DecodeQuaternions(nn.Module):
    def __init__(self, coder: QuaternionCoder) -> None:
        super().__init__()
        self.n = coder.body.n_features
        fixed = coder.encode(np.zeros((1, self.n))).reshape(self.n, 4)
        self.back = constant(fixed * np.array([-1.0, -1.0, -1.0, 1.0]))
        self.axes = constant(np.concatenate([chain.axes for chain in coder.robot.chains]))

    def forward(self, codes: Tensor) -> Tensor:
        turn = _multiply(self.back + 0.0 * codes.reshape(-1, self.n, 4), codes.reshape(-1, self.n, 4))
        angle = 2.0 * angle_of((turn[..., :3] * self.axes).sum(dim=-1), turn[..., 3])
        shifted = angle + math.pi
        return shifted - 2.0 * math.pi * torch.floor(shifted / (2.0 * math.pi)) - math.pi


class _EncodeHumanArms(nn.Module):
    def __init__(self, coder: HumanArmCoder) -> None:
        super().__init__()
        human = coder.human
        self.sides = len(human.sides)
        self.arms = [human.sides.index(side) for side in coder.sides]
        self.axes = constant(human.axes.T)
        self.signs = _signs(coder.sides)
        self.placed = coder.placed
        self.length, self.shoulder = float(coder.lengths.sum()), constant(coder.shoulder)

    def forward(self, frames: Tensor) -> Tensor:
        points = _facing_forward(frames.reshape(-1, self.sides, 3, 3) @ self.axes)[:, self.arms] * self.signs
        elbow, hand = points[:, :, 1] - points[:, :, 0], points[:, :, 2] - points[:, :, 0]
        fore = hand - elbow
        long_upper, long_fore = norm(elbow), norm(fore)
        size = (long_upper + long_fore).mean(dim=1, keepdim=True).clamp(min=_SHORTEST)
        if self.placed:
            size = self.length + 0.0 * size
        place = [(points[:, :, 0] - self.shoulder) / size] if self.placed else []
        upper, lower = elbow / long_upper.clamp(min=_SHORTEST), fore / long_fore.clamp(min=_SHORTEST)
        return torch.cat([*place, elbow / size, hand / size, upper, lower], dim=-1)


class _DecodeHumanArms(nn.Module):
    def __init__(self, coder: HumanArmCoder) -> None:
        super().__init__()
        human = coder.human
        self.width = human.n_features
        self.arms = [human.sides.index(side) for side in coder.sides]
        self.axes, self.signs = constant(human.axes), _signs(coder.sides)
        self.placed, self.lengths = coder.placed, coder.lengths.tolist()
        self.shoulder, self.rest = constant(coder.shoulder), constant(coder.rest)

    def forward(self, codes: Tensor) -> Tensor:
        length = sum(self.lengths)
        shoulder = self.shoulder + (codes[..., :3] * length if self.placed else 0.0 * codes[..., :3])
        shape = codes[..., -HUMAN_WIDTH:]
        elbow, hand = shape[..., 0:3] * length, shape[..., 3:6] * length
        if not self.placed:
            upper = self.lengths[0] * _unit(shape[..., 6:9])
            elbow = 0.5 * (elbow + upper)
            hand = 0.5 * (hand + upper + self.lengths[1] * _unit(shape[..., 9:12]))
        coded = (shoulder[:, :, None] + torch.stack([0.0 * elbow, elbow, hand], dim=2)) * self.signs
        still = self.rest + 0.0 * codes[:, :1, :1, None]
        arms = [
            coded[:, self.arms.index(arm)] if arm in self.arms else still[:, arm] for arm in range(self.rest.shape[0])
        ]
        return (torch.stack(arms, dim=1) @ self.axes).reshape(-1, self.width)


class _EncodeRobotArms(nn.Module):
    def __init__(self, coder: RobotArmCoder) -> None:
        super().__init__()
        robot = coder.robot
        arms = [robot.sides.index(side) for side in coder.sides]
        self.parts = [robot.arm_slices[arm] for arm in arms]
        self.kinematics = nn.ModuleList(ArmKinematics(robot.chains[arm]) for arm in arms)
        self.signs = _signs(coder.sides)
        self.extra, self.extra_signs = coder.extra_columns.tolist(), constant(coder.extra_signs)

    def forward(self, frames: Tensor) -> Tensor:
        points = torch.stack(
            [arm(frames[:, part]) for arm, part in zip(self.kinematics, self.parts, strict=True)], dim=1
        )
        points = points * self.signs
        codes = _unit(points[:, :, 1:] - points[:, :, :-1]).reshape(-1, len(self.parts), 6)
        if not self.extra[0]:
            return codes
        extras = torch.stack([frames[:, columns] for columns in self.extra], dim=1)
        return torch.cat([codes, extras * self.extra_signs], dim=-1)


class _DecodeRobotArms(nn.Module):
    """``RobotArmCoder.follow``: codes and the solver's state to angles and the next state."""

    def __init__(self, coder: RobotArmCoder, dt: float) -> None:
        super().__init__()
        robot = coder.robot
        solver = LimbIK.of(robot)
        self.arms = [robot.sides.index(side) for side in coder.sides]
        self.parts = robot.arm_slices
        self.limbs = nn.ModuleList(
            LimbGraph(chain, arm, dt) for chain, arm in zip(robot.chains, solver.arms, strict=True)
        )
        self.sizes = [2 * len(arm.lower) + 3 for arm in solver.arms]
        self.state_size = solver.state_size
        self.signs = _signs(coder.sides)[:, 0]
        self.rest = constant(coder.rest)
        self.extra, self.extra_signs = coder.extra_columns.tolist(), constant(coder.extra_signs)
        self.hanging = constant([0.0, 0.0, -1.0])
        self.clamp = robot_clamp(robot)

    def forward(self, codes: Tensor, state: Tensor, fresh: Tensor) -> tuple[Tensor, Tensor]:
        frames = self.rest + 0.0 * codes[:, 0, :1]
        columns = list(torch.split(frames, 1, dim=1))
        after = []
        for arm, (limb, own) in enumerate(zip(self.limbs, torch.split(state, self.sizes, dim=1), strict=True)):
            if arm not in self.arms:
                after.append(own)
                continue
            index = self.arms.index(arm)
            upper, fore = (self._direction(codes[:, index, at : at + 3] * self.signs[index]) for at in (0, 3))
            angles, remembered = limb(torch.cat([upper, fore], dim=1), own, fresh)
            after.append(remembered)
            columns[self.parts[arm]] = torch.split(angles, 1, dim=1)
            for extra, column in enumerate(self.extra[index]):
                columns[column] = codes[:, index, 6 + extra : 7 + extra] * self.extra_signs[index, extra]
        result: Tensor = self.clamp(torch.cat(columns, dim=1))
        return result, torch.cat(after, dim=1)

    def _direction(self, vector: Tensor) -> Tensor:
        """Unit length; a vanishing direction becomes a hanging arm, as in ``RobotArmCoder``."""
        vector = torch.where(dot(vector, vector) < 1e-12, self.hanging, vector)
        return vector / norm(vector)


CODERS: dict[type[Coder], tuple[type[nn.Module], type[nn.Module]]] = {
    PositionCoder: (_Encode, _Decode),
    QuaternionCoder: (_EncodeQuaternions, _DecodeQuaternions),
    HumanArmCoder: (_EncodeHumanArms, _DecodeHumanArms),
    RobotArmCoder: (_EncodeRobotArms, _DecodeRobotArms),
}
"""Kind of coder to the modules that encode and decode."""


def _signs(sides: Sequence[Side]) -> Tensor:
    """What makes a left arm of every arm, ``(arms, 1, 3)``."""
    return constant([[_MIRROR[side == "right"]] for side in sides])


def _facing_forward(points: Tensor) -> Tensor:
    """Turns points ``(B, arms, 3, 3)`` about the vertical so that the shoulder line points left."""
    if points.shape[1] != 2:
        return points
    line = points[:, 0, 0] - points[:, 1, 0]
    flat = norm(line[:, :2])
    usable = flat > _FLAT
    safe = torch.where(usable, flat, 1.0 + 0.0 * flat)
    cos = torch.where(usable, line[:, 1:2] / safe, 1.0 + 0.0 * flat)[:, :, None]
    sin = torch.where(usable, line[:, 0:1] / safe, 0.0 * flat)[:, :, None]
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return torch.stack([cos * x - sin * y, sin * x + cos * y, z], dim=-1)


def _unit(vectors: Tensor) -> Tensor:
    return vectors / norm(vectors).clamp(min=1e-9)


def _multiply(p: Tensor, q: Tensor) -> Tensor:
    """Hamilton product of scalar-last quaternions."""
    px, py, pz, pw = p.unbind(-1)
    qx, qy, qz, qw = q.unbind(-1)
    return torch.stack(
        [
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
            pw * qw - px * qx - py * qy - pz * qz,
        ],
        dim=-1,
    )
