"""Regressors in closed form: ridge (also robust), kernel ridge, nearest neighbour, and residuals on an identity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.models.regressors import Affine, Arrays, Regressor
from syda_gym.mappings.models.scaling import Scaler

__all__ = ["KernelRidge", "Nearest", "Ridge"]

_MAX_CENTRES = 1500


class Ridge(Regressor):
    """Affine regression with a quadratic penalty on standardised inputs; penalties are relative to the row count.

    Args:
        scale: of the inputs.
        weight: ``(D, E)``.
        bias: ``(E,)``.
    """

    kind = "ridge"

    def __init__(self, scale: Scaler, weight: FloatArray, bias: FloatArray) -> None:
        self.scale = scale
        self.weight = weight
        self.bias = bias
        self._slope = weight / scale.spread[:, None]
        self._offset = bias - scale.mean @ self._slope

    @classmethod
    def fit(
        cls,
        source: FloatArray,
        target: FloatArray,
        shrinkage: float,
        *,
        robust: bool = False,
        rounds: int = 10,
        scale: Scaler | None = None,
    ) -> Ridge:
        """Fits rows ``(N, D)`` to rows ``(N, E)``.

        Args:
            source: inputs.
            target: outputs.
            shrinkage: penalty in units of the inputs' variance.
            robust: weigh rows by 1 / max(residual, median residual), iteratively (L1-like).
            rounds: of the reweighting.
            scale: of the inputs; each feature by its own standard deviation if ``None``.
        """
        scale = Scaler.fit(source) if scale is None else scale
        inputs = scale(source)
        weights = np.ones(len(inputs))
        model = cls._weighted(scale, inputs, target, shrinkage, weights)
        for _ in range(rounds if robust else 0):
            residual = np.linalg.norm(inputs @ model.weight + model.bias - target, axis=1)
            weights = 1.0 / np.maximum(residual, max(float(np.median(residual)), 1e-9))
            model = cls._weighted(scale, inputs, target, shrinkage, weights / weights.mean())
        return model

    @classmethod
    def path(cls, source: FloatArray, target: FloatArray, shrinkages: Sequence[float]) -> list[Ridge]:
        """``fit`` with several penalties, for little more than the price of one.

        Args:
            source: inputs ``(N, D)``.
            target: outputs ``(N, E)``.
            shrinkages: penalties in units of the inputs' variance.

        Returns:
            One model per penalty.
        """
        scale = Scaler.fit(source)
        inputs = scale(source)
        middle_in, middle_out = inputs.mean(axis=0), target.mean(axis=0)
        centred = inputs - middle_in
        values, vectors = np.linalg.eigh(centred.T @ centred / len(inputs))
        turned = vectors.T @ (centred.T @ (target - middle_out) / len(inputs))
        models = []
        for shrinkage in shrinkages:
            weight = vectors @ (turned / (np.maximum(values, 0.0) + shrinkage)[:, None])
            models.append(cls(scale, weight, middle_out - middle_in @ weight))
        return models

    @classmethod
    def mean(cls, models: Sequence[Ridge], weights: Sequence[float]) -> Ridge:
        """The weighted mean of models with the inputs of one ``path``, as one model."""
        weight: FloatArray = sum(share * model.weight for share, model in zip(weights, models, strict=True))  # type: ignore[assignment]
        bias: FloatArray = sum(share * model.bias for share, model in zip(weights, models, strict=True))  # type: ignore[assignment]
        return cls(models[0].scale, weight, bias)

    @classmethod
    def _weighted(
        cls, scale: Scaler, inputs: FloatArray, target: FloatArray, shrinkage: float, weights: FloatArray
    ) -> Ridge:
        total = weights.sum()
        middle_in, middle_out = weights @ inputs / total, weights @ target / total
        centred = inputs - middle_in
        gram = (centred * weights[:, None]).T @ centred / total + shrinkage * np.eye(inputs.shape[1])
        weight = np.linalg.solve(gram, (centred * weights[:, None]).T @ (target - middle_out) / total)
        return cls(scale, weight, middle_out - middle_in @ weight)

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Affine map of codes ``(..., D)``."""
        return codes @ self._slope + self._offset

    def affine(self) -> Affine:
        """Slope and offset in raw codes."""
        return self._slope, self._offset

    def arrays(self) -> Arrays:
        """Weights."""
        return {"weight": self.weight, "bias": self.bias, **self.scale.arrays("scale")}

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> Ridge:
        """Rebuilds the model."""
        return cls(Scaler.restore(arrays, "scale"), arrays["weight"], arrays["bias"])


