"""BatchedNetwork: many dual autoencoders side by side as one batched network, with their gradients and AdamW.

The gradient is written out by hand: the networks are small, so that an automatic differentiation engine would spend
several times longer on bookkeeping than on arithmetic. ``tests/mappings/test_training.py`` compares it with autograd.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from syda_gym.mappings.models.networks import Stack
from syda_gym.mappings.models.settings import TrainingSettings

if TYPE_CHECKING:
    import torch

__all__ = ["Batch", "BatchedNetwork"]

_BETA_MEAN, _BETA_SQUARE, _EPSILON = 0.9, 0.999, 1e-8


@dataclass(frozen=True, eq=False)
class Batch:
    """What each of M models sees in one step.

    Attributes:
        a: codes of A ``(M, B, D_A)``.
        b: codes of B ``(M, B, D_B)``.
        seen_a: the same with input noise.
        seen_b: the same with input noise.
        weight: of each row ``(M, B)``, adding up to one per model; ``None`` if all are equal.
        active: which models take part ``(M, 1)``; ``None`` if all do.
        rate: learning rate, for all or ``(M, 1)``.
    """

    a: torch.Tensor
    b: torch.Tensor
    seen_a: torch.Tensor
    seen_b: torch.Tensor
    weight: torch.Tensor | None
    active: torch.Tensor | None
    rate: torch.Tensor | float


class BatchedNetwork:
    """M models with the same layers; no model influences another.

    Args:
        settings: sizes, losses and optimiser.
        width_a: of A's codes.
        width_b: of B's codes.
        seeds: one per model.
    """

    def __init__(self, settings: TrainingSettings, width_a: int, width_b: int, seeds: Sequence[int]) -> None:
        import torch

        self.settings = settings
        self.layers = settings.stacks(width_a, width_b)
        self.flat = torch.stack([_initial(self.layers, seed) for seed in seeds])
        self.gradient = torch.zeros_like(self.flat)
        self.parameters = _views(self.flat, self.layers)
        self.gradients = _views(self.gradient, self.layers)
        self.mean = torch.zeros_like(self.flat)
        self.square = torch.zeros_like(self.flat)
        self.count = torch.zeros((len(self.flat), 1))
        self.steps = 0
        self.uneven = False

    def step(self, batch: Batch) -> None:
        """One step of gradient descent on one batch."""
        self.differentiate(batch)
        self._adam(batch.active, batch.rate)

    def stacks(self) -> list[dict[str, Stack]]:
        """The trained stacks of each model."""
        result = []
        for model in range(len(self.flat)):
            stacks = {}
            for name, layers in self.parameters.items():
                weights = [weight[model].numpy().copy() for weight, _ in layers]
                biases = [bias[model, 0].numpy().copy() for _, bias in layers]
                stacks[name] = Stack(weights, biases, self.settings.slope, self._activated(name))
            result.append(stacks)
        return result

    def differentiate(self, batch: Batch) -> None:
        """Writes the gradient of the losses (Eq. 2 to 4, and the cross losses) into ``gradient``."""
        import torch

        settings = self.settings
        weight = batch.weight
        rows: torch.Tensor | float = 1.0 / batch.a.shape[1] if weight is None else weight[:, :, None]
        path_a = self._forward("encode_a", batch.seen_a)
        z_a = path_a[-1]
        if not settings.dual:
            path = self._forward("decode_b", z_a)
            self._backward("encode_a", path_a, self._backward("decode_b", path, self._slope(path[-1], batch.b, rows)))
            return
        path_b = self._forward("encode_b", batch.seen_b)
        z_b = path_b[-1]
        # Both latent codes pass a decoder together: own code first (reconstruction), the other's second (cross).
        aligned = settings.align * self._slope(z_a, z_b, rows)
        slope_a, slope_b = aligned, -aligned
        size = z_a.shape[1]
        for name, own, other, target, own_is_a in (
            ("decode_a", z_a, z_b, batch.a, True),
            ("decode_b", z_b, z_a, batch.b, False),
        ):
            crossed = settings.cross != 0.0
            path = self._forward(name, torch.cat([own, other], dim=1) if crossed else own)
            slope = self._slope(path[-1][:, :size], target, rows) * settings.reconstruct
            if crossed:
                cross = self._slope(path[-1][:, size:], target, rows) * settings.cross
                slope = torch.cat([slope, cross], dim=1)
            back = self._backward(name, path, slope)
            first, second = back[:, :size], back[:, size:]
            if own_is_a:
                slope_a = slope_a + first
                slope_b = slope_b + second if crossed else slope_b
            else:
                slope_b = slope_b + first
                slope_a = slope_a + second if crossed else slope_a
        self._backward("encode_a", path_a, slope_a)
        self._backward("encode_b", path_b, slope_b)

    def _slope(self, value: torch.Tensor, target: torch.Tensor, rows: torch.Tensor | float) -> torch.Tensor:
        """Derivative of the Huber loss, averaged over columns and weighted over rows."""
        difference = (value - target).clamp_(-self.settings.huber, self.settings.huber)
        if isinstance(rows, float):
            return difference.mul_(rows / value.shape[2])
        return difference.mul_(rows).div_(value.shape[2])

    def _activated(self, name: str) -> bool:
        return self.settings.activated and name.startswith("encode")

    def _forward(self, name: str, values: torch.Tensor) -> list[torch.Tensor]:
        """The input and every layer's output."""
        import torch

        layers = self.parameters[name]
        last = len(layers) - (0 if self._activated(name) else 1)
        path = [values]
        for index, (weight, bias) in enumerate(layers):
            values = torch.baddbmm(bias, values, weight)
            if index < last and self.settings.slope != 1.0:
                values = torch.nn.functional.leaky_relu(values, self.settings.slope)
            path.append(values)
        return path

    def _backward(self, name: str, path: list[torch.Tensor], slope: torch.Tensor) -> torch.Tensor:
        """Writes one stack's gradient, given the slope at its output; returns the slope at its input."""
        import torch

        layers = self.parameters[name]
        last = len(layers) - (0 if self._activated(name) else 1)
        for index in range(len(layers) - 1, -1, -1):
            if index < last and self.settings.slope != 1.0:
                # The sign of a leaky ReLU's output is the sign of its input, so the output serves.
                slope = torch.ops.aten.leaky_relu_backward(slope, path[index + 1], self.settings.slope, True)
            to_weight, to_bias = self.gradients[name][index]
            to_weight.copy_(torch.bmm(path[index].transpose(1, 2), slope))
            torch.sum(slope, dim=1, keepdim=True, out=to_bias)
            if index or name.startswith("decode"):
                slope = torch.bmm(slope, layers[index][0].transpose(1, 2))
        return slope

    def _adam(self, active: torch.Tensor | None, rate: torch.Tensor | float) -> None:
        """AdamW (Loshchilov and Hutter 2019); models that sit a step out keep their state."""
        import torch

        decay = self.settings.decay
        if active is None and isinstance(rate, float) and not self.uneven:
            self.steps += 1
            self.mean.mul_(_BETA_MEAN).add_(self.gradient, alpha=1.0 - _BETA_MEAN)
            self.square.mul_(_BETA_SQUARE).addcmul_(self.gradient, self.gradient, value=1.0 - _BETA_SQUARE)
            root = (self.square / (1.0 - _BETA_SQUARE**self.steps)).sqrt_().add_(_EPSILON)
            if decay:
                self.flat.mul_(1.0 - rate * decay)
            self.flat.addcdiv_(self.mean, root, value=-rate / (1.0 - _BETA_MEAN**self.steps))
            return
        if not self.uneven:  # from here on models may have taken different numbers of steps
            self.uneven = True
            self.count += self.steps
        if active is None:
            self.count += 1.0
            self.mean.mul_(_BETA_MEAN).add_(self.gradient, alpha=1.0 - _BETA_MEAN)
            self.square.mul_(_BETA_SQUARE).addcmul_(self.gradient, self.gradient, value=1.0 - _BETA_SQUARE)
            root = (self.square / (1.0 - _BETA_SQUARE**self.count)).sqrt_().add_(_EPSILON)
            if decay:
                self.flat.mul_(1.0 - rate * decay)
            self.flat.sub_(torch.div(self.mean, root, out=root).mul_(rate / (1.0 - _BETA_MEAN**self.count)))
            return
        self.mean = torch.where(active, _BETA_MEAN * self.mean + (1.0 - _BETA_MEAN) * self.gradient, self.mean)
        squared = _BETA_SQUARE * self.square + (1.0 - _BETA_SQUARE) * self.gradient**2
        self.square = torch.where(active, squared, self.square)
        self.count = self.count + active
        count = self.count.clamp(min=1.0)
        root = (self.square / (1.0 - _BETA_SQUARE**count)).sqrt_().add_(_EPSILON)
        step = rate * (self.mean / (1.0 - _BETA_MEAN**count) / root + decay * self.flat)
        self.flat -= torch.where(active, step, torch.zeros_like(step))


