"""The speed limit's loop over the frames of clips, compiled by numba on first use."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.limb_ik.compiling import compiled

__all__ = ["limit_clips"]


@compiled
def _along(at, values, first, last, x):
    """Linear between rows ``first`` to ``last``, constant beyond them, with numpy's rounding."""
    if not x > at[first]:
        return values[first]
    if x >= at[last]:
        return values[last]
    i = first
    while at[i + 1] <= x:
        i += 1
    return (values[i + 1] - values[i]) / (at[i + 1] - at[i]) * (x - at[i]) + values[i]


@compiled
def limit_clips(
    clips: np.ndarray,
    most: np.ndarray,
    slack: float,
    lower: np.ndarray,
    upper: np.ndarray,
    governed: np.ndarray,
    governors: np.ndarray,
    rows: np.ndarray,
    at: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> None:
    """Applies ``limits.step_towards`` from frame to frame, in place.

    Args:
        clips: ``(B, T, n)`` joint angles [rad] within the joint limits.
        most: ``(n,)`` [rad] per frame.
        slack: [rad] by which a step may exceed that.
        lower: ``(n,)`` [rad].
        upper: ``(n,)`` [rad].
        governed: ``(c,)`` joints with coupled limits.
        governors: ``(c,)`` joints that these depend on.
        rows: ``(c + 1,)`` first row of each coupled limit, and one past the last.
        at: ``(rows,)`` angle of the governor [rad].
        low: ``(rows,)`` lower limit there [rad].
        high: ``(rows,)`` upper limit there [rad].
    """
    n = clips.shape[2]
    for b in range(clips.shape[0]):
        for k in range(1, clips.shape[1]):
            last, frame, far = clips[b, k - 1], clips[b, k], False
            for j in range(n):
                step = frame[j] - last[j]
                if not abs(step) <= most[j] + slack:
                    frame[j] = last[j] + min(max(step, -most[j]), most[j])
                    far = True
            if not far:
                continue
            for j in range(n):
                frame[j] = min(max(frame[j], lower[j]), upper[j])
            for which in range(len(governed)):
                # The governing joint counts as its own limits leave it, as in ``Robot.clamp``.
                j, by = governed[which], governors[which]
                angle = min(max(frame[by], lower[by]), upper[by])
                first, end = rows[which], rows[which + 1] - 1
                least, greatest = _along(at, low, first, end, angle), _along(at, high, first, end, angle)
                frame[j] = min(max(frame[j], lower[j], least), upper[j], greatest)
