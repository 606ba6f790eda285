"""ResidualPolicy: a small learned correction on top of another agent, run in numpy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.agent import Agent
from syda_gym.agents.interface import Interface, Reading
from syda_gym.agents.learned.views import Views
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError

__all__ = ["ResidualPolicy"]

_FARTHEST = 10.0  # normalised features are clipped to this many standard deviations


class ResidualPolicy(Agent):
    """Adds ``scale * f`` to the command from below, ``f`` being the low-passed answer of a network in [-1, 1].

    ``f <- smoothing f + (1 - smoothing) a`` with ``a = clip(network(features), -1, 1)``. A network whose last layer is
    zero answers 0, so that the untrained policy *is* the agent below, bit for bit. The correction of a joint is at most
    ``scale`` and its change in one step at most ``2 (1 - smoothing) scale``.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        weights: ``layers.i.weight`` and ``layers.i.bias``; tanh (``activation``) between layers, none after the last.
        mean: of the features ``(F,)``.
        std: of the features ``(F,)``.
        scale: largest correction [rad].
        smoothing: share of the old correction, 0 to below 1.
        activation: ``"tanh"`` or ``"relu"`` between layers.
        squash: ``"clip"`` (PPO) or ``"tanh"`` (SAC, TQC) behind the last layer.
        each_arm: whether the network looks at each arm as if it were the left one and answers for that arm
            (``views.Views``); otherwise it looks at the whole robot and answers for all joints.

    Raises:
        AgentError: weights of other shapes, or settings out of range.
    """

    name = "residual"

    def __init__(
        self,
        interface: Interface,
        base: Agent,
        *,
        weights: Mapping[str, NDArray[np.float32]],
        mean: FloatArray,
        std: FloatArray,
        scale: float = 0.25,
        smoothing: float = 0.6,
        activation: str = "tanh",
        squash: str = "clip",
        each_arm: bool = False,
    ) -> None:
        super().__init__(interface, base)
        if not (0.0 < scale <= np.pi and 0.0 <= smoothing < 1.0):
            raise AgentError(f"expected 0 < scale <= pi and 0 <= smoothing < 1, got {scale} and {smoothing}")
        if activation not in ("tanh", "relu") or squash not in ("clip", "tanh"):
            raise AgentError(f"unknown activation {activation!r} or squash {squash!r}; expected tanh/relu, clip/tanh")
        self.scale, self.smoothing = float(scale), float(smoothing)
        self.activation, self.squash = activation, squash
        self.weights = dict(weights)
        self.mean, self.std = np.asarray(mean, dtype=np.float64), np.asarray(std, dtype=np.float64)
        self.views = Views(interface, each_arm)
        self._layers = _layers(weights, self.views.size, self.views.outputs)
        if self.mean.shape != (self.views.size,) or self.std.shape != self.mean.shape:
            raise AgentError(f"expected a mean and a std of {self.views.size} features, got {self.mean.shape}")

    @classmethod
    def untrained(
        cls,
        interface: Interface,
        base: Agent,
        *,
        hidden: Sequence[int] = (64, 64),
        each_arm: bool = False,
        **settings: Any,
    ) -> ResidualPolicy:
        """A policy whose weights are all zero: it does what the agent below does."""
        views = Views(interface, each_arm)
        sizes = [views.size, *hidden, views.outputs]
        weights: dict[str, NDArray[np.float32]] = {}
        for index, (inputs, outputs) in enumerate(zip(sizes[:-1], sizes[1:], strict=True)):
            weights[f"layers.{index}.weight"] = np.zeros((outputs, inputs), dtype=np.float32)
            weights[f"layers.{index}.bias"] = np.zeros(outputs, dtype=np.float32)
        mean, std = np.zeros(sizes[0]), np.ones(sizes[0])
        return cls(interface, base, weights=weights, mean=mean, std=std, each_arm=each_arm, **settings)

    def reset(self, count: int, seed: int | None = None) -> None:
        """Forgets the corrections."""
        super().reset(count, seed)
        self._correction = np.zeros((count, self.interface.n))

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """Command plus low-passed correction."""
        self._correction = np.where(self._fresh[:, None], 0.0, self._correction)
        answer = self.views.join(self.answer(self.views.see(command, self._correction, reading)))
        self._correction = self.smoothing * self._correction + (1.0 - self.smoothing) * answer
        return command + self.scale * self._correction

    def answer(self, features: FloatArray) -> FloatArray:
        """The network's answers ``(V, outputs)`` in [-1, 1] to the features of views ``(V, F)``."""
        hidden = np.clip((features - self.mean) / self.std, -_FARTHEST, _FARTHEST)
        for weight, bias in self._layers[:-1]:
            hidden = hidden @ weight.T + bias
            hidden = np.tanh(hidden) if self.activation == "tanh" else np.maximum(hidden, 0.0)
        weight, bias = self._layers[-1]
        raw = hidden @ weight.T + bias
        return np.asarray(np.clip(raw, -1.0, 1.0) if self.squash == "clip" else np.tanh(raw))

    @property
    def settings(self) -> dict[str, Any]:
        """``scale``, ``smoothing``, ``activation``, ``squash``, ``each_arm``; weights are stored apart."""
        return {
            "scale": self.scale,
            "smoothing": self.smoothing,
            "activation": self.activation,
            "squash": self.squash,
            "each_arm": self.views.each_arm,
        }


def _layers(
    weights: Mapping[str, NDArray[np.float32]], inputs: int, outputs: int
) -> list[tuple[FloatArray, FloatArray]]:
    count = sum(name.endswith(".weight") for name in weights)
    wanted = {f"layers.{i}.{part}" for i in range(count) for part in ("weight", "bias")}
    if count < 1 or set(weights) != wanted:
        raise AgentError(f"residual weights: expected layers.0.weight, layers.0.bias, ..., got {sorted(weights)}")
    layers = []
    width = inputs
    for i in range(count):
        weight, bias = weights[f"layers.{i}.weight"], weights[f"layers.{i}.bias"]
        if weight.ndim != 2 or weight.shape[1] != width or bias.shape != weight.shape[:1]:
            raise AgentError(
                f"residual weights: layer {i} has shapes {weight.shape}, {bias.shape}; expected (m, {width}) and (m,)"
            )
        width = weight.shape[0]
        layers.append((weight.astype(np.float64), bias.astype(np.float64)))
    if width != outputs:
        raise AgentError(f"residual weights: the last layer gives {width} values, expected {outputs}")
    return layers
