"""Times of frames: their unit is found by what rate of frames it gives, and said aloud where two units are likely.

A column called *timestamp* holds seconds, milliseconds, microseconds, ticks of 100 ns (Kinect, .NET) or nanoseconds.
Only microseconds and ticks are a factor of ten apart; there the rate decides: people are recorded at 30 frames per
second, less often at 60, 25, 100 or 120, hardly ever at 3 or 300. A date (seconds since 1970, ticks since year 1 or
1601) decides before that.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["CLOCKS", "UNITS", "Stamps", "clock_unit", "past_midnight", "seconds", "timecodes"]

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ticks": 1e-7, "ns": 1e-9}
"""Units of time, in seconds."""

CLOCKS: dict[str, str | None] = {
    "time": None, "times": None, "timestamp": None, "timestamps": None, "t": None, "clock": None, "stamp": None,
    "relativetime": None, "captime": None, "devicetime": None, "systemtime": None, "elapsed": None, "datetime": None,
    "date": None, "sec": "s", "secs": "s", "second": "s", "seconds": "s", "millis": "ms", "msec": "ms", "ms": "ms",
    "millisecond": "ms", "milliseconds": "ms", "us": "us", "usec": "us", "micros": "us", "microseconds": "us",
    "ns": "ns",
    "nsec": "ns", "nanoseconds": "ns", "ticks": "ticks", "zeit": None, "temps": None,
    "tiempo": None, "tempo": None, "timecode": None, "smpte": None, "tc": None,
}  # fmt: skip
"""How columns of time are called, with the unit where the name says it."""

_ENDINGS = {"s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms", "milliseconds": "ms",
"us": "us",
            "usec": "us", "microseconds": "us", "ns": "ns", "nsec": "ns", "ticks": "ticks"}  # fmt: skip
_BEGINNINGS = {"time", "times", "timestamp", "timestamps", "t", "clock", "elapsed", "frametime", "device", "system",
               "zeit", "temps"}  # fmt: skip
_WORDS = {"in", "time", "timestamp", "stamp", "of", "frame", "frametime"}

# Rates at which people are recorded, and how much more likely than others they are (in units of the natural logarithm).
_USUAL = {30.0: 1.2, 60.0: 1.0, 25.0: 0.7, 24.0: 0.5, 15.0: 0.7, 50.0: 0.6, 100.0: 0.6, 120.0: 0.8, 10.0: 0.5,
20.0: 0.4,
          12.0: 0.1, 90.0: 0.3, 200.0: 0.2, 240.0: 0.3, 125.0: 0.1, 150.0: 0.1}  # fmt: skip
_SLOWEST, _FASTEST = 0.1, 1_500.0
_DAY = 86_400.0  # s
_TIMECODE = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})[:;.,](\d{1,3})$")
_FILM_RATES = (24, 25, 30, 48, 50, 60, 100, 120, 240)  # frames that a second of a timecode may have
_SURE = 0.9  # how much likelier the best unit must be than the next
_DATES = (  # what a date between 2000 and 2100 is in seconds: since 1970, 1601 and year 1
    (9.46e8, 4.11e9), (1.259e10, 1.575e10), (6.308e10, 6.624e10),
)  # fmt: skip


@dataclass(frozen=True)
class Stamps:
    """Times as they stand in a file.

    Attributes:
        values: ``(N,)``.
        unit: one of ``UNITS`` where the file says it, ``None`` where it has to be found.
        name: what the file calls them, for messages.
    """

    values: FloatArray
    unit: str | None = None
    name: str = "timestamp"


def clock_unit(name: str) -> tuple[bool, str | None]:
    """Whether a column of this name holds times, and their unit where the name says it."""
    words = [word for word in "".join(c if c.isalnum() else " " for c in name.lower()).split() if word]
    joined = "".join(words)
    if joined in CLOCKS:
        return True, CLOCKS[joined]
    if len(words) > 1 and words[0] in _BEGINNINGS and words[-1] in _ENDINGS and set(words[1:-1]) <= _WORDS:
        return True, _ENDINGS[words[-1]]
    if len(words) > 1 and words[-1] in ("timestamp", "time", "stamp") and set(words[:-1]) <= {"frame", "device",
    "system",
                                                                                            "capture",
                                                                                            "relative"}:  # fmt: skip
        return True, None
    return False, None


def seconds(stamps: Stamps) -> tuple[FloatArray | None, str | None]:
    """Times in seconds.

    Returns:
        ``(N,)`` [s], or ``None`` if the values count frames and are no times; and a doubt to say aloud, if there is
        one.
    """
    values = np.asarray(stamps.values, dtype=np.float64)
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    if len(known) < 2 or not (steps > 0).any():
        return values * UNITS[stamps.unit or "s"], None
    if stamps.unit is None and _counts(known, steps):
        return None, None
    step = _typical(known, steps)
    scores = sorted(((_score(step * size, known, size), unit) for unit, size in UNITS.items()), reverse=True)
    best, unit = scores[0]
    doubt = None
    if stamps.unit is not None:
        said = UNITS[stamps.unit]
        rate = 1.0 / (step * said)
        if 1.0 <= rate <= 1_000.0 or best == -np.inf or stamps.unit == unit:
            unit = stamps.unit
            if rate < 5.0:
                doubt = f"{rate:.3g} frames per second by its {stamps.name}, which is slow; --fps says another rate"
        else:
            doubt = (
                f"{stamps.name} gives {rate:.3g} frames per second, which nobody records; taken as {_words(unit)}, "
                f"which gives {1.0 / (step * UNITS[unit]):.3g}"
            )
    elif best > -np.inf and scores[1][0] > best - _SURE:
        other = scores[1][1]
        doubt = (
            f"{stamps.name}: {_words(unit)} give {1.0 / (step * UNITS[unit]):.3g} frames per second, "
            f"{_words(other)} {1.0 / (step * UNITS[other]):.3g}; the first was taken, --fps says another rate"
        )
    elif best == -np.inf:
        unit = "s"
    # The start is taken off first: nanoseconds since 1970 have more digits than a float.
    start = float(known[0])
    result: FloatArray = (values - start) * UNITS[unit] + start * UNITS[unit]
    return result, doubt


def past_midnight(values: FloatArray) -> FloatArray:
    """Times of day [s] that go on growing where a new day begins."""
    steps = np.diff(values, prepend=values[:1])
    result: FloatArray = values + _DAY * np.cumsum(np.nan_to_num(steps) < -0.5 * _DAY)
    return result


def timecodes(cells: Sequence[str]) -> FloatArray | None:
    """Seconds of ``hours:minutes:seconds:frames``; ``None`` if a cell is something else.

    How many frames a second has is told by the highest number before a second ends; where no second ends within the
    recording, nothing tells it.
    """
    found = [_TIMECODE.match(cell) for cell in cells]
    if not found or not all(found):
        return None
    hours, minutes, whole, frames = np.array([match.groups() for match in found if match], dtype=np.float64).T
    times = 3600.0 * hours + 60.0 * minutes + whole
    if len(np.unique(times)) < 2:
        return None
    rate = next((rate for rate in _FILM_RATES if rate > frames.max()), float(frames.max()) + 1.0)
    return past_midnight(times + frames / rate)


def _counts(known: FloatArray, steps: FloatArray) -> bool:
    """Whether values count frames: whole numbers that mostly grow by one."""
    whole = (known == np.round(known)).all()
    return bool(whole and (steps > 0).all() and float(np.median(steps)) == 1.0 and (steps < 1_000).all())


def _typical(known: FloatArray, steps: FloatArray) -> float:
    """The time of one frame: the median step, or the mean one where stamps are coarser than frames."""
    forward = steps[steps > 0]
    if len(forward) < 0.8 * len(steps):
        return float((known.max() - known.min()) / len(steps))
    return float(np.median(forward))


def _score(step: float, known: FloatArray, size: float) -> float:
    """How likely a step [s] is, as a logarithm."""
    if not 1.0 / _FASTEST <= step <= 1.0 / _SLOWEST:
        return -np.inf
    rate = 1.0 / step
    score = -abs(float(np.log(rate / 30.0)))
    score += max((bonus for usual, bonus in _USUAL.items() if abs(rate / usual - 1.0) < 0.04), default=0.0)
    middle = float(np.median(known)) * size
    if any(low < middle < high for low, high in _DATES):
        score += 3.0
    return score


def _words(unit: str) -> str:
    return {
        "s": "seconds",
        "ms": "milliseconds",
        "us": "microseconds",
        "ticks": "ticks of 100 ns",
        "ns": "nanoseconds",
    }[unit]
