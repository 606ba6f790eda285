"""stepping: the arithmetic of one step of ``Motion``, in compiled plain loops."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.limb_ik.compiling import compiled

__all__ = ["Bounds", "ahead", "apart", "drifted", "intention", "settle"]

_SLACK = 1e-12  # rad; rounding of a coupled limit, which is taken off
_LOOK = 0.02  # rad; how far apart the looked-at poses of a way to a standstill are


class Bounds(NamedTuple):
    """What bounds a robot's steps; few arrays, because each costs half a microsecond a call.

    Attributes:
        joints: lower and upper limits [rad], greatest speed, acceleration and jerk (infinite if any will do)
            ``(5, n)``.
        coupled: the governed and the governing joint of each coupled limit, the first of its rows in the table, and the
            one past its last ``(c, 4)``.
        table: governor's angle, lower and upper limit ``(rows, 3)`` [rad].
    """

    joints: FloatArray
    coupled: NDArray[np.int64]
    table: FloatArray

    @classmethod
    def of(cls, joints: list[Any], coupled: list[tuple[int, int, Any]]) -> Bounds:
        """From the five rows, and joint, governor and limit of every coupled limit."""
        rows: list[tuple[int, int, int, int]] = []
        table: list[tuple[float, float, float]] = []
        for joint, governor, limit in coupled:
            first = len(table)
            table += zip(limit.at, limit.lower, limit.upper, strict=True)
            rows.append((joint, governor, first, len(table)))
        return cls(
            np.array(joints, dtype=np.float64),
            np.array(rows, dtype=np.int64).reshape(-1, 4),
            np.array(table, dtype=np.float64).reshape(-1, 3),
        )


@compiled
def _clipped(value, low, high):
    """As numpy's: the upper bound wins."""
    return min(max(value, low), high)


@compiled
def _braking(distance, most, delay):
    """As ``pace.braking_speed``."""
    return most * (math.sqrt(delay * delay + 2.0 * distance / most) - delay)


@compiled
def intention(bounds, state, target, dt, change, factor):
    """Least and greatest velocity that speed, acceleration, jerk and limits ahead permit, and the wanted one (3, n).

    The wanted velocity arrives at the target as soon as possible and does not overshoot it. Rows of ``state``: the last
    command, its velocity and acceleration, the target's velocity, and the two of ``Pace.tempering``.
    """
    n = len(target)
    result = np.empty((3, n))
    share = min(max(factor, 0.0), 1.0)
    for j in range(n):
        lower, upper, speed = bounds.joints[0, j], bounds.joints[1, j], bounds.joints[2, j]
        most, jerk = bounds.joints[3, j], bounds.joints[4, j]
        command, velocity, acceleration, drift = state[0, j], state[1, j], state[2, j], state[3, j]
        slowest, fastest = velocity - most * change, velocity + most * change
        low, high = slowest, fastest  # to come down from a speed that has become too high counts more
        lag = dt
        if jerk < math.inf:
            swing = jerk * change
            low = max(low, min(velocity + (acceleration - swing) * change, high))
            high = min(high, max(velocity + (acceleration + swing) * change, low))
            lag = dt + 0.5 * most / jerk
        cap = share * speed * (1.0 - 1e-9)
        high = max(min(high, cap), slowest)
        low = min(max(low, -cap), fastest)
        low, high = min(low, high), max(low, high)
        slowed, harmless = state[4, j], state[5, j]
        low, high = max(low, -harmless), min(high, harmless)
        if slowed > 0.0:
            low = max(low, slowed)
            high = max(high, slowed)
        elif slowed < 0.0:
            high = min(high, slowed)
            low = min(low, slowed)
        way = target[j] - command
        reach = _braking(abs(way - drift * dt), most, lag)
        wanted = _clipped(way / dt, drift - reach, drift + reach)
        below = _braking(max(command - lower, 0.0), most, dt)
        above = _braking(max(upper - command, 0.0), most, dt)
        # What slides must be able to stop before a limit, too.
        result[0, j], result[1, j] = _clipped(-below, low, high), _clipped(above, low, high)
        result[2, j] = _clipped(_clipped(wanted, -below, above), low, high)
    return result


@compiled
def _coupled_range(bounds, which, governor):
    """As ``coupled_range`` of the kinematics, bit for bit."""
    first, last = bounds.coupled[which, 2], bounds.coupled[which, 3] - 1
    if not governor > bounds.table[first, 0]:
        return bounds.table[first, 1], bounds.table[first, 2]
    if governor >= bounds.table[last, 0]:
        return bounds.table[last, 1], bounds.table[last, 2]
    i = first
    while bounds.table[i + 1, 0] <= governor:
        i += 1
    step, width = governor - bounds.table[i, 0], bounds.table[i + 1, 0] - bounds.table[i, 0]
    return (
        (bounds.table[i + 1, 1] - bounds.table[i, 1]) / width * step + bounds.table[i, 1],
        (bounds.table[i + 1, 2] - bounds.table[i, 2]) / width * step + bounds.table[i, 2],
    )


@compiled
def settle(bounds, poses, row):
    """Whether a pose lies within all limits, coupled ones included, once what rounding adds to those is taken off."""
    for j in range(poses.shape[1]):
        if not (bounds.joints[0, j] <= poses[row, j] <= bounds.joints[1, j]):
            return False
    for which in range(len(bounds.coupled)):
        joint = bounds.coupled[which, 0]
        low, high = _coupled_range(bounds, which, poses[row, bounds.coupled[which, 1]])
        if not (low - _SLACK <= poses[row, joint] <= high + _SLACK):
            return False
        poses[row, joint] = _clipped(poses[row, joint], low, high)
    return True


@compiled
def ahead(bounds, command, velocity, dt):
    """The pose after a step and those on the way to a standstill from there ``(1 + k, n)``; whether all are allowed.

    Each joint brakes for itself.
    """
    n = len(command)
    longest, farthest = 0.0, 0.0
    for j in range(n):
        speed = abs(velocity[j])
        takes = speed / bounds.joints[3, j]
        longest, farthest = max(longest, takes), max(farthest, 0.5 * speed * takes)
    count = math.ceil(farthest / _LOOK)
    poses = np.empty((1 + count, n))
    for j in range(n):
        lower, upper, most = bounds.joints[0, j], bounds.joints[1, j], bounds.joints[3, j]
        end = _clipped(command[j] + velocity[j] * dt, lower, upper)
        poses[0, j] = end
        speed = abs(velocity[j])
        takes = speed / most
        for row in range(1, 1 + count):
            time = min(takes, longest * row / count)
            way = time * (speed - 0.5 * most * time)
            poses[row, j] = _clipped(end + way if velocity[j] > 0.0 else end - way, lower, upper)
    for row in range(1 + count):
        if not settle(bounds, poses, row):
            return poses, False
    return poses, True


@compiled
def apart(a, b):
    """The greatest distance of two poses' joints [rad]."""
    most = 0.0
    for j in range(len(a)):
        most = max(most, abs(a[j] - b[j]))
    return most


@compiled
def drifted(bounds, target, before, last, dt):
    """The target's velocity, and what it was by the last two targets alone ``(2, n)`` [rad/s].

    What moved once may have jumped; a velocity is what two steps have in common.
    """
    result = np.empty((2, len(target)))
    for j in range(len(target)):
        drift = (target[j] - before[j]) / dt
        common = 0.0
        if drift * last[j] > 0.0:
            common = min(abs(drift), abs(last[j]))
            common = common if drift > 0.0 else -common
        result[0, j] = _clipped(common, -bounds.joints[2, j], bounds.joints[2, j])
        result[1, j] = drift
    return result
