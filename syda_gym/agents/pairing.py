"""check_pairing: does an agent belong to the robot that a mapping drives?"""

from __future__ import annotations

from syda_gym.agents.agent import Agent
from syda_gym.errors import AgentError
from syda_gym.mappings.mapping import Mapping as MotionMapping

__all__ = ["check_pairing"]


def check_pairing(agent: Agent, mapping: MotionMapping) -> None:
    """Compares what a mapping gives and takes with what an agent was made for.

    Raises:
        AgentError: another robot, or an operator with other features.
    """
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
