"""AdaptiveLead: a lead that measures how far the motors really go."""

from __future__ import annotations

from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent, limited
from syda_gym.agents.interface import Interface, Reading
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError

__all__ = ["AdaptiveLead"]

_PRIOR = 1e-4  # rad^2; the nominal share counts as much as one step that asks one joint for a hundredth of a radian
_MOST = 1.2  # of the nominal share
_TRUSTED = 0.5  # of the largest step that the joint's top speed allows


class AdaptiveLead(Agent):
    """Undoes the motors' lag with the share that they were seen to cover, not with the nominal one.

    A joint covers ``a (T - q)`` of the way to its target ``T`` in one step. Least squares over all joints and the past
    steps, with exponential forgetting, estimate ``a``; then ``T = q + (command - q) / a`` as in ``Lead``. (Recursive
    least squares: Åström, Wittenmark, *Adaptive Control*, 1995, chapter 2.) It must be the topmost of its stack, since
    it takes what it asks for as what was asked of the motors.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        strength: share of the lead, 0 to 1.
        memory: share of the past that is kept from one step to the next, 0 to below 1.
        least: the smallest share that is believed, in shares of the nominal one.
    """

    name = "adaptive_lead"

    def __init__(self, interface: Interface, base: Agent, *, strength: float = 1.0, memory: float = 0.9, least: float = 0.6) -> None:
        super().__init__(interface, base)
        if not (0.0 <= strength <= 1.0 and 0.0 <= memory < 1.0 and 0.1 <= least <= 1.0):
            raise AgentError(
                "expected 0 <= strength <= 1, 0 <= memory < 1 and 0.1 <= least <= 1, got "
                f"{strength}, {memory} and {least}"
            )
        self.strength, self.memory, self.least = float(strength), float(memory), float(least)
        self._step = interface.robot.speed * interface.dt / interface.alpha

    def reset(self, count: int, seed: int | None = None) -> None:
        """Forgets what was measured."""
        super().reset(count, seed)
        self._asked, self._from = np.zeros((count, self.interface.n)), np.zeros((count, self.interface.n))
        self._moved, self._meant = np.zeros(count), np.zeros(count)

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """``q + (1 + strength (1 / a - 1)) (command - q)`` with the share ``a`` that was measured."""
        fresh, q, nominal = self._fresh, reading.q, self.interface.alpha
        way = np.where(fresh[:, None], 0.0, self._asked - self._from)
        gone = np.where(fresh[:, None], 0.0, q - self._from)
        # A joint that was asked for more than its motor may have had to give tells nothing about its share.
        way = np.where(np.abs(way) < _TRUSTED * self._step, way, 0.0)
        kept = np.where(fresh, 0.0, self.memory)
        self._moved = kept * self._moved + np.sum(gone * way, axis=1)
        self._meant = kept * self._meant + np.sum(way * way, axis=1)
        share = (_PRIOR * nominal + self._moved) / (_PRIOR + self._meant)
        share = np.clip(share, self.least * nominal, min(_MOST * nominal, 1.0))
        wanted = q + (1.0 + self.strength * (1.0 / share - 1.0))[:, None] * (command - q)
        self._from, self._asked = q, limited(self.interface, wanted, command, q)
        return wanted

    @property
    def settings(self) -> dict[str, Any]:
        """``strength``, ``memory`` and ``least``."""
        return {"strength": self.strength, "memory": self.memory, "least": self.least}
