"""The live clock: seconds that never go back and count the time that a machine sleeps."""

from __future__ import annotations

import time

__all__ = ["clock"]


def clock() -> float:
    """Seconds since some moment; the time that a laptop was suspended counts, where the system can tell."""
    if _BOOTTIME is None:
        return time.monotonic()
    return time.clock_gettime(_BOOTTIME)


_BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)
