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
    clips = pair.clip_rows()
    for action in pair.action_names:
        others = pair.actions != action
        predicted = Ridge.fit(_flat(codes[others]), _flat(target[others]), _SHRINKAGE)(codes)
        for name in np.unique(pair.recordings[~others]):
            rows = [clip for clip in clips if pair.recordings[clip[0]] == name]
            lags[str(name)] = _best(rows, predicted, target, limit)
    return lags


def shift_targets(pair: PairedMotions, target: FloatArray, lags: dict[str, int]) -> FloatArray:
    """Moves each recording's targets by its lag, within each clip; ends are held."""
    result = target.copy()
    for rows in pair.clip_rows():
        lag = lags[str(pair.recordings[rows[0]])]
        if lag:
            result[rows] = target[_shifted(rows, lag)]
    return result


def _best(clips: list[Rows], predicted: FloatArray, target: FloatArray, limit: int) -> int:
    """The shift of least squared error; the smaller one when two are equal."""
    shifts = sorted(range(-limit, limit + 1), key=abs)
    costs = [
        sum(float(np.sum((predicted[rows] - target[_shifted(rows, shift)]) ** 2)) for rows in clips) for shift in shifts
    ]
    return shifts[int(np.argmin(costs))]


def _shifted(rows: Rows, lag: int) -> Rows:
    shifted: Rows = rows[np.clip(np.arange(len(rows)) + lag, 0, len(rows) - 1)]
    return shifted


def _flat(codes: FloatArray) -> FloatArray:
    return codes.reshape(-1, codes.shape[-1])
