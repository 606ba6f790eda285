"""Parametric humans: a body from stature and proportions, for studies over many operators."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import SIDES, FloatArray, Side
from syda_gym.embodiments.human import KINECT_AXES, HumanSkeleton
from syda_gym.errors import EmbodimentError

__all__ = ["ARM_ANGLES", "FULL_RANGE", "PARAMETRIC_HUMANS", "parametric_human"]

ARM_ANGLES = ("t1", "t2", "t3", "t4")
"""Angles of the human arm model, right arm, x right, y forward, z up:
wrist = Rx(t1) Ry(t2) Rz(t3) [(0, 0, -l1) + Rx(t4) (0, l2, 0)]."""

FULL_RANGE: dict[str, tuple[float, float]] = {
    name: (float(np.deg2rad(low)), float(np.deg2rad(high)))
    for name, low, high in (("t1", -60, 170), ("t2", -170, 10), ("t3", -60, 90), ("t4", -90, 60))
}
"""Range of a healthy adult's arm angles [rad], as the transferability metric of the paper samples them."""

_COMFORT = {name: float(np.deg2rad(angle)) for name, angle in (("t1", 30), ("t2", -20), ("t3", 0), ("t4", -40))}

# Lengths as fractions of stature: the adult of the paper's recordings, whose hand point is the palm.
_ARM, _UPPER_SHARE, _SHOULDERS = 0.332, 0.506, 0.173

_ROS_AXES = np.eye(3)
_CAMERA_AXES: FloatArray = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # x left, y up, z forward


def parametric_human(
    name: str,
    *,
    stature: float = 1.75,
    arm_proportion: float = 1.0,
    upper_share: float = _UPPER_SHARE,
    shoulder_proportion: float = 1.0,
    mobility: float = 1.0,
    sides: Sequence[Side] = SIDES,
    origin: Literal["head", "torso"] = "torso",
    axes: ArrayLike = KINECT_AXES,
) -> HumanSkeleton:
    """Builds a human from stature and proportions.

    Args:
        name: name of the body.
        stature: height [m].
        arm_proportion: arm length relative to what is usual for the stature.
        upper_share: share of the upper arm in the arm's length.
        shoulder_proportion: shoulder width relative to what is usual for the stature.
        mobility: share of the healthy range of every arm angle, shrunk about a comfortable pose; 1 is unlimited.
        sides: the arms that are tracked.
        origin: the joint on which the recording's origin sits.
        axes: rotation ``(3, 3)`` from recording axes to body axes (x forward, y left, z up).

    Returns:
        A human; give it to ``catalog.register`` to use its name everywhere.

    Raises:
        EmbodimentError: a proportion outside its range.
    """
    for label, value, low, high in (
        ("stature", stature, 0.4, 2.6),
        ("arm_proportion", arm_proportion, 0.3, 2.0),
        ("upper_share", upper_share, 0.2, 0.8),
        ("shoulder_proportion", shoulder_proportion, 0.3, 2.0),
        ("mobility", mobility, 0.2, 1.0),
    ):
        if not low <= value <= high:
            raise EmbodimentError(f"human {name!r}: {label} must be between {low} and {high}, got {value}")
    arm = _ARM * stature * arm_proportion
    limits = None
    if mobility < 1.0:
        limits = {
            angle: tuple(_COMFORT[angle] + mobility * (end - _COMFORT[angle]) for end in FULL_RANGE[angle])
            for angle in ARM_ANGLES
        }
    return HumanSkeleton(
        name,
        height=stature,
        upper_arm=arm * upper_share,
        forearm=arm * (1.0 - upper_share),
        shoulders=_SHOULDERS * stature * shoulder_proportion,
        origin=origin,
        axes=axes,
        sides=sides,
        joint_limits={key: (low, high) for key, (low, high) in limits.items()} if limits else None,
    )


def _tall() -> HumanSkeleton:
    return parametric_human("tall", stature=1.95, axes=_ROS_AXES)


def _child() -> HumanSkeleton:
    return parametric_human("child", stature=1.15, shoulder_proportion=0.93, origin="head", axes=_CAMERA_AXES)


def _long_arms() -> HumanSkeleton:
    return parametric_human("long_arms", stature=1.70, arm_proportion=1.2, upper_share=0.45)


def _stiff() -> HumanSkeleton:
    return parametric_human("stiff", stature=1.66, arm_proportion=0.95, mobility=0.6, origin="head")


def _left_only() -> HumanSkeleton:
    return parametric_human("left_only", stature=1.78, sides=("left",))


PARAMETRIC_HUMANS = {
    "tall": _tall,
    "child": _child,
    "long_arms": _long_arms,
    "stiff": _stiff,
    "left_only": _left_only,
}
"""Makers of the parametric humans in the catalog."""
