"""plain_body: a robot as PyBullet simulates it faithfully: one link per arm joint, all else part of what carries it.

PyBullet gives a link without ``<inertial>`` one kilogram, knows no ``<mimic>``, takes 127 joints, places a root by its
centre of mass and stops at a missing mesh. So a robot is written anew for it: the base is the body frame itself
(x forward, y left, z up), joints that are no arm joints stand at rest, masses and inertias are summed up by pinocchio,
and every landmark is a link of its own. A file in which nothing of this would matter is loaded as it is.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from syda_gym.embodiments.description import POINTS
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.urdf import UrdfTree, configuration, placements_at, read_urdf
from syda_gym.embodiments.reading.cleaning import origin_attributes, size_attributes
from syda_gym.embodiments.reading.parts import Joint, Shape
from syda_gym.embodiments.robot import Robot

__all__ = [
    "BASE",
    "PlainBody",
    "disabled_pairs",
    "is_plain",
    "plain_body",
    "point_link",
    "shapes_at_rest",
    "weak_joints",
]

BASE = "body_frame"
_MOST_JOINTS = 127
_MOST_APART = 60  # links that keep to themselves for the sake of disabled contacts
_LEAST_MASS = 1e-3  # kg; PyBullet takes a moving link without mass for one that stands still
_LEAST_INERTIA = 1e-5  # kg m2
_POINT_MASS = 1e-6  # kg, of a landmark
_GRAY = (0.75, 0.77, 0.8, 1.0)


@dataclass(frozen=True)
class PlainBody:
    """A robot to load into PyBullet.

    Attributes:
        xml: the URDF; empty where the robot's own file is loaded as it is.
        gravity: in the body frame [m/s2]; ``None`` where the world's is turned with the torso.
        torso: link that is put at the origin; ``None`` where the base is there already.
        points: links of elbow and wrist of each arm.
        apart: links by name that stand for themselves in contacts, with the arm joint that carries each (-1: the body).
        missing: meshes that are not there.
    """

    xml: str
    gravity: tuple[float, float, float] | None
    torso: str | None
    points: tuple[str, ...]
    apart: dict[str, int]
    missing: int = 0

    @contextlib.contextmanager
    def file(self, own: str | os.PathLike[str]) -> Iterator[str]:
        """A path to load from, as long as the context lasts: the robot's own file, or one for the moment."""
        if not self.xml:
            yield os.fspath(own)
            return
        handle, path = tempfile.mkstemp(suffix=".urdf")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(self.xml.replace("><", ">\n<"))  # PyBullet reads lines of limited length
            yield path
        finally:
            os.unlink(path)


def point_link(side: str, point: str) -> str:
    """Name of the link that is a landmark."""
    return f"{side} {point}"


def is_plain(robot: Robot, tree: UrdfTree) -> bool:
    """Whether PyBullet reads a URDF as it is meant: primitives, masses on all links, body axes, points at links."""
    description = robot.description
    links = tree.links()
    with_mass = tree.xml.count("<inertial>")
    plain_shapes = all(shape.kind != "mesh" for shapes in tree.shapes.values() for shape in shapes)
    plain_joints = all(
        joint.type in ("revolute", "fixed") and _follows(joint, robot.description.rest)
        for joint in tree.joints.values()
    )
    return (
        tree.path.suffix.lower() == ".urdf"
        and with_mass == len(links)
        and plain_shapes
        and plain_joints
        and not tree.placeholders
        and len(tree.joints) <= _MOST_JOINTS
        and description.axes is None
        and not any(arm.offsets for arm in description.arms)
        and description.torso in tree.parent_joint  # a root is placed by its centre of mass
    )


def _follows(joint: Joint, rest: Mapping[str, float]) -> bool:
    """Whether a joint's rest angle is what its leader's asks for, so that PyBullet need not know that it follows."""
    mimic = joint.mimic
    if mimic is None:
        return True
    return abs(rest.get(joint.name, 0.0) - mimic.multiplier * rest.get(mimic.joint, 0.0) - mimic.offset) < 1e-6


