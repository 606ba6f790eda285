"""Plots: how the joints of an episode followed their reference over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError
from syda_gym.look import COMMAND, REFERENCE, ROBOT

__all__ = ["tracking_figure"]

_COLORS = {"reference": REFERENCE, "command": COMMAND, "robot": ROBOT}


def tracking_figure(robot: Robot, infos: Sequence[dict[str, Any]], dt: float) -> Any:
    """Reference, command and angle of every joint over time, and the landmark errors below.

    Args:
        robot: who moved.
        infos: the ``info`` of each step of one episode, in order.
        dt: time of one step [s].

    Returns:
        A ``matplotlib.figure.Figure``; ``figure.savefig(path)`` writes it.

    Raises:
        OptionError: no step.
    """
    from matplotlib.figure import Figure

    if not infos:
        raise OptionError("tracking_figure: no step to plot; collect the info of every step of an episode")
    times = dt * np.arange(len(infos))
    arms = len(robot.sides)
    rows = max(part.stop - part.start for part in robot.arm_slices) + 1
    figure = Figure(figsize=(5.2 * arms, 1.45 * rows), layout="constrained")
    grid = figure.subplots(rows, arms, sharex=True, squeeze=False)
    columns = {
        "reference": np.degrees([info["reference"] for info in infos]),
        "command": np.degrees([info["command"] for info in infos]),
        "robot": np.degrees([info["q"] for info in infos]),
    }
    for arm, part in enumerate(robot.arm_slices):
        for row, joint in enumerate(range(part.start, part.stop)):
            axes = grid[row, arm]
            for label, values in columns.items():
                wide, style = (2.4, "-") if label == "reference" else (1.1, "--" if label == "command" else "-")
                axes.plot(times, values[:, joint], style, color=_COLORS[label], linewidth=wide, label=label)
            axes.set_title(robot.joint_names[joint], fontsize=9, loc="left", pad=2)
            axes.set_ylabel("deg", fontsize=8)
            axes.tick_params(labelsize=7)
            axes.grid(alpha=0.25)
    errors = 1000.0 * np.array([info["landmark_error"] for info in infos])
    for arm, side in enumerate(robot.sides):
        axes = grid[-1, arm]
        for point, color in ((0, "#3a9d6e"), (1, "#c8472f")):
            name = robot.landmark_names[2 * arm + point]
            axes.plot(times, errors[:, 2 * arm + point], color=color, linewidth=1.2, label=name)
        axes.set_title(f"{side} landmarks: error", fontsize=9, loc="left", pad=2)
        axes.set_ylabel("mm", fontsize=8)
        axes.set_xlabel("s", fontsize=8)
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.25)
        axes.legend(fontsize=7, frameon=False)
    grid[0, 0].legend(fontsize=7, frameon=False, ncols=3)
    return figure
