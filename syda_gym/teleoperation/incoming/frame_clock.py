"""FrameClock: how much time passed from one frame of a stream to the next."""

from __future__ import annotations

__all__ = ["FrameClock"]

_TOLERANCE = 0.25  # s; how much longer than ours the sender's interval may be


class FrameClock:
    """Time between frames by the sender's clock, which knows neither network jitter nor a busy receiver.

    Our own clock counts where the sender tells no time, where its clock stands still or goes back, and where it runs
    ahead of ours, as one that counts milliseconds does.

    Attributes:
        time: all that has passed between frames [s].
    """

    def __init__(self) -> None:
        self.time = 0.0
        self._now: float | None = None
        self._sent: float | None = None

    def advance(self, now: float, sent: float | None) -> float:
        """A frame came; returns the time since the one before [s], 0 for the first.

        Args:
            now: the loop's clock [s].
            sent: the sender's time of the frame [s], or ``None``.
        """
        before, sent_before = self._now, self._sent
        self._now, self._sent = now, sent
        if before is None:
            return 0.0
        passed = now - before
        if sent is not None and sent_before is not None and 0.0 < sent - sent_before <= passed + _TOLERANCE:
            passed = sent - sent_before
        self.time += passed
        return passed
