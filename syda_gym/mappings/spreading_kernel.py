"""The loop behind ``spread_out``, compiled by numba on first use; it adds in NumPy's order, so bits are the same."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.limb_ik.compiling import compiled

__all__ = ["farthest"]


@compiled
def _squared(rows, a, b):
    """Squared distance of two rows; from eight numbers on in eight partial sums, as NumPy adds."""
    width = rows.shape[1]
    total = 0.0
    start = 0
    if width >= 8:
        p = q = r = s = t = u = v = w = 0.0
        start = width - width % 8
        for i in range(0, start, 8):
            p += (rows[a, i] - rows[b, i]) ** 2
            q += (rows[a, i + 1] - rows[b, i + 1]) ** 2
            r += (rows[a, i + 2] - rows[b, i + 2]) ** 2
            s += (rows[a, i + 3] - rows[b, i + 3]) ** 2
            t += (rows[a, i + 4] - rows[b, i + 4]) ** 2
            u += (rows[a, i + 5] - rows[b, i + 5]) ** 2
            v += (rows[a, i + 6] - rows[b, i + 6]) ** 2
            w += (rows[a, i + 7] - rows[b, i + 7]) ** 2
        total = ((p + q) + (r + s)) + ((t + u) + (v + w))
    for i in range(start, width):
        total += (rows[a, i] - rows[b, i]) ** 2
    return total


@compiled
def farthest(rows, first, count, same):
    """Indices of ``count`` rows, ``first`` before all; fewer where the rest lie within ``same`` of one of them."""
    chosen = np.empty(count, dtype=np.int64)
    chosen[0] = first
    distance = np.full(len(rows), np.inf)
    found = 1
    while True:
        last, best, far = chosen[found - 1], 0, -1.0
        for row in range(len(rows)):
            gap = _squared(rows, row, last)
            if gap < distance[row]:
                distance[row] = gap
            if distance[row] > far:
                best, far = row, distance[row]
        if found == count or far <= same:
            return chosen[:found]
        chosen[found] = best
        found += 1
