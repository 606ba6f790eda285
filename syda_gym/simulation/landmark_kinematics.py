"""Landmark kinematics: elbows and wrists of many robots at once, with everything constant folded away."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.arm_chain import ArmChain
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot

__all__ = ["LandmarkKinematics"]

_TINY = 1e-12


class LandmarkKinematics:
    """Forward kinematics of the landmarks for joint-major arrays.

    Each joint is turned so that its axis is z (a constant rotation before and after); then a joint costs two sines and
    one plane rotation of the points that ride on it, instead of a product of matrices. Points are carried from the
    hand towards the torso: ``p <- R_i (Rz(q_i) p') + t_i``. No operation depends on how many robots there are, so the
    result of one robot is the same, bit for bit, alone or among others.

    Args:
        robot: whose arms.
    """

    def __init__(self, robot: Robot) -> None:
        self.n_landmarks = 2 * len(robot.chains)
        self._parts = [
            part
            for arm, (chain, columns) in enumerate(zip(robot.chains, robot.arm_slices, strict=True))
            for part in _parts(chain, columns.start, arm)
        ]
        used = sorted({step[0] for _, steps, _ in self._parts for step in steps})
        self._used = np.array(used, dtype=np.intp)
        place = {joint: index for index, joint in enumerate(used)}
        self._parts = [
            (row, [(place[joint], *rest) for joint, *rest in steps], start) for row, steps, start in self._parts
        ]

    def __call__(self, q: FloatArray) -> FloatArray:
        """Coordinates of the landmarks.

        Args:
            q: joint angles ``(n, B)`` [rad], joint-major.

        Returns:
            ``(6 * arms, B)``: x, y, z [m] of each landmark in the torso frame, ordered as ``landmark_names``.
        """
        angles = q[self._used]
        cosines, sines = np.cos(angles), np.sin(angles)
        result = np.empty((3 * self.n_landmarks, q.shape[1]))
        for row, steps, start in self._parts:
            point: Any = start
            for joint, matrix, offset in steps:
                point = _place(matrix, offset, _spin(cosines[joint], sines[joint], point))
            for axis in range(3):
                result[3 * row + axis] = point[axis]
        return result


def _parts(chain: ArmChain, first: int, arm: int) -> list[tuple[int, list[Any], tuple[float, float, float]]]:
    """For elbow and wrist of one arm: landmark row, steps from the hand to the torso, start point."""
    to_z = [_rotation_to_z(axis) for axis in chain.axes]
    parts = []
    for point, row in ((1, 2 * arm), (2, 2 * arm + 1)):
        carrier = chain.point_joints[point]
        start = chain.point_offsets[point]
        steps = []
        for joint in range(carrier, -1, -1):
            # p_parent = t + F Q^T Rz Q p with Q turning the axis to z; Q p is folded into the step before.
            if joint == carrier:
                start = to_z[joint] @ start
            matrix = chain.rotations[joint] @ to_z[joint].T
            offset = chain.offsets[joint]
            if joint > 0:
                matrix, offset = to_z[joint - 1] @ matrix, to_z[joint - 1] @ offset
            steps.append((first + joint, _clean(matrix), _clean(offset)))
        parts.append((row, steps, _as_point(start)))
    return parts


def _as_point(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in _clean(values))
    return x, y, z


def _clean(values: FloatArray) -> FloatArray:
    """Rounds the noise of products of constants to exact zeros and ones, so that they can be folded."""
    nearest = np.round(values)
    return np.where(np.abs(values - nearest) < _TINY, nearest + 0.0, values)


def _rotation_to_z(axis: FloatArray) -> FloatArray:
    """A rotation that takes the unit vector ``axis`` to z."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return _clean(np.stack([x, np.cross(axis, x), axis]))


def _spin(c: NDArray[Any], s: NDArray[Any], point: Any) -> tuple[Any, Any, Any]:
    """Rz(q) p with exact zeros of ``p`` folded away."""
    x, y, z = point
    return _sum(_times(c, x), _times(s, y), -1), _sum(_times(s, x), _times(c, y), 1), z


def _place(matrix: FloatArray, offset: FloatArray, point: Any) -> tuple[Any, Any, Any]:
    """``matrix @ p + offset`` component by component."""
    x, y, z = (_row(matrix[i], float(offset[i]), point) for i in range(3))
    return x, y, z


def _row(weights: FloatArray, offset: float, point: Any) -> Any:
    total: Any = offset
    for weight, value in zip(weights.tolist(), point, strict=True):
        total = _sum(total, _times(value, weight), 1)
    return total


def _times(a: Any, b: Any) -> Any:
    for one, other in ((a, b), (b, a)):
        if isinstance(one, float):
            if one == 0.0:
                return 0.0
            if one == 1.0:
                return other
    return a * b


def _sum(a: Any, b: Any, sign: int) -> Any:
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return b if sign > 0 else -b
    return a + b if sign > 0 else a - b
