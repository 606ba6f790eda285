"""Anticipation: ready when the next frame comes."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from statistics import median

from syda_gym.teleoperation.incoming.inbox import Received
from syda_gym.teleoperation.incoming.sources import Source

__all__ = ["Anticipation"]

_INTERVALS = 9  # of which the median is the stream's period
_OUTLIERS = 2  # of these intervals, for lost frames
_EARLY = 3e-4  # s; least time before a frame is due at which one is ready for it
_LATE = 1.5e-3  # s; how long after that one watches
_UNEVEN = 3e-3  # s; streams whose intervals differ by more have no rhythm to wait for


class Anticipation:
    """Takes frames from a source and is awake when they come.

    Between two frames a processor falls asleep and its caches fill with other things, so that a frame at 30 Hz takes
    several times as long as one of many in a row. Where frames come evenly, this wakes up just before the next one is
    due, goes through the motions once and then watches for it without sleeping, for about a tenth of the time. A source
    with a thread of its own is not watched, for that would keep the thread from running.

    Args:
        source: started.
        rehearse: what to do before a frame; it must change nothing.
    """

    def __init__(self, source: Source, rehearse: Callable[[], None]) -> None:
        self.source = source
        self._rehearse = rehearse
        self._intervals: deque[float] = deque(maxlen=_INTERVALS)
        self._takes = _LATE  # s; a running mean of what waking up and a rehearsal take
        self._last: float | None = None

    def take(self, timeout: float) -> Received:
        """Waits up to ``timeout`` seconds for a frame or a request and takes it; empty-handed after that."""
        received = self._wait(timeout)
        if received.packet is not None:
            now = time.monotonic()
            if self._last is not None:
                self._intervals.append(now - self._last)
            self._last = now
        return received

    def _wait(self, timeout: float) -> Received:
        end = time.monotonic() + timeout
        due, spread = self._due()
        ready = due - max(_EARLY, 2.0 * spread) - self._takes
        if ready > end:
            return self.source.take(timeout)
        received = self.source.take(max(0.0, ready - time.monotonic()))
        if not self._came(received) and time.monotonic() < due:
            self._rehearse()
            self._takes += 0.1 * (time.monotonic() - ready - self._takes)  # waking up included
            if not self.source.threaded:
                received = self._watch(min(due + _LATE, end))
        return received if self._came(received) else self.source.take(max(0.0, end - time.monotonic()))

    def _watch(self, end: float) -> Received:
        received = self.source.take(0.0)
        while not self._came(received) and time.monotonic() < end:
            received = self.source.take(0.0)
        return received

    def _due(self) -> tuple[float, float]:
        """When the next frame should come, give or take how much; infinitely late if there is no telling."""
        if self._last is None or len(self._intervals) < _INTERVALS:
            return math.inf, 0.0
        period = median(self._intervals)
        spread = sorted(abs(interval - period) for interval in self._intervals)[-1 - _OUTLIERS]
        return (self._last + period if spread <= _UNEVEN else math.inf), spread

    def _came(self, received: Received) -> bool:
        return received.packet is not None or bool(received.controls) or self.source.inbox.closed
