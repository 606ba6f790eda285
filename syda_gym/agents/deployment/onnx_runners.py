"""OnnxRunner and OnnxAgent: exported graphs in onnxruntime, with their state; neither needs torch."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError, MissingExtraError, StorageError
from syda_gym.files import check_size, shortened

__all__ = ["OnnxAgent", "OnnxRunner"]

_MAX_BYTES = 256 * 2**20
_WIDEST = 100_000


class _Graph:
    """A session of onnxruntime with the state of the graph.

    Args:
        path: of the ``.onnx`` file.

    Attributes:
        about: the card: inputs, outputs, interface, stack and mapping.
    """

    first = "observation"
    """Name of the graph's first input, by which the two kinds of export are told apart."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise MissingExtraError("running ONNX graphs", "export") from error
        file = Path(path)
        if not file.is_file():
            raise StorageError(f"no file {file}; export an agent first")
        check_size(file, _MAX_BYTES, "an exported agent (.onnx)")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
            self.about: dict[str, Any] = json.loads(self._session.get_modelmeta().custom_metadata_map["syda_gym"])
            self._widths = {str(port["name"]): int(port["shape"][1]) for port in self.about["inputs"]}
            if not all(0 < width <= _WIDEST for width in self._widths.values()):
                raise ValueError(f"its card gives inputs of {shortened(list(self._widths.values()))} numbers")
        except Exception as error:  # onnxruntime raises classes of its own that it does not export
            raise StorageError(f"{file} is no agent exported by this library: {str(error)[:400]}") from error
        needed = {self.first, "state", "fresh"}
        if not {"state", "fresh"} <= set(self._widths):
            raise StorageError(
                f"{file}: its card lists the inputs {shortened(sorted(self._widths))}; expected {sorted(needed)}"
            )
        given = {port.name for port in self._session.get_inputs()}
        if not set(self._widths) <= given:
            raise StorageError(
                f"{file}: its card lists inputs {shortened(sorted(set(self._widths) - given))} that the graph has not"
            )
        if self.first not in self._widths:
            other = "OnnxRunner" if "frame" in self._widths else "OnnxAgent"
            raise StorageError(f"{file} begins with {next(iter(self._widths))!r}, not {self.first!r}; use {other}")
        self._state = np.zeros((0, self._widths["state"]))
        self._fresh = np.zeros((0, 1))

    def reset(self, count: int = 1) -> None:
        """Prepares for ``count`` robots."""
        self._state = np.zeros((count, self._widths["state"]))
        self._fresh = np.ones((count, 1))

    def _run(self, **inputs: ArrayLike) -> list[FloatArray]:
        """All outputs but the state, which is kept.

        Raises:
            AgentError: another shape than at ``reset``.
        """
        given = {name: np.asarray(value, dtype=np.float64) for name, value in inputs.items()}
        for name, value in given.items():
            if value.shape != (len(self._state), self._widths[name]):
                raise AgentError(f"expected {name} {(len(self._state), self._widths[name])}, got {value.shape}")
        *outputs, self._state = self._session.run(None, {**given, "state": self._state, "fresh": self._fresh})
        self._fresh = np.zeros_like(self._fresh)
        return [np.asarray(output) for output in outputs]


class OnnxRunner(_Graph):
    """Runs mapping and agent from one exported graph: operator frame in, joint command out, as ``Runner`` does.

    Args:
        path: of the ``.onnx`` file.

    Attributes:
        about: the card: inputs, outputs, interface, stack and mapping.

    Raises:
        MissingExtraError: onnxruntime is not installed.
        StorageError: no such file, or not an export of this library with a mapping.
    """

    first = "frame"

    def step(self, frame: ArrayLike, q: ArrayLike, *, qd: ArrayLike | None = None, age: float = 0.0) -> FloatArray:
        """The next command; see ``Runner.step``.

        Args:
            frame: newest operator frame ``(F,)``.
            q: joint angles now ``(n,)`` [rad].
            qd: joint speeds now ``(n,)`` [rad/s]; zero if left out.
            age: age of the operator's frame [s].

        Returns:
            ``(n,)`` [rad].

        Raises:
            AgentError: wrong shapes, or not reset for one robot.
        """
        speeds = np.zeros(np.shape(q)) if qd is None else np.asarray(qd)
        command = self._run(frame=np.asarray(frame)[None], q=np.asarray(q)[None], qd=speeds[None], age=[[age]])[0]
        return np.asarray(command[0])


class OnnxAgent(_Graph):
    """Runs an agent that was exported without its mapping.

    Args:
        path: of the ``.onnx`` file.

    Attributes:
        about: the card: inputs, outputs, interface and stack.

    Raises:
        MissingExtraError: onnxruntime is not installed.
        StorageError: no such file, or not an export of this library without a mapping.
    """

    def act(self, observation: ArrayLike) -> FloatArray:
        """Commands ``(B, n)`` [rad] for observations ``(B, size)``.

        Raises:
            AgentError: another shape than at ``reset``.
        """
        return self._run(observation=observation)[0]
