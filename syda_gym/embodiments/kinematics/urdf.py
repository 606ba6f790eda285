"""Reading a URDF into what the rest of the house needs: limits, and arms as serial chains."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray, Side
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.urdf_budget import check_urdf_tree
from syda_gym.embodiments.reading.checking import check
from syda_gym.embodiments.reading.cleaning import clean_urdf, model_joint_names
from syda_gym.embodiments.reading.parts import Joint, Shape
from syda_gym.embodiments.reading.shapes import read_shapes
from syda_gym.embodiments.reading.source import read_source
from syda_gym.errors import EmbodimentError, nearest_name

__all__ = ["JointLimits", "UrdfTree", "arm_chain", "configuration", "placements_at", "read_urdf", "zero_placements"]


@dataclass(frozen=True)
class JointLimits:
    """Limits of some joints: position [rad], speed [rad/s], effort [N m], each ``(n,)``; infinite where unknown."""

    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    effort: FloatArray


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """A robot's file as a tree.

    Attributes:
        path: the file.
        joints: by name.
        parent_joint: link to the joint that it hangs on.
        model: pinocchio's model.
        model_joints: joint name to the name in ``model``, another one where a link has the joint's name.
        shapes: visual and collision shapes by link.
        xml: the robot as XML that strict parsers take, with inertias and collision shapes.
        notes: small faults of the file that were mended.
        placeholders: joints whose stated effort or speed no motor has; taken as unknown.
    """

    path: Path
    joints: dict[str, Joint]
    parent_joint: dict[str, str]
    model: Any
    model_joints: dict[str, str]
    shapes: dict[str, tuple[Shape, ...]]
    xml: str
    notes: tuple[str, ...] = ()
    placeholders: tuple[str, ...] = ()

    def joint(self, name: str) -> Joint:
        """The joint called ``name``; an error with the nearest name if there is none."""
        if name not in self.joints:
            raise EmbodimentError(f"{self.path.name} has no joint {name!r}; {nearest_name(name, self.joints)}")
        return self.joints[name]

    def limits(self, names: Sequence[str]) -> JointLimits:
        """Limits of the named joints; continuous joints get one turn each way.

        Raises:
            EmbodimentError: joints without limits, or with lower not below upper; all of them are named.
        """
        faults = [fault for name in names if (fault := self._limit_fault(name))]
        if faults:
            raise EmbodimentError(f"{self.path.name}: " + "; ".join(faults))
        rows = [self._limit(name) for name in names]
        lower, upper, speed, effort = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
        return JointLimits(lower, upper, speed, effort)

    def _limit_fault(self, name: str) -> str:
        joint = self.joint(name)
        limit, line = joint.limit, f" (line {joint.line})" if joint.line else ""
        if joint.type == "continuous":
            return ""
        if limit is None or limit.lower is None or limit.upper is None:
            return f"joint {name!r}{line} has no <limit lower upper>; add it to the URDF"
        if not limit.lower < limit.upper:
            hint = "swap them, and mind the sign of the axis" if limit.lower > limit.upper else "it cannot move"
            return f"joint {name!r}{line} has lower limit {limit.lower} not below upper {limit.upper}; {hint}"
        return ""

    def _limit(self, name: str) -> tuple[float, float, float, float]:
        joint = self.joints[name]
        limit = joint.limit
        speed = np.inf if limit is None or limit.velocity is None else limit.velocity
        effort = np.inf if limit is None or limit.effort is None else limit.effort
        if joint.type == "continuous" or limit is None or limit.lower is None or limit.upper is None:
            return -np.pi, np.pi, speed, effort
        return limit.lower, limit.upper, speed, effort

    def path_to(self, ancestor: str, link: str) -> list[str] | None:
        """Joint names from ``ancestor`` down to ``link``, or ``None`` if ``ancestor`` is not above it."""
        chain: list[str] = []
        while link != ancestor:
            if link not in self.parent_joint:
                return None
            name = self.parent_joint[link]
            chain.append(name)
            link = self.joints[name].parent
        return chain[::-1]

    def links(self) -> set[str]:
        """Every link name."""
        return {joint.parent for joint in self.joints.values()} | set(self.parent_joint)


def read_urdf(path: str | Path) -> UrdfTree:
    """Reads a robot's file without its meshes: a URDF, or a xacro or MJCF where the extra for it is installed.

    Raises:
        EmbodimentError: the file is missing, too large, or no robot; every fault in it is named with its line.
        MissingExtraError: a xacro or MJCF without what reads it.
    """
    file = Path(path)
    if not file.is_file():
        raise EmbodimentError(f"no URDF {file}; check the path")
    stat = file.stat()
    return _read(os.path.abspath(file), stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=8)
def _read(path: str, _changed: int, _size: int) -> UrdfTree:
    """Kept, because one command reads a robot several times; a changed file is read anew."""
    import pinocchio

    file = Path(path)
    check_urdf_tree(file)
    root = read_source(file)
    checked = check(root, file)
    shapes = read_shapes(checked.links, file, root)
    elements = {element.get("name"): element for element in root.findall("joint")}
    xml = clean_urdf(checked.links, checked.joints, elements, shapes)
    try:
        model = pinocchio.buildModelFromXML(xml)
    except Exception as error:  # C++ exceptions of many kinds
        raise EmbodimentError(f"{file} is not a URDF that can be read: {error}; expected a <robot> tree") from error
    return UrdfTree(
        path=file,
        joints=checked.joints,
        parent_joint={joint.child: name for name, joint in checked.joints.items()},
        model=model,
        model_joints=model_joint_names(checked.joints, checked.links),
        shapes=shapes,
        xml=xml,
        notes=checked.notes,
        placeholders=checked.placeholders,
    )


def arm_chain(
    tree: UrdfTree,
    torso: str,
    side: Side,
    joints: Sequence[str],
    points: Sequence[str],
    places: Sequence[Sequence[float]] | None = None,
) -> ArmChain:
    """Builds the kinematics of one arm, all other joints locked at zero.

    Args:
        tree: the parsed URDF.
        torso: link in whose frame positions are expressed.
        side: which arm.
        joints: revolute joints of the arm from the torso outward.
        points: links that carry shoulder, elbow, wrist and tip.
        places: where these points lie in the frames of their links [m]; by default at the origins.

    Raises:
        EmbodimentError: no joint, unknown names, joints out of order or not revolute.
    """
    if not joints:
        raise EmbodimentError(f"{tree.path.name}: the {side} arm has no joint; name its revolute joints, torso outward")
    for link in (torso, *points):
        if link not in tree.links():
            raise EmbodimentError(f"{tree.path.name} has no link {link!r}; {nearest_name(link, tree.links())}")
    for name in joints:
        if tree.joint(name).type not in ("revolute", "continuous"):
            raise EmbodimentError(f"{tree.path.name}: arm joint {name!r} is {tree.joint(name).type}, not revolute")
    placements = zero_placements(tree)
    inverse_torso = np.linalg.inv(placements[torso])
    frames = [inverse_torso @ placements[tree.joints[name].child] for name in joints]
    for before, after in zip(joints[:-1], joints[1:], strict=True):
        if tree.path_to(tree.joints[before].child, tree.joints[after].child) is None:
            raise EmbodimentError(f"{tree.path.name}: joint {after!r} does not come after {before!r} in the arm")
    steps = [np.linalg.inv(a) @ b for a, b in zip([np.eye(4), *frames[:-1]], frames, strict=True)]
    carriers = tuple(_carrier(tree, joints, link) for link in points)
    offsets = []
    for link, carrier, place in zip(points, carriers, places or [(0.0, 0.0, 0.0)] * len(points), strict=True):
        seen = inverse_torso @ placements[link]
        if carrier >= 0:
            seen = np.linalg.inv(frames[carrier]) @ inverse_torso @ placements[link]
        offsets.append(seen[:3, 3] + seen[:3, :3] @ np.asarray(place, dtype=np.float64) if any(place) else seen[:3, 3])
    limits = tree.limits(joints)
    axes = np.array([np.asarray(tree.joints[name].axis, dtype=np.float64) for name in joints])
    return ArmChain(
        side=side,
        joints=tuple(joints),
        rotations=np.array([step[:3, :3] for step in steps]),
        offsets=np.array([step[:3, 3] for step in steps]),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        lower=limits.lower,
        upper=limits.upper,
        point_joints=carriers,
        point_offsets=np.array(offsets),
    )


def _carrier(tree: UrdfTree, joints: Sequence[str], link: str) -> int:
    """Index of the last arm joint above ``link``, -1 if none moves it."""
    above = [i for i, name in enumerate(joints) if tree.path_to(tree.joints[name].child, link) is not None]
    return max(above, default=-1)


def zero_placements(tree: UrdfTree) -> dict[str, FloatArray]:
    """Homogeneous transforms of every link at the zero configuration, by pinocchio."""
    return placements_at(tree, {})


def placements_at(tree: UrdfTree, angles: Mapping[str, float]) -> dict[str, FloatArray]:
    """Homogeneous transforms ``(4, 4)`` of every link where the named joints have the given angles, others 0."""
    import pinocchio

    data = tree.model.createData()
    pinocchio.framesForwardKinematics(tree.model, data, configuration(tree, angles))
    return {
        frame.name: np.array(data.oMf[index].homogeneous)
        for index, frame in enumerate(tree.model.frames)
        if frame.type == pinocchio.FrameType.BODY
    }


def configuration(tree: UrdfTree, angles: Mapping[str, float]) -> FloatArray:
    """Pinocchio's configuration with the named joints at the given angles [rad], all others at zero.

    Joints that follow another one (``<mimic>``) follow it.
    """
    import pinocchio

    wanted = dict(angles)
    for name, joint in tree.joints.items():
        if joint.mimic is not None and joint.mimic.joint in tree.joints and name not in angles:
            wanted[name] = joint.mimic.multiplier * angles.get(joint.mimic.joint, 0.0) + joint.mimic.offset
    q: FloatArray = pinocchio.neutral(tree.model)
    for name, angle in wanted.items():
        other = tree.model_joints.get(name, name)
        if not tree.model.existJointName(other):
            continue
        joint = tree.model.joints[tree.model.getJointId(other)]
        if joint.nq == 2:  # a continuous joint is a cosine and a sine in pinocchio
            q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        elif joint.nq == 1:
            q[joint.idx_q] = angle
    return q
