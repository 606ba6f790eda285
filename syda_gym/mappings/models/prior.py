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

    ``y = share R directions(x) + correction(x)`` and, on the way back, ``x = share_back shape(R' directions(y)) +
    correction_back(y)``. The corrections were fitted to what the share of the geometric image leaves over; a whole
    share and no correction are the geometric mapping itself.

    Args:
        prior: the geometric image.
        correction: of the target's code, from the source's.
        correction_back: of the source's code, from the target's.
        shares: how much of the image is kept, 0 to 1, there and back.
    """

    kind = "prior"

    def __init__(
        self,
        prior: GeometricRegressor,
        correction: Ridge,
        correction_back: Ridge,
        shares: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        self.prior = prior
        self.correction = correction
        self.correction_back = correction_back
        self.shares = (float(shares[0]), float(shares[1]))

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Geometric image plus correction."""
        image: FloatArray = self.shares[0] * self.prior(codes) + self.correction(codes)
        return image

    def affine(self) -> Affine:
        """Both as one affine map."""
        slope, offset = self.correction.affine()
        images = self.shares[0] * self.prior(np.eye(len(slope)))
        return images + slope, offset

    def inverse(self) -> PriorRegressor:
        """The rotation back with the correction of the way back."""
        return PriorRegressor(self.prior.inverse(), self.correction_back, self.correction, self.shares[::-1])

    def arrays(self) -> Arrays:
        """The rotation and both corrections."""
        parts: tuple[tuple[str, Regressor], ...] = (
            ("prior", self.prior),
            ("there", self.correction),
            ("back", self.correction_back),
        )
        return {f"{name}/{key}": value for name, part in parts for key, value in part.arrays().items()}

    def settings(self) -> dict[str, Any]:
        """Those of the geometric image, and the shares."""
        return {**self.prior.settings(), "shares": list(self.shares)}

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> PriorRegressor:
        """Rebuilds all parts."""

        def below(name: str) -> Arrays:
            return {key[len(name) + 1 :]: value for key, value in arrays.items() if key.startswith(name + "/")}

        return cls(
            GeometricRegressor.restore(settings, below("prior")),
            Ridge.restore({}, below("there")),
            Ridge.restore({}, below("back")),
            (float(settings["shares"][0]), float(settings["shares"][1])),
        )
