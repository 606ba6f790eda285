"""Interface: what an agent must know of the environment it acts in, and how it reads its observations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import AgentError, nearest_name

__all__ = ["NEEDED", "Interface", "Reading"]

NEEDED = ("base_error", "q", "qd", "packet_age")
"""Entries of the observation that every agent reads."""


@dataclass(frozen=True, eq=False)
class Reading:
    """One observation of ``B`` robots in physical units.

    Attributes:
        base: base command ``(B, n)`` [rad], what the mapping asks for at this step.
        preview: base commands of this step and of the ``k`` steps to come ``(B, k + 1, n)`` [rad]; ``k`` may be 0.
        q: joint angles ``(B, n)`` [rad].
        qd: joint speeds ``(B, n)`` [rad/s].
        age: age of the packet that the base command was computed from ``(B,)`` [s].
        observation: the observation itself ``(B, size)``.
    """

    base: FloatArray
    preview: FloatArray
    q: FloatArray
    qd: FloatArray
    age: FloatArray
    observation: FloatArray


@dataclass(frozen=True, eq=False)
class Interface:
    """Robot, rate, motors and observation layout that an agent is made for.

    Attributes:
        robot: who is driven.
        layout: name of each part of the observation and its slice.
        size: length of the observation.
        dt: time of one control step [s].
        alpha: share of the way to its command that a joint covers within one control step.
    """

    robot: Robot
    layout: Mapping[str, slice]
    size: int
    dt: float
    alpha: float

    def __post_init__(self) -> None:
        missing = [name for name in NEEDED if name not in self.layout]
        if missing:
            raise AgentError(
                f"the observation has no {missing[0]!r}; agents need {', '.join(NEEDED)}; it has "
                f"{', '.join(self.layout)}"
            )
        if not (self.dt > 0.0 and 0.0 < self.alpha <= 1.0):
            raise AgentError(f"expected dt > 0 and 0 < alpha <= 1, got dt={self.dt} and alpha={self.alpha}")

    @classmethod
    def of(cls, env: Any) -> Interface:
        """Reads it from an environment, single or vectorised, wrapped or not.

        Raises:
            AgentError: not a SydaTeleop environment.
        """
        inner = getattr(env, "unwrapped", env)
        try:
            layout, robot, rates = inner.layout, inner.robot, inner.rates
            slices = {str(name): layout[name] for name in layout}
            return cls(robot, slices, int(layout.size), float(rates.dt), float(rates.lag_share))
        except AttributeError as error:
            raise AgentError(
                f"{type(inner).__name__} is not an environment that agents can act in ({error}); "
                "make one with gymnasium.make('SydaTeleop-v0') or gymnasium.make_vec"
            ) from error

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.robot.joint_names)

    def read(self, observation: ArrayLike) -> Reading:
        """Turns observations ``(B, size)`` into physical quantities.

        Raises:
            AgentError: wrong shape or values that are not finite.
        """
        array = np.asarray(observation, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != self.size:
            raise AgentError(f"expected observations (B, {self.size}), got {np.shape(observation)}")
        if not np.isfinite(array).all():
            row, column = np.argwhere(~np.isfinite(array))[0]
            raise AgentError(f"observation {row} is not finite in {self._part_of(int(column))}; reset the environment")
        q = array[:, self.layout["q"]]
        preview = array[:, self.layout["base_error"]].reshape(len(array), -1, self.n) + q[:, None]
        return Reading(
            base=preview[:, 0],
            preview=preview,
            q=q,
            qd=array[:, self.layout["qd"]],
            age=array[:, self.layout["packet_age"]][:, 0],
            observation=array,
        )

    def spec(self) -> dict[str, Any]:
        """A JSON-able description by which a bundle knows its environment again."""
        return {
            "robot": self.robot.spec(),
            "layout": {name: [part.start, part.stop] for name, part in self.layout.items()},
            "size": self.size,
            "dt": self.dt,
            "alpha": self.alpha,
        }

    def check(self, spec: Mapping[str, Any], what: str) -> None:
        """Compares with a stored description.

        Args:
            spec: what ``spec()`` returned when the agent was stored.
            what: how the message calls the agent.

        Raises:
            AgentError: other robot, layout, rate or motors; the message says which.
        """
        mine = self.spec()
        if spec.get("robot") != mine["robot"]:
            theirs = dict(spec.get("robot") or {})
            raise AgentError(
                f"{what} was made for robot {theirs.get('name')!r} with joints {theirs.get('joints')}; this "
                f"environment has {self.robot.name!r}; use the robot it was made for, or train again"
            )
        for part in (*mine["layout"], *dict(spec.get("layout") or {})):
            ours, theirs_part = mine["layout"].get(part), dict(spec.get("layout") or {}).get(part)
            if ours != theirs_part:
                raise AgentError(
                    f"{what} was made for another observation: {part!r} at {theirs_part}, here {ours}; make the "
                    "environment with the options it was trained with (operator, preview), or train again"
                )
        for name in ("dt", "alpha"):
            if abs(float(spec.get(name, np.nan)) - mine[name]) > 1e-9 or name not in spec:
                raise AgentError(
                    f"{what} was made for {name}={spec.get(name)}, this environment has {mine[name]}; use the control "
                    "and physics rate it was trained with"
                )

    def _part_of(self, column: int) -> str:
        for name, part in self.layout.items():
            if part.start <= column < part.stop:
                return f"{name!r}"
        return nearest_name(str(column), self.layout)


def lag_share(gain: float | FloatArray, substeps: int) -> float | FloatArray:
    """Share of the way that a first-order motor covers in one control step: ``1 - (1 - gain) ** substeps``."""
    return 1.0 - (1.0 - gain) ** substeps
