"""Sliding: lets a robot slide along its own body instead of touching it."""

from __future__ import annotations

from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent
from syda_gym.agents.interface import Interface, Reading
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.simulation.collision.slide import slide

__all__ = ["Sliding"]

_NEAR = 0.08  # m; pairs farther apart than this cannot meet within a step
_APART = 0.1  # m/s; the fastest that links which are too near come apart


class Sliding(Agent):
    """Changes the command as little as it can, so that the next step brings no two links nearer than a margin.

    Commands are read as the velocities that the motors make of them in one step; ``slide`` projects these onto what
    the distances of near links permit, as the live loop does it (``teleoperation.safety.motion``). Distances are exact,
    of the shapes in the URDF (``SelfCollision``). Where ``Projection`` moves the goal out of contact, this looks at the
    way there; so it belongs on top of a lead, whose commands go beyond the goal.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        margin: distance that is kept [m]. PyBullet takes links for touching when they are about a millimetre apart.
        approach: share of what is left to the margin that one step may use up, above 0 to 1.

    Raises:
        AgentError: settings out of range, or a robot without collision shapes.
    """

    name = "sliding"

    def __init__(self, interface: Interface, base: Agent, *, margin: float = 0.002, approach: float = 0.9) -> None:
        super().__init__(interface, base)
        if not (0.0 <= margin <= 0.1 and 0.0 < approach <= 1.0):
            raise AgentError(f"expected a margin from 0 to 0.1 m and 0 < approach <= 1, got {margin} and {approach}")
        self.margin, self.approach = float(margin), float(approach)
        self._collision = SelfCollision(interface.robot, self.margin)
        if not self._collision.available:
            raise AgentError(f"robot {interface.robot.name!r} cannot slide along itself: {self._collision.why}")

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """The command that slides along the body."""
        return np.array([self._row(wanted, q) for wanted, q in zip(command, reading.q, strict=True)])

    def _row(self, command: FloatArray, q: FloatArray) -> FloatArray:
        """The same for one robot ``(n,)``; a command that is free stays as it is, bit for bit."""
        self._collision.measure(q)
        distances, gradients = self._collision.near(q, _NEAR)
        rate = self.interface.alpha / self.interface.dt
        wanted = (command - q) * rate
        left = distances - self.margin
        slowest = np.minimum(-self.approach / self.interface.dt * left, _APART)
        if (gradients @ wanted >= slowest).all():
            return command
        speed = self.interface.robot.speed
        velocity = slide(wanted, np.minimum(-speed, wanted), np.maximum(speed, wanted), gradients, slowest)
        return q if velocity is None else q + velocity / rate

    @property
    def settings(self) -> dict[str, Any]:
        """``margin`` and ``approach``."""
        return {"margin": self.margin, "approach": self.approach}
