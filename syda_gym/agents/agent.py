"""Agent: observations in, commands out; agents stack, one on the command of another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.agents.interface import Interface, Reading
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError

__all__ = ["Agent", "BaseAlone"]


class Agent(ABC):
    """Turns observations of ``B`` robots into joint commands.

    An agent stands on another one: it takes ``base.act`` as the command to improve and adds its own idea. The lowest of
    a stack is ``BaseAlone``, which passes on what the mapping asks for. Commands always respect the joint limits, the
    coupled ones included, and never ask a motor for more than its speed limit unless the base command itself does.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below; ``None`` only for ``BaseAlone``.

    Attributes:
        name: short name for tables.
    """

    name: str = "agent"

    def __init__(self, interface: Interface, base: Agent | None = None) -> None:
        self.interface = interface
        self.base = base
        self._count = 0
        self._fresh: NDArray[np.bool_] = np.zeros(0, dtype=bool)

    def reset(self, count: int, seed: int | None = None) -> None:
        """Forgets everything and prepares for ``count`` robots.

        Args:
            count: robots per observation, ``B``.
            seed: of an agent that draws random numbers; the others ignore it.

        Raises:
            AgentError: ``count`` is not positive.
        """
        if count < 1:
            raise AgentError(f"an agent needs at least one robot, got {count}")
        self._count = count
        self._fresh = np.ones(count, dtype=bool)
        if self.base is not None:
            self.base.reset(count, seed)

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Forgets the history of some robots whose episode has just begun.

        Args:
            which: ``(B,)`` true where the next observation is the first of an episode.
        """
        self._fresh |= np.asarray(which, dtype=bool)
        if self.base is not None:
            self.base.restart(which)

    def act(self, observation: ArrayLike) -> FloatArray:
        """Commands for the next control step.

        Args:
            observation: ``(B, size)``, with the ``B`` of the last ``reset``.

        Returns:
            ``(B, n)`` joint angles [rad].

        Raises:
            AgentError: not reset, another number of robots, or another observation.
        """
        return self.act_on(self.interface.read(observation))

    def act_on(self, reading: Reading) -> FloatArray:
        """The same for an observation that is already decoded."""
        if len(reading.q) != self._count:
            raise AgentError(f"{self.name} was reset for {self._count} robots, got {len(reading.q)}; call reset first")
        below = reading.base if self.base is None else self.base.act_on(reading)
        command = limited(self.interface, self.improve(below, reading), below, reading.q)
        self._fresh = np.zeros(self._count, dtype=bool)
        return command

    @abstractmethod
    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """The agent's own step on the command from below.

        Args:
            command: of the agent below, ``(B, n)`` [rad].
            reading: the decoded observation.

        Returns:
            ``(B, n)`` [rad], not yet limited.
        """

    @property
    def settings(self) -> dict[str, Any]:
        """The agent's own parameters, as its constructor takes them."""
        return {}

    @property
    def stack(self) -> tuple[str, ...]:
        """Names from the bottom up."""
        return (*(self.base.stack if self.base is not None else ()), self.name)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({' > '.join(self.stack)}, {self.settings})"


class BaseAlone(Agent):
    """Does nothing but pass on the base command: what every other agent is measured against."""

    name = "base"

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """Returns the command unchanged."""
        return command


def limited(interface: Interface, command: FloatArray, below: FloatArray, q: FloatArray) -> FloatArray:
    """Brings commands within joint and speed limits.

    A first-order motor moves by ``alpha (command - q)`` in one control step, so ``|command - q|`` may be at most
    ``speed dt / alpha``. A base command that is farther away than that stays allowed (the motor itself saturates), so
    that an agent that adds nothing changes nothing.

    Args:
        interface: robot, rate and motors.
        command: ``(B, n)`` [rad].
        below: the command that was improved upon, ``(B, n)`` [rad].
        q: joint angles, ``(B, n)`` [rad].

    Returns:
        ``(B, n)`` [rad].
    """
    step = interface.robot.speed * interface.dt / interface.alpha
    within = np.clip(command, np.minimum(q - step, below), np.maximum(q + step, below))
    return interface.robot.clamp(within)
