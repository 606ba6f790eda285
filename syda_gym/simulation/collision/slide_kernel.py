"""slide_kernel: the least-distance problem of ``slide`` in one compiled plain loop."""

from __future__ import annotations

import math

import numpy as np

from syda_gym.embodiments.limb_ik.compiling import compiled

__all__ = ["system"]

_FEW = 1e-9  # a row of the system that is shorter says nothing


@compiled
def system(wanted, low, high, gradients, slowest):
    """The least-distance problem of ``slide`` as non-negative least squares ``(n + 1, rows)``.

    Rows are left out that hold anywhere between ``low`` and ``high``, and those that say nothing. The scale of the
    joints comes along ``(n,)``, and whether the wanted velocity breaks any row.
    """
    n = len(wanted)
    scale, matrix = np.empty(n), np.empty((n + 1, 2 * n + len(slowest)))
    count, broken = 0, False
    for j in range(n):
        scale[j] = max(high[j] - low[j], 1e-9)  # fast joints give way first; and it makes the numbers alike
    for row in range(len(slowest)):
        least, worst, square = slowest[row], 0.0, 0.0
        for j in range(n):
            slope = gradients[row, j]
            least -= slope * wanted[j]
            worst += min(slope * low[j], slope * high[j])
            square += slope * scale[j] * slope * scale[j]
        length = math.sqrt(square)
        if worst < slowest[row] and (length > _FEW or least > 0.0):
            broken = broken or least > 0.0
            if length > _FEW:  # rows of one length: a distant joint and a near one count alike
                for j in range(n):
                    matrix[j, count] = gradients[row, j] * scale[j] / length
                matrix[n, count] = least / length
                count += 1
    for sign in (1.0, -1.0):
        for j in range(n):
            for i in range(n):
                matrix[i, count] = sign if i == j else 0.0
            least = (low[j] - wanted[j] if sign > 0.0 else wanted[j] - high[j]) / scale[j]
            matrix[n, count] = least
            broken = broken or least > 0.0
            count += 1
    return matrix[:, :count].copy(), scale, broken
