"""Stage: how robot and operator stand before a camera, whatever their sizes."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.simulation.plain_body import shapes_at_rest

__all__ = ["OPERATOR_AT", "Stage"]

OPERATOR_AT = 0.95  # m to the robot's left, of robots with arms no longer than a person's
_MARKER_RADIUS = 0.046  # m, of robots with arms as long as Pepper's or longer
_NEAREST = 3.0  # m; from there a person stands in the picture


class Stage:
    """How robot and operator stand before a camera: as far apart and as far away as their sizes ask for.

    Args:
        robot: who follows.
        operator: who stands beside it, if anybody.
        fov: vertical field of view [degrees].
        aspect: width of the picture over its height.
        distance: that somebody asked for [m], ``None`` for as far as it takes to show everything.

    Attributes:
        operator_at: where the operator stands, to the robot's left [m].
        marker: radius of the balls at elbows and wrists [m].
        distance: from the camera to what it looks at [m].
    """

    def __init__(
        self, robot: Robot, operator: Embodiment | None, fov: float, aspect: float, distance: float | None
    ) -> None:
        self._robot, self._operator = robot, operator
        body = shapes_at_rest(robot)
        shoulders = robot.arm_points(robot.rest)[0, :, 0]
        reach = 1.15 * robot.reach  # with hands
        widest = max(float(np.abs(body[:, 1]).max()), float(np.abs(shoulders[:, 1]).max()) + reach)
        self.operator_at = max(OPERATOR_AT, min(widest, 1.5) + 0.15 if widest > 1.2 * OPERATOR_AT else 0.0)
        self.marker = _MARKER_RADIUS * min(max(robot.reach / 0.3, 0.25), 1.0)
        # The robot's own space, the one that its arms can sweep, and the operator's.
        self._robot_top = max(float(body[:, 2].max()), float(shoulders[:, 2].max()) + reach)
        self._height = float(body[:, 2].max() - body[:, 2].min())
        low = float(body[:, 2].min())
        half_height = max(self._robot_top - low - 0.56 * self._tallest, 0.56 * self._tallest)
        right = widest
        left = widest if operator is None else self.operator_at + 0.6
        half_width = max(right + self._side, left - self._side)
        tangent = float(np.tan(np.radians(0.5 * fov)))
        deep = float(np.abs(body[:, 0]).max())
        needed = max(half_height / tangent, half_width / (tangent * aspect))
        needed = 1.05 * needed + min(deep, 0.5 * needed)
        nearest = 0.0 if operator is None else _NEAREST
        self.distance = max(nearest, needed) if distance is None else float(distance)

    @property
    def _tallest(self) -> float:
        # Shapes count where the stated stature, an estimate from link origins, is far below them.
        robot = self._height if self._height > 1.15 * self._robot.height else self._robot.height
        return max(robot, self._operator.height if self._operator is not None else 0.0)

    @property
    def _side(self) -> float:
        return 0.5 * self.operator_at if self._operator is not None else 0.0

    def center(self, floor: float) -> FloatArray:
        """What the camera looks at [m], above a floor at this height."""
        return np.array([0.0, self._side, floor + 0.56 * self._tallest])  # raised hands need room
