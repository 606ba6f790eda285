"""ArmKinematics: shoulder, elbow and wrist of one arm, and their derivatives, as a graph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from syda_gym.agents.graphs.arithmetic import constant, cross, dot, norm
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain

__all__ = ["ArmKinematics"]

_POINTS = 3  # shoulder, elbow, wrist


class ArmKinematics(nn.Module):
    """Forward kinematics of an arm.

    Args:
        chain: the arm.
        movers: joints by which ``limbs`` differentiates.
        twisting: 1 for movers that turn the elbow's own axis about the upper arm, else 0.
    """

    def __init__(self, chain: ArmChain, movers: Sequence[int] = (), twisting: ArrayLike = ()) -> None:
        super().__init__()
        self.twisting = constant(twisting)
        self.carriers = chain.point_joints[:_POINTS]
        self.offsets = [constant(offset[:, None]) for offset in chain.point_offsets[:_POINTS]]
        self.movers = tuple(movers)
        self.reach = max((*self.carriers, *self.movers)) + 1
        self.steps = [constant(_step(chain, joint)) for joint in range(self.reach)]
        moved = [[float(joint <= carrier) for carrier in self.carriers] for joint in self.movers]
        self.moved = constant(np.array(moved).reshape(len(self.movers), _POINTS, 1))

    def forward(self, angles: Tensor) -> Tensor:
        """Points ``(B, 3, 3)`` [m] in the torso frame for angles ``(B, n)`` [rad]."""
        return self._walk(angles)[0]

    def directions(self, angles: Tensor) -> Tensor:
        """Unit upper arm and forearm ``(B, 6)``."""
        points = self.forward(angles)
        along = points[:, 1:] - points[:, :-1]
        return (along / norm(along)).reshape(-1, 6)

    def limbs(self, angles: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """``kernel.look``: unit upper arm and forearm ``(B, 6)``, their derivatives, and turns about the arm's length.

        The derivatives by the movers are ``(B, m, 6)``, the turns ``(B, m)``.
        """
        points, origins, axes = self._walk(angles)
        arms = points[:, None] - origins[:, :, None]
        speeds = cross(axes[:, :, None] + 0.0 * arms, arms) * self.moved
        along = points[:, 1:] - points[:, :-1]
        length = norm(along)
        along = along / length
        moved = speeds[:, :, 1:] - speeds[:, :, :-1]
        moved = (moved - along[:, None] * dot(along[:, None], moved)) / length[:, None]
        turning = self.twisting * (axes * along[:, :1]).sum(dim=-1)
        return along.reshape(-1, 6), moved.reshape(-1, len(self.movers), 6), turning

    def _walk(self, angles: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Points ``(B, 3, 3)``, origins and axes of the movers ``(B, movers, 3)``."""
        zero = 0.0 * angles[:, :1, None]
        rotation = constant(np.eye(3)) + zero
        position = zero + constant(np.zeros((3, 1)))
        points: dict[int, Tensor] = {}
        origins, axes = [], []
        self._place(-1, rotation, position, points)
        for joint, step in enumerate(self.steps):
            moved = rotation @ step
            angle = angles[:, joint : joint + 1, None]
            position = position + moved[:, :, 9:10]
            if joint in self.movers:
                origins.append(position)
                axes.append(moved[:, :, 10:11])
            rise = 2.0 * torch.sin(0.5 * angle) ** 2  # 1 - cos
            rotation = moved[:, :, 0:3] + torch.sin(angle) * moved[:, :, 3:6] + rise * moved[:, :, 6:9]
            self._place(joint, rotation, position, points)
        found = torch.cat([points[index] for index in range(_POINTS)], dim=2).transpose(1, 2)
        if not origins:
            return found, found, found
        return found, torch.cat(origins, dim=2).transpose(1, 2), torch.cat(axes, dim=2).transpose(1, 2)

    def _place(self, joint: int, rotation: Tensor, position: Tensor, points: dict[int, Tensor]) -> None:
        for index, carrier in enumerate(self.carriers):
            if carrier == joint:
                points[index] = position + rotation @ self.offsets[index]


def _step(chain: ArmChain, joint: int) -> FloatArray:
    """What a joint multiplies to the rotation before it: Rodrigues' formula, its offset and its axis ``(3, 11)``."""
    fixed, (x, y, z) = chain.rotations[joint], chain.axes[joint]
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned = fixed @ across
    return np.concatenate(
        [fixed, turned, turned @ across, chain.offsets[joint][:, None], (fixed @ chain.axes[joint])[:, None]], axis=1
    )
