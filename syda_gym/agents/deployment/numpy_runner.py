"""Runner: a stored mapping and a stored agent as one function of the operator's frame, in numpy, without torch."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
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
from syda_gym.files import asset
from syda_gym.mappings.limits import SpeedLimiter
from syda_gym.mappings.stream import FrameStream

if TYPE_CHECKING:
    from syda_gym.mappings.mapping import Mapping as MotionMapping

from syda_gym.agents.pairing import check_pairing

__all__ = ["Runner", "bundle_path", "check_pairing", "find_mapping", "stored_interface"]


class Runner:
    """Drives one robot: operator frame in, joint command out.

    As in the environment, frames are mapped in time order, and the base command follows the mapping no faster than the
    joint speed limits allow.

    Args:
        agent: who acts.
        mapping: from the operator to the agent's robot.

    Raises:
        AgentError: the mapping leads elsewhere, or its operator has other features than the agent was made for.
    """

    def __init__(self, agent: Agent, mapping: MotionMapping) -> None:
        check_pairing(agent, mapping)
        self.agent, self.mapping = agent, mapping
        self._stream = FrameStream(mapping, 1.0 / agent.interface.dt)
        self._limiter = SpeedLimiter(agent.interface.robot, 1.0 / agent.interface.dt)
        self._observation = np.zeros((1, agent.interface.size))

    @classmethod
    def load(cls, agent: str | os.PathLike[str], mapping: str | os.PathLike[str] | None = None) -> Runner:
        """From the paths of a bundle and of a stored mapping.

        Args:
            agent: path of the bundle, or name of a shipped one.
            mapping: see ``find_mapping``.

        Raises:
            StorageError: missing or corrupt files.
            AgentError: they do not fit together, or no mapping was found.
        """
        path = bundle_path(agent)
        return cls(load_agent(path, stored_interface(read_card(path))), find_mapping(path, mapping))

    def reset(self) -> None:
        """Begins an episode."""
        self.agent.reset(1)
        self._stream.reset()
        self._limiter.reset()

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
        row[layout["base_error"]] = self._limiter(self._stream(frame)) - np.asarray(q)
        row[layout["q"]] = q
        row[layout["qd"]] = 0.0 if qd is None else qd
        row[layout["packet_age"]] = age
        return np.asarray(self.agent.act(self._observation)[0])


def bundle_path(agent: str | os.PathLike[str]) -> Path:
    """The path of a bundle that is given by its path or by the name of a shipped one."""
    shipped = asset("agents", os.fspath(agent))
    return shipped if shipped.with_suffix(".json").is_file() else Path(agent)


def find_mapping(agent: str | os.PathLike[str], mapping: str | os.PathLike[str] | None = None) -> MotionMapping:
    """The mapping of a bundle.

    Args:
        agent: path of the bundle.
        mapping: path of a stored mapping. By default the one stored beside the bundle as ``mapping.json``, as training
            does; without one, the shipped mappings along the route in the bundle's card, if method and preset agree.

    Raises:
        StorageError: missing or corrupt files.
        AgentError: none was found.
    """
    from syda_gym.mappings.storage import load_mapping

    beside = Path(agent).parent / "mapping.json"
    if mapping is not None or beside.is_file():
        return load_mapping(beside if mapping is None else mapping)
    card = read_card(agent)["mapping"]
    route = list(card.get("route") or [])
    paths = [asset("mappings", f"{a}-{b}.json") for a, b in zip(route[:-1], route[1:], strict=True)]
    if paths and all(path.is_file() for path in paths):
        found = load_mapping(paths[0])
        for path in paths[1:]:
            found = found >> load_mapping(path)
        if (found.method, found.preset) == (card.get("method"), card.get("preset")):
            return found
    raise AgentError(
        f"no mapping is stored beside {os.fspath(agent)!r}, and none is shipped for its route "
        f"{' > '.join(route) or '(unknown)'} by {card.get('method')!r}, preset {card.get('preset')!r}; "
        "name the stored one"
    )


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
