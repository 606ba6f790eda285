"""Adding a robot: a URDF becomes a name that every command takes, with a YAML and a picture that a person can check."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot, RobotDescription
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.files import write_text
from syda_gym.teleoperation.safety.self_collision import SelfCollision
from syda_gym.teleoperation.setup.robot_picture import draw_robot

__all__ = ["AddedRobot", "add_robot", "describe_robot"]

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,63}")
_SPREADS = (0.15, 0.3, 0.5, 0.8, 1.2)  # how far the arms are lifted sideways until they touch nothing


@dataclass(frozen=True)
class AddedRobot:
    """What was found in a URDF.

    Attributes:
        robot: ready for use.
        description: the YAML that was written.
        picture: the PNG beside it.
        pointing_error: mean angle [rad] between the limbs of random reachable operator poses and the robot's.
        notices: what a person should check.
    """

    robot: Robot
    description: Path
    picture: Path
    pointing_error: float
    notices: tuple[str, ...]


def add_robot(
    urdf: str | os.PathLike[str],
    name: str | None = None,
    *,
    left: str | None = None,
    right: str | None = None,
    torso: str | None = None,
    replace_existing: bool = False,
) -> AddedRobot:
    """Reads a URDF, finds arms, hands and torso, proposes a rest pose, and makes the robot known under a name.

    The YAML goes to ``catalog.user_folder()`` and is meant to be edited; it points to the URDF where it lies.

    Args:
        urdf: any URDF, with primitives or meshes; meshes need not be there.
        name: the new name, lower case; by default the file's.
        left: link at the end of the left arm, where the search finds the wrong one.
        right: link at the end of the right arm.
        torso: link in whose frame landmarks are expressed.
        replace_existing: overwrite a robot that was added before.

    Returns:
        What was found.

    Raises:
        EmbodimentError: not a URDF, no arms, unknown links (with the nearest name), or a name that is taken.
        OptionError: a name that is no name.
    """
    chosen = name if name is not None else re.sub(r"[^a-z0-9_-]+", "-", Path(urdf).stem.lower()).strip("-_")
    if not _NAME.fullmatch(chosen):
        raise OptionError(
            f"robot name {chosen!r}: use lower-case letters, digits, - and _, at most 64, such as my-robot"
        )
    path = catalog.user_folder() / f"{chosen}.yaml"
    if chosen in catalog.names() and not (replace_existing and path.is_file()):
        raise EmbodimentError(
            f"the name {chosen!r} is taken; choose another with --name"
            + (", or pass --replace" if path.is_file() else "")
        )
    description, notices = describe_robot(urdf, chosen, left=left, right=right, torso=torso)
    robot = Robot(description)
    picture = draw_robot(robot, path.with_suffix(".png"))  # first: a robot that cannot be drawn is not added
    write_text(path, _yaml(robot))
    catalog.register(chosen, Robot.read(path), replace=True)
    return AddedRobot(robot, path, picture, _pointing_error(robot), tuple(notices))


def describe_robot(
    urdf: str | os.PathLike[str],
    name: str,
    *,
    left: str | None = None,
    right: str | None = None,
    torso: str | None = None,
) -> tuple[RobotDescription, list[str]]:
    """A description with rest pose and ignored contacts, and what a person should check about it.

    Raises:
        EmbodimentError: as ``add_robot``.
    """
    found = discover(urdf, name=name, left=left, right=right, torso=torso)
    notices = []
    if len(found.arms) == 1:
        notices.append(f"only a {found.arms[0].side} arm was found; name the other one with --left or --right")
    rest = _hanging(Robot(found))
    described = replace(found, rest=rest)
    robot = Robot(described)
    check = SelfCollision(robot)
    if check.why:
        notices.append(check.why)
    elif check.ignored:
        described = replace(described, disabled_collisions=check.ignored)
        notices.append(
            f"{len(check.ignored)} pairs of links overlap by construction or at rest; their contact is ignored"
        )
    unknown = [n for n, speed in zip(robot.joint_names, robot.speed, strict=True) if not np.isfinite(speed)]
    if unknown:
        notices.append(f"the URDF names no speed limit for {', '.join(unknown)}; live commands keep to 2 rad/s")
    return described, notices


def _hanging(robot: Robot) -> dict[str, float]:
    """Rest angles: arms hanging with slightly bent elbows, lifted sideways as far as it takes to touch nothing."""
    solver = LimbIK(robot)
    sides = [1.0 if side == "left" else -1.0 for side in robot.sides]
    angles = robot.rest
    for spread in _SPREADS:
        wanted = np.array([[[[0.1, spread * side, -1.0], [0.5, spread * side, -1.0]] for side in sides]])
        angles = solver.solve(wanted)[0]
        candidate = Robot(replace(robot.description, rest=dict(zip(robot.joint_names, angles.tolist(), strict=True))))
        if not SelfCollision(candidate, margin=0.0).ignores_far_links():
            break
    return {name: round(float(angle), 4) for name, angle in zip(robot.joint_names, angles, strict=True)}


def _pointing_error(robot: Robot) -> float:
    """How well the robot can point its limbs as a human does: mean angle over poses in front and beside the body."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(200, len(robot.sides), 2, 3))
    directions[..., 0] = np.abs(directions[..., 0])
    for index, side in enumerate(robot.sides):
        outward = 1.0 if side == "left" else -1.0
        directions[:, index, 0, 1] = outward * np.abs(directions[:, index, 0, 1])
    reached = np.diff(robot.arm_points(LimbIK(robot).solve(directions)), axis=2)
    cosine = np.sum(_unit(reached) * _unit(directions), axis=-1)
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)).mean())


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return unit


def _yaml(robot: Robot) -> str:
    description = robot.description
    parts: list[tuple[str, dict[str, object]]] = [
        (f"# Found by `syda-gym robot add`; edit what is wrong, then look again: syda-gym robot show {robot.name}\n"
         "# Lengths in metres, angles in radians.",
         {"name": description.name, "urdf": str(description.urdf)}),
        ("# The link in whose frame landmarks are expressed (x forward, y left, z up after `axes`).",
         {"torso": description.torso, "height": round(description.height, 3)}),
    ]  # fmt: skip
    if description.axes is not None:
        parts.append(
            (
                "# Rows: forward, left and up of the body, in the torso link's own frame.",
                {"axes": [list(row) for row in description.axes]},
            )
        )
    arms = [
        {
            "side": arm.side,
            "joints": list(arm.joints),
            "shoulder": arm.shoulder,
            "elbow": arm.elbow,
            "wrist": arm.wrist,
            "tip": arm.tip,
        }
        for arm in description.arms
    ]
    parts.append(("# Links whose origins are shoulder, elbow, wrist and the end of the arm.", {"arms": arms}))
    parts.append(("# The pose to start from and to return to.", {"rest": dict(description.rest)}))
    if description.disabled_collisions:
        parts.append(
            (
                "# Pairs of links whose contact is ignored: they overlap by construction or at rest.",
                {"disabled_collisions": [list(pair) for pair in description.disabled_collisions]},
            )
        )
    return "".join(f"{comment}\n{_dumped(value)}" for comment, value in parts)


def _dumped(value: dict[str, object]) -> str:
    """One key a line, small lists and tables within the line."""
    return "".join(
        yaml.safe_dump(
            {key: one}, sort_keys=False, width=110, default_flow_style=None if isinstance(one, list | dict) else False
        )
        for key, one in value.items()
    )
