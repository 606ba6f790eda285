"""Projection: brings a command to the nearest pose that is free of contact."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent
from syda_gym.agents.interface import Interface, Reading
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import AgentError
from syda_gym.simulation.capsules import CapsuleModel

__all__ = ["Projection", "capsule_model"]

_ROUNDS = 12
_LARGEST = 0.2  # rad that one round may move a joint; the distance is linear only nearby


class Projection(Agent):
    """Moves the command out of contact along the gradient of the clearance, as little as it can.

    Each round takes the nearest pair of shapes and solves its linearised distance for ``margin`` with the least change
    of the joint angles, ``dq = g (margin - d) / (g g)``, as in projections onto convex sets one constraint at a time
    (Kaczmarz). Distances are those of ``CapsuleModel``, so that this works on any robot with collision shapes.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        margin: clearance that is kept [m].
    """

    name = "projection"

    def __init__(self, interface: Interface, base: Agent, *, margin: float = 0.01) -> None:
        super().__init__(interface, base)
        if not 0.0 <= margin <= 0.1:
            raise AgentError(f"margin must lie between 0 and 0.1 m, got {margin}")
        self.margin = float(margin)
        self._model = capsule_model(interface.robot)

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """The projected command."""
        return self.project(command)

    def project(self, frames: FloatArray) -> FloatArray:
        """The nearest free poses ``(B, n)`` [rad]; poses that are free already stay as they are, bit for bit."""
        result = frames.copy()
        todo = np.arange(len(frames))
        for _ in range(_ROUNDS):
            near = self._model.nearest(result[todo])
            bad = near.distance < self.margin - 1e-4
            todo, gradient, lack = todo[bad], near.gradient[bad], self.margin - near.distance[bad]
            if not len(todo):
                break
            step = gradient * (lack / (np.sum(gradient**2, axis=1) + 1e-6))[:, None]
            result[todo] = self.interface.robot.clamp(result[todo] + np.clip(step, -_LARGEST, _LARGEST))
        return result

    @property
    def settings(self) -> dict[str, Any]:
        """``margin``."""
        return {"margin": self.margin}


@lru_cache(maxsize=8)
def capsule_model(robot: Robot) -> CapsuleModel:
    """The capsule model of a robot, built once (it takes a second)."""
    return CapsuleModel(robot)
