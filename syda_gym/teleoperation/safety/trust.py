"""ConfidencePolicy: how far a mapping is trusted decides how fast the robot may follow it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from syda_gym.errors import OptionError

__all__ = ["ConfidencePolicy"]


@dataclass(frozen=True)
class ConfidencePolicy:
    """Turns an error bound and a tracking confidence into a speed factor.

    The factor is 1 up to ``slow`` and falls linearly to ``crawl`` at ``hold``; beyond, the robot holds. The tracking
    confidence of the source acts in the same way between ``tracking_slow`` and ``tracking_hold``; the smaller wins.

    Attributes:
        slow: error bound [m] from which the robot slows.
        hold: error bound [m] from which it holds.
        crawl: the smallest factor before holding.
        tracking_slow: tracking confidence in [0, 1] below which the robot slows.
        tracking_hold: tracking confidence below which it holds.

    Raises:
        OptionError: thresholds that are not in order.
    """

    slow: float
    hold: float
    crawl: float = 0.15
    tracking_slow: float = 0.6
    tracking_hold: float = 0.25

    def __post_init__(self) -> None:
        if not 0.0 < self.slow < self.hold:
            raise OptionError(f"error bounds must satisfy 0 < slow < hold, got {self.slow} and {self.hold} m")
        if not 0.0 <= self.tracking_hold < self.tracking_slow <= 1.0 or not 0.0 < self.crawl <= 1.0:
            raise OptionError(
                "tracking confidences must satisfy 0 <= hold < slow <= 1 and the crawl factor lie in (0, 1], got "
                f"{self.tracking_hold}, {self.tracking_slow} and {self.crawl}"
            )

    @classmethod
    def for_reach(cls, reach: float) -> ConfidencePolicy:
        """Thresholds for a robot whose arm is ``reach`` [m] long: slow from 0.75 of it, hold from 1.25 of it.

        The bound of a fitted pair is about half the reach, that of a chain of two about three quarters; one larger than
        the arm says nothing about where the wrist will be.
        """
        return cls(slow=0.75 * reach, hold=1.25 * reach)

    def factor(self, bound: float, tracking: float) -> float:
        """Speed factor in [0, 1]; 0 means hold. A bound or confidence that is not a number holds."""
        if math.isnan(bound) or math.isnan(tracking) or bound >= self.hold or tracking < self.tracking_hold:
            return 0.0
        by_bound = _fall((bound - self.slow) / (self.hold - self.slow), self.crawl)
        by_tracking = _fall((self.tracking_slow - tracking) / (self.tracking_slow - self.tracking_hold), self.crawl)
        return min(by_bound, by_tracking)


def _fall(share: float, crawl: float) -> float:
    return 1.0 - (1.0 - crawl) * min(max(share, 0.0), 1.0)
