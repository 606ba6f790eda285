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

    from syda_gym.embodiments.limb_ik.compiling import first_call
    from syda_gym.simulation.collision.slide_kernel import system

    joints = len(wanted)
    matrix, scale, broken = first_call(system, wanted, low, high, gradients, slowest)
    if not broken:
        return np.clip(wanted, low, high)
    goal = np.zeros(joints + 1)
    goal[-1] = 1.0
    try:
        weights, residual = nnls(matrix, goal, maxiter=20 * matrix.shape[1])
    except RuntimeError:  # it did not converge
        return None
    if residual < 1e-6:
        return None
    left = matrix @ weights - goal
    result: FloatArray = np.clip(wanted - scale * left[:joints] / left[joints], low, high)
    return result