def _sizes(layers: dict[str, tuple[int, ...]]) -> list[int]:
    return [
        size for widths in layers.values() for a, b in zip(widths[:-1], widths[1:], strict=True) for size in (a * b, b)
    ]


def _views(
    flat: torch.Tensor, layers: dict[str, tuple[int, ...]]
) -> dict[str, list[tuple[torch.Tensor, torch.Tensor]]]:
    """Weights ``(M, in, out)`` and biases ``(M, 1, out)`` as windows into flat parameters ``(M, P)``."""
    import torch

    parts = iter(torch.split(flat, _sizes(layers), dim=1))
    return {
        name: [
            (next(parts).view(len(flat), a, b), next(parts)[:, None])
            for a, b in zip(widths[:-1], widths[1:], strict=True)
        ]
        for name, widths in layers.items()
    }


def _initial(layers: dict[str, tuple[int, ...]], seed: int) -> torch.Tensor:
    """Glorot-uniform weights and zero biases as one flat vector."""
    import torch

    generator = torch.Generator().manual_seed(int(seed) * 2)
    parts = []
    for widths in layers.values():
        for a, b in zip(widths[:-1], widths[1:], strict=True):
            bound = math.sqrt(6.0 / (a + b))
            parts.append((torch.rand(a * b, generator=generator) * 2.0 - 1.0) * bound)
            parts.append(torch.zeros(b))
    return torch.cat(parts)
