"""Lag: by how many frames a person trailed the motion that they were mimicking, per training recording."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.models.linear import Ridge
from syda_gym.mappings.models.scaling import Scaler
from syda_gym.motions.clip import PairedMotions

__all__ = ["estimate_lags", "shift_targets"]

_LEAST_ACTIONS = 3
_SHRINKAGE = 0.1
Rows = NDArray[np.intp]


def estimate_lags(pair: PairedMotions, source: FloatArray, target: FloatArray, limit: int) -> dict[str, int]:
    """Finds one shift per recording by ridge regression that is fitted without the recording's action.

    Args:
        pair: the training frames.
        source: codes ``(N, K, D)``.
        target: codes ``(N, K, E)``.
        limit: largest shift either way [frames]; 0 switches the search off.

    Returns:
        Recording to the number of frames by which the target runs ahead of the source's image; all zero with fewer than
        three actions, because a ridge fitted to one or two cannot tell.
    """
    lags = {str(name): 0 for name in np.unique(pair.recordings)}
    if limit == 0 or len(pair.action_names) < _LEAST_ACTIONS:
        return lags
    codes = Scaler.fit(_flat(source))(source)
    shifts = np.array(sorted(range(-limit, limit + 1), key=abs))
    clips: dict[str, list[Rows]] = {}
    for rows in pair.clip_rows():
        clips.setdefault(str(pair.recordings[rows[0]]), []).append(rows)
    for action in pair.action_names:
        others = pair.actions != action
        ridge = Ridge.fit(_flat(codes[others]), _flat(target[others]), _SHRINKAGE)
        for name in np.unique(pair.recordings[~others]).tolist():
            costs = sum(_costs(ridge(codes[rows]), target[rows], shifts) for rows in clips[name])
            lags[name] = int(shifts[np.argmin(costs)])  # the smaller one when two are equal
    return lags


def shift_targets(pair: PairedMotions, target: FloatArray, lags: dict[str, int]) -> FloatArray:
    """Moves each recording's targets by its lag, within each clip; ends are held."""
    result = target.copy()
    for rows in pair.clip_rows():
        lag = lags[str(pair.recordings[rows[0]])]
        if lag:
            result[rows] = target[rows[_shifted(len(rows), lag)]]
    return result


def _costs(predicted: FloatArray, target: FloatArray, shifts: NDArray[np.int64]) -> FloatArray:
    """Squared error of a clip ``(N, K, E)`` for each shift of its targets."""
    result: FloatArray = np.sum((predicted - target[_shifted(len(target), shifts[:, None])]) ** 2, axis=(1, 2, 3))
    return result


def _shifted(count: int, lag: int | NDArray[np.int64]) -> Rows:
    """Rows of a clip, moved; ends are held."""
    shifted: Rows = np.clip(np.arange(count) + lag, 0, count - 1)
    return shifted


def _flat(codes: FloatArray) -> FloatArray:
    return codes.reshape(-1, codes.shape[-1])
