"""Keeping limb directions within a human's range of motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray, Side
from syda_gym.embodiments.parametric import ARM_ANGLES, FULL_RANGE

__all__ = ["arm_angles", "directions_from_angles", "within_range"]

# Model axes (x outward, y forward, z up) from body axes (x forward, y left, z up); y changes sign for the right arm.
_MODEL: FloatArray = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def arm_angles(directions: FloatArray, side: Side, limits: Mapping[str, tuple[float, float]]) -> FloatArray:
    """Angles t1 to t4 of the human arm model for limb directions.

    Of the two solutions the one that violates ``limits`` less is taken.

    Args:
        directions: ``(N, 2, 3)`` unit upper-arm and forearm directions, body axes.
        side: which arm.
        limits: ranges of t1 to t4 [rad].

    Returns:
        ``(N, 4)`` [rad].
    """
    upper, fore = np.moveaxis(_to_model(directions, side), 1, 0)
    lateral = np.arcsin(np.clip(upper[:, 0], -1.0, 1.0))
    forward = np.arctan2(upper[:, 1], -upper[:, 2])
    candidates = []
    for t1, t2 in ((forward, -lateral), (forward - np.pi * np.sign(forward), lateral - np.pi)):
        local = np.einsum("nji,nj->ni", _shoulder(t1, t2), fore)
        t4 = np.arcsin(np.clip(local[:, 2], -1.0, 1.0))
        t3 = np.arctan2(-local[:, 0], local[:, 1])
        candidates.append(np.stack([t1, t2, t3, t4], axis=1))
    low, high = _bounds(limits)
    excess = [np.sum(np.abs(c - np.clip(c, low, high)), axis=1) for c in candidates]
    return np.where((excess[0] <= excess[1])[:, None], candidates[0], candidates[1])


def directions_from_angles(angles: FloatArray, side: Side) -> FloatArray:
    """Inverse of ``arm_angles``: ``(N, 4)`` [rad] to ``(N, 2, 3)``."""
    t1, t2, t3, t4 = angles.T
    shoulder = _shoulder(t1, t2)
    upper = -shoulder[:, :, 2]
    local = np.stack([-np.sin(t3) * np.cos(t4), np.cos(t3) * np.cos(t4), np.sin(t4)], axis=1)
    fore = np.einsum("nij,nj->ni", shoulder, local)
    return _to_body(np.stack([upper, fore], axis=1), side)


def within_range(directions: FloatArray, limits: Mapping[str, tuple[float, float]], side: Side) -> FloatArray:
    """Limb directions ``(N, 2, 3)`` with every arm angle clipped to ``limits`` [rad]."""
    low, high = _bounds(limits)
    return directions_from_angles(np.clip(arm_angles(directions, side, limits), low, high), side)


def _bounds(limits: Mapping[str, tuple[float, float]]) -> tuple[FloatArray, FloatArray]:
    ranges = np.array([limits.get(name, FULL_RANGE[name]) for name in ARM_ANGLES], dtype=np.float64)
    return ranges[:, 0], ranges[:, 1]


def _shoulder(t1: FloatArray, t2: FloatArray) -> FloatArray:
    """Rx(t1) Ry(t2), ``(N, 3, 3)``."""
    c1, s1, c2, s2, zero = np.cos(t1), np.sin(t1), np.cos(t2), np.sin(t2), np.zeros_like(t1)
    rows = [[c2, zero, s2], [s1 * s2, c1, -s1 * c2], [-c1 * s2, s1, c1 * c2]]
    return np.array(rows).transpose(2, 0, 1)


def _flip(side: Side) -> FloatArray:
    return np.array([1.0, 1.0 if side == "left" else -1.0, 1.0])


def _to_model(vectors: FloatArray, side: Side) -> FloatArray:
    result: FloatArray = (vectors * _flip(side)) @ _MODEL.T
    return result


def _to_body(vectors: FloatArray, side: Side) -> FloatArray:
    result: FloatArray = (vectors @ _MODEL) * _flip(side)
    return result
