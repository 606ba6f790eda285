"""Arm coders: one code per arm, calibrated to the body, the right arm mirrored so that both arms share one model.

What generalises to unseen actions is the shape of an arm, not where a person stands or how tall they are: positions
relative to the shoulder in units of the arm's length, and unit limb directions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray, Side
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.limb_ik.arm import moving_joints
from syda_gym.embodiments.limb_ik.solver import LimbIK, LimbState
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError
from syda_gym.mappings.coding.coders import Arrays, Coder

__all__ = ["HUMAN_WIDTH", "HumanArmCoder", "RobotArmCoder", "arm_coder", "shared_arms"]

HUMAN_WIDTH = 12
"""Elbow and hand from the shoulder over the arm's length, unit upper arm, unit forearm."""

PLACED_WIDTH = 15
"""The same and before them the shoulder from its usual place, over the arm's length."""

_MIRROR = np.array([1.0, -1.0, 1.0])
_SHORTEST = 1e-6  # m
Vector = tuple[float, float, float]
_DOWN: Vector = (0.0, 0.0, -1.0)
_HANGING = (_DOWN, _DOWN)
"""Upper arm and forearm of an arm that nothing tells about."""


class HumanArmCoder(Coder):
    """A human's arm as 12 numbers, independent of where the person stands, of size and of heading.

    The heading is the direction of the shoulder line in each frame (the declared axes for a one-armed human), the size
    the mean length of the coded arms in each frame. Decoding uses the median limb lengths and shoulders of the fit.

    A *placed* code also says where the shoulder is, and measures in the median length of the fit: 15 numbers that tell
    more about a known person in a known place, and nothing about others.

    Args:
        body: a human.
        settings: ``sides`` that are coded, and whether the code is ``placed``.
        arrays: ``lengths`` (2,) upper arm and forearm [m], ``shoulder`` (3,) of a left arm [m] in body axes, ``rest``
            (arms, 3, 3) median points of all arms, for arms that are not coded.
    """

    kind = "human_arms"

    def __init__(self, body: Embodiment, settings: dict[str, Any], arrays: Arrays) -> None:
        super().__init__(body)
        if not isinstance(body, HumanSkeleton):
            raise MappingError(f"{body.name!r} is no human")
        self.human = body
        self.sides: tuple[Side, ...] = tuple(settings["sides"])
        self._arms = [body.sides.index(side) for side in self.sides]
        self._signs = np.array([_MIRROR if side == "right" else np.ones(3) for side in self.sides])
        self.placed = bool(settings["placed"])
        self.lengths = _shaped(arrays, "lengths", (2,))
        self.shoulder = _shaped(arrays, "shoulder", (3,))
        self.rest = _shaped(arrays, "rest", (len(body.sides), 3, 3))
        self._lateral: list[float] = self._signs[:, 1].tolist()
        self._size, self._middle = float(self.lengths.sum()), self.shoulder.tolist()
        self._turn = np.ascontiguousarray(body.axes.T)

    @classmethod
    def fit(cls, body: HumanSkeleton, frames: FloatArray, sides: Sequence[Side], placed: bool = False) -> HumanArmCoder:
        """Calibrates to frames ``(N, F)``.

        Raises:
            MappingError: limbs of zero length.
        """
        points = _facing_forward(body.arm_points(frames))
        coded = points[:, [body.sides.index(side) for side in sides]]
        lengths = np.median(np.linalg.norm(np.diff(coded, axis=2), axis=-1), axis=(0, 1))
        if lengths.min() < 1e-3:
            raise MappingError(f"limbs of {body.name!r} have median lengths {lengths.tolist()} m; check the landmarks")
        signs = np.array([_MIRROR if side == "right" else np.ones(3) for side in sides])
        # One shoulder for both arms keeps the mapping mirror-equivariant.
        shoulder = np.median(coded[:, :, 0] * signs, axis=0).mean(axis=0)
        arrays = {"lengths": lengths, "shoulder": shoulder, "rest": np.median(points, axis=0)}
        return cls(body, {"sides": list(sides), "placed": placed}, arrays)

    @property
    def width(self) -> int:
        """12, or 15 for a placed code."""
        return PLACED_WIDTH if self.placed else HUMAN_WIDTH

    def encode(self, frames: FloatArray) -> FloatArray:
        """Codes ``(N, arms, 12)``, or 15 numbers for a placed code."""
        if len(frames) == 1:
            return self.encode_one(frames[0])[None]
        points = _facing_forward(self.human.arm_points(frames))[:, self._arms] * self._signs[:, None]
        elbow = points[:, :, 1] - points[:, :, 0]
        hand = points[:, :, 2] - points[:, :, 0]
        fore = hand - elbow
        upper_length = np.sqrt(np.einsum("nad,nad->na", elbow, elbow))[..., None]
        fore_length = np.sqrt(np.einsum("nad,nad->na", fore, fore))[..., None]
        if self.placed:
            size = np.full((1, 1, 1), self.lengths.sum())
        else:
            size = np.maximum((upper_length + fore_length).mean(axis=1, keepdims=True), _SHORTEST)
        place = [(points[:, :, 0] - self.shoulder) / size] if self.placed else []
        return np.concatenate(
            [
                *place,
                elbow / size,
                hand / size,
                elbow / np.maximum(upper_length, _SHORTEST),
                fore / np.maximum(fore_length, _SHORTEST),
            ],
            axis=-1,
        )

    def encode_one(self, frame: FloatArray) -> FloatArray:
        """The same for one frame ``(F,)`` in plain floats, ``(arms, 12)``; live use encodes frame by frame."""
        points = (frame.reshape(-1, 3) @ self._turn).tolist()
        cos, sin = _heading(points) if len(points) == 6 else (1.0, 0.0)
        limbs, total = [], 0.0
        for arm, sign in zip(self._arms, self._lateral, strict=True):
            (sx, sy, sz), (ex, ey, ez), (hx, hy, hz) = points[3 * arm : 3 * arm + 3]
            x, y, uz = ex - sx, ey - sy, ez - sz
            ux, uy = cos * x - sin * y, (sin * x + cos * y) * sign
            x, y, fz = hx - ex, hy - ey, hz - ez
            fx, fy = cos * x - sin * y, (sin * x + cos * y) * sign
            upper, fore = math.sqrt(ux * ux + uy * uy + uz * uz), math.sqrt(fx * fx + fy * fy + fz * fz)
            total += upper + fore
            limbs.append((ux, uy, uz, fx, fy, fz, max(upper, _SHORTEST), max(fore, _SHORTEST)))
        size = self._size if self.placed else max(total / len(limbs), _SHORTEST)
        codes: list[float] = []
        for index, (ux, uy, uz, fx, fy, fz, upper, fore) in enumerate(limbs):
            if self.placed:
                x, y, z = points[3 * self._arms[index]]
                mx, my, mz = self._middle
                lateral = (sin * x + cos * y) * self._lateral[index]
                codes += ((cos * x - sin * y - mx) / size, (lateral - my) / size, (z - mz) / size)
            codes += (ux / size, uy / size, uz / size, (ux + fx) / size, (uy + fy) / size, (uz + fz) / size)
            codes += (ux / upper, uy / upper, uz / upper, fx / fore, fy / fore, fz / fore)
        return np.array(codes).reshape(len(limbs), -1)

    def decode(self, codes: FloatArray) -> FloatArray:
        """Frames ``(N, F)``: the mean of scaled positions and of limbs of fixed length along the directions."""
        length = self.lengths.sum()
        shoulder = self.shoulder + (codes[..., :3] * length if self.placed else np.zeros((*codes.shape[:2], 3)))
        shape = codes[..., -HUMAN_WIDTH:]
        elbow, hand = shape[..., 0:3] * length, shape[..., 3:6] * length
        if not self.placed:
            upper = self.lengths[0] * _unit(shape[..., 6:9])
            elbow = 0.5 * (elbow + upper)
            hand = 0.5 * (hand + upper + self.lengths[1] * _unit(shape[..., 9:12]))
        arms = shoulder[..., None, :] + np.stack([np.zeros_like(elbow), elbow, hand], axis=2)
        points = np.repeat(self.rest[None], len(codes), axis=0)
        points[:, self._arms] = arms * self._signs[:, None]
        return self.human.frames_from_points(points)

    def arrays(self) -> Arrays:
        """The calibration."""
        return {"lengths": self.lengths, "shoulder": self.shoulder, "rest": self.rest}

    def settings(self) -> dict[str, Any]:
        """The coded sides and whether the code is placed."""
        return {"sides": list(self.sides), "placed": self.placed}


