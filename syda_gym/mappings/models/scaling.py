"""Scaler: standardisation of codes."""

from __future__ import annotations

from collections.abc import Mapping as Dict

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["Scaler"]

_LEAST = 1e-3
"""Least standard deviation: a feature that hardly moves in training must not be blown up."""


class Scaler:
    """Subtracts a mean and divides by a standard deviation.

    Args:
        mean: ``(D,)``.
        spread: ``(D,)``, positive.
    """

    def __init__(self, mean: FloatArray, spread: FloatArray) -> None:
        self.mean = np.asarray(mean, dtype=np.float64)
        self.spread = np.asarray(spread, dtype=np.float64)

    @classmethod
    def fit(cls, rows: FloatArray) -> Scaler:
        """Mean and standard deviation of rows ``(N, D)``."""
        return cls(rows.mean(axis=0), np.maximum(rows.std(axis=0), _LEAST))

    @classmethod
    def by_vector(cls, rows: FloatArray, size: int = 3) -> Scaler:
        """Mean of each feature and one standard deviation for every ``size`` features.

        All directions in space then count alike, as they do not where each coordinate is scaled by itself.
        """
        spread = np.sqrt(np.mean(rows.std(axis=0).reshape(-1, size) ** 2, axis=1))
        return cls(rows.mean(axis=0), np.maximum(np.repeat(spread, size), _LEAST))

    @classmethod
    def identity(cls, width: int) -> Scaler:
        """Leaves codes as they are."""
        return cls(np.zeros(width), np.ones(width))

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Standardises."""
        return (codes - self.mean) / self.spread

    def undo(self, codes: FloatArray) -> FloatArray:
        """Goes back to raw codes."""
        return codes * self.spread + self.mean

    def arrays(self, name: str) -> dict[str, FloatArray]:
        """Mean and spread under ``name.mean`` and ``name.spread``."""
        return {f"{name}.mean": self.mean, f"{name}.spread": self.spread}

    @classmethod
    def restore(cls, arrays: Dict[str, FloatArray], name: str) -> Scaler:
        """Rebuilds what ``arrays`` gave."""
        return cls(arrays[f"{name}.mean"], arrays[f"{name}.spread"])
