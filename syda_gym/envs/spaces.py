"""Spaces: actions, reset options and info, as both environments understand them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.envs.fleet import EpisodeWish
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.task.repertoire import Repertoire
from syda_gym.errors import OptionError, nearest_name

__all__ = ["RESET_OPTIONS", "action_from_command", "action_space", "one_info", "wishes"]

RESET_OPTIONS = ("motion", "clip", "frame", "route")
"""Keys of ``reset(options=...)``; ``clip`` is another word for ``motion``."""


def action_space(robot: Robot) -> Any:
    """One number in [-1, 1] per arm joint, in either action mode."""
    return Box(-1.0, 1.0, (len(robot.joint_names),), dtype=np.float32)


def action_from_command(options: TeleopOptions, robot: Robot, command: FloatArray, base: FloatArray) -> FloatArray:
    """The action whose command comes nearest to ``command`` where the base command is ``base``, any leading axes."""
    if options.action_mode == "residual":
        return np.asarray(np.clip((command - base) / options.residual_scale, -1.0, 1.0))
    return np.asarray(np.clip(2.0 * (command - robot.lower) / (robot.upper - robot.lower) - 1.0, -1.0, 1.0))


def wishes(repertoire: Repertoire, options: dict[str, Any] | None, count: int) -> list[EpisodeWish]:
    """What ``reset(options=...)`` asks of each of ``count`` robots.

    ``motion`` and ``frame`` may be one value for all, or a sequence with one value per robot.

    Raises:
        OptionError: unknown keys, clips or frames.
        RouteError: the route cannot be taken.
    """
    given = dict(options or {})
    for key in given:
        if key not in RESET_OPTIONS:
            raise OptionError(f"unknown reset option {key!r}; {nearest_name(str(key), RESET_OPTIONS)}")
    if "motion" in given and "clip" in given:
        raise OptionError("reset options 'motion' and 'clip' mean the same; give one of them")
    clips = _each(given.get("motion", given.get("clip")), count, "motion")
    frames = _each(given.get("frame"), count, "frame")
    route = None if given.get("route") is None else repertoire.route_index(given["route"])
    return [
        EpisodeWish(
            None if clip is None else repertoire.clip_index(clip), None if frame is None else _whole(frame), route
        )
        for clip, frame in zip(clips, frames, strict=True)
    ]


def one_info(info: dict[str, Any], names: dict[str, Any], index: int) -> dict[str, Any]:
    """The entries of one robot: arrays stay arrays, single numbers become Python numbers."""
    result: dict[str, Any] = {}
    for key, value in info.items():
        if key in names:
            result[key] = names[key]
        elif isinstance(value, dict):
            result[key] = {name: column.item(index) for name, column in value.items()}
        else:
            result[key] = value.item(index) if value.ndim == 1 else value[index]
    return result


def _each(value: Any, count: int, what: str) -> Sequence[Any]:
    if value is None or isinstance(value, str) or np.ndim(value) == 0:
        return [value] * count
    values = list(value)
    if len(values) != count:
        raise OptionError(f"reset option {what!r}: expected one value or {count} values, got {len(values)}")
    return values


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise OptionError(f"reset option 'frame' must be a whole number, got {value!r}")
    return int(value)
