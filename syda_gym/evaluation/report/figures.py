"""Bodies over time as simple solids: humans as bones between joints, robots as the shapes of their URDF."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.figure import bones, figure_points
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.look import PERSON, ROBOT_SHELL

__all__ = ["Shape", "Track", "track"]

Colour = tuple[float, float, float]

_ARM_BONES = (
    ("Shoulder", "Elbow", 0.029, "shirt"), ("Elbow", "Hand", 0.022, "skin"), ("Hand", "Hand", 0.028, "skin"),
)  # fmt: skip


@dataclass(frozen=True)
class Shape:
    """One solid.

    Attributes:
        kind: ``"bone"`` (a capsule between two points), ``"sphere"``, ``"cylinder"`` (along z) or ``"box"``.
        size: bone and sphere: radius; cylinder: radius and length; box: three sides [m].
        colour: red, green, blue in 0..1.
        points: the two points of a bone.
        pose: index of the moving pose that carries the solid; -1 if it stands still.
        position: of the solid in the frame of its pose [m].
        rotation: of the solid in the frame of its pose, quaternion scalar-last.
    """

    kind: str
    size: tuple[float, ...]
    colour: Colour
    points: tuple[int, int] = (0, 0)
    pose: int = -1
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Track:
    """One body over time, standing on the floor (z = 0), x forward, y left.

    Attributes:
        name: the body's name.
        kind: ``"human"`` or ``"robot"``.
        shapes: the solids.
        points: ``(N, P, 3)`` points that bones join [m].
        poses: ``(N, L, 7)`` position [m] and quaternion (scalar-last) of each moving link.
        height: of the body [m].
    """

    name: str
    kind: str
    shapes: tuple[Shape, ...]
    points: FloatArray
    poses: FloatArray
    height: float

    def __len__(self) -> int:
        return len(self.points)


def track(body: Embodiment, frames: ArrayLike) -> Track:
    """Poses a body's solids for every frame.

    Args:
        body: a human or a robot.
        frames: ``(N, F)`` of that body.

    Raises:
        EmbodimentError: the frames do not fit the body.
    """
    checked = body.check(frames)
    if isinstance(body, Robot):
        return _robot_track(body, checked)
    return _human_track(body, checked)


def _human_track(body: Embodiment, frames: FloatArray) -> Track:
    if isinstance(body, HumanSkeleton):
        joints = figure_points(body, frames)
        solids: Sequence[tuple[str, str, float, str]] = bones(body)
        used = {name for bone in solids for name in bone[:2]}
        joints = {name: points for name, points in joints.items() if name in used}
        height, feet = body.height, [name for name in joints if name.endswith(("Foot", "Toe"))]
    else:  # a body of the user's that is neither: its arms alone
        arms = body.arm_points(frames)
        joints = {
            f"{side}{part}": arms[:, i, p]
            for i, side in enumerate("LR"[: arms.shape[1]])
            for p, part in enumerate(("Shoulder", "Elbow", "Hand"))
        }
        solids = [
            (f"{side}{a}", f"{side}{b}", radius, colour)
            for side in "LR"[: arms.shape[1]]
            for a, b, radius, colour in _ARM_BONES
        ]
        height, feet = 3.0 * body.reach, list(joints)
    names = list(joints)
    points = np.stack([joints[name] for name in names], axis=1)
    floor = np.median(np.min(np.stack([joints[name][:, 2] for name in feet], axis=1), axis=1)) - 0.024 * height
    middle = np.median(points[:, :, :2].mean(axis=1), axis=0)
    points = points - np.array([*middle, floor])
    shapes = tuple(
        Shape("bone", (radius * height,), PERSON[colour], (names.index(a), names.index(b)))
        for a, b, radius, colour in solids
    )
    return Track(body.name, body.kind, shapes, points, np.zeros((len(points), 0, 7)), height)


def _robot_track(robot: Robot, frames: FloatArray) -> Track:
    model = _robot_model(robot)
    poses = model.poses(frames)
    poses[:, :, 2] -= model.floor
    return Track(robot.name, robot.kind, model.shapes, np.zeros((len(frames), 0, 3)), poses, robot.height)


class _RobotModel:
    """The URDF of a robot with its solids sorted into those that move with the arms and those that stand still."""

    def __init__(self, robot: Robot) -> None:
        import yourdfpy

        from syda_gym.embodiments.kinematics.urdf import read_urdf

        self._robot = robot
        tree = read_urdf(robot.urdf)
        self._model = tree.model
        self._data = self._model.createData()
        # What is no URDF is shown by the shapes that it collides with.
        source = str(robot.urdf) if robot.urdf.suffix.lower() == ".urdf" else io.BytesIO(tree.xml.encode())
        urdf = yourdfpy.URDF.load(source, build_scene_graph=False, load_meshes=False, build_collision_scene_graph=False)
        rest = self.place(robot.rest)
        probe = self.place(np.clip(robot.rest + 0.3, robot.lower, robot.upper))
        self.links = [name for name in rest if name in urdf.link_map and not np.allclose(rest[name], probe[name])]
        colours = {material.name: material.color for material in urdf.robot.materials if material.color is not None}
        shapes = []
        for name, link in urdf.link_map.items():
            if name in rest:
                carrier = self.links.index(name) if name in self.links else -1
                frame = np.eye(4) if carrier >= 0 else rest[name]
                shapes += [_shape(solid, frame, carrier, colours) for solid in _solids(link)]
        still = [shape.position[2] - _half_height(shape) for shape in shapes if shape.pose < 0]
        self.floor = float(min(still, default=min(rest[name][2, 3] for name in rest)))
        self.shapes = tuple(
            shape if shape.pose >= 0 else Shape(
                shape.kind, shape.size, shape.colour, pose=-1, rotation=shape.rotation,
                position=(shape.position[0], shape.position[1], shape.position[2] - self.floor),
            )
            for shape in shapes
        )  # fmt: skip

    def poses(self, frames: FloatArray) -> FloatArray:
        """Position and quaternion of each moving link in the torso frame, ``(N, L, 7)``."""
        from scipy.spatial.transform import Rotation

        ids = [self._model.getBodyId(name) for name in self.links]
        torso = self._model.getBodyId(self._robot.description.torso)
        positions = np.zeros((len(frames), len(ids), 3))
        rotations = np.zeros((len(frames), len(ids), 3, 3))
        for row, frame in enumerate(frames):
            self._move(frame)
            inverse = self._data.oMf[torso].inverse()
            for column, index in enumerate(ids):
                pose = inverse * self._data.oMf[index]
                positions[row, column], rotations[row, column] = pose.translation, pose.rotation
        turns = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat().reshape(len(frames), -1, 4)
        return np.concatenate([positions, turns], axis=2)

    def _move(self, frame: FloatArray) -> None:
        import pinocchio

        q = pinocchio.neutral(self._model)
        angles = {**self._robot.description.rest, **dict(zip(self._robot.joint_names, frame, strict=True))}
        for name, angle in angles.items():
            if self._model.existJointName(name):
                joint = self._model.joints[self._model.getJointId(name)]
                if joint.nq == 1:
                    q[joint.idx_q] = float(angle)
        pinocchio.framesForwardKinematics(self._model, self._data, q)

    def place(self, frame: FloatArray) -> dict[str, FloatArray]:
        """Homogeneous transforms of all links in the torso frame, joints that are no arm joints at rest."""
        import pinocchio

        self._move(frame)
        placed = {
            item.name: np.array(self._data.oMf[index].homogeneous)
            for index, item in enumerate(self._model.frames)
            if item.type == pinocchio.FrameType.BODY
        }
        inverse = np.linalg.inv(placed[self._robot.description.torso])
        return {name: inverse @ pose for name, pose in placed.items()}


@lru_cache(maxsize=32)
def _robot_model(robot: Robot) -> _RobotModel:
    return _RobotModel(robot)


def _solids(link: Any) -> list[Any]:
    """The link's visible primitives, or its collision primitives where it is drawn by meshes."""
    for group in (link.visuals, link.collisions):
        found = [
            item
            for item in group
            if item.geometry is not None and (item.geometry.sphere or item.geometry.cylinder or item.geometry.box)
        ]
        if found:
            return found
    return []