class RobotArmCoder(Coder):
    """A robot's arm as its two unit limb directions, then the angles of joints that move neither elbow nor wrist.

    Directions are decoded by ``LimbIK`` within the joint limits: ``decode`` takes each frame for itself, ``follow``
    takes them in time order. A wrist yaw passes as it is.

    Args:
        body: a robot.
        settings: ``sides`` that are coded.
        arrays: ``rest`` (n,) [rad], the angles of arms that are not coded.

    Attributes:
        extra_columns: columns of the joints that move neither elbow nor wrist, ``(arms, extras)``.
        extra_signs: their signs in a mirrored arm, ``(arms, extras)``.
    """

    kind = "robot_arms"

    def __init__(self, body: Embodiment, settings: dict[str, Any], arrays: Arrays) -> None:
        super().__init__(body)
        if not isinstance(body, Robot):
            raise MappingError(f"{body.name!r} is no robot")
        self.robot = body
        self.sides: tuple[Side, ...] = tuple(settings["sides"])
        self._arms = [body.sides.index(side) for side in self.sides]
        self._signs = np.array([_MIRROR if side == "right" else np.ones(3) for side in self.sides])
        self.rest = _shaped(arrays, "rest", (body.n_features,))
        self._lateral: list[float] = self._signs[:, 1].tolist()
        self._ik = LimbIK.of(body)
        self.extra_columns, self.extra_signs = self._extras()
        idle = np.ones(body.n_features, dtype=bool)
        for arm in self._arms:
            idle[body.arm_slices[arm]] = False
        self._resting = [(int(column), float(self.rest[column])) for column in np.flatnonzero(idle)]
        self._extra_places = [
            (arm, 6 + index, int(column), float(self.extra_signs[arm, index]))
            for (arm, index), column in np.ndenumerate(self.extra_columns)
        ]

    @classmethod
    def fit(cls, body: Robot, frames: FloatArray, sides: Sequence[Side]) -> RobotArmCoder:
        """Takes the median frame as the pose of arms that are not coded."""
        return cls(body, {"sides": list(sides)}, {"rest": body.clamp(np.median(frames, axis=0))[0]})

    @property
    def extras(self) -> int:
        """Joints per arm that move neither elbow nor wrist."""
        return int(self.extra_columns.shape[1])

    @property
    def width(self) -> int:
        """Six numbers for the directions and one per extra joint."""
        return 6 + self.extras

    def encode(self, frames: FloatArray) -> FloatArray:
        """Codes ``(N, arms, 6 + extras)``."""
        points = self.robot.arm_points(frames)[:, self._arms] * self._signs[:, None]
        limbs = _unit(np.diff(points, axis=2)).reshape(len(points), len(self._arms), 6)
        return np.concatenate([limbs, frames[:, self.extra_columns] * self.extra_signs], axis=-1)

    def decode(self, codes: FloatArray) -> FloatArray:
        """Joint angles ``(N, n)`` within the limits, each frame for itself."""
        if len(codes) == 1:
            return self.decode_one(codes[0].tolist())[None]
        return self._completed(self._ik.solve(self._wanted(codes)), codes)

    def decode_one(self, codes: list[list[float]]) -> FloatArray:
        """The same for one frame ``(n,)`` from finite codes ``(arms, 6 + extras)``; live use decodes frame by frame."""
        return self._completed_one(self._ik.solve(np.array([self._wanted_one(codes)]))[0].tolist(), codes)

    def begin(self) -> Any:
        """The state of the limb solver before a clip, a ``LimbState``."""
        return self._ik.begin()

    def follow(self, codes: FloatArray, memory: Any, dt: float | None, limited: bool) -> tuple[FloatArray, Any]:
        """Joint angles ``(N, n)`` within the limits of frames in time order, see ``LimbIK.follow``."""
        if len(codes) == 1:
            frame, memory = self.follow_one(codes[0].tolist(), memory, dt, limited)
            return frame[None], memory
        frames, memory = self._ik.follow(self._wanted(codes)[None], memory, dt, limited=limited)
        return self._completed(frames[0], codes), memory

    def follow_one(
        self, codes: list[list[float]], memory: LimbState, dt: float | None, limited: bool
    ) -> tuple[FloatArray, LimbState]:
        """The same for one frame ``(n,)`` from finite codes ``(arms, 6 + extras)``."""
        frames, memory = self._ik.follow(np.array([[self._wanted_one(codes)]]), memory, dt, limited=limited)
        return self._completed_one(frames[0, 0].tolist(), codes), memory

    def _wanted(self, codes: FloatArray) -> FloatArray:
        """Limb directions ``(N, arms, 2, 3)`` of all arms in the torso frame."""
        limbs = codes[..., :6].reshape(*codes.shape[:2], 2, 3)
        # A vanishing direction (a model that knows nothing) becomes a hanging arm rather than a division by zero.
        limbs = np.where(np.sum(limbs**2, axis=-1, keepdims=True) < _SHORTEST**2, _DOWN, limbs)
        wanted = np.zeros((len(codes), len(self.robot.sides), 2, 3))
        wanted[:, :, :, 2] = -1.0
        wanted[:, self._arms] = limbs * self._signs[:, None]
        return wanted

    def _completed(self, frames: FloatArray, codes: FloatArray) -> FloatArray:
        """Solved frames with the arms that are not coded at rest, and the joints that the code holds as they are."""
        for column, angle in self._resting:
            frames[:, column] = angle
        frames[:, self.extra_columns] = codes[..., 6:] * self.extra_signs
        return self.robot.clamp(frames)

    def _wanted_one(self, codes: list[list[float]]) -> list[tuple[Vector, Vector]]:
        """``_wanted`` for one frame in plain floats."""
        wanted: list[tuple[Vector, Vector]] = [_HANGING] * len(self.robot.sides)
        for arm, sign, (ux, uy, uz, fx, fy, fz, *_) in zip(self._arms, self._lateral, codes, strict=True):
            upper = (ux, uy * sign, uz) if ux * ux + uy * uy + uz * uz >= _SHORTEST**2 else _DOWN
            fore = (fx, fy * sign, fz) if fx * fx + fy * fy + fz * fz >= _SHORTEST**2 else _DOWN
            wanted[arm] = (upper, fore)
        return wanted

    def _completed_one(self, frame: list[float], codes: list[list[float]]) -> FloatArray:
        """``_completed`` for one frame in plain floats."""
        for column, angle in self._resting:
            frame[column] = angle
        for arm, index, column, sign in self._extra_places:
            frame[column] = codes[arm][index] * sign
        return np.array(self.robot.clamp_one(frame))

    def arrays(self) -> Arrays:
        """The pose of arms that are not coded."""
        return {"rest": self.rest}

    def settings(self) -> dict[str, Any]:
        """The coded sides."""
        return {"sides": list(self.sides)}

    def _extras(self) -> tuple[np.ndarray[Any, np.dtype[np.intp]], FloatArray]:
        """Columns of the joints beyond those of the inverse kinematics, per coded arm, and their mirror signs."""
        per_arm = [
            [
                self.robot.arm_slices[arm].start + joint
                for joint in range(self.robot.chains[arm].n_joints)
                if joint not in moving_joints(self.robot.chains[arm])
            ]
            for arm in self._arms
        ]
        if len({len(columns) for columns in per_arm}) != 1:
            per_arm = [[] for _ in per_arm]  # arms that differ cannot share these joints; they stay at rest
        columns = np.array(per_arm, dtype=np.intp).reshape(len(self._arms), -1)
        signs = np.ones(columns.shape)
        if columns.size and len(self.robot.sides) == 2:
            images = self.robot.mirror(np.ones((1, self.robot.n_features)))[0]
            for row, side in enumerate(self.sides):
                if side == "right":
                    signs[row] = images[columns[row]]
        return columns, signs


