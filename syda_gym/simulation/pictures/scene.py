"""Scene: what a camera looks at, built in a PyBullet client that simulates nothing."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.figure import bones, figure_points
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.kinematics.urdf import read_urdf
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError
from syda_gym.look import GROUND, PERSON
from syda_gym.simulation.plain_body import plain_body, shapes_at_rest
from syda_gym.simulation.quiet import quiet

__all__ = ["Marker", "PosedRobot", "PosedSkeleton", "floor_below"]

_logger = logging.getLogger("syda_gym.simulation")
_told: set[str] = set()  # files whose missing meshes were told of

_AWAY = (0.0, 0.0, -1000.0)
_HIDDEN = (1.0, 1.0, 1.0, 0.0)


class PosedRobot:
    """A robot that takes poses and nothing else, its torso frame at ``place``.

    Args:
        robot: who.
        client: PyBullet client.
        place: of the torso frame [m].
        urdf: another URDF with the same joint names to show instead, for example one with the vendor's meshes.

    Raises:
        EmbodimentError: PyBullet cannot load the URDF, or it lacks a joint of the robot.
    """

    def __init__(
        self,
        robot: Robot,
        client: int,
        place: Sequence[float] = (0.0, 0.0, 0.0),
        urdf: str | os.PathLike[str] | None = None,
    ) -> None:
        import pybullet

        self._bullet, self._client = pybullet, client
        path = os.fspath(urdf or robot.urdf)
        tree = read_urdf(path)
        for name in robot.joint_names:
            if name not in tree.joints:
                raise EmbodimentError(f"{path} has no joint {name!r}; it does not show a {robot.name!r}")
        plain = plain_body(robot, ("visual",), tree if urdf else None)
        if plain.missing and path not in _told:
            _told.add(path)
            _logger.warning("%s: %d meshes are not there; what shows nothing is drawn as sticks", path, plain.missing)
        try:
            with plain.file(path) as shown, quiet(robot.name):
                self.body: int = pybullet.loadURDF(shown, useFixedBase=True, physicsClientId=client)
        except pybullet.error as error:
            raise EmbodimentError(f"PyBullet cannot load {path}: {error}; check the file and its meshes") from error
        rows = [
            pybullet.getJointInfo(self.body, joint, physicsClientId=client)
            for joint in range(pybullet.getNumJoints(self.body, physicsClientId=client))
        ]
        joints = {row[1].decode(): row[0] for row in rows}
        self._arms = [joints[name] for name in robot.joint_names]
        self._links = {row[12].decode(): row[0] for row in rows}
        parents = {row[0]: row[16] for row in rows}
        self.moving = [link for link in parents if _hangs_on(link, set(self._arms), parents)]
        self.still = [-1, *(link for link in parents if link not in self.moving)]
        for name, angle in robot.description.rest.items():
            if name in joints:
                pybullet.resetJointState(self.body, joints[name], angle, physicsClientId=client)
        self._put_torso(-1 if plain.torso is None else self._links.get(plain.torso, -1), place)
        # Boxes around links without collision shapes are empty: what is lowest then follows from the shapes.
        self._lowest = None if plain.torso else float(shapes_at_rest(robot, tree)[:, 2].min()) + float(place[2])

    def pose(self, q: FloatArray) -> None:
        """Takes joint angles ``(n,)`` [rad]."""
        self._bullet.resetJointStatesMultiDof(
            self.body, self._arms, [[angle] for angle in q.tolist()], physicsClientId=self._client
        )

    def points(self) -> FloatArray:
        """Origins of the links that move with the arms, ``(N, 3)`` [m]."""
        states = self._bullet.getLinkStates(
            self.body, self.moving, computeForwardKinematics=1, physicsClientId=self._client
        )
        return np.array([state[4] for state in states])

    def hide(self, links: Sequence[int]) -> None:
        """Makes links invisible."""
        for link in links:
            self._bullet.changeVisualShape(self.body, link, rgbaColor=_HIDDEN, physicsClientId=self._client)

    def simplify(self, radius: float) -> None:
        """Hides round shapes of the arms that are thinner than ``radius`` [m], such as fingers."""
        thin = (self._bullet.GEOM_SPHERE, self._bullet.GEOM_CYLINDER, self._bullet.GEOM_CAPSULE)
        place: dict[int, int] = {}
        for shape in self._bullet.getVisualShapeData(self.body, physicsClientId=self._client):
            link, kind, size = shape[1], shape[2], shape[3]
            place[link] = place.get(link, -1) + 1
            thickness = size[0] if kind == self._bullet.GEOM_SPHERE else size[1]
            if link in self.moving and kind in thin and thickness < radius:
                self._bullet.changeVisualShape(
                    self.body, link, shapeIndex=place[link], rgbaColor=_HIDDEN, physicsClientId=self._client
                )

    def paint(self, color: Sequence[float]) -> None:
        """Gives all visible parts one colour."""
        for link in [-1, *self._links.values()]:
            self._bullet.changeVisualShape(self.body, link, rgbaColor=color, physicsClientId=self._client)

    def lowest(self) -> float:
        """Height of its lowest point at rest [m]."""
        if self._lowest is not None:
            return self._lowest
        boxes = [
            self._bullet.getAABB(self.body, link, physicsClientId=self._client) for link in [-1, *self._links.values()]
        ]
        return float(min(box[0][2] for box in boxes))

    def remove(self) -> None:
        """Takes the robot out of the scene."""
        self._bullet.removeBody(self.body, physicsClientId=self._client)

    def _put_torso(self, torso: int, place: Sequence[float]) -> None:
        bullet, client = self._bullet, self._client
        base = bullet.getBasePositionAndOrientation(self.body, physicsClientId=client)
        frame = base
        if torso >= 0:
            state = bullet.getLinkState(self.body, torso, computeForwardKinematics=1, physicsClientId=client)
            frame = (state[4], state[5])
        inverse = bullet.invertTransform(*frame)
        moved = bullet.multiplyTransforms(place, (0.0, 0.0, 0.0, 1.0), *bullet.multiplyTransforms(*inverse, *base))
        bullet.resetBasePositionAndOrientation(self.body, *moved, physicsClientId=client)


class PosedSkeleton:
    """A human of round bones, see ``embodiments.figure``, standing at ``place``.

    Args:
        human: who.
        client: PyBullet client.
        place: point on the floor between the feet [m].
        moving: ``True`` for the arms alone, ``False`` for all the rest, ``None`` for everything.
    """

    def __init__(self, human: HumanSkeleton, client: int, place: Sequence[float], moving: bool | None = None) -> None:
        import pybullet

        self._bullet, self._client, self._human = pybullet, client, human
        self._place = np.asarray(place, dtype=np.float64)
        standing = {name: points[0] for name, points in figure_points(human, human.standing()).items()}
        self._bones: list[tuple[str, str, int]] = []
        self._balls: list[tuple[str, int]] = []
        seen: set[tuple[str, str, float]] = set()
        for bone in bones(human):
            if moving is not None and bone.moves != moving:
                continue
            radius, color = bone.radius * human.height, (*PERSON[bone.colour], 1.0)
            if bone.start != bone.end:
                length = float(np.linalg.norm(standing[bone.end] - standing[bone.start]))
                self._bones.append((bone.start, bone.end, _bone(pybullet, client, radius, length, color)))
            for name in {bone.start, bone.end}:
                if (name, bone.colour, radius) not in seen:
                    seen.add((name, bone.colour, radius))
                    self._balls.append((name, _ball(pybullet, client, radius, color)))
        self._sole = 0.024 * human.height
        self.pose(human.standing())

    def pose(self, frame: FloatArray) -> None:
        """Takes a frame ``(F,)`` in the human's own features."""
        points = {name: rows[0] for name, rows in figure_points(self._human, frame).items()}
        feet = min(points[name][2] for name in ("LFoot", "RFoot", "LToe", "RToe"))
        hips = 0.5 * (points["LHip"] + points["RHip"])
        shift = self._place - np.array([hips[0], hips[1], feet - self._sole])
        self._points = np.array([points[name] + shift for name, _ in self._balls])
        for first, second, body in self._bones:
            a, b = points[first] + shift, points[second] + shift
            self._move(body, 0.5 * (a + b), _turn_to(b - a))
        for name, body in self._balls:
            self._move(body, points[name] + shift, (0.0, 0.0, 0.0, 1.0))

    def points(self) -> FloatArray:
        """Where its points are, ``(N, 3)`` [m]."""
        return self._points

    def _move(self, body: int, position: FloatArray, orientation: Sequence[float]) -> None:
        self._bullet.resetBasePositionAndOrientation(body, position.tolist(), orientation, physicsClientId=self._client)


