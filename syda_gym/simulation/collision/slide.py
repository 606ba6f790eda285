"""slide: the velocity nearest to the wanted one with which no pair of links comes together too fast."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["slide"]


def slide(
    wanted: FloatArray, low: FloatArray, high: FloatArray, gradients: FloatArray, slowest: FloatArray
) -> FloatArray | None:
    """Projects a velocity onto what is allowed, so that a robot slides along its own body instead of sticking to it.

    Velocity damping (Faverjon and Tournassoud, ICRA 1987): each near pair bounds how fast its distance may shrink. The
    projection is a small quadratic program, min |x| with G x >= h, solved as a least-distance problem by non-negative
    least squares (Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23).

    Args:
        wanted: ``(n,)`` [rad/s].
        low: least velocity ``(n,)`` [rad/s].
        high: greatest velocity ``(n,)`` [rad/s].
        gradients: how each pair's distance grows with the joint angles ``(pairs, n)`` [m/rad].
        slowest: least rate of each pair's distance ``(pairs,)`` [m/s].

    Returns:
        ``(n,)`` [rad/s] within ``low`` and ``high``, or ``None`` if no velocity will do.
    """
    from scipy.optimize import nnls

    joints = len(wanted)
    scale = np.maximum(high - low, 1e-9)  # fast joints give way first; and it makes the numbers alike
    identity = np.eye(joints)
    rows = np.vstack([gradients * scale, identity, -identity])
    least = np.concatenate([slowest - gradients @ wanted, (low - wanted) / scale, (wanted - high) / scale])
    if (least <= 0.0).all():
        return np.clip(wanted, low, high)
    # Rows of one length: a distant joint and a near one count alike.
    length = np.linalg.norm(rows, axis=1)
    usable = length > 1e-9
    rows, least = rows[usable] / length[usable, None], least[usable] / length[usable]
    matrix = np.vstack([rows.T, least[None]])
    goal = np.zeros(joints + 1)
    goal[-1] = 1.0
    try:
        weights, residual = nnls(matrix, goal, maxiter=20 * len(least))
    except RuntimeError:  # it did not converge
        return None
    if residual < 1e-6:
        return None
    left = matrix @ weights - goal
    result: FloatArray = np.clip(wanted - scale * left[:joints] / left[joints], low, high)
    return result
