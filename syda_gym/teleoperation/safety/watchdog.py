"""Watchdog: what to do while no trustworthy frame arrives, and the way home."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError

__all__ = ["Ease", "Watch", "Watchdog"]

_INSTANT = 1e-6  # s


class Watch(StrEnum):
    """The verdict of the watchdog."""

    FOLLOW = "follow"
    HOLD = "hold"
    EASE = "ease"


@dataclass
class Watchdog:
    """Holds after a short silence and eases to rest after a longer one.

    Silence means no frame that was accepted *and* trusted: garbage, implausible limbs and an error bound beyond its
    threshold count as silence.

    Attributes:
        silence: seconds without a good frame until the robot holds.
        hold: further seconds until it eases to rest.

    Raises:
        OptionError: a time is not positive.
    """

    silence: float = 0.25
    hold: float = 1.0
    _fed: float = -np.inf

    def __post_init__(self) -> None:
        if not (self.silence > 0.0 and self.hold >= 0.0):
            raise OptionError(f"watchdog times must be positive, got {self.silence} and {self.hold} s")

    def feed(self, now: float) -> None:
        """A good frame arrived at ``now`` [s]."""
        self._fed = now

    def wake(self, now: float) -> None:
        """The robot may move again from ``now`` [s] on: it holds until a frame comes, and eases if none does."""
        self._fed = max(self._fed, now - self.silence - _INSTANT)

    def verdict(self, now: float) -> Watch:
        """What to do at ``now`` [s]."""
        quiet = now - self._fed
        if quiet < self.silence:
            return Watch.FOLLOW
        return Watch.HOLD if quiet < self.silence + self.hold else Watch.EASE


class Ease:
    """A minimum-jerk way from one pose to another, all joints arriving together.

    ``s(u) = 10 u^3 - 15 u^4 + 6 u^5`` (Flash and Hogan, J. Neurosci. 5(7), 1985); its peak speed is 1.875 times the
    mean, which sets the duration.

    Args:
        start: ``(n,)`` [rad].
        goal: ``(n,)`` [rad].
        speed: largest joint speed to use ``(n,)`` [rad/s].
        began: time of the start [s].
        shortest: least duration [s].
    """

    def __init__(
        self, start: FloatArray, goal: FloatArray, speed: FloatArray, began: float, shortest: float = 1.0
    ) -> None:
        self.start = start.copy()
        self.way = goal - start
        self.began = began
        self.duration = max(shortest, 1.875 * float(np.max(np.abs(self.way) / speed)))

    def at(self, now: float) -> FloatArray:
        """The pose ``(n,)`` at ``now`` [s]."""
        u = min(max((now - self.began) / self.duration, 0.0), 1.0)
        return self.start + self.way * (u * u * u * (10.0 + u * (6.0 * u - 15.0)))
