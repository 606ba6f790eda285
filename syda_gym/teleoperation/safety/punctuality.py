"""Punctuality: how late commands leave, and how fast a robot may be for that."""

from __future__ import annotations

import math

__all__ = ["GENTLE", "SPACING", "Punctuality"]

GENTLE = 0.7
"""Share of the greatest acceleration with which braking is planned; the rest is for commands that leave late."""

SPACING = 0.7
"""Share of the period by which two commands are kept apart at the least, where frames come unevenly."""

_RESERVE = 1.5  # how much later than ever lately a command may leave
_MEMORY = 5.0  # s for which a late command makes the robot slower, for every second lately in which one was late
_LONGEST_MEMORY = 40.0  # s
_LATELY = 60.0  # s
_LATE = 0.05  # periods; less is not counted as late
_CAUTION = 5.0  # s at the beginning in which nobody knows yet how late commands will be

Remembered = tuple[tuple[float, float], ...]
"""Times [s] and what was so then [s]; the first is what counts."""


class Punctuality:
    """Remembers how much later than planned commands left, and tells the speed at which that does no harm.

    A step that was planned for ``d`` seconds and leaves ``e`` seconds late is slower on the wire than it was meant:
    that looks, and is, like braking. With braking planned at a share of the limit ``a``, a joint whose speed ``v`` is
    at most

        a ((1 - share) d d / e + 1.5 d + e / 2)

    never brakes harder than ``a``, whether it was moving evenly or braking already. The least of this over all ``e`` up
    to the greatest seen lately times ``a`` is what a joint may do; it never falls below about two and a quarter times
    ``a d``, for a robot that slow may be kept waiting as long as one likes. What every command is late, the time that a
    decision takes, is not counted: intervals are not changed by it.

    Args:
        period: of the loop [s].

    Attributes:
        least: how late every command has left lately [s].
        seconds: a joint may be as fast as it gets in this time by its greatest acceleration [s].
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.least = 0.0
        self.seconds = math.inf
        self._latest: Remembered = ()  # how late, each less than those before
        self._soonest: Remembered = ()  # how late, each more than those before
        self._shortest: Remembered = ()  # steps, each longer than those before
        self._late_seconds: tuple[int, ...] = ()  # those of the last minute in which a command was late
        self._careful_until: float | None = None

    def saw(self, now: float, step: float, late: float, known: bool) -> None:
        """A command left.

        Args:
            now: the loop's clock [s].
            step: how long it was planned for [s].
            late: how much longer it took, at the most [s].
            known: whether the source knows when commands leave.
        """
        memory = self._memory(now, late - self.least)
        self._latest = (*(one for one in self._latest if one[1] > late and now - one[0] < memory), (now, late))
        self._soonest = (*(one for one in self._soonest if one[1] < late and now - one[0] < memory), (now, late))
        self._shortest = (*(one for one in self._shortest if one[1] < step and now - one[0] < memory), (now, step))
        self.least = max(0.0, self._soonest[0][1])
        worst, shortest = _RESERVE * (self._latest[0][1] - self.least), self._shortest[0][1]
        if known:
            self._careful_until = now + _CAUTION if self._careful_until is None else self._careful_until
            if now < self._careful_until:
                worst, shortest = max(worst, self._period), min(shortest, SPACING * self._period)
        self.seconds = self._harmless(shortest + self.least, worst)

    def _memory(self, now: float, extra: float) -> float:
        """How long a late command counts [s]."""
        second = math.floor(now)
        if extra > _LATE * self._period and second not in self._late_seconds:
            self._late_seconds = (*self._late_seconds, second)
        self._late_seconds = tuple(one for one in self._late_seconds if now - one < _LATELY)
        return min(_MEMORY * max(len(self._late_seconds), 1), _LONGEST_MEMORY)

    def _harmless(self, step: float, late: float) -> float:
        late = min(late, step * math.sqrt(2.0 * (1.0 - GENTLE)))  # more is not worse
        return math.inf if late <= 0.0 else (1.0 - GENTLE) * step * step / late + 1.5 * step + 0.5 * late
