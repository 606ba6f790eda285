"""Export: mapping and agent, or an agent alone, as one ONNX graph that anything can run."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.agents.agent import Agent
from syda_gym.agents.bundle import package_versions
from syda_gym.agents.deployment.numpy_runner import Runner
from syda_gym.agents.deployment.onnx_runners import OnnxAgent, OnnxRunner
from syda_gym.agents.stacks import stack_spec
from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import MissingExtraError
from syda_gym.files import atomic_path, write_json

if TYPE_CHECKING:
    from syda_gym.mappings.mapping import Mapping as MotionMapping

__all__ = ["OPSET", "agent_parity", "card_path", "export_onnx", "runner_parity"]

OPSET = 17
FORMAT = 2
"""Version of the card."""


@dataclass(frozen=True)
class _Port:
    """One input or output of a graph."""

    name: str
    width: int
    unit: str
    meaning: str
    columns: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """For the card."""
        known: dict[str, Any] = {
            "name": self.name,
            "shape": ["robots", self.width],
            "type": "float64",
            "unit": self.unit,
            "meaning": self.meaning,
        }
        return {**known, "columns": list(self.columns)} if self.columns else known


def export_onnx(agent: Agent, path: str | os.PathLike[str], mapping: MotionMapping | None = None) -> Path:
    """Writes mapping and agent as one ONNX graph, and a card of its inputs and outputs as JSON beside it.

    With a mapping the graph takes the operator's frame: inputs ``frame`` ``(B, F)``, ``q`` ``(B, n)`` [rad], ``qd``
    ``(B, n)`` [rad/s], ``age`` ``(B, 1)`` [s], ``state`` ``(B, S)`` and ``fresh`` ``(B, 1)``; outputs ``command``
    [rad], ``base`` [rad] (what the mapping asks for, within the speed limits) and ``next_state``. Without one it takes
    the environment's ``observation`` ``(B, size)`` instead of the first four. Everything is float64, because in single
    precision inverse kinematics may choose another branch. Feed zeros as the first state and ``fresh = 1`` in the
    first step of an episode, then the returned state and 0.

    Args:
        agent: what to export.
        path: of the ``.onnx`` file; the card is written as ``.onnx.json`` beside it.
        mapping: from the operator to the agent's robot; the agent alone if ``None``.

    Returns:
        The path.

    Raises:
        AgentError: they do not fit together, or a part of them has no graph; the message says which parts have.
        MissingExtraError: onnx is not installed.
        StorageError: the files cannot be written.
    """
    import torch

    from syda_gym.agents.graphs.stack import AgentGraph
    from syda_gym.agents.graphs.teleop import TeleopGraph

    try:
        import onnx
    except ImportError as error:
        raise MissingExtraError("ONNX export", "export") from error
    module: Any = (AgentGraph(agent) if mapping is None else TeleopGraph(agent, mapping)).eval()
    ports = _ports(agent, mapping, max(module.state_size, 1))
    names = ([port.name for port in ports[0]], [port.name for port in ports[1]])
    example = tuple(torch.ones(2, port.width, dtype=torch.float64) for port in ports[0])
    card = _card(agent, mapping, ports)
    with atomic_path(path) as temporary:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the tracer's remarks about constants mean nothing to a user
            traced = torch.jit.trace(module, example, check_trace=False)  # type: ignore[no-untyped-call]
            torch.onnx.export(
                traced,
                example,
                str(temporary),
                input_names=names[0],
                output_names=names[1],
                dynamic_axes={name: {0: "robots"} for name in (*names[0], *names[1])},
                opset_version=OPSET,
                dynamo=False,
            )
        model = onnx.load(str(temporary))
        entry = model.metadata_props.add()
        entry.key, entry.value = "syda_gym", json.dumps(card)
        onnx.save(model, str(temporary))
    write_json(card_path(path), card)
    return Path(path)


def card_path(path: str | os.PathLike[str]) -> Path:
    """Where the card of an exported graph lies; never the card of a bundle of the same name."""
    return Path(path).with_name(Path(path).name + ".json")


def agent_parity(agent: Agent, exported: OnnxAgent, observations: ArrayLike) -> float:
    """Largest difference of commands [rad] between an agent and its export.

    Args:
        agent: the original.
        exported: the export.
        observations: ``(T, B, size)`` in time order.
    """
    array = np.asarray(observations, dtype=np.float64)
    agent.reset(array.shape[1])
    exported.reset(array.shape[1])
    return max(float(np.abs(agent.act(step) - exported.act(step)).max()) for step in array)


def runner_parity(runner: Runner, exported: OnnxRunner, frames: ArrayLike, ages: Sequence[float] = ()) -> float:
    """Largest difference of commands [rad] between a runner and its export, each driving a robot of its own.

    The robots are ideal motors, ``q += alpha (command - q)``, so that a difference would grow as it does in use.

    Args:
        runner: the original.
        exported: the export.
        frames: operator frames ``(T, F)`` in time order.
        ages: of the frames [s]; zero where left out.
    """
    alpha, speed = runner.agent.interface.alpha, runner.agent.interface.robot.speed * runner.agent.interface.dt
    array = np.asarray(frames, dtype=np.float64)
    runner.reset()
    exported.reset()
    one, other = runner.mapping(array[0]), runner.mapping(array[0])
    worst = 0.0
    for index, frame in enumerate(array):
        age = float(ages[index]) if len(ages) else 0.0
        command, seen = runner.step(frame, one, age=age), exported.step(frame, other, age=age)
        worst = max(worst, float(np.abs(command - seen).max()))
        one = one + np.clip(alpha * (command - one), -speed, speed)
        other = other + np.clip(alpha * (seen - other), -speed, speed)
    return worst


def _ports(agent: Agent, mapping: MotionMapping | None, state: int) -> tuple[list[_Port], list[_Port]]:
    """Inputs and outputs."""
    robot = agent.interface.robot
    n, joints = agent.interface.n, robot.joint_names
    memory = _Port("state", state, "", "memory: zeros before the first step, then next_state of the step before")
    fresh = _Port("fresh", 1, "", "1 in the first step of an episode, then 0; state is not read where it is 1")
    command = _Port("command", n, "rad", "joint command for the next control step", joints)
    after = _Port("next_state", state, "", "memory for the next step")
    if mapping is None:
        meaning = "the environment's observation; interface.layout says which columns are what"
        return [_Port("observation", agent.interface.size, "", meaning), memory, fresh], [command, after]
    source = mapping.source
    features = tuple(feature.name for feature in source.features)
    inputs = [
        _Port("frame", source.n_features, _unit(source), "newest frame of the operator", features),
        _Port("q", n, "rad", "joint angles now", joints),
        _Port("qd", n, "rad/s", "joint speeds now; zeros if unknown", joints),
        _Port("age", 1, "s", "age of the operator's frame; zero if unknown"),
        memory,
        fresh,
    ]
    base = _Port("base", n, "rad", "what the mapping asks for, within joint and speed limits", joints)
    return inputs, [command, base, after]


def _unit(body: Embodiment) -> str:
    return ", ".join(dict.fromkeys(feature.unit for feature in body.features))


def _card(
    agent: Agent, mapping: MotionMapping | None, ports: tuple[Sequence[_Port], Sequence[_Port]]
) -> dict[str, Any]:
    """What a user of the graph must know."""
    return {
        "format": FORMAT,
        "graph": "agent alone" if mapping is None else "mapping and agent",
        "inputs": [port.as_dict() for port in ports[0]],
        "outputs": [port.as_dict() for port in ports[1]],
        "step_s": agent.interface.dt,
        "interface": agent.interface.spec(),
        "stack": stack_spec(agent),
        "mapping": None if mapping is None else {"route": list(mapping.route), **mapping.card.to_json()},
        "versions": package_versions(),
    }
