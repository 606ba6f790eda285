"""HumanSkeleton: a human known by the positions that a depth camera or a motion file gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import SIDES, Embodiment, Feature, FloatArray, Side
from syda_gym.errors import EmbodimentError

__all__ = ["BONES", "KINECT_AXES", "SKELETON_JOINTS", "HumanSkeleton"]

SKELETON_JOINTS = (
    "Head", "Neck", "Torso",
    "LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand",
    "LHip", "LKnee", "LFoot", "RHip", "RKnee", "RFoot",
)  # fmt: skip
"""The 15 OpenNI / Kinect v1 joints of the paper's recordings."""

BONES = (
    ("Head", "Neck"), ("Neck", "Torso"),
    ("Neck", "LShoulder"), ("LShoulder", "LElbow"), ("LElbow", "LHand"),
    ("Neck", "RShoulder"), ("RShoulder", "RElbow"), ("RElbow", "RHand"),
    ("Torso", "LHip"), ("LHip", "LKnee"), ("LKnee", "LFoot"),
    ("Torso", "RHip"), ("RHip", "RKnee"), ("RKnee", "RFoot"),
)  # fmt: skip
"""Joint pairs to draw as lines."""

KINECT_AXES: FloatArray = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Body axes from recording axes: x = subject's right, y up, z backward becomes x forward, y left, z up."""

# Rest of the body as fractions of stature, from the shoulders' midpoint, body axes (x, y, z).
# Proportions after Drillis and Contini as printed in Winter, Biomechanics and Motor Control of Human Movement.
_REST_OF_BODY: dict[str, tuple[float, float, float]] = {
    "Head": (0.0, 0.0, 0.118),
    "Neck": (0.0, 0.0, 0.012),
    "Torso": (0.0, 0.0, -0.16),
    "LHip": (0.0, 0.052, -0.288),
    "LKnee": (0.0, 0.052, -0.533),
    "LFoot": (0.0, 0.052, -0.779),
    "RHip": (0.0, -0.052, -0.288),
    "RKnee": (0.0, -0.052, -0.533),
    "RFoot": (0.0, -0.052, -0.779),
}


