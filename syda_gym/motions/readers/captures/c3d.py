"""C3D, the files of optical motion capture: markers around the joints, opened by ``ezc3d``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from syda_gym.errors import MotionError, nearest_name
from syda_gym.files import BUDGET, check_size
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.captures.child import arrays_from_child
from syda_gym.motions.readers.markers import joint_points
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import NOTHING_SAID, UNITS, Said
from syda_gym.motions.readers.skeleton import motions_from
from syda_gym.motions.readers.tables.people import chosen
from syda_gym.motions.readers.text import first_bytes

__all__ = ["is_c3d", "read_c3d"]


def is_c3d(path: Path) -> bool:
    """Whether the second byte is C3D's key and the ending is ``.c3d``."""
    return first_bytes(path, 2)[1:2] == b"\x50" and path.suffix.lower() == ".c3d"


def read_c3d(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads a C3D file.

    Args:
        path: the file.
        said: what a person says about it.

    Returns:
        Motions of one human, ``"operator"``; a joint is the middle of the markers around it, so it lies where the
        markers are, up to a few centimetres from the bone.

    Raises:
        MotionError: missing, damaged, or without markers of an arm.
        MissingExtraError: ``ezc3d`` is not installed.
    """
    file = check_size(path, BUDGET.text, "a C3D file", MotionError)
    found = arrays_from_child("open_c3d", file, "reading C3D", "c3d", "ezc3d")
    points, labels = found["points"], [str(label) for label in found["labels"]]
    if points.ndim != 3 or points.shape[1] < len(labels):
        raise MotionError(f"{file} has {points.shape} points for {len(labels)} labels; it is damaged")
    groups: dict[str, dict[str, int]] = {}
    for index, label in enumerate(labels):
        who, _, name = label.rpartition(":")
        groups.setdefault(who, {}).setdefault(name, index)
    people = [who for who, names in groups.items() if {"LShoulder", "RShoulder"} & set(joint_points(list(names)))]
    number, notes = chosen(file, people or list(groups), said)
    names = groups[(people or list(groups))[number]]
    listed = list(names)
    places = {joint: [names[listed[i]] for i in indices] for joint, indices in joint_points(listed).items()}
    for joint, name in said.joints.items():
        if name not in names:
            raise MotionError(f"{file} has no point {name!r} for {joint}; {nearest_name(name, listed[:200])}")
        places[joint] = [names[name]]
    joints = {joint: points[:, indices].mean(axis=1) for joint, indices in places.items()}
    rate = float(np.ravel(found["rate"])[0])
    unit = UNITS.get(str(found["units"][0]).strip().lower())
    used = ", ".join(
        f"{joint} = {'+'.join(labels[i] for i in places[joint])}"
        for joint in joints
        if joint[1:] in ("Shoulder", "Elbow", "Hand")
    )
    return motions_from(
        Recording(
            file, "c3d", joints, fps=rate if 0.1 <= rate <= 1_500.0 else None, up=(0.0, 0.0, 1.0), unit=unit,
            names=listed,
            notes=[*notes, f"joints: {used}"],
        ),
        said,
    )  # fmt: skip
