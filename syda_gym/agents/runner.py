"""Runner: a stored mapping and a stored agent as one function of the operator's frame, in numpy, without torch."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.agents.agent import Agent
from syda_gym.agents.bundle import load_agent, read_card
from syda_gym.agents.interface import Interface
from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import AgentError

if TYPE_CHECKING:
    from syda_gym.mappings.mapping import Mapping as MotionMapping

__all__ = ["Runner", "stored_interface"]


class Runner:
    """Drives one robot: operator frame in, joint command out.

    Args:
        agent: who acts.
        mapping: from the operator to the agent's robot.

    Raises:
        AgentError: the mapping leads elsewhere, or its operator has other features than the agent was made for.
    """

    def __init__(self, agent: Agent, mapping: MotionMapping) -> None:
        interface = agent.interface
        if mapping.target != interface.robot:
            raise AgentError(
                f"the mapping maps onto {mapping.target.name!r}, the agent drives {interface.robot.name!r}; "
                "give a mapping onto the agent's robot"
            )
        features = interface.layout["operator"].stop - interface.layout["operator"].start
        if mapping.source.n_features != features:
            raise AgentError(
                f"the mapping reads {mapping.source.n_features} features of {mapping.source.name!r}, the agent was "
                f"made for {features}; use the operator it was trained with"
            )
        self.agent, self.mapping = agent, mapping
        self._observation = np.zeros((1, interface.size))

    @classmethod
    def load(cls, agent: str | os.PathLike[str], mapping: str | os.PathLike[str]) -> Runner:
        """From the paths of a bundle and of a stored mapping.

        Raises:
            StorageError: missing or corrupt files.
            AgentError: they do not fit together.
        """
        from syda_gym.mappings.storage import load_mapping

        return cls(load_agent(agent, stored_interface(read_card(agent))), load_mapping(mapping))

    def reset(self) -> None:
        """Begins an episode."""
        self.agent.reset(1)

    def step(self, frame: ArrayLike, q: ArrayLike, *, qd: ArrayLike | None = None, age: float = 0.0) -> FloatArray:
        """The next command.

        Args:
            frame: newest operator frame ``(F,)``.
            q: joint angles now ``(n,)`` [rad].
            qd: joint speeds now ``(n,)`` [rad/s]; zero if left out.
            age: age of the operator's frame [s].

        Returns:
            ``(n,)`` [rad], within the joint limits.
        """
        layout, row = self.agent.interface.layout, self._observation[0]
        row[layout["operator"]] = frame
        row[layout["base_error"]] = self.mapping(np.asarray(frame, dtype=np.float64)) - np.asarray(q)
        row[layout["q"]] = q
        row[layout["qd"]] = 0.0 if qd is None else qd
        row[layout["packet_age"]] = age
        return np.asarray(self.agent.act(self._observation)[0])


def stored_interface(card: Mapping[str, Any]) -> Interface:
    """The interface that a bundle was stored with, without an environment.

    Raises:
        AgentError: its robot is unknown here or has changed.
    """
    spec = dict(card["interface"])
    robot = catalog.from_spec(spec["robot"])
    if not isinstance(robot, Robot):
        raise AgentError(f"the bundle drives {robot.name!r}, which is no robot")
    layout = {name: slice(int(start), int(stop)) for name, (start, stop) in spec["layout"].items()}
    return Interface(robot, layout, int(spec["size"]), float(spec["dt"]), float(spec["alpha"]))
