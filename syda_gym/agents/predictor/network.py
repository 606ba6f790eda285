"""The predictor's network, the robot's landmarks and the motor law in torch, differentiable."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from syda_gym.agents.interface import Interface
from syda_gym.agents.learned.tcn import DILATIONS, TcnShape
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain

__all__ = ["TorchLandmarks", "follow", "initial_weights", "response", "tcn"]


class TorchLandmarks:
    """Elbows and wrists of a robot.

    Args:
        interface: whose robot.
    """

    def __init__(self, interface: Interface) -> None:
        robot = interface.robot
        self._points = [
            (part, _Point(chain, point))
            for chain, part in zip(robot.chains, robot.arm_slices, strict=True)
            for point in (1, 2)
        ]

    def __call__(self, q: Tensor) -> Tensor:
        """Joint angles ``(..., n)`` [rad] to landmarks ``(..., 2 * arms, 3)`` [m]."""
        rows = q.reshape(-1, q.shape[-1])
        found = torch.stack([point(rows[:, part]) for part, point in self._points], dim=1)
        return found.reshape(*q.shape[:-1], len(self._points), 3)


class _Point:
    """One point of an arm, carried from its joint down to the torso: three products a joint instead of six matrices."""

    def __init__(self, chain: ArmChain, point: int) -> None:
        self._start = _constant(chain.point_offsets[point][None])
        self._steps = []
        for i in range(chain.point_joints[point], -1, -1):
            cross, fixed = _cross(chain.axes[i]), chain.rotations[i]
            # Rodrigues: R v = v + sin(q) K v + (1 - cos(q)) K K v; transposed, because vectors are rows.
            turns = [_constant((fixed @ matrix).T) for matrix in (np.eye(3), cross, cross @ cross)]
            self._steps.append((i, _constant(chain.offsets[i]), turns))

    def __call__(self, q: Tensor) -> Tensor:
        """Angles of the arm ``(N, joints)`` to positions ``(N, 3)``."""
        sines, versines = torch.sin(q), 1.0 - torch.cos(q)
        v = self._start
        for i, offset, (still, quarter, half) in self._steps:
            v = offset + v @ still + sines[:, i : i + 1] * (v @ quarter) + versines[:, i : i + 1] * (v @ half)
        return v


def follow(commands: Tensor, start: Tensor, powers: tuple[Tensor, Tensor]) -> Tensor:
    """Joint angles that a first-order motor reaches: ``q += k (c - q)`` over time, as one product.

    Args:
        commands: ``(E, T, n)`` [rad].
        start: angles before the first command ``(E, n)`` [rad].
        powers: what ``response`` made of the motors' shares ``k``.

    Returns:
        Angles after each command ``(E, T, n)`` [rad].
    """
    weights, left = powers
    return torch.bmm(weights, commands) + left[:, :, None] * start[:, None]


def response(shares: FloatArray, steps: int) -> tuple[Tensor, Tensor]:
    """How much of each earlier command, and of the start, is in the angle after a step.

    Args:
        shares: share ``k`` of the way that a motor covers in one step ``(E, 1)``, or in each step ``(E, T)``.
        steps: ``T``.

    Returns:
        Weights of the commands ``(E, T, T)`` and of the start ``(E, T)``.
    """
    k = _constant(shares)
    if k.shape[1] > 1:
        return _changing_response(k)
    ages = torch.arange(steps)[:, None] - torch.arange(steps)[None]
    weights = k[:, :, None] * (1.0 - k[:, :, None]) ** ages.clamp(min=0)
    return torch.where(ages >= 0, weights, torch.zeros(())), (1.0 - k) ** torch.arange(1, steps + 1)[None]


def _changing_response(k: Tensor) -> tuple[Tensor, Tensor]:
    """``response`` for shares ``(E, T)`` that change: what a command left is passed on by each later step."""
    steps = k.shape[1]
    later = torch.arange(steps)[:, None] > torch.arange(steps)[None]
    passed = torch.where(later, (1.0 - k)[:, :, None], torch.ones(())).cumprod(dim=1)
    weights = torch.where(torch.ones(steps, steps).tril().bool(), passed * k[:, None], torch.zeros(()))
    return weights, (1.0 - k).cumprod(dim=1)


def tcn(parameters: dict[str, Tensor], inputs: Tensor) -> Tensor:
    """The network of ``tcn.StreamingTcn`` over whole sequences ``(E, T, inputs)``; returns ``(E, T, outputs)``."""
    steps = inputs.shape[1]
    hidden = torch.relu(inputs @ parameters["inlet.weight"].T + parameters["inlet.bias"])
    for block, dilation in enumerate(DILATIONS):
        taps = parameters[f"blocks.{block}.weight"]
        past = torch.cat([hidden[:, :1].expand(-1, 2 * dilation, -1), hidden], dim=1)
        mixed = past[:, :steps] @ taps[0].T + past[:, dilation : dilation + steps] @ taps[1].T + hidden @ taps[2].T
        hidden = hidden + torch.relu(mixed + parameters[f"blocks.{block}.bias"])
    result: Tensor = hidden @ parameters["outlet.weight"].T + parameters["outlet.bias"]
    return result


def initial_weights(shape: TcnShape, seed: int) -> dict[str, Tensor]:
    """Random weights of a network whose last layer is zero, so that untrained it corrects nothing."""
    generator = torch.Generator().manual_seed(seed)
    parameters = {}
    for name, size in shape.shapes().items():
        if name.endswith("bias") or name.startswith("outlet"):
            value = torch.zeros(size)
        else:
            fan_in = size[-1] * (size[0] if len(size) == 3 else 1)
            value = torch.randn(size, generator=generator) * float(np.sqrt(1.0 / fan_in))
        parameters[name] = value.requires_grad_()
    return parameters


def _constant(values: FloatArray) -> Tensor:
    return torch.as_tensor(np.ascontiguousarray(values), dtype=torch.float32)


def _cross(axis: FloatArray) -> FloatArray:
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