class Marker:
    """A ball whose colour can change."""

    def __init__(self, client: int, radius: float) -> None:
        import pybullet

        self._bullet, self._client = pybullet, client
        self._body = _ball(pybullet, client, radius, (0.0, 1.0, 0.0, 1.0))
        self._color: tuple[float, ...] = ()

    def show(self, position: FloatArray, color: Sequence[float]) -> None:
        """Puts the ball somewhere in a colour."""
        self._bullet.resetBasePositionAndOrientation(
            self._body, position.tolist(), (0.0, 0.0, 0.0, 1.0), physicsClientId=self._client
        )
        if tuple(color) != self._color:
            self._color = tuple(color)
            self._bullet.changeVisualShape(self._body, -1, rgbaColor=color, physicsClientId=self._client)

    def hide(self) -> None:
        """Takes the ball out of sight."""
        self._bullet.resetBasePositionAndOrientation(
            self._body, _AWAY, (0.0, 0.0, 0.0, 1.0), physicsClientId=self._client
        )


def floor_below(client: int, height: float, colour: tuple[float, float, float] = GROUND) -> None:
    """A floor whose surface is at ``height`` [m]."""
    import pybullet

    shape = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=(20.0, 20.0, 0.01), rgbaColor=(*colour, 1.0), physicsClientId=client
    )
    pybullet.createMultiBody(0.0, -1, shape, (0.0, 0.0, height - 0.01), physicsClientId=client)


