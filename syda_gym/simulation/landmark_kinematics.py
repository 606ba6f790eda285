"""Landmark kinematics: elbows and wrists of many robots at once, with everything constant folded away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.robot import Robot

__all__ = ["LandmarkKinematics"]

_TINY = 1e-12
_ELBOW, _WRIST = 1, 2
Column = Any  # a float, or an array that broadcasts to (points, arms, B)


@dataclass(frozen=True)
class _Step:
    """One joint on the way from the hand to the torso: p <- matrix (Rz(q) p) + offset."""

    joint: int
    matrix: list[list[Column]]
    offset: list[Column]


class LandmarkKinematics:
    """Forward kinematics of the landmarks for joint-major arrays.

    Each joint is turned so that its axis is z (a constant rotation before and after); then a joint costs two sines and
    one plane rotation of the points that ride on it, instead of a product of matrices. Points are carried from the
    hand towards the torso, both arms at once where they are built alike, wrist and elbow together from where they meet.
    Constants that are 0 or 1 cost nothing. No operation mixes robots, so that one robot gets the same bits alone and
    among others.

    Args:
        robot: whose arms.
    """

    def __init__(self, robot: Robot) -> None:
        self.n_landmarks = 2 * len(robot.chains)
        alike = len({(chain.n_joints, chain.point_joints[:3]) for chain in robot.chains}) == 1
        arms = list(range(len(robot.chains)))
        groups = [arms] if alike else [[arm] for arm in arms]
        self._groups = [_Group(robot, group) for group in groups]

    def __call__(self, q: FloatArray) -> FloatArray:
        """Coordinates of the landmarks.

        Args:
            q: joint angles ``(n, B)`` [rad], joint-major.

        Returns:
            ``(6 * arms, B)``: x, y, z [m] of each landmark in the torso frame, ordered as ``landmark_names``.
        """
        result = np.empty((self.n_landmarks // 2, 2, 3, q.shape[1]))
        for group in self._groups:
            group.fill(q, result)
        return result.reshape(3 * self.n_landmarks, q.shape[1])


class _Group:
    """Arms that are built alike."""

    def __init__(self, robot: Robot, arms: list[int]) -> None:
        chains = [robot.chains[arm] for arm in arms]
        self._arms = arms
        self._carriers = [chains[0].point_joints[_ELBOW], chains[0].point_joints[_WRIST]]
        count = max(self._carriers) + 1
        self._columns = np.array(
            [[robot.arm_slices[arm].start + joint for arm in arms] for joint in range(count)], dtype=np.intp
        )
        self._steps = [_step(chains, joint) for joint in range(count)]
        self._starts = [_start(chains, point) for point in (_ELBOW, _WRIST)]

    def fill(self, q: FloatArray, result: FloatArray) -> None:
        """Writes the landmarks of these arms into ``(arms, 2, 3, B)``."""
        angles = q[self._columns]
        cosines, sines = np.cos(angles), np.sin(angles)
        elbow, wrist = self._carriers
        meet = min(elbow, wrist)
        tips = []
        for start, carrier in zip(self._starts, self._carriers, strict=True):
            point = start
            for joint in range(carrier, meet, -1):
                point = self._carry(joint, cosines, sines, point)
            tips.append(point)
        shape = (len(self._arms), q.shape[1])
        both = [np.stack([np.broadcast_to(tip[axis], shape) for tip in tips]) for axis in range(3)]
        for joint in range(meet, -1, -1):
            both = self._carry(joint, cosines, sines, both)
        for axis in range(3):
            result[self._arms, :, axis] = np.swapaxes(np.broadcast_to(both[axis], (2, *shape)), 0, 1)

    def _carry(self, joint: int, cosines: FloatArray, sines: FloatArray, point: list[Column]) -> list[Column]:
        step = self._steps[joint]
        c, s = cosines[joint], sines[joint]
        x, y, z = point
        turned = [_sum(_times(c, x), _times(s, y), -1), _sum(_times(s, x), _times(c, y), 1), z]
        return [_row(weights, offset, turned) for weights, offset in zip(step.matrix, step.offset, strict=True)]


def _step(chains: list[ArmChain], joint: int) -> _Step:
    # p_parent = t + F Q^T Rz Q p with Q turning the axis to z; Q p is folded into the step of the joint before.
    matrices, offsets = [], []
    for chain in chains:
        matrix, offset = chain.rotations[joint] @ _rotation_to_z(chain.axes[joint]).T, chain.offsets[joint]
        if joint > 0:
            before = _rotation_to_z(chain.axes[joint - 1])
            matrix, offset = before @ matrix, before @ offset
        matrices.append(_clean(matrix))
        offsets.append(_clean(offset))
    stacked, moved = np.array(matrices), np.array(offsets)
    return _Step(
        joint,
        [[_constant(stacked[:, row, column]) for column in range(3)] for row in range(3)],
        [_constant(moved[:, axis]) for axis in range(3)],
    )


def _start(chains: list[ArmChain], point: int) -> list[Column]:
    places = np.array(
        [_clean(_rotation_to_z(chain.axes[chain.point_joints[point]]) @ chain.point_offsets[point]) for chain in chains]
    )
    return [_constant(places[:, axis]) for axis in range(3)]


def _constant(values: FloatArray) -> Column:
    """One number if all arms share it, otherwise a column ``(arms, 1)``."""
    return float(values[0]) if (values == values[0]).all() else values[:, None].copy()


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


def _row(weights: list[Column], offset: Column, point: list[Column]) -> Column:
    total = offset
    for weight, value in zip(weights, point, strict=True):
        if isinstance(weight, float) and weight == -1.0:
            total = _sum(total, value, -1)
        else:
            total = _sum(total, _times(value, weight), 1)
    return total


def _times(a: Column, b: Column) -> Column:
    for one, other in ((a, b), (b, a)):
        if isinstance(one, float):
            if one == 0.0:
                return 0.0
            if one == 1.0:
                return other
    return a * b


def _sum(a: Column, b: Column, sign: int) -> Column:
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return b if sign > 0 else -b
    return a + b if sign > 0 else a - b
