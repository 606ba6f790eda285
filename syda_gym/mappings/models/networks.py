"""Networks for inference: stacks of dense layers in numpy (Eq. 1 of the paper)."""

from __future__ import annotations

from collections.abc import Mapping as Dict
from collections.abc import Sequence

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["Stack", "stacks_from_arrays"]


class Stack:
    """Dense layers, Z_i = phi(a_i + w_i Z_{i-1}), phi being a leaky ReLU.

    Numpy needs a fraction of torch's time for one frame; the numbers agree to 1e-6.

    Args:
        weights: one ``(in, out)`` per layer.
        biases: one ``(out,)`` per layer.
        slope: of the leaky ReLU for negative values; 1 makes the stack linear.
        activated: apply phi to the last layer too (the paper's encoders) rather than leave it linear (decoders).
    """

    def __init__(
        self, weights: Sequence[FloatArray], biases: Sequence[FloatArray], slope: float, activated: bool = False
    ) -> None:
        self.weights = [np.asarray(w, dtype=np.float64) for w in weights]
        self.biases = [np.asarray(b, dtype=np.float64) for b in biases]
        self.slope = float(slope)
        self.activated = bool(activated)

    @property
    def width(self) -> int:
        """Width of the output."""
        return int(self.weights[-1].shape[1])

    def __call__(self, values: FloatArray) -> FloatArray:
        """Maps ``(..., in)`` to ``(..., out)``."""
        last = len(self.weights) - (0 if self.activated else 1)
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            values = values @ weight + bias
            if index < last and self.slope != 1.0:
                values = np.maximum(values, self.slope * values)
        return values

    def arrays(self, name: str) -> dict[str, FloatArray]:
        """Weights and biases under ``name.w0``, ``name.b0``, ..."""
        result = {}
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            result[f"{name}.w{index}"] = weight
            result[f"{name}.b{index}"] = bias
        return result


def stacks_from_arrays(
    arrays: Dict[str, FloatArray], names: Sequence[str], slope: float, activated: bool
) -> dict[str, Stack]:
    """Rebuilds stacks from what ``Stack.arrays`` gave; names without weights are left out.

    Args:
        arrays: numbers by name.
        names: stacks to look for; those called ``encode_*`` end in latent features.
        slope: of the leaky ReLU.
        activated: whether latent features are activated.
    """
    result = {}
    for name in names:
        count = 0
        while f"{name}.w{count}" in arrays:
            count += 1
        if count:
            weights = [arrays[f"{name}.w{i}"] for i in range(count)]
            biases = [arrays[f"{name}.b{i}"] for i in range(count)]
            result[name] = Stack(weights, biases, slope, activated and name.startswith("encode"))
    return result
