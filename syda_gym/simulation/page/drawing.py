"""Bodies on a page: a robot as its URDF shows it, a human as round bones; runs in the page's process."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.figure import bones, figure_points
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.errors import EmbodimentError
from syda_gym.look import PERSON
from syda_gym.simulation.page.plan import BodyPlan

__all__ = ["HumanDrawing", "PointsDrawing", "RobotDrawing", "drawing"]

_BALL_FACES = 320
_GHOST_THINNER = 0.003  # m


class RobotDrawing:
    """A robot on the page.

    Args:
        server: viser's.
        plan: of the robot.

    Raises:
        EmbodimentError: the URDF cannot be read, shows nothing, or lacks a joint of the robot.
    """

    def __init__(self, server: Any, plan: BodyPlan) -> None:
        self._urdf = urdf = _load(Path(plan.urdf))
        known = list(urdf.actuated_joint_names)
        for joint in plan.joints:
            if joint not in known:
                raise EmbodimentError(f"{plan.urdf} has no movable joint {joint!r}; it does not show this robot")
        if plan.torso not in urdf.link_map:
            raise EmbodimentError(f"{plan.urdf} has no link {plan.torso!r}; it does not show this robot")
        self._columns = [known.index(joint) for joint in plan.joints]
        self._angles = np.array([plan.rest.get(joint, 0.0) for joint in known])
        self._collisions = not (urdf.scene is not None and urdf.scene.geometry)
        urdf.update_cfg(self._angles)
        self._root = np.eye(4)
        self._root[:3, 3] = plan.place
        self._root = self._root @ np.linalg.inv(self._transform(plan.torso))
        self._links: dict[str, Any] = {}
        self.lowest = np.inf
        for link, meshes in self._meshes().items():
            self._links[link] = server.scene.add_frame(f"/{plan.name}/{link}", show_axes=False)
            place = self._root @ self._transform(link)
            for index, mesh in enumerate(_joined(meshes)):
                _add(server, f"/{plan.name}/{link}/{index}", mesh, plan.colour)
                self.lowest = min(self.lowest, float((mesh.vertices @ place[2, :3] + place[2, 3]).min()))
        self._latest: tuple[float, ...] = ()
        self._placed: dict[str, FloatArray] = {}
        self._put()

    def pose(self, values: list[float]) -> None:
        """Takes joint angles in the plan's order [rad]."""
        if tuple(values) == self._latest:  # what does not move need not be sent to every browser
            return
        self._latest = tuple(values)
        self._angles[self._columns] = values
        self._urdf.update_cfg(self._angles)
        self._put()

    def stand_on(self, floor: float) -> None:
        """A floor at this height was laid [m]; the robot stands where its torso is."""

    def _put(self) -> None:
        from viser import transforms

        for link, frame in self._links.items():
            place = self._root @ self._transform(link)
            if link in self._placed and np.allclose(place, self._placed[link], atol=1e-5):
                continue
            self._placed[link] = place
            frame.wxyz = transforms.SO3.from_matrix(place[:3, :3]).wxyz
            frame.position = place[:3, 3]

    def _transform(self, link: str) -> FloatArray:
        found: FloatArray = np.asarray(
            self._urdf.get_transform(link, self._urdf.base_link, collision_geometry=self._collisions)
        )
        return found

    def _meshes(self) -> dict[str, list[Any]]:
        """The solids of each link in the link's frame."""
        scene = self._urdf.collision_scene if self._collisions else self._urdf.scene
        found: dict[str, list[Any]] = {}
        for node in scene.graph.nodes_geometry:
            link = scene.graph.transforms.parents[node]
            turn, name = scene.graph[node]
            local = np.linalg.inv(scene.graph[link][0]) @ turn
            mesh = _coarse(scene.geometry[name])
            mesh.apply_transform(local)
            found.setdefault(link, []).append(mesh)
        return found


class PointsDrawing:
    """Round bones between points.

    Args:
        server: viser's.
        plan: of the points.
    """

    def __init__(self, server: Any, plan: BodyPlan) -> None:
        self._server, self._plan = server, plan
        self._bones = plan.bones
        self._solids: list[Any] = []
        self._latest: list[Any] = []
        self.lowest = np.inf
        self._root = server.scene.add_frame(f"/{plan.name}", show_axes=False, position=plan.place)

    def pose(self, values: list[Any]) -> None:
        """Takes the points ``(P, 3)`` [m] that the bones join."""
        if values == self._latest:
            return
        self._latest = values
        points = self._points(values)
        if not self._solids:
            self._build(points)
        for (a, b, _, _), solid in zip(self._bones, self._solids, strict=True):
            turn, middle = _turn_to(points[b] - points[a]), 0.5 * (points[a] + points[b])
            if not np.allclose(solid.position, middle, atol=1e-4) or not np.allclose(solid.wxyz, turn, atol=1e-4):
                solid.position, solid.wxyz = middle, turn

    def stand_on(self, floor: float) -> None:
        """A floor at this height was laid [m]; points stay where they are."""

    def _points(self, values: list[Any]) -> FloatArray:
        return np.array(values, dtype=np.float64)

    def _build(self, points: FloatArray) -> None:
        from trimesh import creation

        opacity = None if self._plan.colour is None else self._plan.colour[3]
        for index, (a, b, radius, colour) in enumerate(self._bones):
            length = float(np.linalg.norm(points[b] - points[a]))
            if length < 1e-6:
                mesh = creation.icosphere(subdivisions=3, radius=radius)
            else:
                mesh = creation.capsule(length, radius, count=[24, 24])
                mesh.apply_translation(-mesh.bounds.mean(axis=0))
            self._solids.append(
                self._server.scene.add_mesh_simple(
                    f"/{self._plan.name}/{index}", mesh.vertices, mesh.faces, opacity=opacity,
                    color=_bytes(colour if self._plan.colour is None else self._plan.colour),
                )
            )  # fmt: skip


