"""Normalisation of what a residual policy sees: spreads that its own later corrections cannot leave far behind."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["LEAST_CORRECTION_SPREAD", "LEAST_SPREAD", "spreads"]

LEAST_SPREAD = 0.05
"""Smallest spread of a feature, in its own unit (m, rad, rad/s, s), so that what hardly moves is not blown up."""

LEAST_CORRECTION_SPREAD = 0.5
"""Smallest spread of the previous corrections, which lie in [-1, 1] and are all zero as long as the base acts alone."""


def spreads(features: FloatArray, joints: int) -> FloatArray:
    """By what features are divided.

    They are measured while the base acts alone. The corrections are constant then; divided by what is measured, every
    correction that the policy makes later would lie at the end of the range and tell nothing.

    Args:
        features: of ``policy_features`` while the base acts alone ``(N, F)``; the last ``joints`` are the corrections.
        joints: of the robot.

    Returns:
        ``(F,)``.
    """
    least = np.full(features.shape[1], LEAST_SPREAD)
    least[-joints:] = LEAST_CORRECTION_SPREAD
    return np.asarray(np.maximum(features.std(axis=0), least))
