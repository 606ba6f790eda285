"""closed_form: the poses that point both limbs of an arm without regard to its limits, in compiled plain loops.

``unit`` makes the limbs' directions.
"""

from __future__ import annotations

import math

import numpy as np

from syda_gym.embodiments.limb_ik.compiling import compiled, copy

__all__ = ["closed_form", "unit"]

_TURN = 2.0 * math.pi


@compiled
def _wrapped(angle, lower, upper):
    """The angle by whole turns within half a turn of mid-range."""
    start = 0.5 * (lower + upper) - math.pi
    turns = angle - start
    return start + turns - _TURN * math.floor(turns / _TURN)


@compiled
def _two_turns(turn, goal, angles):
    """Both pairs of angles about two axes that bring a direction onto ``goal``; ``False`` if only near it.

    The second Paden-Kahan subproblem (Murray, Li, Sastry, *A Mathematical Introduction to Robotic Manipulation*, 1994,
    section 3.2). Rows of ``turn``: first axis, second axis, beside, across; then cosine, start, offset.
    """
    first, beside, across = turn[0], turn[2], turn[3]
    cosine, start, offset = turn[4, 0], turn[4, 1], turn[4, 2]
    span = 1.0 - cosine * cosine
    along = goal[0] * first[0] + goal[1] * first[1] + goal[2] * first[2]
    alpha, beta = (along - cosine * start) / span, (start - cosine * along) / span
    square = (1.0 - alpha * alpha - beta * beta - 2.0 * alpha * beta * cosine) / span
    # Beyond reach, the nearest point of the circle that the inner turn describes.
    gamma = math.sqrt(square * span) if square > 0.0 else 0.0
    aim = math.atan2(
        goal[0] * across[0] + goal[1] * across[1] + goal[2] * across[2],
        goal[0] * beside[0] + goal[1] * beside[1] + goal[2] * beside[2],
    )
    root = math.sqrt(span)
    outer, inner = math.atan2(gamma, beta * root), math.atan2(gamma, alpha * root)
    angles[0, 0], angles[0, 1] = aim - outer, -inner - offset
    angles[1, 0], angles[1, 1] = aim + outer, inner - offset
    return square >= 0.0


@compiled
def _turned_back(turn, a, b, vector, result):
    """Undoes a turn by ``a`` about the first axis, then one by ``b`` about the second."""
    x, y, z = vector[0], vector[1], vector[2]
    for row in range(2):
        u, v, w = turn[row, 0], turn[row, 1], turn[row, 2]
        angle = a if row == 0 else b
        c, s = math.cos(angle), math.sin(angle)
        along = (u * x + v * y + w * z) * (1.0 - c)
        x, y, z = (
            x * c + (y * w - z * v) * s + u * along,
            y * c + (z * u - x * w) * s + v * along,
            z * c + (x * v - y * u) * s + w * along,
        )
    result[0], result[1], result[2] = x, y, z


@compiled
def closed_form(arm, target, starts):
    """The four closed-form poses without regard to limits, in the first four rows of ``starts``."""
    elbows, wrists, turned = np.empty((2, 2)), np.empty((2, 2)), np.empty(3)
    _two_turns(arm.turns[0], target[:3], elbows)
    for e in range(2):
        _turned_back(arm.turns[0], elbows[e, 0], elbows[e, 1], target[3:], turned)
        _two_turns(arm.turns[1], turned, wrists)
        for w in range(2):
            row = starts[2 * e + w]
            copy(arm.rest, row)
            for index in range(4):
                j = arm.closed[index]
                angle = elbows[e, index] if index < 2 else wrists[w, index - 2]
                row[j] = _wrapped(angle, arm.lower[j], arm.upper[j])


@compiled
def unit(vectors, shortest, result):
    """Vectors (N, 3) of length one; whether all were finite and no shorter than that."""
    sound = True
    for row in range(len(vectors)):
        x, y, z = vectors[row, 0], vectors[row, 1], vectors[row, 2]
        length = math.sqrt(x * x + y * y + z * z)
        sound = sound and length >= shortest and length < math.inf
        result[row, 0], result[row, 1], result[row, 2] = x / length, y / length, z / length
    return sound
