"""Where the joints of a BVH file are: offsets turned by the rotations above them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.motions.readers.bvh.hierarchy import Hierarchy, Joint

__all__ = ["joint_positions"]


def joint_positions(hierarchy: Hierarchy, wanted: Iterable[int]) -> Mapping[int, FloatArray]:
    """Positions of some joints in the file's units and axes.

    Args:
        hierarchy: the file.
        wanted: indices of joints.

    Returns:
        Index to ``(N, 3)``.
    """
    joints, values = hierarchy.joints, hierarchy.values
    wanted = set(wanted)
    needed: set[int] = set()
    for index in wanted:
        while index >= 0 and index not in needed:
            needed.add(index)
            index = joints[index].parent
    inner = {joints[index].parent for index in needed}  # only their rotations move something that is wanted
    added = _adds_to_offsets(hierarchy)
    places: dict[int, FloatArray] = {}
    turns: dict[int, FloatArray] = {}
    for index in sorted(needed):
        joint = joints[index]
        local = _translation(joint, values, added or joint.parent < 0)
        if joint.parent < 0:
            places[index] = local
        else:
            places[index] = places[joint.parent] + np.einsum("nij,nj->ni", turns[joint.parent], local)
        if index in inner:
            turn = _rotation(joint, values)
            turns[index] = turn if joint.parent < 0 else turns[joint.parent] @ turn
    return {index: places[index] for index in wanted}


def _translation(joint: Joint, values: FloatArray, add: bool) -> FloatArray:
    """``(N, 3)`` from the parent: the offset, or the position channels instead of it or on top of it."""
    local = np.tile(joint.offset, (len(values), 1))
    for column, (axis, rotation) in enumerate(joint.channels, start=joint.first):
        if not rotation:
            local[:, axis] = values[:, column] + (joint.offset[axis] if add else 0.0)
    return local


def _adds_to_offsets(hierarchy: Hierarchy) -> bool:
    """Whether position channels of inner joints come on top of their offsets.

    Some tools write the whole translation, others only what is added to the offset: then the channels are near zero
    where the offsets are not.
    """
    whole, rest, size = 0.0, 0.0, 0.0
    for joint in hierarchy.joints:
        axes = {axis: joint.first + i for i, (axis, rotation) in enumerate(joint.channels) if not rotation}
        if joint.parent < 0 or len(axes) < 3:
            continue
        position = hierarchy.values[:, [axes[axis] for axis in range(3)]].mean(axis=0)
        whole += float(np.linalg.norm(position - joint.offset))
        rest += float(np.linalg.norm(position))
        size += float(np.linalg.norm(joint.offset))
    return size > 0.0 and rest < whole


def _rotation(joint: Joint, values: FloatArray) -> FloatArray:
    """``(N, 3, 3)``: one turn a channel, in the order of the channels."""
    result = np.broadcast_to(np.eye(3), (len(values), 3, 3))
    for column, (axis, rotation) in enumerate(joint.channels, start=joint.first):
        if not rotation:
            continue
        angle = np.deg2rad(values[:, column])
        cosine, sine = np.cos(angle), np.sin(angle)
        turn = np.zeros((len(values), 3, 3))
        one, two = (axis + 1) % 3, (axis + 2) % 3
        turn[:, axis, axis] = 1.0
        turn[:, one, one] = turn[:, two, two] = cosine
        turn[:, two, one], turn[:, one, two] = sine, -sine
        result = result @ turn
    return result
