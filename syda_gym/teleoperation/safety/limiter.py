"""CommandLimiter: the last gate before a robot: joint limits, coupled limits and joint speeds hold in every command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.coupled import coupled_range
from syda_gym.embodiments.robot import CoupledLimit, Robot
from syda_gym.errors import OptionError

if TYPE_CHECKING:
    from syda_gym.teleoperation.safety.stepping import Bounds

__all__ = ["UNKNOWN_SPEED", "CommandLimiter"]

UNKNOWN_SPEED = 2.0
"""Speed limit [rad/s] of a joint whose URDF names none."""

# Keeps the step below speed * dt after the rounding of adding it to the angle and subtracting it again.
_ROUNDING = 1.0 - 1e-9
_HALVINGS = 20
_INSIDE = 1e-12  # rad; so that rounding does not lead out of a coupled limit


class CommandLimiter:
    """Moves from one allowed command towards a wanted one, as far as limits and speeds permit.

    Given a previous command within all limits, the result is within all limits, and no joint moves faster than
    ``fraction * speed``. Where the two clash, because a joint's range shrinks faster than the joint may move, the joint
    that governs the range moves less.

    Args:
        robot: whose limits.
        fraction: share of the speed limits that may be used, in (0, 1].

    Raises:
        OptionError: ``fraction`` is not in (0, 1].
    """

    def __init__(self, robot: Robot, fraction: float = 1.0) -> None:
        if not 0.0 < fraction <= 1.0:
            raise OptionError(f"speed fraction must be in (0, 1], got {fraction}")
        self.robot = robot
        self.lower, self.upper = robot.lower, robot.upper
        self.speed: FloatArray = fraction * np.where(np.isfinite(robot.speed), robot.speed, UNKNOWN_SPEED)
        names = robot.joint_names
        self._coupled = tuple(
            _Coupled(names.index(row.joint), names.index(row.by), row)
            for row in robot.description.coupled_limits
            if row.joint in names and row.by in names
        )
        self._range = self.lower.tolist(), self.upper.tolist()

    def bounds(self, acceleration: FloatArray, jerk: FloatArray | None) -> Bounds:
        """All that bounds a step, as the compiled arithmetic takes it.

        Args:
            acceleration: greatest ``(n,)`` [rad/s^2].
            jerk: greatest ``(n,)`` [rad/s^3]; ``None`` if any will do.
        """
        from syda_gym.teleoperation.safety.stepping import Bounds

        most = np.full(len(self.lower), np.inf) if jerk is None else jerk
        rows = [self.lower, self.upper, self.speed, acceleration, most]
        return Bounds.of(rows, [(row.joint, row.by, row.row) for row in self._coupled])

    def start(self, angles: FloatArray) -> FloatArray:
        """The allowed command nearest to ``angles`` ``(n,)`` [rad]; where a run begins."""
        return np.ascontiguousarray(self.robot.clamp(angles)[0])

    def move(self, previous: FloatArray, wanted: FloatArray, dt: float, factor: float = 1.0) -> FloatArray:
        """The next command.

        Args:
            previous: the last command ``(n,)`` [rad], within all limits.
            wanted: where to go ``(n,)`` [rad], finite.
            dt: time since the last command [s]; nothing moves if it is not positive.
            factor: slows all joints, in [0, 1].

        Returns:
            A new array ``(n,)`` [rad].
        """
        time = max(dt, 0.0) * min(max(factor, 0.0), 1.0) * _ROUNDING
        # Plain floats: for a handful of joints numpy would spend its time on calling.
        before, steps, result = previous.tolist(), (self.speed * time).tolist(), []
        for start, goal, step, low, high in zip(before, wanted.tolist(), steps, *self._range, strict=True):
            value = start + min(max(goal - start, -step), step)
            result.append(min(max(value, low), high))
        if self._coupled:
            for row in self._coupled:
                row.apply(before, result, steps[row.joint])
            if not all(row.holds(result) for row in self._coupled):  # couplings that depend on each other
                result = before
        return np.array(result)

    def couple(self, previous: FloatArray, wanted: FloatArray, slack: FloatArray) -> FloatArray:
        """``wanted`` ``(n,)`` [rad] with coupled limits kept.

        Args:
            previous: the last command ``(n,)`` [rad], within all limits.
            wanted: the next one, within the plain limits.
            slack: how far each joint may move ``(n,)`` [rad].
        """
        before, result = previous.tolist(), wanted.tolist()
        for row in self._coupled:
            row.apply(before, result, float(slack[row.joint]))
        return np.array(result)

    def allows(self, angles: FloatArray) -> bool:
        """Whether ``angles`` ``(n,)`` [rad] lie within all limits."""
        inside = bool(((angles >= self.lower) & (angles <= self.upper)).all())
        return inside and all(row.holds(angles.tolist()) for row in self._coupled)


@dataclass(frozen=True, eq=False)
class _Coupled:
    """One coupled limit in plain floats: two scalar interpolations cost less than one numpy call."""

    joint: int
    by: int
    row: CoupledLimit

    def range(self, governor: float) -> tuple[float, float]:
        """Lower and upper limit of the joint at an angle of its governor."""
        return coupled_range(governor, self.row.at, self.row.lower, self.row.upper)

    def _inside(self, governor: float) -> tuple[float, float]:
        low, high = self.range(governor)
        margin = min(_INSIDE, 0.5 * (high - low))
        return low + margin, high - margin

    def holds(self, q: Sequence[float]) -> bool:
        low, high = self.range(q[self.by])
        return low <= q[self.joint] <= high

    def apply(self, previous: Sequence[float], q: list[float], slack: float) -> None:
        """Moves the joint into its range; if it is too slow for that, holds the governor back.

        Args:
            previous: the last command.
            q: the next one, changed in place.
            slack: how far the joint may move.
        """
        value, governor, before = q[self.joint], q[self.by], previous[self.joint]
        low, high = self._inside(governor)
        inside = min(max(value, low), high)
        if abs(inside - before) > slack:
            start = previous[self.by]
            share, width = 0.0, 1.0
            for _ in range(_HALVINGS):
                width *= 0.5
                low, high = self._inside(start + (share + width) * (governor - start))
                if abs(min(max(value, low), high) - before) <= slack:
                    share += width
            q[self.by] = start + share * (governor - start)
            low, high = self._inside(q[self.by])
            inside = min(max(value, low), high)
        q[self.joint] = inside
