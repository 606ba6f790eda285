"""Stacks: agents written down as plain data and built again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.agent import Agent, BaseAlone
from syda_gym.agents.classical.adaptive import AdaptiveLead
from syda_gym.agents.classical.projection import Projection
from syda_gym.agents.classical.rivals import Ema, Kalman, Lead, OneEuro
from syda_gym.agents.classical.sliding import Sliding
from syda_gym.agents.interface import Interface
from syda_gym.agents.learned.policy import ResidualPolicy
from syda_gym.agents.learned.predictor import Predictor
from syda_gym.errors import AgentError, nearest_name

__all__ = ["AGENTS", "build_stack", "stack_arrays", "stack_spec"]

Arrays = Mapping[str, NDArray[Any]]

AGENTS: Mapping[str, type[Agent]] = {
    kind.name: kind
    for kind in (BaseAlone, Lead, AdaptiveLead, Ema, OneEuro, Kalman, Projection, Sliding, Predictor, ResidualPolicy)
}
"""Every kind of agent by name."""


def stack_spec(agent: Agent) -> list[dict[str, Any]]:
    """Name and settings of every agent of a stack, from the bottom up, as JSON-able data."""
    below = stack_spec(agent.base) if agent.base is not None else []
    return [*below, {"agent": agent.name, "settings": agent.settings}]


def stack_arrays(agent: Agent) -> dict[str, NDArray[Any]]:
    """Weights and normalisation of every learned agent of a stack; names begin with its place from the bottom."""
    arrays = stack_arrays(agent.base) if agent.base is not None else {}
    place = len(agent.stack) - 1
    if isinstance(agent, Predictor | ResidualPolicy):
        arrays |= {f"{place}.weights.{name}": value for name, value in agent.weights.items()}
    if isinstance(agent, ResidualPolicy):
        arrays |= {f"{place}.mean": agent.mean, f"{place}.std": agent.std}
    return arrays


def build_stack(interface: Interface, spec: Sequence[Mapping[str, Any]], arrays: Arrays | None = None) -> Agent:
    """Builds a stack from what ``stack_spec`` and ``stack_arrays`` gave.

    Raises:
        AgentError: unknown agents, settings or arrays that do not fit.
    """
    given = dict(arrays or {})
    agent: Agent | None = None
    for place, entry in enumerate(spec):
        name = str(entry.get("agent"))
        if name not in AGENTS:
            raise AgentError(f"unknown agent {name!r}; {nearest_name(name, AGENTS)}")
        agent = _build(interface, agent, name, dict(entry.get("settings") or {}), given, place)
    if agent is None:
        raise AgentError("the stack is empty; it needs at least the agent 'base'")
    if given:
        raise AgentError(f"arrays that belong to no agent of the stack: {sorted(given)}")
    return agent


def _build(
    interface: Interface, base: Agent | None, name: str, settings: dict[str, Any], arrays: dict[str, Any], place: int
) -> Agent:
    if (base is None) != (name == BaseAlone.name):
        raise AgentError(f"agent {name!r} at place {place}: a stack begins with 'base' and has no other")
    if base is None:
        return BaseAlone(interface)
    kind = AGENTS[name]
    if kind in (Predictor, ResidualPolicy):
        prefix = f"{place}.weights."
        settings["weights"] = {key[len(prefix) :]: arrays.pop(key) for key in list(arrays) if key.startswith(prefix)}
    if kind is ResidualPolicy:
        for part in ("mean", "std"):
            if f"{place}.{part}" not in arrays:
                raise AgentError(f"the normalisation '{place}.{part}' of the residual policy is missing")
            settings[part] = np.asarray(arrays.pop(f"{place}.{part}"))
    try:
        return kind(interface, base, **settings)
    except TypeError as error:
        raise AgentError(f"agent {name!r} does not take these settings: {error}") from error
