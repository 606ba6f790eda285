"""Pace: how fast the robot really moves, told by when its commands left, and how much faster or slower it may get."""

from __future__ import annotations

import copy

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.teleoperation.safety.punctuality import GENTLE, Punctuality

__all__ = ["Pace", "braking_speed"]

_TINY = 1e-6  # s; commands this close together count as one
_STALL = 2.0  # periods without a command after which the robot stands still
_LONGEST = 1.5  # periods; no step is planned for longer


class Pace:
    """Keeps the velocity of a stream of commands whose intervals are never quite even.

    What a robot feels is how far its commands are apart when they *arrive*. A busy machine sends one late and the next
    on time, and what was a slow step by the loop's own clock is a fast one on the wire. So velocities here are
    differences of commands over the time between their sendings, and a step may last as long as has passed since the
    last command had left: the interval on the wire is never shorter. The velocity of an interval counts for its middle;
    two of them are half of both intervals apart, which is the time in which it may change.

    When exactly a command left is known to lie between two looks at the clock. Getting faster counts from the slowest
    that the robot may be, getting slower from the fastest.

    Args:
        period: of the loop [s].
        joints: number of joints.

    Attributes:
        velocity: of the last command at the least ``(n,)`` [rad/s]; zero if nothing came for so long that it stands.
        acceleration: of the last command ``(n,)`` [rad/s^2].
        dt: how long the next step may last [s].
        change: how much time the velocity has to change [s].
        punctuality: how late commands leave.
    """

    def __init__(self, period: float, joints: int) -> None:
        self._period = period
        self.velocity = np.zeros(joints)
        self.acceleration = np.zeros(joints)
        self.dt = 0.0
        self.change = 0.0
        self.punctuality = Punctuality(period)
        self._was = np.zeros(joints)  # the velocity of the last command by the wire, even if that was long ago
        self._faster = 1.0  # how many times faster it may have been
        self._lasts = 0.0  # how long the next step will last on the wire [s]
        self._braking = 0.0  # how much time the velocity has to fall [s]
        self._stalled = False  # whether it stands because nothing came
        self._step = np.zeros(joints)  # the last command less the one before
        self._planned = np.zeros(joints)
        self._before: float | None = None  # when the command before the last one had left
        self._first: float | None = None  # when it left at the earliest
        self._last: float | None = None  # when the last one had left
        self._last_first = 0.0

    def begin(self, now: float, left: float | None, leaving: float | None = None) -> None:
        """A command is to be found at ``now`` [s].

        Args:
            now: the loop's clock.
            left: when the last command had left, at the latest, on the same clock; if not known, when it was decided.
            leaving: when it left at the earliest; if not known, at ``left``.
        """
        if self._last is None:
            self.dt = self.change = 0.0
            return
        last = self._last if left is None else min(max(left, self._last), now)
        first = last if leaving is None else min(max(leaving, self._last), last)
        passed = now - last
        if self._first is not None and self.dt > 0.0:
            self.punctuality.saw(now, self.dt, last - self._first - self.dt, left is not None)
        self.dt = min(passed, _LONGEST * self._period)
        # Without a history, as if the robot had stood still for a period.
        longest = self._period if self._first is None else last - self._first
        shortest = self._period if self._before is None else max(first - self._before, 0.0)
        # The slower of what it may have been: getting faster is what harms.
        self.velocity = self._was = self._step / longest if longest > _TINY else self._planned
        self._faster = longest / shortest if shortest > _TINY else 1.0
        self.change = 0.5 * (shortest + self.dt)
        self._lasts = now - first + self.punctuality.least
        self._braking = 0.5 * (shortest + self._lasts)
        self._stalled = passed > _STALL * self._period
        if self._stalled:  # nothing came for so long that the robot has come to rest
            self.velocity = np.zeros_like(self.velocity)
            self.acceleration = np.zeros_like(self.velocity)
            self.change = self.dt
        self._last, self._last_first = last, first

    @property
    def idle(self) -> bool:
        """Whether no time has passed in which to move."""
        return self.dt <= _TINY

    def slowed(self, most: FloatArray, alike: bool = False) -> FloatArray:
        """Velocities ``(n,)`` [rad/s] of a step that gets slower by ``most`` ``(n,)`` [rad/s^2] by what the wire sees.

        The step lasts longer than it was planned for; else that would look like more braking. None is faster than the
        one before.

        Args:
            most: deceleration.
            alike: all joints in proportion, so that a straight line stays one.
        """
        speed = np.maximum(self._faster * np.abs(self._was), _TINY)
        kept = np.maximum(1.0 - most * self._braking / speed, 0.0)
        if alike:
            kept = np.full(len(kept), kept.min(where=self._was != 0.0, initial=1.0))
        share = kept * self._faster * self._lasts / max(self.dt, _TINY)
        result: FloatArray = self._was * np.minimum(share, 1.0)
        return result

    def tempering(self, most: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What a wire that is not punctual leaves of a step: a velocity not to fall below, and a greatest speed.

        Below the first, joints ``(n,)`` [rad/s] would brake harder than ``most`` ``(n,)`` [rad/s^2] by what the wire
        sees. Faster than the second ``(n,)`` [rad/s], a late command would do harm. After a stall, it is also what the
        wire lets a robot have that turns round: it sees the step before the stall and the one after it, and not that
        the robot stood still between them.
        """
        slowed, limit = self.slowed(most), most / GENTLE
        harmless = limit * self.punctuality.seconds
        if self._stalled:
            turned = (limit * self._braking - self._faster * np.abs(self._was)) * self._lasts / max(self.dt, _TINY)
            harmless = np.minimum(harmless, np.maximum(turned, 0.0))
        return slowed, np.maximum(harmless, np.abs(slowed))

    def end(self, now: float, step: FloatArray) -> None:
        """The command was found: the last one plus ``step`` ``(n,)`` [rad]."""
        if self._last is None:
            self._last = self._last_first = now
            return
        if self.idle:  # one command sent twice
            return
        planned = step / self.dt
        self.acceleration = (planned - self.velocity) / max(self.change, _TINY)
        self._before, self._first = self._last, self._last_first
        self._last = self._last_first = now
        self._step, self._planned = step, planned

    def rest(self) -> None:
        """The robot has been stopped, or put somewhere: it does not move.

        A stop does not wait for its turn. Counted as a step, one so short would make the robot slow for as long as late
        commands are remembered.
        """
        self.velocity = self._was = np.zeros_like(self.velocity)
        self.acceleration = np.zeros_like(self.velocity)
        self._step, self._planned = np.zeros_like(self.velocity), np.zeros_like(self.velocity)
        self.dt = 0.0

    def twin(self) -> Pace:
        """A copy whose steps change nothing of this one."""
        twin = copy.copy(self)
        twin.punctuality = copy.copy(self.punctuality)
        return twin


def braking_speed(distance: FloatArray, most: FloatArray, delay: float | FloatArray) -> FloatArray:
    """The speed ``(n,)`` [rad/s] from which a joint can still stop within a distance.

    Args:
        distance: ``(n,)`` [rad], not negative.
        most: deceleration ``(n,)`` [rad/s^2].
        delay: time that passes before the braking begins [s].
    """
    result: FloatArray = most * (np.sqrt(delay * delay + 2.0 * distance / most) - delay)
    return result
