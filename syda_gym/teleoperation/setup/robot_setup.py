"""Adding a robot: a URDF becomes a name that every command takes, with a YAML and a picture that a person can check."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import search
from syda_gym.embodiments.kinematics.urdf import read_urdf
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot, RobotDescription
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.files import write_text
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.simulation.plain_body import weak_joints
from syda_gym.teleoperation.setup.robot_picture import draw_robot
from syda_gym.teleoperation.setup.robot_yaml import robot_yaml
from syda_gym.teleoperation.setup.verdict import Verdict, judge_robot

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
        verdict: how far its limbs can point as a person's do.
        notices: what a person should check.
    """

    robot: Robot
    description: Path
    picture: Path
    verdict: Verdict
    notices: tuple[str, ...]

    @property
    def pointing_error(self) -> float:
        """Mean angle between the limbs of a person's poses and the robot's [rad]."""
        return self.verdict.error


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
        urdf: any URDF, with primitives or meshes, which need not be there; a xacro or an MJCF where the extra for it is
            installed; or a description (``.yaml``) written by hand, whose points and joints are taken as they are.
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
    verdict = judge_robot(robot)
    title = f"points its limbs within {np.degrees(verdict.error):.1f} degrees of a person's: {verdict.word}"
    # The picture first: a robot that cannot be drawn is not added.
    picture = draw_robot(robot, path.with_suffix(".png"), title=title)
    write_text(path, robot_yaml(description))
    catalog.register(chosen, Robot.read(path), replace=True)
    return AddedRobot(robot, path, picture, verdict, tuple(notices))


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
    found, notices = _found(urdf, name, left, right, torso)
    if len(found.arms) == 1:
        notices.append(f"only a {found.arms[0].side} arm was found; name the other one with --left or --right")
    described = found if found.rest else replace(found, rest=_hanging(Robot(found)))
    robot = Robot(described)
    tree = read_urdf(described.urdf)
    missing = sum(shape.missing for shapes in tree.shapes.values() for shape in shapes)
    if missing:
        notices.append(f"{missing} meshes that the file names are not there; what shows nothing is drawn as sticks")
    check = SelfCollision(robot)
    if check.why:
        notices.append(check.why)
    elif check.ignored:
        pairs = tuple(dict.fromkeys([*described.disabled_collisions, *check.ignored]))
        described = replace(described, disabled_collisions=pairs)
        notices.append(
            f"{len(check.ignored)} pairs of links overlap by construction or at rest; their contact is ignored"
        )
    unknown = [n for n, speed in zip(robot.joint_names, robot.speed, strict=True) if not np.isfinite(speed)]
    if unknown:
        notices.append(f"the URDF names no speed limit for {', '.join(unknown)}; live commands keep to 2 rad/s")
    weak = weak_joints(robot)
    if weak:
        told = ", ".join(f"{joint} ({needed:.1f} of {effort:.1f} N m)" for joint, needed, effort in weak)
        notices.append(f"stretched forward, gravity asks more of these motors than the URDF's effort: {told}")
    return described, notices


def _found(
    urdf: str | os.PathLike[str], name: str, left: str | None, right: str | None, torso: str | None
) -> tuple[RobotDescription, list[str]]:
    """What was found in a file, or a description that somebody wrote, and notes about it."""
    if Path(urdf).suffix.lower() in (".yaml", ".yml"):
        if (left, right, torso) != (None, None, None):
            raise OptionError("a description names its arms itself; drop --left, --right and --torso, or name a URDF")
        return replace(Robot.read(urdf).description, name=name), []
    found = search(urdf, name=name, left=left, right=right, torso=torso)
    notes = list(found.notes)
    if found.left_out:
        told = ", ".join(found.left_out[:8]) + (
            f" and {len(found.left_out) - 8} more" if len(found.left_out) > 8 else ""
        )
        notes.append(f"joints on the arms that are not moved: {told}")
    return found.description, notes


def _hanging(robot: Robot) -> dict[str, float]:
    """Rest angles: arms hanging with slightly bent elbows, lifted sideways as far as it takes to touch nothing."""
    solver = LimbIK(robot)
    sides = [1.0 if side == "left" else -1.0 for side in robot.sides]
    angles = robot.rest
    for spread in _SPREADS:
        wanted = np.array([[[[0.1, spread * side, -1.0], [0.5, spread * side, -1.0]] for side in sides]])
        angles = solver.solve(wanted)[0]
        candidate = Robot(replace(robot.description, rest=dict(zip(robot.joint_names, angles.tolist(), strict=True))))
        if not SelfCollision(candidate, margin=0.0, samples=16).ignores_far_links():
            break
    return {name: round(float(angle), 4) for name, angle in zip(robot.joint_names, angles, strict=True)}
