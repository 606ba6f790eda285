"""body_axes: which way is forward, left and up, from the shoulders, and from feet, head or base where there are some.

Not from the arms: at a robot's zero pose they may point anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syda_gym.embodiments.discovery.limbs import Limb
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.urdf import UrdfTree

__all__ = ["body_axes"]

_SNAP = 0.15  # rad; a direction nearer than this to one of the root's axes is that axis
_APART = 1e-2  # m; shoulders nearer than this say nothing


def body_axes(
    tree: UrdfTree,
    placements: dict[str, FloatArray],
    shoulders: Sequence[FloatArray],
    arms: Sequence[FloatArray],
    limbs: Sequence[Limb],
) -> FloatArray:
    """Rows: forward, left and up in the root's frame. ROS has them along x, y, z, but not every model does.

    Args:
        tree: the robot.
        placements: of every link at the zero pose ``(4, 4)``.
        shoulders: left and right shoulder at the zero pose ``(3,)`` [m]; fewer than two say nothing.
        arms: middle of the left and right arm, for shoulders that share one place on the breastbone.
        limbs: all limbs that were found, legs and heads among them.
    """
    axes = np.eye(3)
    if len(shoulders) < 2:
        return axes
    lateral = shoulders[0] - shoulders[1]
    if float(np.linalg.norm(lateral)) < _APART:
        lateral = arms[0] - arms[1]
    if float(np.linalg.norm(lateral)) < 1e-3:
        return axes
    left = _snapped(lateral)
    middle = 0.5 * (shoulders[0] + shoulders[1])
    up = _up(tree, placements, middle, left, limbs)
    return np.array([np.cross(left, up), left, up])


def _up(
    tree: UrdfTree, placements: dict[str, FloatArray], middle: FloatArray, left: FloatArray, limbs: Sequence[Limb]
) -> FloatArray:
    z = np.array([0.0, 0.0, 1.0])
    feet = [placements[limb.last_link][:3, 3] for limb in limbs if limb.kind == "leg"]
    heads = [placements[limb.last_link][:3, 3] for limb in limbs if limb.kind == "other" and _is_head(tree, limb)]
    hints = [middle - np.mean(feet, axis=0)] if len(feet) >= 2 else []
    hints += [np.mean(heads, axis=0) - middle] if heads else []
    for hint in hints:
        rise = hint - left * float(left @ hint)
        if float(np.linalg.norm(rise)) > 0.1:
            # Legs may be bent and heads may look ahead; only a clear contradiction of z counts.
            cosine = float(rise @ z) / float(np.linalg.norm(rise))
            if cosine > 0.5 and abs(float(left @ z)) < 0.5:
                break
            return _across(_snapped(rise), left)
    if abs(float(left @ z)) < 0.5:
        return _across(z, left)
    # A model whose z points sideways and that has neither feet nor head: up is where the arms are, seen from the rest.
    inner = {name for limb in limbs for name in limb.joints}
    body = [placement[:3, 3] for link, placement in placements.items() if not inner & set(_road(tree, link))]
    rise = middle - np.mean(body, axis=0)
    rise = rise - left * float(left @ rise)
    if float(np.linalg.norm(rise)) < 1e-6:
        rise = np.cross(np.eye(3)[int(np.argmin(np.abs(left)))], left)
    return _across(_nearest_axis(rise), left)


def _road(tree: UrdfTree, link: str) -> list[str]:
    """Joints between the root and a link."""
    found = []
    while link in tree.parent_joint:
        found.append(tree.parent_joint[link])
        link = tree.joints[found[-1]].parent
    return found


def _is_head(tree: UrdfTree, limb: Limb) -> bool:
    words = " ".join([*limb.joints, limb.last_link]).lower()
    return "head" in words or "neck" in words


def _snapped(direction: FloatArray) -> FloatArray:
    """A unit vector, exactly one of the root's axes if it is near to one: makers build along them."""
    unit = direction / float(np.linalg.norm(direction))
    axis = _nearest_axis(unit)
    near: FloatArray = axis if float(unit @ axis) > np.cos(_SNAP) else unit
    return near


def _nearest_axis(direction: FloatArray) -> FloatArray:
    largest = int(np.argmax(np.abs(direction)))
    axis: FloatArray = np.eye(3)[largest] * np.sign(direction[largest])
    return axis


def _across(up: FloatArray, left: FloatArray) -> FloatArray:
    """``up`` made square to ``left``."""
    square = up - left * float(left @ up)
    result: FloatArray = square / float(np.linalg.norm(square))
    return result
