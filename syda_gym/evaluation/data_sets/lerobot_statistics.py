"""Statistics of columns as LeRobot normalises by them: least, greatest, mean, deviation, quantiles and count."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["QUANTILES", "Colours", "Statistics", "statistics_of"]

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_LOOKED_AT = 100  # pictures of an episode that colours are counted in
_THINNED = 3  # every third pixel of every third row

Statistics = dict[str, Any]
"""Name of a figure (``min``, ``max``, ``mean``, ``std``, ``q01`` ..., ``count``) to nested lists."""


def statistics_of(rows: NDArray[Any]) -> Statistics:
    """Figures over the rows of a numeric column.

    Args:
        rows: ``(N,)`` or ``(N, k)``.

    Returns:
        Lists of ``k`` numbers (one for a column of numbers); ``count`` is ``[N]``.
    """
    values = np.asarray(rows, dtype=np.float64)
    values = values.reshape(len(values), -1)
    figures = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        **{name: np.quantile(values, share, axis=0) for name, share in QUANTILES.items()},
    }
    return {**{name: value.tolist() for name, value in figures.items()}, "count": [len(values)]}


class Colours:
    """How often each of 256 levels was seen in each channel: enough for every figure, in any number of pictures.

    Attributes:
        counts: ``(3, 256)``.
        pictures: looked at.
    """

    def __init__(self) -> None:
        self.counts: NDArray[np.int64] = np.zeros((3, 256), dtype=np.int64)
        self.pictures = 0

    @staticmethod
    def worth_a_look(frames: int) -> frozenset[int]:
        """Pictures of an episode that are counted: all of a short one, else spread evenly."""
        return frozenset(np.linspace(0, frames - 1, min(frames, _LOOKED_AT)).round().astype(int).tolist())

    def look(self, picture: NDArray[np.uint8]) -> None:
        """Counts the pixels of one picture ``(height, width, 3)``, thinned out."""
        thin = picture[::_THINNED, ::_THINNED].reshape(-1, 3)
        for channel in range(3):
            self.counts[channel] += np.bincount(thin[:, channel], minlength=256)
        self.pictures += 1

    @classmethod
    def together(cls, parts: Sequence[Colours]) -> Colours:
        """All that several have seen."""
        whole = cls()
        for part in parts:
            whole.counts += part.counts
            whole.pictures += part.pictures
        return whole

    def statistics(self) -> Statistics:
        """Figures of each channel in [0, 1], shaped ``(3, 1, 1)`` as the format wants them."""
        levels = np.arange(256) / 255.0
        share = self.counts / self.counts.sum(axis=1, keepdims=True)
        mean = share @ levels
        below = np.cumsum(share, axis=1)
        figures: dict[str, FloatArray] = {
            "min": np.array([levels[np.flatnonzero(row)[0]] for row in self.counts]),
            "max": np.array([levels[np.flatnonzero(row)[-1]] for row in self.counts]),
            "mean": mean,
            "std": np.sqrt(np.maximum(share @ levels**2 - mean**2, 0.0)),
            **{
                name: np.array([levels[min(int(np.searchsorted(row, part)), 255)] for row in below])
                for name, part in QUANTILES.items()
            },
        }
        return {
            **{name: value.reshape(3, 1, 1).tolist() for name, value in figures.items()},
            "count": [self.pictures],
        }