def _shape(solid: Any, frame: FloatArray, carrier: int, colours: dict[str, Any]) -> Shape:
    from scipy.spatial.transform import Rotation

    pose = frame @ (np.eye(4) if solid.origin is None else np.asarray(solid.origin, dtype=np.float64))
    geometry = solid.geometry
    size: tuple[float, ...]
    if geometry.sphere:
        kind, size = "sphere", (float(geometry.sphere.radius),)
    elif geometry.cylinder:
        kind, size = "cylinder", (float(geometry.cylinder.radius), float(geometry.cylinder.length))
    else:
        kind, size = "box", tuple(float(side) for side in geometry.box.size)
    turn = Rotation.from_matrix(pose[:3, :3]).as_quat()
    return Shape(
        kind,
        size,
        _colour(solid, colours),
        pose=carrier,
        position=(float(pose[0, 3]), float(pose[1, 3]), float(pose[2, 3])),
        rotation=(float(turn[0]), float(turn[1]), float(turn[2]), float(turn[3])),
    )


def _colour(solid: Any, colours: dict[str, Any]) -> Colour:
    """The solid's own colour, or that of the material it names."""
    material = getattr(solid, "material", None)
    found = None if material is None else material.color or colours.get(material.name)
    if found is None:
        return ROBOT_SHELL
    return (float(found.rgba[0]), float(found.rgba[1]), float(found.rgba[2]))


def _half_height(shape: Shape) -> float:
    """Half of the extent along z of a solid that stands still."""
    from scipy.spatial.transform import Rotation

    up = np.abs(Rotation.from_quat(shape.rotation).as_matrix()[2])
    if shape.kind == "sphere":
        return shape.size[0]
    if shape.kind == "cylinder":
        return float(up[2] * shape.size[1] / 2 + np.sqrt(max(0.0, 1 - up[2] ** 2)) * shape.size[0])
    return float(up @ np.array(shape.size) / 2)
