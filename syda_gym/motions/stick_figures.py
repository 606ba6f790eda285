"""Stick figures of motions over time, to look at what a file holds."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import BONES, HumanSkeleton
from syda_gym.errors import MotionError
from syda_gym.files import atomic_path
from syda_gym.look import LEFT, RIGHT
from syda_gym.motions.clip import MotionClip

__all__ = ["draw_clips"]

_COLOURS = {"left": LEFT, "right": RIGHT}


def draw_clips(
    clips: Sequence[MotionClip], path: str | os.PathLike[str], *, snapshots: int = 8, title: str = ""
) -> Path:
    """Draws clips as rows of stick figures, seen from the front (their left arm is on the right) and from the side.

    Left arm red, right arm blue, wrist paths thin; values that were gaps have hollow dots.

    Args:
        clips: one row of pictures per clip.
        path: PNG file to write.
        snapshots: how many frames of each clip are shown.
        title: heading.

    Returns:
        ``path``.

    Raises:
        MotionError: no clips.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not clips:
        raise MotionError("no clips to draw; give at least one")
    figure = Figure(figsize=(1.35 * snapshots + 1.8, 2.75 * len(clips) + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(2 * len(clips), snapshots, squeeze=False)
    for row, clip in enumerate(clips):
        _draw_row(clip, grid[2 * row : 2 * row + 2], snapshots)
    if title:
        figure.suptitle(title)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=90, format="png")
    return Path(path)


def _draw_row(clip: MotionClip, axes: Any, snapshots: int) -> None:
    points = clip.body.arm_points(clip.frames)
    reach = clip.body.reach
    centre = points[:, :, 0].mean(axis=(0, 1))
    times = np.linspace(0, len(clip) - 1, snapshots).round().astype(int)
    for column, t in enumerate(times):
        for view, horizontal in enumerate((1, 0)):
            axis = axes[view, column]
            _draw_body(axis, clip, t, horizontal)
            for arm, side in enumerate(clip.body.sides):
                limbs = points[t, arm]
                axis.plot(
                    limbs[:, horizontal], limbs[:, 2], color=_COLOURS[side], lw=2, marker="o", ms=3,
                    mfc="white" if _held(clip, t, arm) else None,
                )  # fmt: skip
                past = points[: t + 1, arm, 2]
                axis.plot(past[:, horizontal], past[:, 2], color=_COLOURS[side], lw=0.5, alpha=0.6)
            middle = centre[horizontal]
            axis.set_xlim(middle - 1.35 * reach, middle + 1.35 * reach)
            axis.set_ylim(centre[2] - 1.25 * reach, centre[2] + 1.25 * reach)
            axis.set_aspect("equal")
            axis.set_xticks([])
            axis.set_yticks([])
        axes[0, column].set_title(f"{t / clip.fps:.1f} s", fontsize=7)
    axes[0, 0].set_ylabel(f"{clip.body.name}\n{clip.recording[-28:]}\nfront", fontsize=7)
    axes[1, 0].set_ylabel("side (facing right)", fontsize=7)


def _held(clip: MotionClip, t: int, arm: int) -> bool:
    if clip.filled is None or clip.body.kind != "human":
        return False
    return bool(clip.filled[t].reshape(len(clip.body.sides), -1)[arm].any())


def _draw_body(axis: Any, clip: MotionClip, t: int, horizontal: int) -> None:
    """Trunk and head in grey: a human's resting joints, or a box between a robot's shoulders."""
    if isinstance(clip.body, HumanSkeleton):
        joints = clip.body.complete(clip.frames[t : t + 1])
        for a, b in BONES:
            if a in joints and b in joints and not {"LElbow", "RElbow"} & {a, b}:
                line = np.vstack([joints[a], joints[b]])
                axis.plot(line[:, horizontal], line[:, 2], color="0.75", lw=1)
        head: FloatArray = joints["Head"][0]
        axis.plot(head[horizontal], head[2], "o", color="0.75", ms=6)
        return
    shoulders = clip.body.arm_points(clip.frames[t])[0, :, 0]
    line = np.vstack([shoulders, np.zeros((1, 3)), shoulders[:1]])
    axis.plot(line[:, horizontal], line[:, 2], color="0.75", lw=1)
