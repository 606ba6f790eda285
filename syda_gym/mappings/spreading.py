"""spread_out: a few rows that stand for many, each as far as can be from those before it."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["spread_out"]

_MOST = 4000  # of more rows, every second or third is looked at
_SAME = 1e-12  # squared distance at which the rest are copies of those chosen


def spread_out(rows: FloatArray, count: int) -> FloatArray:
    """Farthest-point subset: starts at the row nearest to the mean and adds the row farthest from those chosen.

    Args:
        rows: ``(N, D)``.
        count: rows at most.

    Returns:
        ``(M, D)``, M at most ``count``; fewer where the others are copies.
    """
    # numba is imported where mappings are fitted, not before.
    from syda_gym.embodiments.limb_ik.compiling import first_call
    from syda_gym.mappings.spreading_kernel import farthest

    if len(rows) > _MOST:
        rows = rows[:: -(-len(rows) // _MOST)]
    first = int(np.argmin(np.sum((rows - rows.mean(axis=0)) ** 2, axis=1)))
    columns = np.ascontiguousarray(rows.T, dtype=np.float64)
    chosen: FloatArray = rows[first_call(farthest, columns, first, min(count, len(rows)), _SAME)]
    return chosen
