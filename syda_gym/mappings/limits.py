"""Joint speed limits for sequences: a causal filter that leaves motions within the limits untouched."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError

__all__ = ["SpeedLimiter", "limit_speed", "speed_violations", "step_towards"]

_SLACK = 1e-12  # rad; rounding of q + (t - q) must not count as motion beyond the limit


class SpeedLimiter:
    """Moves joint angles towards a target as fast as the speed limits allow, one frame at a time.

    A target that itself obeys the limits is reached exactly in every frame (no lag), and a faster one is followed at
    full speed, see ``step_towards``.

    Args:
        robot: whose limits hold.
        fps: frames per second.

    Raises:
        OptionError: ``fps`` is not positive.
    """

    def __init__(self, robot: Robot, fps: float) -> None:
        _step(robot, fps)
        self.robot, self.fps = robot, fps
        self._last: FloatArray | None = None

    def reset(self, frame: ArrayLike | None = None) -> None:
        """Starts anew, at ``frame`` ``(n,)`` [rad] or wherever the next target is."""
        self._last = None if frame is None else self.robot.clamp(np.asarray(frame, dtype=np.float64))

    def __call__(self, target: ArrayLike) -> FloatArray:
        """The next joint angles ``(n,)`` [rad] on the way to ``target`` ``(n,)``."""
        goal = self.robot.clamp(np.asarray(target, dtype=np.float64))
        self._last = goal if self._last is None else step_towards(self.robot, self._last, goal, self.fps)
        return np.asarray(self._last[0])


def step_towards(robot: Robot, last: FloatArray, goal: FloatArray, fps: float) -> FloatArray:
    """One frame on the way to a goal: per joint ``q += clip(goal - q, -v dt, v dt)``.

    Args:
        robot: whose limits hold.
        last: ``(B, n)`` joint angles [rad] of the frame before.
        goal: ``(B, n)`` joint angles [rad] within the joint limits; joints that can reach them do so exactly.
        fps: frames per second.

    Returns:
        ``(B, n)`` [rad]; no row depends on another.
    """
    most = _step(robot, fps)
    step = goal - last
    near = np.abs(step) <= most + _SLACK
    if near.all():
        return goal
    # A coupled limit may have moved with its governing joint; the governed joint follows it.
    return robot.clamp(np.where(near, goal, last + np.clip(step, -most, most)))


def limit_speed(robot: Robot, frames: ArrayLike, fps: float) -> FloatArray:
    """Applies ``SpeedLimiter`` to whole clips.

    Args:
        robot: whose limits hold.
        frames: ``(N, n)`` joint angles [rad] of one clip in time order, or ``(B, N, n)`` for clips of one length.
        fps: frames per second.

    Returns:
        As many joint angles [rad]; a clip does not depend on the others.
    """
    given = np.asarray(frames, dtype=np.float64)
    q = robot.clamp(robot.check(given.reshape(-1, given.shape[-1]))).reshape(given.shape)
    if (np.abs(np.diff(q, axis=-2)) <= _step(robot, fps) + _SLACK).all():
        return q
    clips: FloatArray = q.reshape(-1, *q.shape[-2:])
    _limit_clips(robot, clips, fps)
    return clips.reshape(q.shape)


def speed_violations(robot: Robot, frames: ArrayLike, fps: float) -> NDArray[np.bool_]:
    """Which steps between frames exceed the joint speed limits, ``(N - 1, n)`` boolean."""
    q = robot.check(frames)
    result: NDArray[np.bool_] = np.abs(np.diff(q, axis=0)) * float(fps) > robot.speed * (1.0 + 1e-9)
    return result


def _limit_clips(robot: Robot, clips: FloatArray, fps: float) -> None:
    """``step_towards`` from frame to frame of clips ``(B, N, n)``, in place; compiled, for resets wait for it."""
    from syda_gym.embodiments.limb_ik.compiling import first_call
    from syda_gym.mappings.limit_kernel import limit_clips

    coupled = robot._coupled
    at, low, high = (np.concatenate([np.zeros(0), *[row[part] for row in coupled]]) for part in (2, 3, 4))
    first_call(
        limit_clips,
        clips,
        _step(robot, fps),
        _SLACK,
        robot.lower,
        robot.upper,
        np.array([row[0] for row in coupled], dtype=np.int64),
        np.array([row[1] for row in coupled], dtype=np.int64),
        np.cumsum([0, *[len(row[2]) for row in coupled]]).astype(np.int64),
        at,
        low,
        high,
    )


def _step(robot: Robot, fps: float) -> FloatArray:
    """How far each joint gets in one frame [rad].

    Raises:
        OptionError: ``fps`` is not positive.
    """
    if not (np.isfinite(fps) and fps > 0):
        raise OptionError(f"fps must be positive, got {fps}")
    return robot.speed / float(fps)
