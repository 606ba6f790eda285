"""Frustum: what a camera sees, and the part of the picture that some points lie in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["Frustum", "PictureWindow"]

_NEAR, _FAR = 0.1, 30.0


@dataclass(frozen=True)
class PictureWindow:
    """A rectangle of whole pixels; rows count from the top."""

    left: int
    top: int
    width: int
    height: int

    @property
    def pixels(self) -> tuple[slice, slice]:
        """Rows and columns, to index a picture with."""
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)


class Frustum:
    """A perspective camera.

    Args:
        eye: where it stands ``(3,)`` [m].
        target: what it looks at ``(3,)`` [m].
        fov: vertical field of view [degrees].
        width: of the picture [pixels].
        height: of the picture [pixels].

    Attributes:
        view: OpenGL's view matrix, 16 numbers, column by column.
        whole: the whole picture.
    """

    def __init__(self, eye: FloatArray, target: FloatArray, fov: float, width: int, height: int) -> None:
        import pybullet

        self._bullet: Any = pybullet
        self.view: list[float] = pybullet.computeViewMatrix(eye.tolist(), target.tolist(), (0.0, 0.0, 1.0))
        self._camera = np.array(self.view).reshape(4, 4).T
        self.whole = PictureWindow(0, 0, width, height)
        self._focal = 0.5 * height / float(np.tan(0.5 * np.radians(fov)))  # pixels

    def projection(self, window: PictureWindow) -> list[float]:
        """OpenGL's projection matrix of a part of the picture, 16 numbers; its pixels are those of the whole."""
        scale, whole = _NEAR / self._focal, self.whole
        left, top = window.left - 0.5 * whole.width, 0.5 * whole.height - window.top
        edges = (left, left + window.width, top - window.height, top)
        matrix: list[float] = self._bullet.computeProjectionMatrix(*(scale * edge for edge in edges), _NEAR, _FAR)
        return matrix

    def around(self, points: FloatArray, radius: float) -> PictureWindow:
        """The smallest window that holds balls about points.

        Args:
            points: ``(N, 3)`` [m].
            radius: of the balls [m].

        Returns:
            The window; the whole picture where a ball reaches behind the camera or none is in the picture.
        """
        seen = points @ self._camera[:3, :3].T + self._camera[:3, 3]
        depth = -seen[:, 2]
        if depth.min() <= radius + _NEAR:
            return self.whole
        # The silhouette of a ball lies a little outside the circle that its radius spans at its centre's depth.
        reach = radius / (depth - radius)
        columns = 0.5 * self.whole.width + self._focal * seen[:, 0] / depth
        rows = 0.5 * self.whole.height - self._focal * seen[:, 1] / depth
        reach = self._focal * reach
        left, right = int((columns - reach).min()), int(np.ceil((columns + reach).max()))
        top, bottom = int((rows - reach).min()), int(np.ceil((rows + reach).max()))
        left, right = max(left, 0), min(right, self.whole.width)
        top, bottom = max(top, 0), min(bottom, self.whole.height)
        if left >= right or top >= bottom:
            return self.whole
        return PictureWindow(left, top, right - left, bottom - top)