def _hangs_on(link: int, arms: set[int], parents: dict[int, int]) -> bool:
    while link >= 0:
        if link in arms:
            return True
        link = parents[link]
    return False


def _ball(bullet: Any, client: int, radius: float, color: Sequence[float]) -> int:
    shape = bullet.createVisualShape(bullet.GEOM_SPHERE, radius=radius, rgbaColor=color, physicsClientId=client)
    body: int = bullet.createMultiBody(0.0, -1, shape, _AWAY, physicsClientId=client)
    return body


def _bone(bullet: Any, client: int, radius: float, length: float, color: Sequence[float]) -> int:
    # A cylinder, whose ends lie inside the joints' balls: a capsule takes three times as long to draw.
    shape = bullet.createVisualShape(
        bullet.GEOM_CYLINDER, radius=radius, length=length, rgbaColor=color, physicsClientId=client
    )
    body: int = bullet.createMultiBody(0.0, -1, shape, _AWAY, physicsClientId=client)
    return body


def _turn_to(direction: FloatArray) -> tuple[float, float, float, float]:
    """Quaternion (x, y, z, w) that takes z to ``direction``."""
    x, y, z = (direction / max(float(np.linalg.norm(direction)), 1e-9)).tolist()
    if z < -1.0 + 1e-9:
        return (1.0, 0.0, 0.0, 0.0)
    norm = float(np.sqrt(2.0 * (1.0 + z)))
    return (-y / norm, x / norm, 0.0, norm / 2.0)
