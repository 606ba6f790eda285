"""ArmChain: the kinematics of one serial arm for many configurations at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray, Side

__all__ = ["ArmChain"]


@dataclass(frozen=True, eq=False)
class ArmChain:
    """A serial chain of revolute joints from the torso to the tip of an arm.

    Joint ``i`` is placed at translation ``offsets[i]`` and rotation ``rotations[i]`` in the frame of joint ``i - 1``
    (the torso for ``i = 0``) and turns about the unit axis ``axes[i]`` in its own frame. Points ride on a joint:
    point ``p`` sits at ``point_offsets[p]`` in the frame of joint ``point_joints[p]``.

    Attributes:
        side: which arm.
        joints: joint names in order from the torso, ``n``.
        rotations: ``(n, 3, 3)``.
        offsets: ``(n, 3)`` [m].
        axes: ``(n, 3)``.
        lower: lower joint limits ``(n,)`` [rad].
        upper: upper joint limits ``(n,)`` [rad].
        point_joints: index of the joint that carries shoulder, elbow, wrist and tip; -1 for the torso. Other points may
            ride on a copy made with ``dataclasses.replace``, for example the ends of collision capsules.
        point_offsets: ``(P, 3)`` [m], one per entry of ``point_joints``.
    """

    side: Side
    joints: tuple[str, ...]
    rotations: FloatArray
    offsets: FloatArray
    axes: FloatArray
    lower: FloatArray
    upper: FloatArray
    point_joints: tuple[int, ...]
    point_offsets: FloatArray

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joints)

    def points(self, angles: ArrayLike) -> FloatArray:
        """Shoulder, elbow, wrist and tip (or whatever points ride on this chain).

        Args:
            angles: ``(N, n)`` [rad].

        Returns:
            ``(N, P, 3)`` [m] in the torso frame, ``P`` = 4.
        """
        return self._sweep(np.asarray(angles, dtype=np.float64), with_axes=False)[0]

    def jacobians(self, angles: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Positions of the points and their derivatives with respect to every joint.

        Args:
            angles: ``(N, n)`` [rad].

        Returns:
            Points ``(N, P, 3)`` [m] and Jacobians ``(N, P, 3, n)`` [m/rad].
        """
        q = np.asarray(angles, dtype=np.float64)
        points, origins, directions = self._sweep(q, with_axes=True)
        jacobian = np.cross(directions[:, None], points[:, :, None] - origins[:, None])
        for point, carrier in enumerate(self.point_joints):
            jacobian[:, point, carrier + 1 :] = 0.0
        return points, np.swapaxes(jacobian, 2, 3)

    def _sweep(self, q: FloatArray, with_axes: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Walks the chain once; returns points (N,4,3), joint origins (N,n,3) and world axes (N,n,3)."""
        count = len(q)
        # Component-major (3, 3, N): each scalar operation runs over a contiguous row of samples.
        rotation = np.repeat(np.eye(3)[:, :, None], count, axis=2)
        position = np.zeros((3, count))
        points = np.zeros((len(self.point_joints), 3, count))
        origins = np.zeros((self.n_joints, 3, count))
        directions = np.zeros((self.n_joints, 3, count))
        self._place_points(-1, rotation, position, points)
        for i in range(self.n_joints):
            position = position + _turn(rotation, self.offsets[i])
            fixed = _multiply_constant(rotation, self.rotations[i])
            if with_axes:
                origins[i] = position
                directions[i] = _turn(fixed, self.axes[i])
            rotation = _rotate(fixed, self.axes[i], q[:, i])
            self._place_points(i, rotation, position, points)
        return (
            np.ascontiguousarray(points.transpose(2, 0, 1)),
            np.ascontiguousarray(origins.transpose(2, 0, 1)),
            np.ascontiguousarray(directions.transpose(2, 0, 1)),
        )

    def _place_points(self, joint: int, rotation: FloatArray, position: FloatArray, points: FloatArray) -> None:
        for index, carrier in enumerate(self.point_joints):
            if carrier == joint:
                points[index] = position + _turn(rotation, self.point_offsets[index])


def _turn(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    """Rotates one constant vector by every rotation: (3, 3, N) x (3,) -> (3, N)."""
    turned: FloatArray = rotation[:, 0] * vector[0] + rotation[:, 1] * vector[1] + rotation[:, 2] * vector[2]
    return turned


def _multiply_constant(rotation: FloatArray, constant: FloatArray) -> FloatArray:
    """Multiplies every rotation by one constant matrix from the right."""
    if np.array_equal(constant, np.eye(3)):
        return rotation
    return np.stack([_turn(rotation, constant[:, column]) for column in range(3)], axis=1)


def _rotate(rotation: FloatArray, axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Multiplies every rotation by its own turn about a common axis (Rodrigues' formula)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis
    rest = 1.0 - c
    columns = (
        (c + x * x * rest, y * x * rest + z * s, z * x * rest - y * s),
        (x * y * rest - z * s, c + y * y * rest, z * y * rest + x * s),
        (x * z * rest + y * s, y * z * rest - x * s, c + z * z * rest),
    )
    return np.stack([rotation[:, 0] * a + rotation[:, 1] * b + rotation[:, 2] * d for a, b, d in columns], axis=1)
