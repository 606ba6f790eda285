"""Rates: the one place that knows how often control and physics run and which motor gain belongs to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from syda_gym.errors import OptionError

__all__ = ["Rates"]

_REFERENCE_HZ = 240.0
_REFERENCE_GAIN = 0.1  # PyBullet's default position gain, which belongs to its default rate of 240 Hz


@dataclass(frozen=True)
class Rates:
    """Control and physics rate.

    Attributes:
        control_hz: commands per second.
        physics_hz: physics steps per second, a whole multiple of ``control_hz``.

    Raises:
        OptionError: a rate is not positive, or physics is no whole multiple of control.
    """

    control_hz: float = 30.0
    physics_hz: float = 240.0

    def __post_init__(self) -> None:
        for label, value in (("control_hz", self.control_hz), ("physics_hz", self.physics_hz)):
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                raise OptionError(f"{label} must be a positive number, got {value!r}")
            if not (np.isfinite(value) and 1.0 <= value <= 10_000.0):
                raise OptionError(f"{label} must lie between 1 and 10000 Hz, got {value}")
        ratio = self.physics_hz / self.control_hz
        if ratio < 1 or abs(ratio - round(ratio)) > 1e-9:
            below = max(1, int(ratio)) * self.control_hz
            raise OptionError(
                f"physics_hz={self.physics_hz:g} must be a whole multiple of control_hz={self.control_hz:g}; "
                f"nearest: physics_hz={below:g} or {below + self.control_hz:g}"
            )

    @property
    def substeps(self) -> int:
        """Physics steps per control step."""
        return round(self.physics_hz / self.control_hz)

    @property
    def dt(self) -> float:
        """Control step [s]."""
        return 1.0 / self.control_hz

    @property
    def physics_dt(self) -> float:
        """Physics step [s]."""
        return 1.0 / self.physics_hz

    @property
    def motor_gain(self) -> float:
        """Share of the position error that a motor removes in one physics step.

        ``1 - 0.9 ** (240 / physics_hz)``: the same closed-loop time constant at every rate as PyBullet's default gain
        of 0.1 has at its default rate of 240 Hz.
        """
        return float(1.0 - (1.0 - _REFERENCE_GAIN) ** (_REFERENCE_HZ / self.physics_hz))

    @property
    def lag_share(self) -> float:
        """Share of the way to its command that an unsaturated joint covers in one control step."""
        return float(1.0 - (1.0 - self.motor_gain) ** self.substeps)