def arm_coder(
    body: Embodiment, frames: FloatArray, sides: Sequence[Side], placed: bool = False
) -> HumanArmCoder | RobotArmCoder:
    """Fits the arm coder of a body to frames ``(N, F)``; ``placed`` concerns humans."""
    if isinstance(body, HumanSkeleton):
        return HumanArmCoder.fit(body, frames, sides, placed)
    if isinstance(body, Robot):
        return RobotArmCoder.fit(body, frames, sides)
    raise MappingError(f"{body!r} is neither a human nor a robot; arm codes need one of them")


def shared_arms(source: Embodiment, target: Embodiment) -> tuple[tuple[Side, ...], tuple[Side, ...]]:
    """Which arm of the source drives which arm of the target.

    Arms of the same side drive each other. Where there is none, one arm drives the other body's single arm as its
    mirror image.
    """
    common = tuple(side for side in source.sides if side in target.sides)
    return (common, common) if common else (source.sides[:1], target.sides[:1])


def _facing_forward(points: FloatArray) -> FloatArray:
    """Turns points ``(N, arms, 3, 3)`` about the vertical so that the shoulder line points left."""
    if points.shape[1] != 2:
        return points
    line = points[:, 0, 0] - points[:, 1, 0]
    flat = np.hypot(line[:, 0], line[:, 1])
    usable = flat > 0.02  # m; shoulders above each other tell no heading
    cos = np.where(usable, line[:, 1] / np.where(usable, flat, 1.0), 1.0)[:, None, None]
    sin = np.where(usable, line[:, 0] / np.where(usable, flat, 1.0), 0.0)[:, None, None]
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1)


def _heading(points: list[list[float]]) -> tuple[float, float]:
    """Cosine and sine of the turn that ``_facing_forward`` makes, for the six points of one frame."""
    x, y = points[0][0] - points[3][0], points[0][1] - points[3][1]
    flat = math.hypot(x, y)
    return (y / flat, x / flat) if flat > 0.02 else (1.0, 0.0)


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    return unit


def _shaped(arrays: Arrays, name: str, shape: tuple[int, ...]) -> FloatArray:
    value = np.asarray(arrays[name], dtype=np.float64)
    if value.shape != shape:
        raise MappingError(f"{name!r} must have shape {shape}, got {value.shape}")
    return value
