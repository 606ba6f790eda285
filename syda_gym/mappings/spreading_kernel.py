"""The loop behind ``spread_out``, compiled by numba on first use; it adds in NumPy's order, so bits are the same."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.limb_ik.compiling import compiled

__all__ = ["farthest"]


@compiled
def _squared(columns, last, gap, parts):
    """Squared distances of all rows to one, into ``gap``; from eight numbers on in eight partial sums, as NumPy adds.

    Numbers of one column lie side by side, so that several rows are computed at once.
    """
    width, count = columns.shape
    start = 0
    for row in range(count):
        gap[row] = 0.0
    if width >= 8:
        start = width - width % 8
        for part in range(8):
            one, sums, at = columns[part], parts[part], columns[part, last]
            for row in range(count):
                sums[row] = (one[row] - at) ** 2
        for i in range(8, start):
            one, sums, at = columns[i], parts[i % 8], columns[i, last]
            for row in range(count):
                sums[row] += (one[row] - at) ** 2
        p, q, r, s = parts[0], parts[1], parts[2], parts[3]
        t, u, v, w = parts[4], parts[5], parts[6], parts[7]
        for row in range(count):
            gap[row] = ((p[row] + q[row]) + (r[row] + s[row])) + ((t[row] + u[row]) + (v[row] + w[row]))
    for i in range(start, width):
        one, at = columns[i], columns[i, last]
        for row in range(count):
            gap[row] += (one[row] - at) ** 2


@compiled
def farthest(columns, first, count, same):
    """Indices of ``count`` rows, ``first`` before all; fewer where the rest lie within ``same`` of one of them.

    ``columns`` ``(D, N)`` is contiguous.
    """
    rows = columns.shape[1]
    chosen = np.empty(count, dtype=np.int64)
    chosen[0] = first
    distance = np.full(rows, np.inf)
    gap, parts = np.empty(rows), np.empty((8, rows))
    found = 1
    while True:
        _squared(columns, chosen[found - 1], gap, parts)
        for row in range(rows):
            distance[row] = min(distance[row], gap[row])
        best, far = 0, -1.0
        for row in range(rows):
            if distance[row] > far:
                best, far = row, distance[row]
        if found == count or far <= same:
            return chosen[:found]
        chosen[found] = best
        found += 1
