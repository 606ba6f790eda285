"""Backend: what the environment may ask of a world, whichever physics is behind it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.simulation.rates import Rates

__all__ = ["BACKENDS", "Backend", "MotorConditions"]

BACKENDS = ("bullet", "servo")
"""PyBullet, or the motor law in numpy."""


@dataclass(frozen=True)
class MotorConditions:
    """How a robot differs from the nominal one.

    Attributes:
        gain: factor on the motors' position gain.
        speed: factor on the top speed of the joints.
        payload: mass held in each hand [kg].
        friction: share of each motor's effort that friction eats up.
    """

    gain: float = 1.0
    speed: float = 1.0
    payload: float = 0.0
    friction: float = 0.0


NOMINAL = MotorConditions()


class Backend(Protocol):
    """``count`` robots of one kind that take joint commands.

    Attributes:
        robot: the kind.
        rates: control and physics rate.
        count: number of robots, called B.
        pose: ``(B, n + 6 * arms)``: joint angles [rad], then the landmarks' coordinates [m] in the torso frame.
        qd: ``(B, n)`` joint speeds [rad/s].
        contacts: ``(B,)`` pairs of links of a robot that touch each other; 0 without self-collision.
    """

    robot: Robot
    rates: Rates
    count: int
    contacts: NDArray[np.int64]

    @property
    def pose(self) -> FloatArray:
        """Joint angles and landmark coordinates."""

    @property
    def qd(self) -> FloatArray:
        """Joint speeds."""

    def reset(self, which: NDArray[np.intp], q: FloatArray) -> None:
        """Puts robots ``which`` ``(k,)`` at rest at joint angles ``q`` ``(k, n)`` [rad]."""

    def let_go(self) -> None:
        """Copies the state arrays, so that a reset of some robots does not write into arrays that others hold."""

    def set_conditions(self, index: int, conditions: MotorConditions) -> None:
        """Changes motors and payload of one robot until they are changed again."""

    def advance(self, commands: FloatArray) -> None:
        """Lets every robot follow its command ``(B, n)`` [rad] for one control step; new state arrays result."""

    def advance_one(self, command: list[float]) -> list[float]:
        """``advance`` for a world of one robot; joint angles, landmark coordinates and joint speeds in one list."""

    def reset_one(self, q: list[float]) -> list[float]:
        """``reset`` for a world of one robot; joint angles, landmark coordinates and joint speeds in one list."""

    def close(self) -> None:
        """Releases what the world holds; harmless when repeated."""
