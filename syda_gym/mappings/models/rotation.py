"""GeometricRegressor: limb directions of one body turned into those of another; nothing is learned but a rotation."""

from __future__ import annotations

from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.models.regressors import Arrays, Regressor

__all__ = ["GeometricRegressor"]


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
