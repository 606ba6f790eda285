"""A causal temporal convolutional network in numpy, one step at a time, with the weights that torch trained.

Bai, Kolter, Koltun, *An Empirical Evaluation of Generic Convolutional and Recurrent Networks for Sequence Modeling*,
2018, https://arxiv.org/abs/1803.01271: dilated causal convolutions with residual connections. Every block keeps the
last ``2 * dilation`` of its inputs, so that a step costs the same whatever the history.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError

__all__ = ["DILATIONS", "StreamingTcn", "TcnShape", "receptive_field"]

DILATIONS = (1, 2, 4, 8)
"""Dilation of each block; every block has three taps."""

Weights = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True)
class TcnShape:
    """Sizes of a network: inputs, channels and outputs."""

    inputs: int
    channels: int
    outputs: int

    def check(self, weights: Weights) -> None:
        """Compares weights with these sizes.

        Raises:
            AgentError: a weight is missing, superfluous or of another shape.
        """
        wanted = self.shapes()
        for name in (*wanted, *weights):
            got = weights[name].shape if name in weights else None
            if got != wanted.get(name):
                raise AgentError(f"predictor weights: {name!r} has shape {got}, expected {wanted.get(name)}")

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of every weight by name."""
        c = self.channels
        shapes: dict[str, tuple[int, ...]] = {"inlet.weight": (c, self.inputs), "inlet.bias": (c,)}
        for block in range(len(DILATIONS)):
            shapes[f"blocks.{block}.weight"] = (3, c, c)
            shapes[f"blocks.{block}.bias"] = (c,)
        return shapes | {"outlet.weight": (self.outputs, c), "outlet.bias": (self.outputs,)}


def receptive_field() -> int:
    """Number of steps that an output looks back on, itself included."""
    return 1 + 2 * sum(DILATIONS)


class StreamingTcn:
    """Runs the network step by step for ``B`` streams.

    Args:
        weights: by name, see ``TcnShape.shapes``.
        shape: sizes of the network.

    Raises:
        AgentError: the weights do not fit the sizes.
    """

    def __init__(self, weights: Weights, shape: TcnShape) -> None:
        shape.check(weights)
        self.shape = shape
        self._weights = {name: np.asarray(value, dtype=np.float64) for name, value in weights.items()}
        self._past: list[FloatArray] = []

    def reset(self, count: int) -> None:
        """Prepares for ``count`` streams without history."""
        self._past = [np.zeros((2 * dilation, count, self.shape.channels)) for dilation in DILATIONS]

    def step(self, inputs: FloatArray, fresh: NDArray[np.bool_]) -> FloatArray:
        """One step of every stream.

        Args:
            inputs: ``(B, inputs)``.
            fresh: ``(B,)`` streams that begin with this step; their past is taken to have been equal to it.

        Returns:
            ``(B, outputs)``.
        """
        hidden = _relu(inputs @ self._weights["inlet.weight"].T + self._weights["inlet.bias"])
        for block, dilation in enumerate(DILATIONS):
            past = self._past[block]
            past[:, fresh] = hidden[fresh]
            taps = self._weights[f"blocks.{block}.weight"]
            mixed = past[0] @ taps[0].T + past[dilation] @ taps[1].T + hidden @ taps[2].T
            self._past[block] = np.concatenate([past[1:], hidden[None]])
            hidden = hidden + _relu(mixed + self._weights[f"blocks.{block}.bias"])
        return np.asarray(hidden @ self._weights["outlet.weight"].T + self._weights["outlet.bias"])


def _relu(x: FloatArray) -> FloatArray:
    return np.maximum(x, 0.0)
