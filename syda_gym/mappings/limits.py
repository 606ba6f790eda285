"""Joint speed limits for sequences: a causal filter that leaves motions within the limits untouched."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError

__all__ = ["SpeedLimiter", "limit_speed", "speed_violations"]

_SLACK = 1e-12  # rad; rounding of q + (t - q) must not count as motion beyond the limit


class SpeedLimiter:
    """Moves joint angles towards a target as fast as the speed limits allow, one frame at a time.

    The step is ``q += clip(target - q, -v dt, v dt)`` per joint. Hence a target that itself obeys the limits is
    reached exactly in every frame (no lag), and a faster one is followed at full speed.

    Args:
        robot: whose limits hold.
        fps: frames per second.

    Raises:
        OptionError: ``fps`` is not positive.
    """

    def __init__(self, robot: Robot, fps: float) -> None:
        if not (np.isfinite(fps) and fps > 0):
            raise OptionError(f"fps must be positive, got {fps}")
        self.robot = robot
        self._step = robot.speed / float(fps)
        self._last: FloatArray | None = None

    def reset(self, frame: ArrayLike | None = None) -> None:
        """Starts anew, at ``frame`` ``(n,)`` [rad] or wherever the next target is."""
        self._last = None if frame is None else self.robot.clamp(np.asarray(frame, dtype=np.float64))[0]

    def __call__(self, target: ArrayLike) -> FloatArray:
        """The next joint angles ``(n,)`` [rad] on the way to ``target`` ``(n,)``."""
        goal = self.robot.clamp(np.asarray(target, dtype=np.float64))[0]
        if self._last is None:
            self._last = np.asarray(goal, dtype=np.float64)
            return self._last
        step = goal - self._last
        if (np.abs(step) <= self._step + _SLACK).all():
            self._last = np.asarray(goal, dtype=np.float64)
            return self._last
        moved = self._last + np.clip(step, -self._step, self._step)
        # A coupled limit may have moved with its governing joint; the governed joint follows it.
        self._last = np.asarray(self.robot.clamp(moved)[0], dtype=np.float64)
        return self._last


def limit_speed(robot: Robot, frames: ArrayLike, fps: float) -> FloatArray:
    """Applies ``SpeedLimiter`` to a whole sequence.

    Args:
        robot: whose limits hold.
        frames: ``(N, n)`` joint angles [rad] of one clip in time order.
        fps: frames per second.

    Returns:
        ``(N, n)`` [rad].
    """
    q = robot.clamp(robot.check(frames))
    if not speed_violations(robot, q, fps).any():
        return q
    limiter = SpeedLimiter(robot, fps)
    return np.stack([limiter(frame) for frame in q])


def speed_violations(robot: Robot, frames: ArrayLike, fps: float) -> NDArray[np.bool_]:
    """Which steps between frames exceed the joint speed limits, ``(N - 1, n)`` boolean."""
    q = robot.check(frames)
    result: NDArray[np.bool_] = np.abs(np.diff(q, axis=0)) * float(fps) > robot.speed * (1.0 + 1e-9)
    return result