def plain_body(
    robot: Robot, roles: Sequence[str] = (), tree: UrdfTree | None = None, *, whole: bool = True
) -> PlainBody:
    """Writes a robot for PyBullet.

    Args:
        robot: whose arms move.
        roles: ``collision`` and/or ``visual``: the shapes that are wanted.
        tree: another file of the same robot, for its looks; by default the robot's own.
        whole: whether a file that PyBullet reads as it is meant is loaded with all its joints and links. If not, it is
            written anew like any other: joints that are no arm joints are fixed and fixed links merged, which costs a
            physics step of Pepper a third.
    """
    own = read_urdf(robot.urdf)
    tree = tree or own
    if whole and is_plain(robot, tree):
        points = tuple(link for arm in _arms(robot) for link in (arm.elbow, arm.wrist))
        return PlainBody("", None, robot.description.torso, points, {})
    return _Writer(robot, tree, roles, looks=tree is not own).body()


class _Writer:
    """One robot on its way into XML."""

    def __init__(self, robot: Robot, tree: UrdfTree, roles: Sequence[str], looks: bool) -> None:
        self._robot, self._tree, self._roles, self._looks = robot, tree, roles, looks
        self._rest = {name: a for name, a in robot.description.rest.items() if name not in robot.joint_names}
        self._places = placements_at(tree, self._rest)
        self._carriers = _carriers(tree, robot.joint_names)
        self._body = _body_frame(robot, tree, self._places)
        self._frames = [self._body @ np.eye(4)] + [self._places[tree.joints[name].child] for name in robot.joint_names]
        self._apart = self._find_apart() if "collision" in roles else {}
        self._missing = 0

    def body(self) -> PlainBody:
        robot = self._robot
        out = [f"<robot name={quoteattr(robot.name)}>"]
        out.append(f"<link name={quoteattr(BASE)}>{_inertial(1.0, np.zeros(3), np.eye(3))}{self._shapes(-1)}</link>")
        inertias = self._inertias()
        for joint, name in enumerate(robot.joint_names):
            link = self._tree.joints[name].child
            out.append(f"<link name={quoteattr(link)}>{_inertial(*inertias[joint])}{self._shapes(joint)}</link>")
            out.append(self._joint(joint, name, link))
        points = []
        for arm in [] if self._looks else _arms(robot):
            for point in ("elbow", "wrist"):
                points.append(point_link(arm.side, point))
                out.append(self._point(arm, point))
        for link in self._apart:
            out.append(self._apart_link(link))
        return PlainBody("".join([*out, "</robot>"]), self._gravity(), None, tuple(points), self._apart, self._missing)

    def _joint(self, joint: int, name: str, link: str) -> str:
        robot = self._robot
        above = self._carriers[self._tree.joints[name].parent]
        place = np.linalg.inv(self._frames[above + 1]) @ self._frames[joint + 1]
        parent = BASE if above < 0 else self._tree.joints[robot.joint_names[above]].child
        axis = " ".join(f"{float(v):.15g}" for v in self._tree.joints[name].axis)
        return (
            f'<joint name={quoteattr(name)} type="revolute">{_origin(place)}<parent link={quoteattr(parent)}/>'
            f'<child link={quoteattr(link)}/><axis xyz="{axis}"/><limit lower="{float(robot.lower[joint])!r}" '
            f'upper="{float(robot.upper[joint])!r}" effort="1e6" velocity="1e6"/></joint>'
        )

    def _point(self, arm: Any, point: str) -> str:
        link = getattr(arm, point)
        place = self._places[link].copy()
        place[:3, 3] += place[:3, :3] @ np.array(arm.point_offsets[POINTS.index(point)])
        return self._fixed(point_link(arm.side, point), self._carriers[link], place, "")

    def _apart_link(self, link: str) -> str:
        shapes = "".join(
            _shape(shape, shape.placement)
            for shape in self._tree.shapes.get(link, ())
            if shape.role == "collision" and not shape.missing
        )
        return self._fixed(link + " apart", self._carriers[link], self._places[link], shapes)

    def _fixed(self, name: str, carrier: int, place: FloatArray, shapes: str) -> str:
        parent = BASE if carrier < 0 else self._tree.joints[self._robot.joint_names[carrier]].child
        relative = np.linalg.inv(self._frames[carrier + 1]) @ place
        inertial = _inertial(_POINT_MASS, np.zeros(3), 1e-9 * np.eye(3), least=False)
        return (
            f"<link name={quoteattr(name)}>{inertial}{shapes}</link>"
            f'<joint name={quoteattr(name + " fixed")} type="fixed">{_origin(relative)}'
            f"<parent link={quoteattr(parent)}/><child link={quoteattr(name)}/></joint>"
        )

    def _shapes(self, carrier: int) -> str:
        found: list[str] = []
        for link, at in self._carriers.items():
            if at != carrier or link in self._apart:
                continue
            place = np.linalg.inv(self._frames[carrier + 1]) @ self._places[link]
            for role in self._roles:
                shapes = self._wanted(link, role)
                found += [_shape(shape, place @ shape.placement, role) for shape in shapes]
        if not found and "visual" in self._roles:
            found = self._sticks(carrier)
        return "".join(found)

    def _wanted(self, link: str, role: str) -> list[Shape]:
        """Shapes of a role; a link that cannot be seen shows what it collides with."""
        every = self._tree.shapes.get(link, ())
        shapes = [shape for shape in every if shape.role == role]
        self._missing += sum(shape.missing for shape in shapes)
        there = [shape for shape in shapes if not shape.missing]
        if role == "visual" and not there:
            there = [shape for shape in every if shape.role == "collision" and not shape.missing]
        return there

    def _sticks(self, carrier: int) -> list[str]:
        """Capsules in place of what has no shape: to the next joints and points that this link carries."""
        frame = np.linalg.inv(self._frames[carrier + 1])
        ends = [
            self._frames[joint + 1][:3, 3]
            for joint, name in enumerate(self._robot.joint_names)
            if self._carriers[self._tree.joints[name].parent] == carrier
        ]
        for arm in _arms(self._robot):
            for point, offset in zip(POINTS, arm.point_offsets, strict=True):
                link = getattr(arm, point)
                if link in self._places and self._carriers[link] == carrier:
                    ends.append(self._places[link][:3, 3] + self._places[link][:3, :3] @ np.array(offset))
        start = np.zeros(3) if carrier >= 0 or not ends else frame[:3, :3] @ np.mean(ends, axis=0) + frame[:3, 3]
        return [
            text for end in ends for text in _stick(start, frame[:3, :3] @ end + frame[:3, 3], 0.06 * self._robot.reach)
        ]

    def _inertias(self) -> list[tuple[float, FloatArray, FloatArray]]:
        """Mass, centre and inertia about it of what each arm joint carries, in the joint's frame."""
        import pinocchio

        tree = self._tree
        kept = {tree.model_joints[name] for name in self._robot.joint_names}
        locked = [tree.model.getJointId(name) for name in tree.model.names if name not in ("universe", *kept)]
        model = pinocchio.buildReducedModel(tree.model, locked, configuration(tree, self._rest))
        found = []
        for name in self._robot.joint_names:
            inertia = model.inertias[model.getJointId(tree.model_joints[name])]
            found.append((float(inertia.mass), np.array(inertia.lever), np.array(inertia.inertia)))
        return found

    def _gravity(self) -> tuple[float, float, float]:
        """Down in the body frame: where the root's stands at rest, if the torso leans."""
        zero = _body_frame(self._robot, self._tree, placements_at(self._tree, {}))
        down = self._body[:3, :3].T @ zero[:3, :3] @ np.array([0.0, 0.0, -9.81])
        x, y, z = (float(v) for v in np.where(np.abs(down) < 1e-9, 0.0, down))
        return (x, y, z)

    def _find_apart(self) -> dict[str, int]:
        named = [link for pair in self._robot.description.disabled_collisions for link in pair]
        found = [
            link
            for link in dict.fromkeys(named)
            if any(s.role == "collision" and not s.missing for s in self._tree.shapes.get(link, ()))
        ]
        return {link: self._carriers[link] for link in found[:_MOST_APART]}


