"""Camera: pictures of robot, ghost and operator, off screen and without a display."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, nearest_name
from syda_gym.look import GROUNDS, LIGHT_AMBIENT, LIGHT_DIFFUSE, LIGHT_FROM, LIGHT_SPECULAR, REFERENCE, rgba
from syda_gym.simulation.landmark_kinematics import LandmarkKinematics
from syda_gym.simulation.pictures.frustum import Frustum, PictureWindow
from syda_gym.simulation.pictures.scene import Marker, PosedRobot, PosedSkeleton, floor_below
from syda_gym.simulation.pictures.stage import Stage

__all__ = ["GHOST_COLOR", "Camera", "CameraView", "Picture", "error_color"]

Picture = NDArray[np.uint8]

GHOST_COLOR = rgba(REFERENCE)
_GHOST_SHARE = 0.45
_GHOST_FINEST = 0.012  # m; a ghost has no fingers, which are most of the triangles
_GHOST_GAP = 2e-5  # of depth, so that a ghost that coincides with the robot does not flicker
_GIRTH = 0.15  # m around the origins of links that their shapes are looked for in; grows where it proves too little


@dataclass(frozen=True)
class CameraView:
    """Where the camera stands and what it shows.

    Attributes:
        width: of the picture [pixels].
        height: of the picture [pixels].
        distance: from the camera to what it looks at [m]; ``None`` for as far as it takes to show everything.
        yaw: 0 looks at the robot's face, positive from its left [degrees].
        pitch: positive looks down [degrees].
        fov: vertical field of view [degrees].
        ghost: show the reference as a translucent ghost.
        operator: show the operator beside the robot.
        error: show the landmark errors as colours of elbows and wrists, green (none) to red (``error_scale``).
        error_scale: landmark error that is fully red [m].
        appearance: a URDF with the same joint names to show instead, for example the vendor's with meshes.
        ground: what they stand on and before: ``day``, ``night`` for dark pages, or ``dusk`` for both.

    Raises:
        OptionError: a value outside what is allowed.
    """

    width: int = 480
    height: int = 360
    distance: float | None = None
    yaw: float = 0.0
    pitch: float = 8.0
    fov: float = 42.0
    ghost: bool = True
    operator: bool = True
    error: bool = True
    error_scale: float = 0.15
    appearance: str | os.PathLike[str] | None = None
    ground: str = "day"

    def __post_init__(self) -> None:
        if self.ground not in GROUNDS:
            raise OptionError(f"camera ground={self.ground!r} is unknown; {nearest_name(str(self.ground), GROUNDS)}")
        for name, low, high in (
            ("width", 16, 4096), ("height", 16, 4096), ("distance", 0.2, 50.0), ("yaw", -360.0, 360.0),
            ("pitch", -89.0, 89.0), ("fov", 5.0, 120.0), ("error_scale", 1e-4, 10.0),
        ):  # fmt: skip
            value = getattr(self, name)
            if name == "distance" and value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not low <= value <= high:
                raise OptionError(f"camera {name} must lie between {low} and {high}, got {value!r}")

    @classmethod
    def resolve(cls, value: CameraView | Mapping[str, Any] | None) -> CameraView:
        """Accepts a view, a mapping with some of its values, or ``None``.

        Raises:
            OptionError: an unknown name.
        """
        if isinstance(value, CameraView):
            return value
        if value is None:
            return cls()
        if not isinstance(value, Mapping):
            raise OptionError(f"camera must be a CameraView or a dict, got {type(value).__name__}")
        known = [field.name for field in fields(cls)]
        for name in value:
            if name not in known:
                raise OptionError(f"unknown camera setting {name!r}; {nearest_name(str(name), known)}")
        return cls(**value)


class Camera:
    """Takes pictures; it has PyBullet clients of its own, so that looking never changes the physics.

    Whatever does not move is rendered once and kept with its depth; a frame renders the arms alone, in the part of the
    picture where they are, and is laid over it.

    Args:
        robot: who follows.
        operator: who leads, shown at the robot's left side; ``None`` for nobody.
        view: where the camera stands and what it shows.
    """

    def __init__(self, robot: Robot, operator: Embodiment | None = None, view: CameraView | None = None) -> None:
        import pybullet

        self._bullet = pybullet
        self.view = view = view or CameraView()
        self._robot, self._operator = robot, operator if view.operator else None
        self._clients: list[int] = []
        self._girth = _GIRTH
        self.stage = Stage(robot, self._operator, view.fov, view.width / view.height, view.distance)
        self._landmarks = LandmarkKinematics(robot)
        try:
            self._solid = self._connect()
            self._background, self._depth = self._take_background()
            self._puppet = PosedRobot(robot, self._solid, urdf=view.appearance)
            self._puppet.hide(self._puppet.still)
            self._skeleton = self._add_operator(self._solid, moving=True)
            self._markers = [Marker(self._solid, self.stage.marker) for _ in robot.landmark_names] if view.error else []
            self._ghost: PosedRobot | None = None
            if view.ghost:
                self._ghost_client = self._connect()
                self._ghost = PosedRobot(robot, self._ghost_client, urdf=view.appearance)
                self._ghost.paint(GHOST_COLOR)
                self._ghost.hide(self._ghost.still)
                self._ghost.simplify(_GHOST_FINEST)
        except BaseException:
            self.close()
            raise

    def picture(
        self,
        q: FloatArray,
        *,
        reference: FloatArray | None = None,
        operator: FloatArray | None = None,
        errors: FloatArray | None = None,
    ) -> Picture:
        """Takes a picture.

        Args:
            q: the robot's joint angles ``(n,)`` [rad].
            reference: joint angles of the ghost ``(n,)`` [rad]; ``None`` for no ghost.
            operator: the operator's frame ``(F,)``; ``None`` leaves it as it is.
            errors: landmark errors ``(2 * arms,)`` [m]; ``None`` for no colours.

        Returns:
            ``(height, width, 3)`` uint8.
        """
        self._puppet.pose(q)
        if self._skeleton is not None and operator is not None:
            self._skeleton.pose(operator)
        self._show_errors(q, errors)
        movers = [body for body in (self._puppet, self._skeleton) if body is not None]
        window, image, depth = self._look(self._solid, np.concatenate([body.points() for body in movers]), self._depth)
        result, nearest = self._background.copy(), self._depth
        front = depth < nearest[window.pixels]
        result[window.pixels][front] = image[front]
        if self._ghost is not None and reference is not None:
            nearest = nearest.copy()
            np.minimum(nearest[window.pixels], depth, out=nearest[window.pixels])
            self._ghost.pose(reference)
            window, veil, depth = self._look(self._ghost_client, self._ghost.points(), nearest)
            front = depth < nearest[window.pixels] - _GHOST_GAP
            # Only the pixels of the ghost are blended; the rest of the picture stays as it is.
            covered = result[window.pixels]
            mixed = (1.0 - _GHOST_SHARE) * covered[front] + _GHOST_SHARE * veil[front]
            covered[front] = mixed.astype(np.uint8)
        return result

    def close(self) -> None:
        """Disconnects; harmless when repeated."""
        clients, self._clients = self._clients, []
        for client in clients:
            if self._bullet.isConnected(client):
                self._bullet.disconnect(client)

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_clients", None):
            self.close()

    def _connect(self) -> int:
        client: int = self._bullet.connect(self._bullet.DIRECT)
        self._clients.append(client)
        return client

    def _take_background(self) -> tuple[Picture, NDArray[np.float32]]:
        puppet = PosedRobot(self._robot, self._solid, urdf=self.view.appearance)
        self._floor = puppet.lowest()
        self._aim(puppet)
        puppet.hide(puppet.moving)
        client = self._connect()  # of its own, because PyBullet cannot take single shapes out again
        still = PosedRobot(self._robot, client, urdf=self.view.appearance)
        still.hide(still.moving)
        puppet.remove()
        ground = GROUNDS[self.view.ground]
        floor_below(client, self._floor, ground.floor)
        self._add_operator(client, moving=False)
        shot, far = self._shoot(client, self._frustum.whole)
        image, depth = shot.copy(), far.copy()
        self._bullet.disconnect(client)
        self._clients.remove(client)
        sky = depth >= 1.0
        shade = np.linspace(0.0, 1.0, self.view.height)[:, None, None]
        gradient = 255.0 * ((1.0 - shade) * np.array(ground.sky_top) + shade * np.array(ground.sky_bottom))
        image[sky] = np.broadcast_to(gradient, image.shape)[sky].astype(np.uint8)
        return image, depth

    def _add_operator(self, client: int, *, moving: bool) -> PosedSkeleton | PosedRobot | None:
        if self._operator is None:
            return None
        if isinstance(self._operator, HumanSkeleton):
            return PosedSkeleton(self._operator, client, (0.0, self.stage.operator_at, self._floor), moving)
        if not isinstance(self._operator, Robot):
            return None
        body = PosedRobot(self._operator, client, (0.0, self.stage.operator_at, 0.0))
        rise = self._floor - body.lowest()
        body.remove()
        body = PosedRobot(self._operator, client, (0.0, self.stage.operator_at, rise))
        body.hide(body.still if moving else body.moving)
        return body

    def _aim(self, puppet: PosedRobot) -> None:
        """Looks at the middle of what stands there."""
        view, stage = self.view, self.stage
        center = stage.center(self._floor)
        yaw, pitch = np.radians(view.yaw), np.radians(view.pitch)
        away = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
        self._frustum = Frustum(center + stage.distance * away, center, view.fov, view.width, view.height)

    def _look(
        self, client: int, points: FloatArray, behind: NDArray[np.float32]
    ) -> tuple[PictureWindow, Picture, NDArray[np.float32]]:
        """Renders what stands about ``points``: where in the picture, its colours and its depth."""
        window = self._frustum.around(points, self._girth)
        image, depth = self._shoot(client, window)
        if window == self._frustum.whole or not _cut(depth < behind[window.pixels], window, self._frustum.whole):
            return window, image, depth
        self._girth *= 1.5  # shapes reach beyond the window: hands that are larger than expected
        return self._frustum.whole, *self._shoot(client, self._frustum.whole)

    def _shoot(self, client: int, window: PictureWindow) -> tuple[Picture, NDArray[np.float32]]:
        raw = self._bullet.getCameraImage(
            window.width,
            window.height,
            self._frustum.view,
            self._frustum.projection(window),
            lightDirection=LIGHT_FROM,
            lightAmbientCoeff=LIGHT_AMBIENT,
            lightDiffuseCoeff=LIGHT_DIFFUSE,
            lightSpecularCoeff=LIGHT_SPECULAR,
            shadow=0,
            flags=self._bullet.ER_NO_SEGMENTATION_MASK,
            renderer=self._bullet.ER_TINY_RENDERER,
            physicsClientId=client,
        )
        shape = (window.height, window.width)
        image = np.asarray(raw[2], dtype=np.uint8).reshape(*shape, 4)[:, :, :3]
        return image, np.asarray(raw[3], dtype=np.float32).reshape(shape)

    def _show_errors(self, q: FloatArray, errors: FloatArray | None) -> None:
        if not self._markers:
            return
        if errors is None:
            for marker in self._markers:
                marker.hide()
            return
        points = self._landmarks(q[:, None]).reshape(-1, 3)
        for marker, point, error in zip(self._markers, points, errors.tolist(), strict=True):
            marker.show(point, error_color(error / self.view.error_scale))


def error_color(share: float) -> tuple[float, float, float, float]:
    """Green at 0, yellow at one half, red at 1 and beyond."""
    s = round(16.0 * min(max(share, 0.0), 1.0)) / 16.0  # in steps, because recolouring is slow
    return (min(1.0, 0.15 + 1.7 * s), min(0.75, 1.6 * (1.0 - s)), 0.12, 1.0)


def _cut(shown: NDArray[np.bool_], window: PictureWindow, whole: PictureWindow) -> bool:
    """Whether what a window shows goes on beyond an edge that is none of the picture's."""
    edges = (
        (window.left > 0, shown[:, 0]),
        (window.top > 0, shown[0]),
        (window.left + window.width < whole.width, shown[:, -1]),
        (window.top + window.height < whole.height, shown[-1]),
    )
    return any(inner and bool(edge.any()) for inner, edge in edges)
