"""Biovision hierarchies (BVH): joints are found by their names and their place in the tree."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError, nearest_name
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.bvh.hierarchy import Hierarchy, read_hierarchy
from syda_gym.motions.readers.bvh.kinematics import joint_positions
from syda_gym.motions.readers.markers import joint_points
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import NOTHING_SAID, Said
from syda_gym.motions.readers.skeleton import motions_from
from syda_gym.motions.readers.text import first_bytes, read_lines

__all__ = ["is_bvh", "read_bvh"]

_ARM_PARTS = ("Shoulder", "Elbow", "Hand")


def is_bvh(path: Path) -> bool:
    """Whether a file begins with ``HIERARCHY``."""
    return first_bytes(path, 64).lstrip(b"\xef\xbb\xbf \r\n\t").upper().startswith(b"HIERARCHY")


def read_bvh(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads a BVH file.

    Args:
        path: the ``.bvh`` file.
        said: what a person says about it.

    Returns:
        Motions of one human, ``"operator"``, at the file's frame rate, in metres, seen from its own body.

    Raises:
        MotionError: missing, too large, truncated or damaged (the message names the line), or without arms.
    """
    file = Path(path)
    hierarchy = read_hierarchy(file, read_lines(file, "a BVH file"))
    names = [joint.name for joint in hierarchy.joints]
    matched = _matched(file, hierarchy, names, said)
    positions = joint_positions(hierarchy, matched.values())
    joints = {joint: positions[index] for joint, index in matched.items()}
    notes = [
        *hierarchy.notes,
        "joints: " + ", ".join(f"{joint} = {names[matched[joint]]}" for joint in matched if joint[1:] in _ARM_PARTS),
    ]
    start = 0
    if _begins_with_calibration(joints):
        start = 1
        notes.append("the first frame is a calibration pose that the motion does not continue; dropped")
    return motions_from(
        Recording(
            file,
            "bvh",
            {joint: values[start:] for joint, values in joints.items()},
            fps=1.0 / hierarchy.frame_time,
            lines=hierarchy.lines[start:],
            names=names,
            notes=notes,
        ),
        said,
    )


def _matched(file: Path, hierarchy: Hierarchy, names: list[str], said: Said) -> dict[str, int]:
    parents = [joint.parent for joint in hierarchy.joints]
    matched = {joint: places[0] for joint, places in joint_points(names, parents).items()}
    matched.setdefault("Pelvis", 0)
    for joint, name in said.joints.items():
        if name not in names:
            raise MotionError(
                f"{file} has no joint {name!r} for {joint}; {nearest_name(name, [n[:60] for n in names])}"
            )
        matched[joint] = names.index(name)
    counts = Counter(names)
    for joint, index in matched.items():
        if joint[1:] in _ARM_PARTS and counts[names[index]] > 1:
            lines = ", ".join(str(one.line) for one in hierarchy.joints if one.name == names[index])
            raise MotionError(
                f"{file}: joint {names[index]!r} occurs {counts[names[index]]} times (lines {lines[:60]}); an arm's "
                f"names must be "
                "distinct"
            )
    return matched


def _begins_with_calibration(joints: dict[str, FloatArray]) -> bool:
    """Whether a hand jumps by half an arm between the first two frames and nowhere near as far later (CMU's T pose)."""
    for side in "LR":
        arm = [joints.get(side + part) for part in _ARM_PARTS]
        if any(values is None or len(values) < 4 for values in arm):
            continue
        shoulder, elbow, hand = (values for values in arm if values is not None)
        length = np.linalg.norm(elbow[1] - shoulder[1]) + np.linalg.norm(hand[1] - elbow[1])
        jumps = np.linalg.norm(np.diff(hand - shoulder, axis=0), axis=1)
        if jumps[0] > 0.5 * length and jumps[0] > 3.0 * jumps[1:].max():
            return True
    return False