class HumanDrawing(PointsDrawing):
    """A human, standing on the floor.

    Args:
        server: viser's.
        plan: of the human.
    """

    def __init__(self, server: Any, plan: BodyPlan) -> None:
        super().__init__(server, plan)
        self._human = HumanSkeleton(**{key: value for key, value in plan.human.items() if key != "kind"})
        names = list(figure_points(self._human, self._human.standing()))
        self._bones = tuple(
            (names.index(bone.start), names.index(bone.end), bone.radius * self._human.height, PERSON[bone.colour])
            for bone in bones(self._human)
        )

    def stand_on(self, floor: float) -> None:
        """Puts the feet on a floor at this height [m]."""
        x, y, z = self._plan.place
        self._root.position = (x, y, z + floor)

    def _points(self, values: list[Any]) -> FloatArray:
        points = {name: rows[0] for name, rows in figure_points(self._human, np.array(values)).items()}
        soles = min(points[name][2] for name in ("LFoot", "RFoot", "LToe", "RToe")) - 0.024 * self._human.height
        hips = 0.5 * (points["LHip"] + points["RHip"])
        placed: FloatArray = np.stack(list(points.values())) - np.array([hips[0], hips[1], soles])
        return placed


def drawing(server: Any, plan: BodyPlan) -> RobotDrawing | PointsDrawing:
    """Draws a body.

    Raises:
        EmbodimentError: see ``RobotDrawing``.
    """
    if plan.kind == "robot":
        return RobotDrawing(server, plan)
    return HumanDrawing(server, plan) if plan.kind == "human" else PointsDrawing(server, plan)


def _load(path: Path) -> Any:
    from functools import partial

    import yourdfpy

    if not path.is_file():
        raise EmbodimentError(f"no URDF {path} for the view; check the path")
    try:
        urdf = yourdfpy.URDF.load(str(path), filename_handler=partial(yourdfpy.filename_handler_magic, dir=path.parent))
    except Exception as error:  # yourdfpy, lxml and trimesh raise many kinds
        raise EmbodimentError(
            f"the view cannot show {path}: {' '.join(str(error).split())[:200] or type(error).__name__}; expected a "
            "URDF whose meshes lie where it says"
        ) from error
    if urdf.scene is None or not urdf.scene.geometry:
        urdf = yourdfpy.URDF.load(
            str(path), filename_handler=partial(yourdfpy.filename_handler_magic, dir=path.parent),
            build_collision_scene_graph=True, load_collision_meshes=True,
        )  # fmt: skip
        if urdf.collision_scene is None or not urdf.collision_scene.geometry:
            raise EmbodimentError(
                f"the view can show nothing of {path}: it has no shapes, or their meshes were not found; give another "
                "URDF of the robot with --appearance"
            )
    return urdf


def _coarse(mesh: Any) -> Any:
    """A copy, with fewer triangles where it is a ball; a robot of primitives has hundreds of them."""
    from trimesh import creation

    if len(mesh.faces) > _BALL_FACES:
        middle = mesh.bounds.mean(axis=0)
        radii = np.linalg.norm(mesh.vertices - middle, axis=1)
        if np.ptp(radii) < 1e-6:
            ball = creation.icosphere(subdivisions=2, radius=float(radii[0]))
            ball.apply_translation(middle)
            if mesh.visual.kind == "face" or mesh.visual.kind == "vertex":
                ball.visual.face_colors = np.tile(mesh.visual.face_colors[:1], (len(ball.faces), 1))
            return ball
    return mesh.copy()


def _joined(meshes: list[Any]) -> list[Any]:
    """One mesh of all that are merely coloured, for a browser draws a few large ones faster than many small ones."""
    from trimesh import util

    plain = [mesh for mesh in meshes if mesh.visual.kind != "texture"]
    rest = [mesh for mesh in meshes if mesh.visual.kind == "texture"]
    return ([util.concatenate(plain)] if plain else []) + rest


def _add(server: Any, name: str, mesh: Any, colour: tuple[float, float, float, float] | None) -> None:
    if colour is None:
        server.scene.add_mesh_trimesh(name, mesh)
        return
    # A little thinner, so that a ghost that stands where the robot is lies inside it.
    inside = mesh.vertices - _GHOST_THINNER * mesh.vertex_normals
    server.scene.add_mesh_simple(name, inside, mesh.faces, color=_bytes(colour), opacity=colour[3])


def _bytes(colour: Sequence[float]) -> tuple[int, int, int]:
    red, green, blue = colour[:3]
    return round(255 * red), round(255 * green), round(255 * blue)


def _turn_to(direction: FloatArray) -> tuple[float, float, float, float]:
    """Quaternion (w, x, y, z) that takes z to ``direction``."""
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        return (1.0, 0.0, 0.0, 0.0)
    x, y, z = (direction / length).tolist()
    if z < -1.0 + 1e-9:
        return (0.0, 1.0, 0.0, 0.0)
    norm = float(np.sqrt(2.0 * (1.0 + z)))
    return (norm / 2.0, -y / norm, x / norm, 0.0)
