"""GeometricRegressor: limb directions of one body turned into those of another; nothing is learned but a rotation."""

from __future__ import annotations

from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.models.regressors import Affine, Arrays, Regressor

__all__ = ["GeometricRegressor", "fitted_rotation"]


class GeometricRegressor(Regressor):
    """Turns limb directions by one rotation; lengths are the target's own.

    Args:
        rotation: ``(3, 3)`` from source to target directions of a left arm.
        source_share: upper arm over arm length of a human source, 0 for a robot.
        target_share: the same for the target.
    """

    kind = "geometric"

    def __init__(self, rotation: FloatArray, source_share: float, target_share: float) -> None:
        self.rotation = np.asarray(rotation, dtype=np.float64).reshape(3, 3)
        self.source_share = float(source_share)
        self.target_share = float(target_share)

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Codes of the target from codes of the source."""
        limbs = codes[..., -6:].reshape(*codes.shape[:-1], 2, 3) @ self.rotation.T
        flat = limbs.reshape(*codes.shape[:-1], 6)
        if not self.target_share:
            return flat
        elbow = self.target_share * limbs[..., 0, :]
        return np.concatenate([elbow, elbow + (1.0 - self.target_share) * limbs[..., 1, :], flat], axis=-1)

    def affine(self) -> Affine:
        """The image as a linear map, for a code of the width that the other direction gives."""
        images = self(np.eye(12 if self.source_share else 6))
        return images, np.zeros(images.shape[1])

    def inverse(self) -> GeometricRegressor:
        """The rotation back."""
        return GeometricRegressor(self.rotation.T, self.target_share, self.source_share)

    def arrays(self) -> Arrays:
        """The rotation."""
        return {"rotation": self.rotation}

    def settings(self) -> dict[str, Any]:
        """The shares."""
        return {"source_share": self.source_share, "target_share": self.target_share}

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> GeometricRegressor:
        """Rebuilds the model."""
        return cls(arrays["rotation"], settings["source_share"], settings["target_share"])


def fitted_rotation(source: FloatArray, target: FloatArray, lean: float = 0.0) -> FloatArray:
    """The rotation that turns source directions onto target directions with least squares (Kabsch 1976).

    Args:
        source: ``(N, 3)`` or several vectors a row, ``(N, 3 k)``.
        target: as many.
        lean: pull towards no rotation at all: this many times ``N`` is added to each axis' own correlation. One action
            may show too few directions to tell a rotation; a little of this settles what it leaves open.

    Returns:
        ``(3, 3)``.
    """
    a, b = source.reshape(-1, 3), target.reshape(-1, 3)
    u, _, vt = np.linalg.svd(b.T @ a + lean * len(a) * np.eye(3))
    sign = np.sign(np.linalg.det(u @ vt))
    rotation: FloatArray = u @ np.diag([1.0, 1.0, sign]) @ vt
    return rotation
