"""Figure: what a human looks like: round bones between named points, with a face, a neck, hands, feet and a torso."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton

__all__ = ["Bone", "bones", "figure_points"]


class Bone(NamedTuple):
    """A solid with round ends between two points of ``figure_points``; a ball where they are the same.

    Attributes:
        start: name of one point.
        end: name of the other.
        radius: as a fraction of stature; only for looks.
        colour: what of the person it is, a key of ``look.PERSON``.
    """

    start: str
    end: str
    radius: float
    colour: str

    @property
    def moves(self) -> bool:
        """Whether it moves with an arm."""
        return (self.start[1:] in _ARM_POINTS and self.start != self.end) or self.start[1:] in ("Elbow", "Hand", "Palm")


_ARM_POINTS = ("Shoulder", "Elbow", "Hand", "Palm")

_TRUNK = (
    Bone("Head", "Head", 0.060, "skin"), Bone("Hair", "Hair", 0.0605, "hair"), Bone("Nose", "Nose", 0.0095, "skin"),
    Bone("LEye", "LEye", 0.0085, "eyes"), Bone("REye", "REye", 0.0085, "eyes"), Bone("Throat", "Neck", 0.027, "skin"),
    Bone("LCollar", "RCollar", 0.036, "shirt"), Bone("LChest", "RChest", 0.058, "shirt"),
    Bone("LUpperRib", "RUpperRib", 0.0585, "shirt"), Bone("LRib", "RRib", 0.058, "shirt"),
    Bone("LLowerRib", "RLowerRib", 0.057, "shirt"), Bone("LWaist", "RWaist", 0.056, "shirt"),
    Bone("LBelt", "RBelt", 0.056, "trousers"), Bone("LPelvis", "RPelvis", 0.057, "trousers"),
    Bone("LHip", "RHip", 0.052, "trousers"),
    Bone("Breast", "Navel", 0.010, "strip"),
)  # fmt: skip

_SIDE = (
    Bone("Shoulder", "Shoulder", 0.036, "shirt"), Bone("Shoulder", "Elbow", 0.029, "shirt"),
    Bone("Elbow", "Hand", 0.022, "skin"), Bone("Hand", "Palm", 0.024, "skin"),
    Bone("Hip", "Knee", 0.041, "trousers"), Bone("Knee", "Foot", 0.031, "trousers"),
    Bone("Foot", "Toe", 0.024, "shoes"),
)  # fmt: skip

# Points beside the joints: the joint or middle that they hang on, and where from there, as fractions of stature in
# body axes (x forward, y left, z up).
_BESIDE: dict[str, tuple[str, tuple[float, float, float]]] = {
    "Hair": ("Head", (-0.013, 0.0, 0.015)), "Nose": ("Head", (0.062, 0.0, -0.006)),
    "LEye": ("Head", (0.053, 0.021, 0.010)), "REye": ("Head", (0.053, -0.021, 0.010)),
    "Throat": ("Head", (0.0, 0.0, -0.04)),
    "LUpperRib": ("Middle", (0.0, 0.050, -0.086)), "RUpperRib": ("Middle", (0.0, -0.050, -0.086)),
    "LRib": ("Middle", (0.0, 0.045, -0.115)), "RRib": ("Middle", (0.0, -0.045, -0.115)),
    "LLowerRib": ("Middle", (0.0, 0.040, -0.145)), "RLowerRib": ("Middle", (0.0, -0.040, -0.145)),
    "LBelt": ("Middle", (0.0, 0.038, -0.208)), "RBelt": ("Middle", (0.0, -0.038, -0.208)),
    "LWaist": ("Middle", (0.0, 0.036, -0.175)), "RWaist": ("Middle", (0.0, -0.036, -0.175)),
    "LPelvis": ("Middle", (0.0, 0.040, -0.240)), "RPelvis": ("Middle", (0.0, -0.040, -0.240)),
    "Breast": ("Middle", (0.055, 0.0, -0.035)), "Navel": ("Middle", (0.053, 0.0, -0.185)),
    "LToe": ("LFoot", (0.085, 0.008, -0.010)), "RToe": ("RFoot", (0.085, -0.008, -0.010)),
}  # fmt: skip
_PALM = 0.045  # of stature, beyond the wrist


def bones(human: HumanSkeleton) -> tuple[Bone, ...]:
    """The solids of a person; of a one-armed one those of the arm that is tracked."""
    sides = [
        Bone(f"{side}{bone.start}", f"{side}{bone.end}", bone.radius, bone.colour)
        for side in "LR"
        for bone in _SIDE
        if bone.start not in _ARM_POINTS or any(name[0].upper() == side for name in human.sides)
    ]
    return (*_TRUNK, *sides)


def figure_points(human: HumanSkeleton, frames: ArrayLike) -> dict[str, FloatArray]:
    """Every point that ``bones`` join.

    Args:
        human: who.
        frames: ``(N, F)``.

    Returns:
        Name to ``(N, 3)`` [m], body axes.
    """
    joints = human.complete(frames)
    tall = human.height
    points: dict[str, FloatArray] = dict(joints)
    middle = joints["Neck"] - np.array([0.0, 0.0, 0.012 * tall])
    points["Middle"] = middle
    for name, (base, offset) in _BESIDE.items():
        points[name] = points[base] + tall * np.array(offset)
    half = _half_width(human, joints, middle)
    for side in "LR":
        points[f"{side}Collar"] = middle + 0.85 * half[side]
        points[f"{side}Chest"] = middle + 0.50 * half[side] + np.array([0.0, 0.0, -0.058 * tall])
        if f"{side}Hand" in joints:
            forearm = joints[f"{side}Hand"] - joints[f"{side}Elbow"]
            length = np.maximum(np.linalg.norm(forearm, axis=1, keepdims=True), 1e-6)
            points[f"{side}Palm"] = joints[f"{side}Hand"] + _PALM * tall * forearm / length
    return points


def _half_width(human: HumanSkeleton, joints: Mapping[str, FloatArray], middle: FloatArray) -> dict[str, FloatArray]:
    """From the middle of the shoulders to each of them, ``(N, 3)``; mirrored where only one is tracked."""
    half = {side: joints[f"{side}Shoulder"] - middle for side in "LR" if f"{side}Shoulder" in joints}
    for side, other in (("L", "R"), ("R", "L")):
        if side not in half:
            half[side] = half[other] * np.array([1.0, -1.0, 1.0])
    return half
