"""Window: the same scene as the camera's, live in PyBullet's own viewer."""

from __future__ import annotations

import math
import os
import sys
import time

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError
from syda_gym.simulation.pictures.camera import GHOST_COLOR, CameraView, error_color
from syda_gym.simulation.pictures.scene import Marker, PosedRobot, PosedSkeleton, floor_below
from syda_gym.simulation.pictures.stage import Stage

__all__ = ["Window", "has_display"]

_FOV = 60.0  # degrees; of PyBullet's viewer


def has_display() -> bool:
    """Whether a window can be opened here."""
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY"))


class Window:
    """Shows robot, ghost and operator in real time; the mouse moves the camera.

    Args:
        robot: who follows.
        operator: who leads.
        view: where the camera stands at first, and what is shown.
        fps: pictures per second.

    Raises:
        OptionError: there is no display.
    """

    def __init__(self, robot: Robot, operator: Embodiment, view: CameraView, fps: float) -> None:
        if not has_display():
            # Without this check PyBullet ends the whole process.
            raise OptionError("render_mode='human' needs a display ($DISPLAY is not set); use render_mode='rgb_array'")
        import pybullet

        self._bullet, self._robot, self._view, self._period = pybullet, robot, view, 1.0 / fps
        self._client: int = pybullet.connect(pybullet.GUI, options=f"--width={view.width} --height={view.height}")
        if self._client < 0:
            raise OptionError("PyBullet could not open a window; use render_mode='rgb_array'")
        pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0, physicsClientId=self._client)
        self._puppet = PosedRobot(robot, self._client, urdf=view.appearance)
        floor = self._puppet.lowest()
        self._ghost: PosedRobot | None = None
        if view.ghost:
            self._ghost = PosedRobot(robot, self._client, urdf=view.appearance)
            self._ghost.paint((*GHOST_COLOR[:3], 0.4))
            self._ghost.hide(self._ghost.still)
        stage = Stage(robot, operator if view.operator else None, view.fov, view.width / view.height, view.distance)
        self._operator: PosedSkeleton | PosedRobot | None = None
        if view.operator and isinstance(operator, HumanSkeleton):
            self._operator = PosedSkeleton(operator, self._client, (0.0, stage.operator_at, floor))
        elif view.operator and isinstance(operator, Robot):
            self._operator = PosedRobot(operator, self._client, (0.0, stage.operator_at, 0.0))
        self._markers = [Marker(self._client, stage.marker) for _ in robot.landmark_names] if view.error else []
        floor_below(self._client, floor)
        middle = tuple(stage.center(floor).tolist())
        # The viewer's field of view is its own; from nearer it shows what the camera does.
        nearer = math.tan(math.radians(0.5 * view.fov)) / math.tan(math.radians(0.5 * _FOV))
        pybullet.resetDebugVisualizerCamera(
            nearer * stage.distance, 90.0 + view.yaw, -view.pitch, middle, physicsClientId=self._client
        )
        self._next = time.monotonic()

    def show(self, q: FloatArray, *, reference: FloatArray, operator: FloatArray | None, errors: FloatArray) -> None:
        """Shows one frame and waits until it is time for the next one; arguments as ``Camera.picture``."""
        self._puppet.pose(q)
        if self._ghost is not None:
            self._ghost.pose(reference)
        if self._operator is not None and operator is not None:
            self._operator.pose(operator)
        points = self._robot.landmarks(q)[0]
        for marker, point, error in zip(self._markers, points, errors.tolist(), strict=False):
            marker.show(point, error_color(error / self._view.error_scale))
        self._next = max(self._next + self._period, time.monotonic())
        time.sleep(max(0.0, self._next - time.monotonic()))

    def close(self) -> None:
        """Closes the window; harmless when repeated."""
        client, self._client = self._client, -1
        if client >= 0 and self._bullet.isConnected(client):
            self._bullet.disconnect(client)
