"""Reading a URDF into what the rest of the house needs: limits, and arms as serial chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray, Side
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.urdf_budget import check_urdf_tree
from syda_gym.errors import EmbodimentError, nearest_name

__all__ = ["JointLimits", "UrdfTree", "arm_chain", "read_urdf", "zero_placements"]

_MAX_URDF_BYTES = 32 * 2**20


@dataclass(frozen=True)
class JointLimits:
    """Limits of some joints: position [rad], speed [rad/s], effort [N m], each ``(n,)``."""

    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    effort: FloatArray


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """A parsed URDF: yourdfpy's joints by name, and pinocchio's model of the same file."""

    path: Path
    joints: dict[str, Any]
    parent_joint: dict[str, str]
    model: Any

    def joint(self, name: str) -> Any:
        """The joint called ``name``; an error with the nearest name if there is none."""
        if name not in self.joints:
            raise EmbodimentError(f"{self.path.name} has no joint {name!r}; {nearest_name(name, self.joints)}")
        return self.joints[name]

    def limits(self, names: Sequence[str]) -> JointLimits:
        """Limits of the named joints; continuous joints get one turn each way.

        Raises:
            EmbodimentError: a joint without limits, or with lower not below upper.
        """
        rows = [self._limit(name) for name in names]
        lower, upper, speed, effort = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
        return JointLimits(lower, upper, speed, effort)

    def _limit(self, name: str) -> tuple[float, float, float, float]:
        joint = self.joint(name)
        limit = joint.limit
        if joint.type == "continuous":
            speed = getattr(limit, "velocity", None) or np.inf
            return -np.pi, np.pi, float(speed), float(getattr(limit, "effort", None) or np.inf)
        if limit is None or limit.lower is None or limit.upper is None:
            raise EmbodimentError(f"{self.path.name}: joint {name!r} has no <limit lower upper>; add it to the URDF")
        if not limit.lower < limit.upper:
            raise EmbodimentError(
                f"{self.path.name}: joint {name!r} has lower limit {limit.lower} not below upper {limit.upper}"
            )
        return (
            float(limit.lower),
            float(limit.upper),
            float(limit.velocity or np.inf),
            float(limit.effort or np.inf),
        )

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
    """Parses a URDF without its meshes.

    Raises:
        EmbodimentError: the file is missing, too large, or not a URDF.
    """
    import pinocchio
    import yourdfpy

    file = Path(path)
    if not file.is_file():
        raise EmbodimentError(f"no URDF {file}; check the path")
    if file.stat().st_size > _MAX_URDF_BYTES:
        raise EmbodimentError(f"{file} is larger than {_MAX_URDF_BYTES >> 20} MB; that is no plain URDF")
    check_urdf_tree(file)
    try:
        urdf = yourdfpy.URDF.load(
            str(file), build_scene_graph=False, load_meshes=False, build_collision_scene_graph=False
        )
        model = pinocchio.buildModelFromUrdf(str(file))
    except Exception as error:  # both parsers raise many kinds, from lxml errors to C++ exceptions
        raise EmbodimentError(f"{file} is not a URDF that can be read: {error}; expected a <robot> tree") from error
    joints = dict(urdf.joint_map)
    if not joints:
        raise EmbodimentError(f"{file} has no joints; expected the URDF of a robot with at least one arm")
    return UrdfTree(file, joints, {joint.child: name for name, joint in joints.items()}, model)


def arm_chain(
    tree: UrdfTree, torso: str, side: Side, joints: Sequence[str], points: tuple[str, str, str, str]
) -> ArmChain:
    """Builds the kinematics of one arm, all other joints locked at zero.

    Args:
        tree: the parsed URDF.
        torso: link in whose frame positions are expressed.
        side: which arm.
        joints: revolute joints of the arm from the torso outward.
        points: links whose origins are shoulder, elbow, wrist and tip.

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
    offsets = [
        (inverse_torso @ placements[link] if carrier < 0 else np.linalg.inv(frames[carrier]) @ inverse_torso
         @ placements[link])[:3, 3]
        for link, carrier in zip(points, carriers, strict=True)
    ]  # fmt: skip
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
        point_joints=(carriers[0], carriers[1], carriers[2], carriers[3]),
        point_offsets=np.array(offsets),
    )


def _carrier(tree: UrdfTree, joints: Sequence[str], link: str) -> int:
    """Index of the last arm joint above ``link``, -1 if none moves it."""
    above = [i for i, name in enumerate(joints) if tree.path_to(tree.joints[name].child, link) is not None]
    return max(above, default=-1)


def zero_placements(tree: UrdfTree) -> dict[str, FloatArray]:
    """Homogeneous transforms of every link at the zero configuration, by pinocchio."""
    import pinocchio

    data = tree.model.createData()
    pinocchio.framesForwardKinematics(tree.model, data, pinocchio.neutral(tree.model))
    return {
        frame.name: np.array(data.oMf[index].homogeneous)
        for index, frame in enumerate(tree.model.frames)
        if frame.type == pinocchio.FrameType.BODY
    }
