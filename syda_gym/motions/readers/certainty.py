"""Which points a tool lost: states of a Kinect, visibilities, confidences, flags."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.motions.readers.said import Said

__all__ = ["looks_like_certainty", "lost", "without_lost"]

_LEAST = 0.5
_TRACKED = 2.0  # Kinect v2: 0 not tracked, 1 inferred, 2 tracked; Azure Kinect: 0 none, 1 predicted, 2 medium, 3 high


def lost(certainty: FloatArray, said: Said) -> NDArray[np.bool_]:
    """Which points do not count.

    Args:
        certainty: any shape; not a number where nothing is known, which counts as tracked.
        said: may hold a threshold of one's own, or that inferred points count.
    """
    known = certainty[np.isfinite(certainty)]
    if said.confidence is not None:
        least = said.confidence
    elif len(known) and known.max() > 1.0:
        states = known.max() <= 3.0 and (known == np.round(known)).all()
        least = (1.0 if said.inferred else _TRACKED) if states else _LEAST * (100.0 if known.max() <= 100.0 else 1.0)
    else:
        least = _LEAST
    result: NDArray[np.bool_] = np.asarray(certainty < least)
    return result


def without_lost(points: FloatArray, certainty: FloatArray | None, said: Said) -> FloatArray:
    """Points ``(N, P, 3)`` with NaN where ``certainty`` ``(N, P)`` says that they were lost."""
    if certainty is None:
        return points
    return np.where(lost(certainty, said)[..., None], np.nan, points)


def looks_like_certainty(values: FloatArray) -> bool:
    """Whether numbers are states or confidences: nearly all whole and small, or nearly all between 0 and 1."""
    known = values[np.isfinite(values)]
    if not len(known):
        return False
    whole = (known == np.round(known)) & (known >= 0.0) & (known <= 3.0)
    share = (known >= 0.0) & (known <= 1.0)
    return bool(max(whole.mean(), share.mean()) > 0.95)
