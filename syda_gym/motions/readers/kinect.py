"""Kinect v2 recordings as comma-separated text: a timestamp and 25 joints of x, y, z and tracking state per line.

This is how Microsoft's LabanotationSuite and many recorders built on the Kinect for Windows SDK 2.0 write bodies: the
time in units of 100 ns, positions in metres in camera space (x to the sensor's left, y up, z away from the sensor), and
per joint 0 not tracked, 1 inferred, 2 tracked.
https://learn.microsoft.com/previous-versions/windows/kinect/dn758662(v=ieb.10)
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.skeleton import Recording, motions_from
from syda_gym.motions.readers.text import first_bytes, numbers, read_lines, split_row

__all__ = ["KINECT_JOINTS", "is_kinect", "read_kinect"]

KINECT_JOINTS = (
    "SpineBase", "SpineMid", "Neck", "Head",
    "ShoulderLeft", "ElbowLeft", "WristLeft", "HandLeft", "ShoulderRight", "ElbowRight", "WristRight", "HandRight",
    "HipLeft", "KneeLeft", "AnkleLeft", "FootLeft", "HipRight", "KneeRight", "AnkleRight", "FootRight",
    "SpineShoulder", "HandTipLeft", "ThumbLeft", "HandTipRight", "ThumbRight",
)  # fmt: skip
"""The 25 joints in the order of the SDK's ``JointType``."""

# Canonical joint to SDK joint. "Hand" is the wrist, the point on which errors are measured.
_USED = {
    "Pelvis": "SpineBase", "Torso": "SpineMid", "Neck": "SpineShoulder", "Head": "Head",
    "LShoulder": "ShoulderLeft", "LElbow": "ElbowLeft", "LHand": "WristLeft",
    "RShoulder": "ShoulderRight", "RElbow": "ElbowRight", "RHand": "WristRight",
    "LHip": "HipLeft", "LKnee": "KneeLeft", "LFoot": "AnkleLeft", "LToe": "FootLeft",
    "RHip": "HipRight", "RKnee": "KneeRight", "RFoot": "AnkleRight", "RToe": "FootRight",
}  # fmt: skip

_COLUMNS = 1 + 4 * len(KINECT_JOINTS)
_TICK = 1e-7  # s


def is_kinect(path: Path) -> bool:
    """Whether the first full line has a timestamp and 25 joints."""
    lines = first_bytes(path).decode("utf-8", "replace").splitlines()
    return bool(lines) and len(split_row(lines[0])) == _COLUMNS and lines[0].lstrip()[:1].isdigit()


def read_kinect(path: str | Path, *, inferred: bool = False) -> Motions:
    """Reads a Kinect v2 recording.

    Args:
        path: the ``.csv`` file.
        inferred: take inferred positions as they are; by default they count as gaps, for the sensor guessed them.

    Returns:
        Motions of one human, ``"operator"``, with timestamps; gaps are filled and flagged by ``skeleton.motions_from``.

    Raises:
        MotionError: the file is missing, too large, not in this format, or a joint is hardly ever tracked.
    """
    file = Path(path)
    lines = read_lines(file, "a Kinect v2 recording (.csv)")
    rows, places = [], []
    for index, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        cells = split_row(line)
        if len(cells) != _COLUMNS:
            end = "; is the file truncated?" if index == len(lines) else ""
            raise MotionError(
                f"{file}, line {index}: {len(cells)} columns, expected {_COLUMNS} (a timestamp, then x, y, z and "
                f"tracking state of 25 joints){end}"
            )
        rows.append(numbers(cells, file, index))
        places.append(index)
    if not rows:
        raise MotionError(f"{file} has no frames")
    table = np.array(rows)
    states = table[:, 4::4]
    if not np.isin(states[np.isfinite(states)], (0, 1, 2)).all():
        row = int(np.flatnonzero(~np.isin(states, (0, 1, 2)).all(axis=1))[0])
        raise MotionError(f"{file}, line {places[row]}: a tracking state is none of 0, 1 and 2")
    positions = table[:, 1:].reshape(len(table), len(KINECT_JOINTS), 4)[:, :, :3].copy()
    positions[~(states >= (1 if inferred else 2))] = np.nan
    joints = {name: positions[:, KINECT_JOINTS.index(source)] for name, source in _USED.items()}
    notes = [] if inferred else ["inferred joints count as untracked"]
    return motions_from(
        Recording(
            file,
            "kinect",
            joints,
            timestamps=table[:, 0] * _TICK,
            lines=np.array(places),
            names=KINECT_JOINTS,
            notes=notes,
        )
    )
