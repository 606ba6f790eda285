"""LiveStatistics: rate, latency percentiles and counts of a run, in memory that does not grow."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

__all__ = ["LiveStatistics"]


class LiveStatistics:
    """What is shown on the screen while a robot is teleoperated.

    Args:
        window: how many of the latest latencies the percentiles are taken over.

    Attributes:
        commands: commands sent.
        frames: frames that reached the loop.
        states: commands sent in each state.
        reasons: how often each reason slowed or held the robot, or dropped a frame or packet.
        bound: the latest error bound [m].
    """

    def __init__(self, window: int = 10_000) -> None:
        self.commands = 0
        self.frames = 0
        self.states: Counter[str] = Counter()
        self.reasons: Counter[str] = Counter()
        self.bound = float("nan")
        self._latency = np.zeros(window)
        self._sent = np.zeros(64)

    def command(self, now: float, state: str) -> None:
        """A command was sent at ``now`` [s]."""
        self._sent[self.commands % len(self._sent)] = now
        self.commands += 1
        self.states[state] += 1

    def latency(self, seconds: float) -> None:
        """A frame took ``seconds`` from its arrival to its command."""
        self._latency[self.frames % len(self._latency)] = seconds
        self.frames += 1

    @property
    def newest_latency(self) -> float:
        """What the latest frame took [s], NaN before the first."""
        return float(self._latency[(self.frames - 1) % len(self._latency)]) if self.frames else float("nan")

    @property
    def rate(self) -> float:
        """Commands per second over the last 64 commands; 0 before the second one."""
        count = min(self.commands, len(self._sent))
        if count < 2:
            return 0.0
        newest = self._sent[(self.commands - 1) % len(self._sent)]
        oldest = self._sent[self.commands % len(self._sent) if self.commands > len(self._sent) else 0]
        return float((count - 1) / (newest - oldest)) if newest > oldest else 0.0

    def percentile(self, share: float) -> float:
        """Latency percentile [s] over the window, NaN without frames."""
        count = min(self.frames, len(self._latency))
        return float(np.percentile(self._latency[:count], share)) if count else float("nan")

    def summary(self) -> dict[str, Any]:
        """All figures, with units in their names."""
        return {
            "commands": self.commands,
            "frames": self.frames,
            "rate_hz": self.rate,
            "latency_p50_ms": 1e3 * self.percentile(50),
            "latency_p99_ms": 1e3 * self.percentile(99),
            "latency_max_ms": 1e3 * self.percentile(100),
            "bound_m": self.bound,
            "states": dict(self.states),
            "reasons": dict(self.reasons),
        }