def shapes_at_rest(robot: Robot, tree: UrdfTree | None = None) -> FloatArray:
    """Corners of everything that a robot shows at rest, ``(N, 3)`` [m] in the body frame; link origins too."""
    from syda_gym.embodiments.reading.shapes import corners

    tree = tree or read_urdf(robot.urdf)
    angles = {**robot.description.rest, **dict(zip(robot.joint_names, robot.rest.tolist(), strict=True))}
    places = placements_at(tree, angles)
    inverse = np.linalg.inv(_body_frame(robot, tree, places))
    points = [
        corners(shape) @ places[link][:3, :3].T + places[link][:3, 3]
        for link, shapes in tree.shapes.items()
        if link in places
        for shape in shapes
    ]
    points += [np.array([place[:3, 3] for place in places.values()])]
    result: FloatArray = np.concatenate(points) @ inverse[:3, :3].T + inverse[:3, 3]
    return result


def _body_frame(robot: Robot, tree: UrdfTree, places: dict[str, FloatArray]) -> FloatArray:
    """The torso frame turned to body axes."""
    torso = robot.description.torso
    root = next(iter(tree.links() - set(tree.parent_joint)))
    frame = places[torso if torso in places else root].copy()
    if robot.description.axes is not None:
        frame[:3, :3] = frame[:3, :3] @ np.array(robot.description.axes).T
    return frame