class HumanSkeleton(Embodiment):
    """A human whose frames are the positions of shoulders, elbows and hands.

    Frames hold x, y, z [m] of ``LShoulder, LElbow, LHand, RShoulder, RElbow, RHand`` (the paper's 18 features; a
    one-armed human has 9) in the recording's own origin and axes.

    Args:
        name: name in the catalog.
        height: stature [m].
        upper_arm: shoulder to elbow [m], median over recorded frames.
        forearm: elbow to hand [m], median over recorded frames.
        shoulders: distance between the shoulders [m].
        origin: which joint the recording's origin sits on, ``"head"`` or ``"torso"`` (documentation and pictures).
        axes: rotation ``(3, 3)`` that takes recording axes to body axes.
        sides: the arms that are tracked.
        joint_limits: ranges [rad] of the four arm angles t1..t4 of the human arm model of the transferability
            metric; ``None`` for an adult's full range.

    Raises:
        EmbodimentError: a length is not positive, the axes are no rotation, or the origin is unknown.
    """

    def __init__(
        self,
        name: str,
        *,
        height: float,
        upper_arm: float,
        forearm: float,
        shoulders: float,
        origin: Literal["head", "torso"] = "torso",
        axes: ArrayLike = KINECT_AXES,
        sides: Sequence[Side] = SIDES,
        joint_limits: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        lengths = {"height": height, "upper_arm": upper_arm, "forearm": forearm, "shoulders": shoulders}
        for label, value in lengths.items():
            if not (np.isfinite(value) and value > 0):
                raise EmbodimentError(f"human {name!r}: {label} must be a positive length in metres, got {value}")
        if max(height, 1.0) > 3.0:
            raise EmbodimentError(f"human {name!r}: height {height} m; give metres, not centimetres")
        if origin not in ("head", "torso"):
            raise EmbodimentError(f"human {name!r}: origin must be 'head' or 'torso', got {origin!r}")
        rotation = np.asarray(axes, dtype=np.float64)
        if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6):
            raise EmbodimentError(f"human {name!r}: axes must be a 3x3 rotation, got {rotation.tolist()}")
        if not sides or tuple(side for side in SIDES if side in sides) != tuple(sides):
            raise EmbodimentError(f"human {name!r}: sides must be ('left', 'right') or one of them, got {sides}")
        self.name = name
        self.height = float(height)
        self.upper_arm = float(upper_arm)
        self.forearm = float(forearm)
        self.shoulders = float(shoulders)
        self.origin = origin
        self.axes = rotation
        self.sides = tuple(sides)
        self.joint_limits = dict(joint_limits) if joint_limits else None
        self.feature_joints = tuple(
            f"{side[0].upper()}{part}" for side in self.sides for part in ("Shoulder", "Elbow", "Hand")
        )
        self.features = tuple(Feature(f"{joint}.{axis}", "m") for joint in self.feature_joints for axis in "xyz")

    @property
    def kind(self) -> Literal["human", "robot"]:
        """``"human"``."""
        return "human"

    @property
    def arm_lengths(self) -> FloatArray:
        """Nominal upper-arm and forearm lengths [m], ``(arms, 2)``."""
        return np.tile([self.upper_arm, self.forearm], (len(self.sides), 1))

    def arm_points(self, frames: ArrayLike) -> FloatArray:
        """Shoulder, elbow and wrist of each arm, ``(N, arms, 3, 3)`` [m], body axes, the recording's origin."""
        positions = self.check(frames).reshape(-1, len(self.sides), 3, 3)
        return positions @ self.axes.T

    def frames_from_points(self, points: ArrayLike) -> FloatArray:
        """Inverse of ``arm_points``: frames ``(N, F)`` from points ``(N, arms, 3, 3)`` in body axes [m]."""
        array = np.asarray(points, dtype=np.float64)
        if array.ndim != 4 or array.shape[1:] != (len(self.sides), 3, 3):
            raise EmbodimentError(f"points of {self.name!r}: expected (N, {len(self.sides)}, 3, 3), got {array.shape}")
        return (array @ self.axes).reshape(len(array), -1)

    def mirror(self, frames: ArrayLike) -> FloatArray:
        """Swaps left and right and reflects across the sagittal plane through the recording's origin."""
        points = self.arm_points(frames)
        if len(self.sides) == 2:
            points = points[:, ::-1]
        return self.frames_from_points(points * np.array([1.0, -1.0, 1.0]))

    def complete(self, frames: ArrayLike) -> dict[str, FloatArray]:
        """All 15 joints for a picture: the tracked ones as they are, the others standing upright below them.

        Args:
            frames: ``(N, F)``.

        Returns:
            Joint name to ``(N, 3)`` positions [m] in body axes.
        """
        points = self.arm_points(frames)
        if len(self.sides) == 2:
            middle = points[:, :, 0].mean(axis=1)
        else:
            outward = 0.5 * self.shoulders * (1.0 if self.sides[0] == "left" else -1.0)
            middle = points[:, 0, 0] - np.array([0.0, outward, 0.0])
        joints = {joint: middle + self.height * np.array(offset) for joint, offset in _REST_OF_BODY.items()}
        for index, side in enumerate(self.sides):
            for point, part in enumerate(("Shoulder", "Elbow", "Hand")):
                joints[f"{side[0].upper()}{part}"] = points[:, index, point]
        return joints

    def standing(self) -> FloatArray:
        """One frame ``(F,)``: standing upright with the arms hanging down, origin as recorded."""
        below = {"head": -0.118, "torso": 0.16}[self.origin] * self.height
        points = np.zeros((1, len(self.sides), 3, 3))
        for index, side in enumerate(self.sides):
            outward = 0.5 * self.shoulders * (1.0 if side == "left" else -1.0)
            drops = np.array([0.0, self.upper_arm, self.upper_arm + self.forearm])
            points[0, index] = np.column_stack([np.zeros(3), np.full(3, outward), below - drops])
        frame: FloatArray = self.frames_from_points(points)[0]
        return frame

    def spec(self) -> dict[str, Any]:
        """A JSON-able description of this human."""
        return {
            "kind": "human",
            "name": self.name,
            "height": self.height,
            "upper_arm": self.upper_arm,
            "forearm": self.forearm,
            "shoulders": self.shoulders,
            "origin": self.origin,
            "axes": self.axes.tolist(),
            "sides": list(self.sides),
            "joint_limits": {k: list(v) for k, v in self.joint_limits.items()} if self.joint_limits else None,
        }
