"""Collision shapes of a URDF as capsules on the arms and convex obstacles on the rest of the body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.urdf import configuration, read_urdf
from syda_gym.embodiments.robot import Robot

__all__ = ["ArmCapsules", "BoxObstacle", "CapsuleObstacle", "Shapes", "read_shapes"]


@dataclass(frozen=True, eq=False)
class ArmCapsules:
    """The capsules that ride on one arm.

    Attributes:
        chain: the arm, whose points are the capsules' ends: first all starts, then all ends.
        part: the arm's joints among the robot's.
        radii: ``(P,)`` [m].
        joints: joint that carries each capsule.
        links: link of each capsule.
    """

    chain: ArmChain
    part: slice
    radii: FloatArray
    joints: tuple[int, ...]
    links: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class CapsuleObstacle:
    """A capsule that stands still in the torso frame: ends ``(3,)`` [m] and radius [m]."""

    start: FloatArray
    end: FloatArray
    radius: float
    link: str


@dataclass(frozen=True, eq=False)
class BoxObstacle:
    """A box that stands still in the torso frame: rotation ``(3, 3)``, centre and half sides ``(3,)`` [m]."""

    rotation: FloatArray
    centre: FloatArray
    half: FloatArray
    link: str


@dataclass(frozen=True, eq=False)
class Shapes:
    """Every collision shape of a robot: on its arms, and on the rest of its body at rest."""

    arms: tuple[ArmCapsules, ...]
    capsules: tuple[CapsuleObstacle, ...]
    boxes: tuple[BoxObstacle, ...]


@dataclass(frozen=True, eq=False)
class _Capsule:
    """A capsule in the frame of what carries it."""

    start: FloatArray
    end: FloatArray
    radius: float


def read_shapes(robot: Robot) -> Shapes:
    """Reads the collision shapes of a robot; every joint that is no arm joint stays at rest.

    Spheres, cylinders and capsules on an arm become capsules, boxes a few parallel capsules that fill them to the
    thinnest side; meshes become the capsule around their principal axis. On the body boxes stay boxes.
    """
    import pinocchio

    tree = read_urdf(robot.urdf)
    model = tree.model
    shapes = pinocchio.buildGeomFromUrdfString(model, tree.xml, pinocchio.GeometryType.COLLISION)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, configuration(tree, robot.description.rest))
    pinocchio.updateFramePlacements(model, data)
    torso = data.oMf[model.getFrameId(robot.description.torso)].copy()
    if robot.description.axes is not None:
        torso.rotation = torso.rotation @ np.array(robot.description.axes).T
    arm_joints = {tree.model_joints[name]: name for name in robot.joint_names}
    carried: list[list[tuple[int, str, _Capsule]]] = [[] for _ in robot.chains]
    capsules, boxes = [], []
    for shape in shapes.geometryObjects:
        link = model.frames[shape.parentFrame].name
        arm, joint = _carrier(robot, arm_joints.get(model.names[shape.parentJoint], ""))
        if arm is not None:
            placement = shape.placement
            carried[arm] += [
                (joint, link, c) for c in _capsules(shape.geometry, placement.rotation, placement.translation)
            ]
            continue
        placement = torso.inverse() * data.oMi[shape.parentJoint] * shape.placement
        if type(shape.geometry).__name__ == "Box":
            half = np.asarray(shape.geometry.halfSide, dtype=np.float64)
            boxes.append(BoxObstacle(placement.rotation.copy(), placement.translation.copy(), half, link))
        else:
            for c in _capsules(shape.geometry, placement.rotation, placement.translation):
                capsules.append(CapsuleObstacle(c.start, c.end, c.radius, link))
    arms = tuple(
        _on_arm(chain, part, items) for chain, part, items in zip(robot.chains, robot.arm_slices, carried, strict=True)
    )
    return Shapes(arms, tuple(capsules), tuple(boxes))


def _carrier(robot: Robot, joint: str) -> tuple[int | None, int]:
    """Which arm, and which of its joints, carries the shapes of a pinocchio joint."""
    for arm, chain in enumerate(robot.chains):
        if joint in chain.joints:
            return arm, chain.joints.index(joint)
    return None, -1


def _on_arm(chain: ArmChain, part: slice, items: list[tuple[int, str, _Capsule]]) -> ArmCapsules:
    kept = [item for item in items if not any(_inside(item, other) for other in items if other is not item)]
    joints = tuple(joint for joint, _, _ in kept)
    ends = np.array([c.start for _, _, c in kept] + [c.end for _, _, c in kept]).reshape(-1, 3)
    return ArmCapsules(
        chain=replace(chain, point_joints=(*joints, *joints), point_offsets=ends),
        part=part,
        radii=np.array([c.radius for _, _, c in kept]),
        joints=joints,
        links=tuple(link for _, link, _ in kept),
    )


def _inside(one: tuple[int, str, _Capsule], other: tuple[int, str, _Capsule]) -> bool:
    """Whether a capsule lies in another one of the same joint (a cylinder's end spheres do)."""
    if one[0] != other[0]:
        return False
    small, large = one[2], other[2]
    return all(_to_segment(end, large) + small.radius <= large.radius + 1e-9 for end in (small.start, small.end))


def _to_segment(point: FloatArray, capsule: _Capsule) -> float:
    along = capsule.end - capsule.start
    length = float(along @ along)
    t = 0.0 if length == 0.0 else float(np.clip((point - capsule.start) @ along / length, 0.0, 1.0))
    return float(np.linalg.norm(point - capsule.start - t * along))


def _capsules(geometry: Any, rotation: FloatArray, position: FloatArray) -> list[_Capsule]:
    """Capsules that stand for one shape, in the frame of its joint."""
    kind = type(geometry).__name__
    if kind == "Sphere":
        return [_Capsule(position.copy(), position.copy(), float(geometry.radius))]
    if kind in ("Cylinder", "Capsule"):
        # A cylinder of ours ends in two spheres, so the capsule over its whole length is exact; a bare one gets round
        # caps that stick out, which errs to the safe side. A disc becomes its box, filled like any other.
        radius, half = float(geometry.radius), float(geometry.halfLength)
        if half < radius and kind == "Cylinder" and half < 0.6 * radius and radius > 0.1:
            return _fill(np.array([0.9 * radius, 0.9 * radius, half]), rotation, position)
        axis = rotation[:, 2] * half
        return [_Capsule(position - axis, position + axis, radius)]
    if kind == "Box":
        return _fill(np.asarray(geometry.halfSide, dtype=np.float64), rotation, position)
    return [_around(geometry, rotation, position)]


def _fill(half: FloatArray, rotation: FloatArray, position: FloatArray) -> list[_Capsule]:
    """Parallel capsules along the longest side of a box, as thick as its thinnest side."""
    thin, wide, long = np.argsort(half)
    radius = float(half[thin])
    count = max(1, int(np.ceil(half[wide] / radius - 0.25)))
    shifts = np.linspace(-1.0, 1.0, count) * (half[wide] - radius) if count > 1 else np.zeros(1)
    axis = rotation[:, long] * (half[long] - radius)
    return [
        _Capsule(position + s * rotation[:, wide] - axis, position + s * rotation[:, wide] + axis, radius)
        for s in shifts
    ]


def _around(geometry: Any, rotation: FloatArray, position: FloatArray) -> _Capsule:
    """The capsule around the principal axis of a mesh."""
    vertices = np.array(geometry.vertices() if callable(geometry.vertices) else geometry.vertices, dtype=np.float64)
    points = vertices.reshape(-1, 3) @ rotation.T + position
    centre = points.mean(axis=0)
    axis = np.linalg.svd(points - centre, full_matrices=False)[2][0]
    along = (points - centre) @ axis
    radius = float(np.linalg.norm(points - centre - along[:, None] * axis, axis=1).max())
    low, high = float(along.min()) + radius, float(along.max()) - radius
    if low > high:
        low = high = (low + high) / 2.0
    return _Capsule(centre + low * axis, centre + high * axis, radius)
