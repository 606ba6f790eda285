"""Tracking: the reward as pure functions of arrays, one small function a term."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError, nearest_name

__all__ = ["TERMS", "RewardWeights", "in_order", "reward_terms"]

TERMS = ("joints", "landmarks", "correction_change", "limits", "contacts", "jitter")
"""Names of the reward terms, in the order of the columns of ``reward_terms``."""


@dataclass(frozen=True)
class RewardWeights:
    """Weights and sharpness of the reward terms; every penalty is a positive weight.

    Attributes:
        joints: weight of ``exp(-joint_sharpness * sum((q - reference)^2))``.
        landmarks: weight of ``exp(-landmark_sharpness * mean landmark error)``.
        correction_change: penalty on the mean squared change of the correction between two steps.
        limits: penalty per joint whose command had to be clipped at its limit.
        contacts: penalty per pair of touching links.
        jitter: penalty on the mean third difference of the landmarks [per m/frame^3].
        joint_sharpness: [1/rad^2].
        landmark_sharpness: [1/m].

    Raises:
        OptionError: a weight is negative or not finite.
    """

    joints: float = 0.5
    landmarks: float = 0.5
    correction_change: float = 0.02
    limits: float = 0.0
    contacts: float = 0.0
    jitter: float = 0.0
    joint_sharpness: float = 2.0
    landmark_sharpness: float = 10.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                raise OptionError(f"reward weight {field.name!r} must be a number, got {value!r}")
            if not (np.isfinite(value) and value >= 0.0):
                raise OptionError(f"reward weight {field.name!r} must be finite and not negative, got {value}")

    @classmethod
    def resolve(cls, value: RewardWeights | Mapping[str, Any] | None) -> RewardWeights:
        """Accepts weights, a mapping with some of them, or ``None`` for the defaults.

        Raises:
            OptionError: an unknown name.
        """
        if isinstance(value, RewardWeights):
            return value
        if value is None:
            return cls()
        if not isinstance(value, Mapping):
            raise OptionError(f"reward must be RewardWeights or a dict of weights, got {type(value).__name__}")
        known = [field.name for field in fields(cls)]
        for name in value:
            if name not in known:
                raise OptionError(f"unknown reward weight {name!r}; {nearest_name(str(name), known)}")
        return cls(**value)


def in_order(values: FloatArray) -> FloatArray:
    """Sum over the last axis, from the first entry to the last.

    numpy's own sum chooses its order by shape and strides; this one gives the same bits for one robot and for many.
    """
    total = values[..., 0] + values[..., 1]
    for index in range(2, values.shape[-1]):
        total = total + values[..., index]
    return np.asarray(total)


def closeness(distance: FloatArray, sharpness: float) -> FloatArray:
    """``exp(-sharpness * distance)``: 1 at distance 0, falling to 0."""
    return np.asarray(np.exp(distance * -sharpness))


def reward_terms(
    weights: RewardWeights,
    *,
    squared_joint_error: FloatArray,
    landmark_error: FloatArray,
    correction_change: FloatArray,
    limit_hits: NDArray[np.int64],
    contacts: NDArray[np.int64],
    jitter: FloatArray,
) -> FloatArray:
    """All weighted terms.

    Args:
        weights: of the terms.
        squared_joint_error: sum over the joints of ``(q - reference)^2``, ``(B,)`` [rad^2].
        landmark_error: mean distance of the landmarks from their reference, ``(B,)`` [m].
        correction_change: mean over the joints of the squared change of the correction, ``(B,)``.
        limit_hits: joints whose command was clipped, ``(B,)``.
        contacts: touching pairs of links, ``(B,)``.
        jitter: mean third difference of the landmarks, ``(B,)`` [m/frame^3].

    Returns:
        ``(len(TERMS), B)``; the reward is the sum over the terms.
    """
    terms = np.zeros((len(TERMS), len(squared_joint_error)))
    terms[0] = weights.joints * closeness(squared_joint_error, weights.joint_sharpness)
    terms[1] = weights.landmarks * closeness(landmark_error, weights.landmark_sharpness)
    terms[2] = -weights.correction_change * correction_change
    if weights.limits:
        terms[3] = -weights.limits * limit_hits
    if weights.contacts:
        terms[4] = -weights.contacts * contacts
    if weights.jitter:
        terms[5] = -weights.jitter * jitter
    return terms
