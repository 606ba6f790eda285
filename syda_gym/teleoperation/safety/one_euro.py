"""OneEuroFilter: smooth when slow, prompt when fast; causal, for one stream of joint angles."""

from __future__ import annotations

import math

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError

__all__ = ["OneEuroFilter"]


class OneEuroFilter:
    """The One-Euro filter (Casiez, Roussel, Vogel, CHI 2012, https://doi.org/10.1145/2207676.2208639).

    A first-order low pass whose cutoff grows with the speed of the signal: ``cutoff = minimum + beta * |speed|``, where
    the speed itself is low-passed at ``speed_cutoff``. Each joint has a cutoff of its own.

    Args:
        minimum: cutoff at rest [Hz]; lower is smoother.
        beta: how much the cutoff grows [Hz per rad/s]; higher is prompter.
        speed_cutoff: cutoff of the speed estimate [Hz].

    Raises:
        OptionError: a cutoff is not positive or ``beta`` is negative.
    """

    def __init__(self, minimum: float = 2.0, beta: float = 3.0, speed_cutoff: float = 1.0) -> None:
        if minimum <= 0.0 or speed_cutoff <= 0.0 or beta < 0.0:
            raise OptionError(
                f"One-Euro filter: cutoffs must be positive and beta not negative, got {minimum}, {speed_cutoff} "
                f"and {beta}"
            )
        self.minimum = minimum
        self.beta = beta
        self.speed_cutoff = speed_cutoff
        # Plain floats: for a handful of joints numpy would spend its time on calling.
        self._values: list[float] | None = None
        self._speeds: list[float] = []

    def reset(self, value: FloatArray | None = None) -> None:
        """Forgets the past; a given ``value`` ``(n,)`` becomes the present."""
        self._values = None if value is None else value.tolist()
        self._speeds = [] if value is None else [0.0] * len(value)

    def __call__(self, value: FloatArray, dt: float) -> FloatArray:
        """The smoothed value.

        Args:
            value: ``(n,)``.
            dt: time since the last value [s]; not positive means that the value replaces nothing.

        Returns:
            ``(n,)``.
        """
        if self._values is None:
            self.reset(value)
            return value.copy()
        if dt > 0.0:
            share, turn = _share(self.speed_cutoff, dt), 2.0 * math.pi * dt
            values, speeds = [], []  # new lists, so that a copy of the filter is one
            for new, old, speed in zip(value.tolist(), self._values, self._speeds, strict=True):
                change = new - old
                speed += share * (change / dt - speed)
                cutoff = turn * (self.minimum + self.beta * abs(speed))
                speeds.append(speed)
                values.append(old + change * cutoff / (1.0 + cutoff))
            self._values, self._speeds = values, speeds
        return np.array(self._values)


def _share(cutoff: float, dt: float) -> float:
    """Weight of the new value in a first-order low pass."""
    product = 2.0 * math.pi * cutoff * dt
    return product / (1.0 + product)
