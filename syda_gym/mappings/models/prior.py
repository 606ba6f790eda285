"""PriorRegressor: the geometric image of one body's arm in another, plus a shrunk correction, both ways."""

from __future__ import annotations

from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.models.linear import Ridge
from syda_gym.mappings.models.regressors import Affine, Arrays, Regressor
from syda_gym.mappings.models.rotation import GeometricRegressor

__all__ = ["PriorRegressor"]


class PriorRegressor(Regressor):
    """What geometry says of a code, and what recordings add to it.

    ``y = R directions(x) + correction(x)`` and, on the way back, ``x = shape(R' directions(y)) + correction_back(y)``.
    The corrections were fitted to what the geometric image leaves over, so that one of zero leaves the geometric
    mapping itself.

    Args:
        prior: the geometric image.
        correction: of the target's code, from the source's.
        correction_back: of the source's code, from the target's.
    """

    kind = "prior"

    def __init__(self, prior: GeometricRegressor, correction: Ridge, correction_back: Ridge) -> None:
        self.prior = prior
        self.correction = correction
        self.correction_back = correction_back

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Geometric image plus correction."""
        image: FloatArray = self.prior(codes) + self.correction(codes)
        return image

    def affine(self) -> Affine:
        """Both as one affine map."""
        slope, offset = self.correction.affine()
        images = self.prior(np.eye(len(slope)))
        return images + slope, offset

    def inverse(self) -> PriorRegressor:
        """The rotation back with the correction of the way back."""
        return PriorRegressor(self.prior.inverse(), self.correction_back, self.correction)

    def arrays(self) -> Arrays:
        """The rotation and both corrections."""
        parts: tuple[tuple[str, Regressor], ...] = (
            ("prior", self.prior),
            ("there", self.correction),
            ("back", self.correction_back),
        )
        return {f"{name}/{key}": value for name, part in parts for key, value in part.arrays().items()}

    def settings(self) -> dict[str, Any]:
        """Those of the geometric image."""
        return self.prior.settings()

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> PriorRegressor:
        """Rebuilds all parts."""

        def below(name: str) -> Arrays:
            return {key[len(name) + 1 :]: value for key, value in arrays.items() if key.startswith(name + "/")}

        return cls(
            GeometricRegressor.restore(settings, below("prior")),
            Ridge.restore({}, below("there")),
            Ridge.restore({}, below("back")),
        )
