"""Heads: small models of their own for joints that move neither elbow nor wrist, such as a wrist yaw."""

from __future__ import annotations

from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.models.linear import Ridge
from syda_gym.mappings.models.regressors import Affine, Arrays, Regressor, restore_regressor

__all__ = ["HeadedRegressor", "fit_head"]

_SHRINKAGE = 0.3


class HeadedRegressor(Regressor):
    """A main regressor for limbs and a ridge for extra joints, side by side, in both directions.

    Args:
        main: from main codes to main codes.
        head: from whole source codes to the target's extra joints; ``None`` if it has none.
        back: from whole target codes to the source's extra joints; ``None`` if it has none.
        width: of the source's main codes.
        width_back: of the target's main codes.
    """

    kind = "headed"

    def __init__(self, main: Regressor, head: Ridge | None, back: Ridge | None, width: int, width_back: int) -> None:
        self.main = main
        self.head = head
        self.back = back
        self.width = width
        self.width_back = width_back

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Main and extra codes, side by side."""
        main = self.main(codes if codes.shape[-1] == self.width else codes[..., : self.width])
        return main if self.head is None else np.concatenate([main, self.head(codes)], axis=-1)

    def affine(self) -> Affine | None:
        """Main part and head side by side, where the main part is affine."""
        main = self.main.affine()
        if main is None or self.head is None:
            return main
        slope, offset = self.head.affine()
        # The head may see more of the code than the main part does.
        padded = np.zeros((len(slope), main[0].shape[1]))
        padded[: self.width] = main[0]
        return np.concatenate([padded, slope], axis=1), np.concatenate([main[1], offset])

    def inverse(self) -> HeadedRegressor:
        """The main model's inverse with the heads exchanged."""
        return HeadedRegressor(self.main.inverse(), self.back, self.head, self.width_back, self.width)

    def arrays(self) -> Arrays:
        """Numbers of all parts."""
        parts: list[tuple[str, Regressor | None]] = [("main", self.main), ("head", self.head), ("back", self.back)]
        return {f"{name}/{key}": value for name, part in parts if part for key, value in part.arrays().items()}

    def settings(self) -> dict[str, Any]:
        """Kind and settings of the main part, widths, and which heads there are."""
        return {
            "main": {"kind": self.main.kind, "settings": self.main.settings()},
            "head": self.head is not None,
            "back": self.back is not None,
            "width": self.width,
            "width_back": self.width_back,
        }

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> HeadedRegressor:
        """Rebuilds the parts."""

        def below(name: str) -> Arrays:
            return {key[len(name) + 1 :]: value for key, value in arrays.items() if key.startswith(name + "/")}

        return cls(
            restore_regressor(settings["main"], below("main")),
            Ridge.restore({}, below("head")) if settings["head"] else None,
            Ridge.restore({}, below("back")) if settings["back"] else None,
            int(settings["width"]),
            int(settings["width_back"]),
        )


def fit_head(source: FloatArray, extras: FloatArray) -> Ridge | None:
    """Ridge from codes ``(N, K, D)`` to extra joints ``(N, K, E)``; ``None`` if there are none."""
    if extras.shape[-1] == 0:
        return None
    return Ridge.fit(source.reshape(-1, source.shape[-1]), extras.reshape(-1, extras.shape[-1]), _SHRINKAGE)
