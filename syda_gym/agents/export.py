"""Export: an agent as one ONNX graph that anything can run, checked against the agent itself."""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.agents.agent import Agent
from syda_gym.agents.stacks import stack_spec
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError, MissingExtraError, StorageError
from syda_gym.files import atomic_path

__all__ = ["OPSET", "OnnxRunner", "export_onnx", "parity"]

OPSET = 17


def export_onnx(agent: Agent, path: str | os.PathLike[str]) -> Path:
    """Writes an agent as one ONNX graph.

    Inputs ``observation`` ``(B, size)``, ``state`` ``(B, S)`` and ``fresh`` ``(B, 1)``; outputs ``command`` ``(B, n)``
    [rad] and ``next_state``. Feed zeros as the first state and ``fresh = 1`` in the first step of an episode, then the
    returned state and 0. The layout of the observation, joint names and rates are in the graph's metadata under
    ``syda_gym``.

    Args:
        agent: what to export.
        path: of the ``.onnx`` file.

    Returns:
        The path.

    Raises:
        AgentError: the stack holds an agent without a graph.
        MissingExtraError: onnx is not installed.
        StorageError: the file cannot be written.
    """
    import torch

    from syda_gym.agents.graph import AgentGraph

    try:
        import onnx
    except ImportError as error:
        raise MissingExtraError("ONNX export", "export") from error
    module: Any = AgentGraph(agent).eval()
    example = (
        torch.zeros(2, agent.interface.size),
        torch.zeros(2, max(module.state_size, 1)),
        torch.ones(2, 1),
    )
    names = ["observation", "state", "fresh"]
    axes = {name: {0: "robots"} for name in (*names, "command", "next_state")}
    about = {**agent.interface.spec(), "stack": stack_spec(agent), "state_size": max(module.state_size, 1)}
    with atomic_path(path) as temporary:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the tracer's remarks about constants mean nothing to a user
            torch.onnx.export(
                module,
                example,
                str(temporary),
                input_names=names,
                output_names=["command", "next_state"],
                dynamic_axes=axes,
                opset_version=OPSET,
                dynamo=False,
            )
        model = onnx.load(str(temporary))
        entry = model.metadata_props.add()
        entry.key, entry.value = "syda_gym", json.dumps(about)
        onnx.save(model, str(temporary))
    return Path(path)


class OnnxRunner:
    """Runs an exported agent with onnxruntime, keeping its state.

    Args:
        path: of the ``.onnx`` file.

    Attributes:
        about: interface, stack and state size, as stored.

    Raises:
        MissingExtraError: onnxruntime is not installed.
        StorageError: no such file, or not an export of this library.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise MissingExtraError("running ONNX graphs", "export") from error
        file = Path(path)
        if not file.is_file():
            raise StorageError(f"no file {file}; export an agent first")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        try:
            self._session = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
            self.about = json.loads(self._session.get_modelmeta().custom_metadata_map["syda_gym"])
        except Exception as error:  # onnxruntime raises classes of its own that it does not export
            raise StorageError(f"{file} is no agent exported by this library: {error}") from error
        self._state: NDArray[np.float32] = np.zeros((0, 0), dtype=np.float32)
        self._fresh: NDArray[np.float32] = np.zeros((0, 1), dtype=np.float32)

    def reset(self, count: int = 1) -> None:
        """Prepares for ``count`` robots."""
        self._state = np.zeros((count, int(self.about["state_size"])), dtype=np.float32)
        self._fresh = np.ones((count, 1), dtype=np.float32)

    def act(self, observation: ArrayLike) -> FloatArray:
        """Commands ``(B, n)`` [rad] for observations ``(B, size)``.

        Raises:
            AgentError: another shape than at ``reset``.
        """
        array = np.asarray(observation, dtype=np.float32)
        if array.shape != (len(self._state), int(self.about["size"])):
            raise AgentError(f"expected observations {(len(self._state), self.about['size'])}, got {array.shape}")
        command, self._state = self._session.run(
            None, {"observation": array, "state": self._state, "fresh": self._fresh}
        )
        self._fresh = np.zeros_like(self._fresh)
        return np.asarray(command, dtype=np.float64)


def parity(agent: Agent, runner: OnnxRunner, observations: ArrayLike) -> float:
    """Largest difference of commands [rad] between an agent and its export.

    Args:
        agent: the original.
        runner: the export.
        observations: ``(T, B, size)`` in time order.
    """
    array = np.asarray(observations, dtype=np.float32)
    agent.reset(array.shape[1])
    runner.reset(array.shape[1])
    return max(float(np.abs(agent.act(step) - runner.act(step)).max()) for step in array)
