"""Regressors as modules: codes ``(B, K, D)`` to codes ``(B, K, E)``."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor, nn

from syda_gym.agents.graphs.arithmetic import constant
from syda_gym.errors import AgentError
from syda_gym.mappings.models.heads import HeadedRegressor
from syda_gym.mappings.models.hop import HopRegressor, MeanRegressor, TwoWay
from syda_gym.mappings.models.linear import KernelRidge, Nearest, Ridge
from syda_gym.mappings.models.networks import Stack
from syda_gym.mappings.models.prior import PriorRegressor
from syda_gym.mappings.models.regressors import DirectRegressor, DualRegressor, Regressor
from syda_gym.mappings.models.rotation import GeometricRegressor
from syda_gym.mappings.models.scaling import Scaler

__all__ = ["REGRESSORS", "regressor_graph"]


def regressor_graph(regressor: Regressor, width: int) -> nn.Module:
    """The module of a regressor.

    Args:
        regressor: what to write.
        width: ``D``, numbers per code.

    Raises:
        AgentError: this kind of model has no graph.
    """
    if type(regressor) not in REGRESSORS:
        raise AgentError(
            f"a {regressor.kind!r} model cannot be written as a graph; "
            f"{', '.join(kind.kind for kind in REGRESSORS)} can; export the agent alone and map with the numpy runner"
        )
    return REGRESSORS[type(regressor)](regressor, width)


class _Affine(nn.Module):
    """Any affine model, known by its images of zero and of the unit vectors."""

    def __init__(self, regressor: Regressor, width: int) -> None:
        super().__init__()
        images = regressor(np.concatenate([np.zeros((1, width)), np.eye(width)]))
        self.weight, self.bias = constant(images[1:] - images[:1]), constant(images[0])

    def forward(self, codes: Tensor) -> Tensor:
        return codes @ self.weight + self.bias


class _Scale(nn.Module):
    def __init__(self, scale: Scaler) -> None:
        super().__init__()
        self.mean, self.spread = constant(scale.mean), constant(scale.spread)

    def forward(self, codes: Tensor) -> Tensor:
        return (codes - self.mean) / self.spread

    def undo(self, codes: Tensor) -> Tensor:
        return codes * self.spread + self.mean


class _Layers(nn.Module):
    """A ``Stack``."""

    def __init__(self, stack: Stack) -> None:
        super().__init__()
        self.layers = [(constant(w), constant(b)) for w, b in zip(stack.weights, stack.biases, strict=True)]
        self.slope = stack.slope
        self.last = len(self.layers) - (0 if stack.activated else 1)

    def forward(self, values: Tensor) -> Tensor:
        for index, (weight, bias) in enumerate(self.layers):
            values = values @ weight + bias
            if index < self.last and self.slope != 1.0:
                values = torch.maximum(values, self.slope * values)
        return values


class _Networks(nn.Module):
    """A's encoder, then B's decoder."""

    def __init__(self, regressor: DualRegressor | DirectRegressor, width: int) -> None:
        super().__init__()
        self.scale_a, self.scale_b = _Scale(regressor.scale_a), _Scale(regressor.scale_b)
        self.encode, self.decode = _Layers(regressor.stacks["encode_a"]), _Layers(regressor.stacks["decode_b"])

    def forward(self, codes: Tensor) -> Tensor:
        return self.scale_b.undo(self.decode(self.encode(self.scale_a(codes))))


class _Kernel(nn.Module):
    def __init__(self, regressor: KernelRidge, width: int) -> None:
        super().__init__()
        self.scale = _Scale(regressor.scale)
        self.centres, self.squares = constant(regressor.centres.T), constant(np.sum(regressor.centres**2, axis=1))
        self.weight, self.bias = constant(regressor.weight), constant(regressor.bias)
        self.rate = -regressor.gamma / width

    def forward(self, codes: Tensor) -> Tensor:
        rows = self.scale(codes)
        distance = (rows * rows).sum(dim=-1, keepdim=True) + self.squares - 2.0 * rows @ self.centres
        return torch.exp(self.rate * distance.clamp(min=0.0)) @ self.weight + self.bias


class _Neighbours(nn.Module):
    def __init__(self, regressor: Nearest, width: int) -> None:
        super().__init__()
        self.scale, self.count = _Scale(regressor.scale), regressor.neighbours
        self.inputs, self.squares = constant(regressor.inputs.T), constant(np.sum(regressor.inputs**2, axis=1))
        self.outputs = constant(regressor.outputs)

    def forward(self, codes: Tensor) -> Tensor:
        distance = self.squares - 2.0 * self.scale(codes) @ self.inputs
        nearest = torch.topk(distance, self.count, dim=-1, largest=False).indices
        return self.outputs[nearest].mean(dim=-2)


class _Headed(nn.Module):
    def __init__(self, regressor: HeadedRegressor, width: int) -> None:
        super().__init__()
        self.width = regressor.width
        self.main = regressor_graph(regressor.main, regressor.width)
        self.head = None if regressor.head is None else regressor_graph(regressor.head, width)

    def forward(self, codes: Tensor) -> Tensor:
        main: Tensor = self.main(codes[..., : self.width])
        return main if self.head is None else torch.cat([main, self.head(codes)], dim=-1)


class _Mean(nn.Module):
    def __init__(self, regressor: MeanRegressor, width: int) -> None:
        super().__init__()
        self.columns, self.on_identity = regressor.columns, regressor.on_identity
        self.members = nn.ModuleList(
            regressor_graph(member, stop - start)
            for member, (start, stop) in zip(regressor.members, regressor.columns, strict=True)
        )

    def forward(self, codes: Tensor) -> Tensor:
        images = []
        for member, (start, stop), identity in zip(self.members, self.columns, self.on_identity, strict=True):
            image = member(codes[..., start:stop])
            images.append(image + codes[..., -6:] if identity else image)
        return torch.stack(images).mean(dim=0)


def _networks(regressor: DualRegressor | DirectRegressor, width: int) -> nn.Module:
    linear = all(regressor.stacks[name].slope == 1.0 for name in ("encode_a", "decode_b"))
    return _Affine(regressor, width) if linear else _Networks(regressor, width)


def _two_way(regressor: TwoWay, width: int) -> nn.Module:
    return regressor_graph(regressor.there, width)


REGRESSORS: dict[type[Regressor], Callable[..., nn.Module]] = {
    DualRegressor: _networks,
    DirectRegressor: _networks,
    Ridge: _Affine,
    KernelRidge: _Kernel,
    Nearest: _Neighbours,
    HeadedRegressor: _Headed,
    HopRegressor: _Affine,
    MeanRegressor: _Mean,
    TwoWay: _two_way,
    GeometricRegressor: _Affine,
    PriorRegressor: _Affine,
}
"""Kind of model to what makes its module."""