class KernelRidge(Regressor):
    """Kernel ridge regression with a Gaussian kernel exp(-gamma |x - y|^2 / D) on standardised inputs.

    With many rows a farthest-point subset of 1500 centres carries the kernel (subset of regressors).

    Args:
        scale: of the inputs.
        centres: ``(C, D)`` standardised.
        weight: ``(C, E)``.
        bias: ``(E,)``.
        gamma: of the kernel.
    """

    kind = "kernel_ridge"

    def __init__(self, scale: Scaler, centres: FloatArray, weight: FloatArray, bias: FloatArray, gamma: float) -> None:
        self.scale = scale
        self.centres = centres
        self.weight = weight
        self.bias = bias
        self.gamma = gamma

    @classmethod
    def fit(cls, source: FloatArray, target: FloatArray, shrinkage: float, gamma: float) -> KernelRidge:
        """Fits rows ``(N, D)`` to rows ``(N, E)``; ``shrinkage`` is the penalty on the kernel's diagonal."""
        scale = Scaler.fit(source)
        inputs = scale(source)
        bias = target.mean(axis=0)
        if len(inputs) <= _MAX_CENTRES:
            gram = _kernel(inputs, inputs, gamma) + shrinkage * np.eye(len(inputs))
            return cls(scale, inputs, np.linalg.solve(gram, target - bias), bias, gamma)
        centres = inputs[np.linspace(0, len(inputs) - 1, _MAX_CENTRES).astype(int)]
        cross = _kernel(inputs, centres, gamma)
        gram = cross.T @ cross + shrinkage * _kernel(centres, centres, gamma) + 1e-8 * np.eye(len(centres))
        return cls(scale, centres, np.linalg.solve(gram, cross.T @ (target - bias)), bias, gamma)

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Maps codes ``(..., D)``."""
        rows = self.scale(codes).reshape(-1, codes.shape[-1])
        mapped = np.concatenate(
            [
                _kernel(rows[start : start + 4096], self.centres, self.gamma) @ self.weight
                for start in range(0, len(rows), 4096)
            ]
        )
        return (mapped + self.bias).reshape(*codes.shape[:-1], -1)

    def arrays(self) -> Arrays:
        """Centres and weights."""
        return {"centres": self.centres, "weight": self.weight, "bias": self.bias, **self.scale.arrays("scale")}

    def settings(self) -> dict[str, Any]:
        """The kernel."""
        return {"gamma": self.gamma}

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> KernelRidge:
        """Rebuilds the model."""
        scale = Scaler.restore(arrays, "scale")
        return cls(scale, arrays["centres"], arrays["weight"], arrays["bias"], float(settings["gamma"]))


class Nearest(Regressor):
    """Mean of the targets of the k nearest training codes (standardised).

    Args:
        scale: of the inputs.
        inputs: ``(N, D)`` standardised.
        outputs: ``(N, E)``.
        neighbours: k.
    """

    kind = "nearest"

    def __init__(self, scale: Scaler, inputs: FloatArray, outputs: FloatArray, neighbours: int) -> None:
        self.scale = scale
        self.inputs = inputs
        self.outputs = outputs
        self.neighbours = neighbours

    @classmethod
    def fit(cls, source: FloatArray, target: FloatArray, neighbours: int) -> Nearest:
        """Remembers rows ``(N, D)`` and ``(N, E)``."""
        scale = Scaler.fit(source)
        return cls(scale, scale(source), target, max(1, min(neighbours, len(source))))

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Maps codes ``(..., D)``."""
        rows = self.scale(codes).reshape(-1, codes.shape[-1])
        squares = np.sum(self.inputs**2, axis=1)
        parts = []
        for start in range(0, len(rows), 1024):
            distance = squares - 2.0 * rows[start : start + 1024] @ self.inputs.T
            nearest = np.argpartition(distance, self.neighbours - 1, axis=1)[:, : self.neighbours]
            parts.append(self.outputs[nearest].mean(axis=1))
        return np.concatenate(parts).reshape(*codes.shape[:-1], -1)

    def arrays(self) -> Arrays:
        """The remembered rows."""
        return {"inputs": self.inputs, "outputs": self.outputs, **self.scale.arrays("scale")}

    def settings(self) -> dict[str, Any]:
        """K."""
        return {"neighbours": self.neighbours}

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> Nearest:
        """Rebuilds the model."""
        scale = Scaler.restore(arrays, "scale")
        return cls(scale, arrays["inputs"], arrays["outputs"], int(settings["neighbours"]))


def _kernel(rows: FloatArray, centres: FloatArray, gamma: float) -> FloatArray:
    distance = np.sum(rows**2, axis=1)[:, None] + np.sum(centres**2, axis=1) - 2.0 * rows @ centres.T
    values: FloatArray = np.exp(-gamma / rows.shape[1] * np.maximum(distance, 0.0))
    return values
