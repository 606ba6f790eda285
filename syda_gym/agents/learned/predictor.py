"""Predictor: a supervised network that reads the history of command, state and packet age."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.agent import Agent
from syda_gym.agents.interface import Interface, Reading
from syda_gym.agents.learned.tcn import StreamingTcn, TcnShape
from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["AGE_SCALE", "GAP_SCALE", "STEP_SCALE", "Predictor", "input_count", "network_inputs"]

STEP_SCALE = 0.05
GAP_SCALE = 0.1
AGE_SCALE = 0.1
"""Typical change of a command in one step [rad], gap of base or joint to command [rad], age of a packet [s]."""


class Predictor(Agent):
    """Adds to the command from below what a causal convolutional network makes of its history.

    The network sees two streams, the command from below and the base command itself: a filter below is smooth and late,
    the base command is rough and fresh, and what they differ by tells a turn from noise. It sees the level and change
    of the command, its gaps to the base command (and to those to come, where a preview is shown) and to the joint, and
    the packet age, over the last
    ``tcn.receptive_field()`` steps, and answers with a correction of at most ``bound``. It is trained by regression
    through the servo (see ``predictor_training``). A ``Lead`` belongs on top of it. Runs in numpy alone.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below: a filter such as ``Kalman``, or ``BaseAlone``.
        weights: of the network by name.
        channels: width of the network.
        bound: largest correction [rad].

    Raises:
        AgentError: the weights do not fit.
    """

    name = "predictor"

    def __init__(
        self,
        interface: Interface,
        base: Agent,
        *,
        weights: Mapping[str, NDArray[np.float32]],
        channels: int = 48,
        bound: float = 0.6,
    ) -> None:
        super().__init__(interface, base)
        n = interface.n
        self.weights = dict(weights)
        self.channels, self.bound = int(channels), float(bound)
        self._network = StreamingTcn(weights, TcnShape(input_count(interface), self.channels, n))

    def reset(self, count: int, seed: int | None = None) -> None:
        """Forgets the history."""
        super().reset(count, seed)
        self._network.reset(count)
        self._last = np.zeros((count, self.interface.n))

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """Command plus correction."""
        last = np.where(self._fresh[:, None], command, self._last)
        self._last = command
        inputs = network_inputs(self.interface, command, last, reading.preview, reading.q, reading.age)
        return command + self.bound * np.tanh(self._network.step(inputs, self._fresh) / self.bound)

    @property
    def settings(self) -> dict[str, Any]:
        """``channels`` and ``bound``; the weights are stored apart."""
        return {"channels": self.channels, "bound": self.bound}


def network_inputs(
    interface: Interface, command: FloatArray, last: FloatArray, preview: FloatArray, q: FloatArray, age: FloatArray
) -> FloatArray:
    """What the network sees of one step.

    Args:
        interface: for the robot's limits, by which levels are scaled to about [-1, 1].
        command: from the agent below, of this step ``(..., n)`` [rad].
        last: the same of the step before ``(..., n)`` [rad].
        preview: base commands of this step and of those to come ``(..., k + 1, n)`` [rad].
        q: joint angles ``(..., n)`` [rad].
        age: of the packet ``(...)`` [s].

    Returns:
        ``(..., input_count(interface))``.
    """
    robot = interface.robot
    centre, half = (robot.upper + robot.lower) / 2.0, (robot.upper - robot.lower) / 2.0
    parts = [
        (command - centre) / half,
        (command - last) / STEP_SCALE,
        ((preview - command[..., None, :]) / GAP_SCALE).reshape(*command.shape[:-1], -1),
        (q - command) / GAP_SCALE,
        np.asarray(age)[..., None] / AGE_SCALE,
    ]
    return np.concatenate(parts, axis=-1)


def input_count(interface: Interface) -> int:
    """Number of values of ``network_inputs``."""
    shown = interface.layout["base_error"]
    return 3 * interface.n + int(shown.stop - shown.start) + 1
