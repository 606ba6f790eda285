"""The classical rivals: analytic lead, exponential and One-Euro filters, a Kalman filter that knows packet times."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent, BaseAlone
from syda_gym.agents.interface import Interface, Reading
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError, nearest_name

__all__ = ["CONTACT_RIVALS", "RIVALS", "Ema", "Kalman", "Lead", "OneEuro", "Range", "Rival", "make_rival"]


class Lead(Agent):
    """Undoes the motors' first-order lag.

    A joint covers ``alpha (T - q)`` of the way to its target ``T`` in one step, so ``T = q + (command - q) / alpha``
    makes it arrive. With noise a full lead raises jitter, hence ``strength``: 0 is no lead, 1 the full one.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        strength: share of the lead, 0 to 1; up to 2 for motors that are known to be weaker than nominal.
    """

    name = "lead"

    def __init__(self, interface: Interface, base: Agent, *, strength: float = 1.0) -> None:
        super().__init__(interface, base)
        self.strength = _between("strength", strength, 0.0, 2.0)

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """``q + (1 + strength (1 / alpha - 1)) (command - q)``."""
        if self.strength == 0.0:
            return command
        return reading.q + (1.0 + self.strength * (1.0 / self.interface.alpha - 1.0)) * (command - reading.q)

    @property
    def settings(self) -> dict[str, Any]:
        """``strength``."""
        return {"strength": self.strength}


class Ema(Agent):
    """Exponential moving average of the command: ``y += rate (x - y)``.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        rate: weight of the newest command, 0 < rate <= 1.
    """

    name = "ema"

    def __init__(self, interface: Interface, base: Agent, *, rate: float = 0.5) -> None:
        super().__init__(interface, base)
        self.rate = _between("rate", rate, 1e-6, 1.0)

    def reset(self, count: int, seed: int | None = None) -> None:
        """Forgets the average."""
        super().reset(count, seed)
        self._mean = np.zeros((count, self.interface.n))

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """The average, started at the first command."""
        fresh = self._fresh[:, None]
        self._mean = np.where(fresh, command, self._mean + self.rate * (command - self._mean))
        return self._mean

    @property
    def settings(self) -> dict[str, Any]:
        """``rate``."""
        return {"rate": self.rate}


class OneEuro(Agent):
    """The One-Euro filter: a low-pass whose cutoff rises with speed.

    Casiez, Roussel, Vogel, *1 Euro Filter: A Simple Speed-based Low-pass Filter for Noisy Input in Interactive
    Systems*, CHI 2012, https://gery.casiez.net/1euro/. ``cutoff = min_cutoff + beta |smoothed speed|``; the weight of
    the newest value is ``1 / (1 + 1 / (2 pi cutoff dt))``.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        min_cutoff: cutoff at rest [Hz].
        beta: rise of the cutoff with speed [Hz s/rad].
        speed_cutoff: cutoff of the speed's own low-pass [Hz].
    """

    name = "one_euro"

    def __init__(
        self,
        interface: Interface,
        base: Agent,
        *,
        min_cutoff: float = 1.0,
        beta: float = 1.0,
        speed_cutoff: float = 1.0,
    ) -> None:
        super().__init__(interface, base)
        self.min_cutoff = _between("min_cutoff", min_cutoff, 1e-6, 1e6)
        self.beta = _between("beta", beta, 0.0, 1e6)
        self.speed_cutoff = _between("speed_cutoff", speed_cutoff, 1e-6, 1e6)

    def reset(self, count: int, seed: int | None = None) -> None:
        """Forgets value and speed."""
        super().reset(count, seed)
        shape = (count, self.interface.n)
        self._raw, self._value, self._speed = np.zeros(shape), np.zeros(shape), np.zeros(shape)

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """The filtered command, started at the first one with no speed."""
        fresh = self._fresh[:, None]
        raw_speed = np.where(fresh, 0.0, (command - self._raw) / self.interface.dt)
        weight = self._weight(np.array(self.speed_cutoff))
        self._speed = np.where(fresh, 0.0, self._speed + weight * (raw_speed - self._speed))
        weights = self._weight(self.min_cutoff + self.beta * np.abs(self._speed))
        self._value = np.where(fresh, command, self._value + weights * (command - self._value))
        self._raw = command
        return self._value

    def _weight(self, cutoff: FloatArray) -> FloatArray:
        return 1.0 / (1.0 + 1.0 / (2.0 * np.pi * cutoff * self.interface.dt))

    @property
    def settings(self) -> dict[str, Any]:
        """``min_cutoff``, ``beta`` and ``speed_cutoff``."""
        return {"min_cutoff": self.min_cutoff, "beta": self.beta, "speed_cutoff": self.speed_cutoff}


class Kalman(Agent):
    """A constant-velocity Kalman filter on the times at which packets were sent.

    Each joint has angle and speed, driven by white acceleration of density ``process`` and measured with standard
    deviation ``noise``; a packet is filtered once, at the time it was sent (now minus its age), and the state is then
    extrapolated to now. Packets that arrive again (a held command) and packets older than one already seen are not
    measured. Only the ratio of process and noise matters to the estimate. Bar-Shalom, Li, Kirubarajan, *Estimation with
    Applications to Tracking and Navigation*, 2001, section 6.2.2 (discretised white acceleration).

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        process: density of the acceleration [rad/s^2/sqrt(Hz)].
        noise: standard deviation of a measurement [rad].
        horizon: longest extrapolation [s]; later the pose is held.
    """

    name = "kalman"

    def __init__(
        self, interface: Interface, base: Agent, *, process: float = 10.0, noise: float = 0.02, horizon: float = 0.3
    ) -> None:
        super().__init__(interface, base)
        self.process = _between("process", process, 1e-9, 1e9)
        self.noise = _between("noise", noise, 1e-9, 1e3)
        self.horizon = _between("horizon", horizon, 0.0, 10.0)

    def reset(self, count: int, seed: int | None = None) -> None:
        """Forgets the states."""
        super().reset(count, seed)
        self._angle = np.zeros((count, self.interface.n))
        self._speed = np.zeros((count, self.interface.n))
        self._covariance = np.zeros((count, 3))  # var(angle), cov, var(speed); the same for all joints of a robot
        self._sent = np.zeros(count)
        self._now = np.zeros(count)

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """The extrapolated estimate."""
        self._now = np.where(self._fresh, 0.0, self._now + self.interface.dt)
        sent = self._now - reading.age
        self._begin(command, sent)
        new = ~self._fresh & (sent > self._sent + 1e-6)
        self._filter(command, sent, new)
        ahead = np.clip(self._now - self._sent, 0.0, self.horizon)
        return self._angle + self._speed * ahead[:, None]

    def _begin(self, command: FloatArray, sent: FloatArray) -> None:
        fresh = self._fresh
        self._angle = np.where(fresh[:, None], command, self._angle)
        self._speed = np.where(fresh[:, None], 0.0, self._speed)
        # An operator may already be moving: one radian a second of doubt, which the first packets resolve.
        start = np.array([self.noise**2, 0.0, 1.0])
        self._covariance = np.where(fresh[:, None], start, self._covariance)
        self._sent = np.where(fresh, sent, self._sent)

    def _filter(self, command: FloatArray, sent: FloatArray, new: np.ndarray[Any, np.dtype[np.bool_]]) -> None:
        step = np.where(new, sent - self._sent, 0.0)
        pp, pv, vv = self._covariance.T
        density = self.process**2
        pp = pp + 2.0 * step * pv + step**2 * vv + density * step**3 / 3.0
        pv = pv + step * vv + density * step**2 / 2.0
        vv = vv + density * step
        angle = self._angle + self._speed * step[:, None]
        gain_angle, gain_speed = pp / (pp + self.noise**2), pv / (pp + self.noise**2)
        surprise = command - angle
        mask = new[:, None]
        self._angle = np.where(mask, angle + gain_angle[:, None] * surprise, self._angle)
        self._speed = np.where(mask, self._speed + gain_speed[:, None] * surprise, self._speed)
        updated = np.stack([(1.0 - gain_angle) * pp, (1.0 - gain_angle) * pv, vv - gain_speed * pv], axis=1)
        self._covariance = np.where(mask, updated, self._covariance)
        self._sent = np.where(new, sent, self._sent)

    @property
    def settings(self) -> dict[str, Any]:
        """``process``, ``noise`` and ``horizon``."""
        return {"process": self.process, "noise": self.noise, "horizon": self.horizon}


@dataclass(frozen=True)
class Range:
    """Where ``tune`` looks for a setting; ``log`` for one that spans decades."""

    low: float
    high: float
    log: bool = False


@dataclass(frozen=True)
class Rival:
    """A named stack of classical agents.

    Attributes:
        summary: one line for tables.
        build: makes it from an interface and flat settings.
        ranges: settings that ``tune`` may change, by name.
    """

    summary: str
    build: Callable[..., Agent]
    ranges: Mapping[str, Range]


_STRENGTH = {"strength": Range(0.0, 1.0)}
_ADAPTIVE = {
    "memory": Range(0.5, 0.98), "least": Range(0.4, 1.0), "braking": Range(0.3, 3.0, log=True),
    "together": Range(0.9, 2.0, log=True), "strength": Range(0.0, 1.5),
}  # fmt: skip
_EURO = {"min_cutoff": Range(0.1, 10.0, log=True), "beta": Range(0.01, 30.0, log=True)}
_KALMAN = {"process": Range(0.5, 500.0, log=True), "horizon": Range(0.0, 0.4)}


def _one_euro_lead(interface: Interface, *, strength: float = 1.0, **settings: float) -> Agent:
    return Lead(interface, OneEuro(interface, BaseAlone(interface), **settings), strength=strength)


def _ema_lead(interface: Interface, *, strength: float = 1.0, **settings: float) -> Agent:
    return Lead(interface, Ema(interface, BaseAlone(interface), **settings), strength=strength)


def _kalman_lead(interface: Interface, *, strength: float = 1.0, **settings: float) -> Agent:
    return Lead(interface, Kalman(interface, BaseAlone(interface), **settings), strength=strength)


def _adaptive_lead(interface: Interface, **settings: float) -> Agent:
    from syda_gym.agents.classical.adaptive import AdaptiveLead

    return AdaptiveLead(interface, BaseAlone(interface), **settings)


def _projection(interface: Interface, **settings: float) -> Agent:
    from syda_gym.agents.classical.projection import Projection

    return Projection(interface, BaseAlone(interface), **settings)


def _projection_lead(interface: Interface, *, strength: float = 1.0, **settings: float) -> Agent:
    return Lead(interface, _projection(interface, **settings), strength=strength)


def _sliding_lead(interface: Interface, *, strength: float = 1.0, **settings: float) -> Agent:
    from syda_gym.agents.classical.sliding import Sliding

    return Sliding(interface, Lead(interface, BaseAlone(interface), strength=strength), **settings)


CONTACT_RIVALS = ("projection", "projection_lead", "sliding_lead")
"""Rivals that only matter where the arms touch something; they cost more time than the others."""

RIVALS: Mapping[str, Rival] = {
    "base": Rival("the mapping's command, unchanged", lambda i: BaseAlone(i), {}),
    "lead": Rival("analytic inverse of the motor lag", lambda i, **s: Lead(i, BaseAlone(i), **s), _STRENGTH),
    "adaptive_lead": Rival(
        "lead by the share that the motors were seen to cover, which brakes in time",
        _adaptive_lead,
        _ADAPTIVE,
    ),
    "one_euro": Rival("One-Euro filter", lambda i, **s: OneEuro(i, BaseAlone(i), **s), _EURO),
    "one_euro_lead": Rival("One-Euro filter, then lead", _one_euro_lead, _EURO | _STRENGTH),
    "ema_lead": Rival("exponential average, then lead", _ema_lead, {"rate": Range(0.05, 1.0, log=True)} | _STRENGTH),
    "projection": Rival("nearest command out of contact", _projection, {"margin": Range(0.0, 0.03)}),
    "projection_lead": Rival(
        "nearest command out of contact, then lead",
        _projection_lead,
        {"margin": Range(0.0, 0.03)} | _STRENGTH,
    ),
    "sliding_lead": Rival(
        "lead, then slides along the robot's own body",
        _sliding_lead,
        {"margin": Range(0.0, 0.01), "approach": Range(0.3, 1.0)} | _STRENGTH,
    ),
    "kalman": Rival("constant-velocity Kalman filter on packet times, then lead", _kalman_lead, _KALMAN | _STRENGTH),
}
"""The classical rivals by name."""


def make_rival(name: str, interface: Interface, **settings: float) -> Agent:
    """Builds a rival of ``RIVALS``.

    Raises:
        AgentError: unknown name or setting; the message says which exist.
    """
    if name not in RIVALS:
        raise AgentError(f"unknown agent {name!r}; {nearest_name(name, RIVALS)}")
    try:
        return RIVALS[name].build(interface, **settings)
    except TypeError as error:
        allowed = ", ".join(RIVALS[name].ranges) or "none"
        raise AgentError(f"agent {name!r} takes the settings {allowed}; got {sorted(settings)}") from error


def _between(name: str, value: float, low: float, high: float) -> float:
    if not (np.isfinite(value) and low <= value <= high):
        raise AgentError(f"{name} must lie between {low:g} and {high:g}, got {value}")
    return float(value)
