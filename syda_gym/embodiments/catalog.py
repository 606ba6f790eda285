"""The catalog: names to embodiments; users register their own."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

from syda_gym import files
from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.parametric import PARAMETRIC_HUMANS
from syda_gym.embodiments.reading.source import ROBOT_ENDINGS
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, nearest_name
from syda_gym.files import asset

__all__ = ["from_spec", "get", "is_robot_file", "names", "register", "resolve", "user_folder"]

_makers: dict[str, Callable[[], Embodiment]] = {}


def register(name: str, maker: Callable[[], Embodiment] | Embodiment, *, replace: bool = False) -> None:
    """Makes a body known under a name.

    Args:
        name: the name that commands and ``get`` take.
        maker: the body itself, or a function without arguments that builds it on first use.
        replace: allow an existing name to be taken over.

    Raises:
        EmbodimentError: the name is taken and ``replace`` is false.
    """
    if name in _makers and not replace:
        raise EmbodimentError(f"the name {name!r} is taken; choose another or pass replace=True")
    body = maker
    _makers[name] = (lambda: body) if isinstance(body, Embodiment) else body
    _build.cache_clear()


def names() -> tuple[str, ...]:
    """Every known name, sorted; robots added by the user included."""
    return tuple(sorted({*_makers, *(path.stem for path in user_folder().glob("*.yaml"))}))


def get(name: str) -> Embodiment:
    """The body called ``name``.

    Raises:
        EmbodimentError: unknown name; the message says which is nearest.
    """
    if name not in names():
        raise EmbodimentError(f"unknown embodiment {name!r}; {nearest_name(name, names())}")
    return _build(name)


def resolve(body: str | os.PathLike[str] | Embodiment) -> Embodiment:
    """Accepts a body, its name, or the path of a robot description (``.yaml``) or of a URDF, whose arms are found.

    Raises:
        EmbodimentError: an unknown name, or a file that is no robot.
    """
    if isinstance(body, Embodiment):
        return body
    text = os.fspath(body)
    if text.lower().endswith((".yaml", ".yml")):
        return Robot.read(text)
    if is_robot_file(text):
        from syda_gym.embodiments.discovery.arms import discover_robot

        return discover_robot(text)
    return get(text)


def is_robot_file(body: object) -> bool:
    """Whether something is the path of a robot's file or description, by its ending."""
    if not isinstance(body, str | os.PathLike):
        return False
    return os.fspath(body).lower().endswith((*ROBOT_ENDINGS, ".yaml", ".yml"))


def from_spec(spec: dict[str, Any]) -> Embodiment:
    """Rebuilds a body from ``Embodiment.spec()`` and checks that a robot still has the same kinematics.

    Raises:
        EmbodimentError: unknown robot, or its URDF has changed since the description was stored.
    """
    kind = spec.get("kind")
    if kind == "human":
        return HumanSkeleton(**{key: value for key, value in spec.items() if key != "kind"})
    if kind == "robot":
        robot = get(str(spec["name"]))
        if robot.spec() != spec:
            raise EmbodimentError(
                f"robot {spec['name']!r} differs from the stored one (joints or kinematics changed); fit again"
            )
        return robot
    raise EmbodimentError(f"unknown kind of embodiment {kind!r}; expected 'human' or 'robot'")


def user_folder() -> Path:
    """Where ``syda-gym robot add`` keeps descriptions: ``$SYDA_GYM_HOME/robots`` or ``~/.syda_gym/robots``."""
    return files.user_folder("robots")


@lru_cache(maxsize=256)
def _build(name: str) -> Embodiment:
    if name in _makers:
        return _makers[name]()
    return Robot.read(user_folder() / f"{name}.yaml")


def _adult() -> Embodiment:
    # Link medians of the paper's recordings (adult mimicking Pepper); stature from the paper's Table 1.
    return HumanSkeleton("adult", height=1.75, upper_arm=0.294, forearm=0.287, shoulders=0.303, origin="head")


def _kid() -> Embodiment:
    return HumanSkeleton("kid", height=1.42, upper_arm=0.215, forearm=0.214, shoulders=0.224, origin="torso")


register("adult", _adult)
register("kid", _kid)
register("pepper", lambda: Robot.read(asset("robots", "pepper.yaml")))
register("nao", lambda: Robot.read(asset("robots", "nao.yaml")))
for _name, _maker in PARAMETRIC_HUMANS.items():
    register(_name, _maker)