def _carriers(tree: UrdfTree, joints: Sequence[str]) -> dict[str, int]:
    """Link to the index of the nearest arm joint above it, -1 for what stands still."""
    index = {name: i for i, name in enumerate(joints)}
    found: dict[str, int] = {}
    for link in tree.links():
        at = link
        while at in tree.parent_joint and tree.parent_joint[at] not in index:
            at = tree.joints[tree.parent_joint[at]].parent
        found[link] = index[tree.parent_joint[at]] if at in tree.parent_joint else -1
    return found


def _arms(robot: Robot) -> list[Any]:
    by_side = {arm.side: arm for arm in robot.description.arms}
    return [by_side[side] for side in robot.sides]


def _origin(place: FloatArray) -> str:
    values = origin_attributes(place)
    return f'<origin xyz="{values["xyz"]}" rpy="{values["rpy"]}"/>'


def _inertial(mass: float, centre: FloatArray, tensor: FloatArray, least: bool = True) -> str:
    """Along the principal axes, since PyBullet takes no products of inertia."""
    values, axes = np.linalg.eigh(0.5 * (tensor + tensor.T))
    if least:
        mass, values = max(mass, _LEAST_MASS), np.maximum(values, _LEAST_INERTIA)
        lack = max(float(values[2] - values[0] - values[1]), 0.0)  # no body has such moments; PyBullet drops them all
        values = values + np.array([0.51, 0.51, 0.0]) * lack
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = axes, centre
    x, y, z = (float(v) for v in values)
    return (
        f'<inertial>{_origin(place)}<mass value="{mass:.9g}"/><inertia ixx="{x:.9g}" iyy="{y:.9g}" izz="{z:.9g}" '
        'ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _shape(shape: Shape, place: FloatArray, role: str | None = None) -> str:
    role = role or shape.role
    if shape.kind == "mesh":
        scale = " ".join(f"{v:.9g}" for v in shape.size)
        inner = f'<mesh filename={quoteattr(str(shape.mesh))} scale="{scale}"/>'
    else:
        sizes = " ".join(f'{key}="{value}"' for key, value in size_attributes(shape).items())
        inner = f"<{shape.kind} {sizes}/>"
    color = ""
    if role == "visual":
        seen = shape.color is not None and shape.color[3] > 0.0 and max(shape.color[:3]) > 0.05
        # Black without light is a converter's default, and an invisible link is none to look at.
        rgba = " ".join(f"{v:.4g}" for v in (shape.color if seen and shape.color else _GRAY))
        color = f'<material name="m{rgba.replace(" ", "_")}"><color rgba="{rgba}"/></material>'
    return f"<{role}>{_origin(place)}<geometry>{inner}</geometry>{color}</{role}>"


def _stick(start: FloatArray, end: FloatArray, radius: float) -> list[str]:
    """A capsule, as PyBullet draws it: a cylinder between two balls."""
    way = end - start
    length = float(np.linalg.norm(way))
    if length < 1e-3:
        return []
    z = way / length
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    middle = np.eye(4)
    middle[:3, :3], middle[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), 0.5 * (start + end)
    found = [_shape(Shape("visual", "cylinder", (radius, length), middle), middle)]
    for at in (start, end):
        place = np.eye(4)
        place[:3, 3] = at
        found.append(_shape(Shape("visual", "sphere", (radius,), place), place))
    return found


def weak_joints(robot: Robot, frames: FloatArray | None = None) -> list[tuple[str, float, float]]:
    """Joints whose stated effort is less than gravity alone asks for.

    Args:
        robot: whose arms.
        frames: poses ``(N, n)`` [rad]; by default the arms stretched forward, where gravity asks most.

    Returns:
        Joint, the torque that holds it in the worst of the poses, and its effort [N m].
    """
    import pinocchio

    from syda_gym.embodiments.limb_ik.solver import LimbIK

    if frames is None:
        frames = LimbIK.of(robot).solve(np.tile([1.0, 0.0, 0.0], (1, len(robot.sides), 2, 1)))
    tree = read_urdf(robot.urdf)
    writer = _Writer(robot, tree, (), looks=False)
    down = np.array(writer._gravity())
    names = [tree.model_joints[name] for name in robot.joint_names]
    locked = [tree.model.getJointId(name) for name in tree.model.names if name not in ("universe", *names)]
    model = pinocchio.buildReducedModel(tree.model, locked, configuration(tree, writer._rest))
    model.gravity.linear = writer._body[:3, :3] @ down
    data = model.createData()
    worst = np.zeros(len(names))
    for frame in frames:
        q = pinocchio.neutral(model)
        for name, angle in zip(names, frame.tolist(), strict=True):
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
        torque = pinocchio.computeGeneralizedGravity(model, data, q)
        found = [abs(float(torque[model.joints[model.getJointId(name)].idx_v])) for name in names]
        worst = np.maximum(worst, found)
    return [
        (name, float(needed), float(effort))
        for name, needed, effort in zip(robot.joint_names, worst, robot.effort, strict=True)
        if needed > effort
    ]


def disabled_pairs(robot: Robot, body: PlainBody) -> list[tuple[str, str]]:
    """Pairs of PyBullet's links whose contact does not count.

    Links of one carrier never move against each other, and neighbours overlap by construction.
    """
    if not body.xml:
        return list(robot.description.disabled_collisions)
    tree = read_urdf(robot.urdf)
    carriers = _carriers(tree, robot.joint_names)
    above = {i: carriers[tree.joints[name].parent] for i, name in enumerate(robot.joint_names)}
    names = {-1: BASE, **{i: tree.joints[name].child for i, name in enumerate(robot.joint_names)}}
    pairs = [
        (first + " apart", second + " apart")
        for first, second in robot.description.disabled_collisions
        if first in body.apart and second in body.apart
    ]
    apart = list(body.apart.items())
    for index, (link, carrier) in enumerate(apart):
        near = {carrier, above.get(carrier, -1), *(i for i, a in above.items() if a == carrier)}
        pairs += [(link + " apart", names[i]) for i in near]
        pairs += [(link + " apart", other + " apart") for other, theirs in apart[index + 1 :] if theirs in near]
    return pairs
