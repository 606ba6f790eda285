"""OpenNI / Kinect v1 skeletons as text, 15 joints a frame, usually in millimetres.

Three layouts are understood:

- rows of the Cornell activity data sets (CAD-60, CAD-120): ``frame, (9 numbers of orientation, confidence, x, y, z,
  confidence) x 11 joints, (x, y, z, confidence) x 4 joints,`` and ``END`` as the last line;
- rows of 15 joints in OpenNI's order, each ``x y z`` or ``x y z confidence``, with or without a time [s] in front;
- a table whose header names joints and axes, see ``table``.

A position of exactly (0, 0, 0) is how OpenNI says that it lost a joint.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import SKELETON_JOINTS
from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.skeleton import Recording, motions_from
from syda_gym.motions.readers.table import is_header, read_table
from syda_gym.motions.readers.text import first_bytes, numbers, read_lines, split_row

__all__ = ["CORNELL_JOINTS", "is_openni", "read_openni"]

CORNELL_JOINTS = (
    "Head", "Neck", "Torso", "LShoulder", "LElbow", "RShoulder", "RElbow", "LHip", "LKnee", "RHip", "RKnee",
    "LHand", "RHand", "LFoot", "RFoot",
)  # fmt: skip
"""Joint order of the Cornell data sets; the first eleven have an orientation."""

_CORNELL_COLUMNS = 1 + 11 * 14 + 4 * 4
_COUNT = len(SKELETON_JOINTS)
_PLAIN = {_COUNT * 3: (0, 3), _COUNT * 3 + 1: (1, 3), _COUNT * 4: (0, 4), _COUNT * 4 + 1: (1, 4)}
_LEAST_CONFIDENCE = 0.5


def is_openni(path: Path) -> bool:
    """Whether the first line is a row of 15 joints, or a header that names joints in a ``.txt`` file."""
    lines = first_bytes(path).decode("utf-8", "replace").splitlines()
    if not lines or "\0" in lines[0]:
        return False
    cells = split_row(lines[0])
    try:
        [float(cell) for cell in cells]
    except ValueError:
        return path.suffix.lower() in (".txt", ".skeleton") and is_header(lines[0])
    return len(cells) in _PLAIN or len(cells) == _CORNELL_COLUMNS


def read_openni(path: str | Path) -> Motions:
    """Reads an OpenNI / Kinect v1 skeleton recording.

    Args:
        path: the text file.

    Returns:
        Motions of one human, ``"operator"``; gaps are filled and flagged by ``skeleton.motions_from``. Without times in
        the file 30 frames per second are assumed.

    Raises:
        MotionError: the file is missing, too large or in none of the three layouts; the message names the line.
    """
    file = Path(path)
    lines = read_lines(file, "an OpenNI skeleton as text")
    if is_header(lines[0]):
        return motions_from(read_table(file, lines, "openni", least=_LEAST_CONFIDENCE, zero_is_gap=True))
    rows, places = _rows(file, lines)
    columns = rows.shape[1]
    if columns == _CORNELL_COLUMNS:
        joints, times = _cornell(rows), None
    else:
        start, width = _PLAIN[columns]
        values = rows[:, start:].reshape(len(rows), _COUNT, width)
        confidence = values[:, :, 3] if width == 4 else np.ones(values.shape[:2])
        joints = {name: _tracked(values[:, i, :3], confidence[:, i]) for i, name in enumerate(SKELETON_JOINTS)}
        times = rows[:, 0] if start else None
    return motions_from(
        Recording(file, "openni", joints, fps=None, timestamps=times, lines=places, names=SKELETON_JOINTS)
    )


def _rows(file: Path, lines: list[str]) -> tuple[FloatArray, np.ndarray]:
    rows: list[FloatArray] = []
    places = []
    for index, line in enumerate(lines, start=1):
        if not line.strip() or line.strip() in ("END", "END,"):
            continue
        cells = split_row(line)
        expected = len(rows[0]) if rows else None
        if expected is None and len(cells) not in _PLAIN and len(cells) != _CORNELL_COLUMNS:
            raise MotionError(
                f"{file}, line {index}: {len(cells)} columns; expected {sorted(_PLAIN)} (15 joints, with or without "
                f"time and confidence), {_CORNELL_COLUMNS} (Cornell rows), or a header that names joints"
            )
        if expected is not None and len(cells) != expected:
            end = "; is the file truncated?" if index == len(lines) else ""
            raise MotionError(f"{file}, line {index}: {len(cells)} columns, the lines before have {expected}{end}")
        rows.append(numbers(cells, file, index))
        places.append(index)
    if not rows:
        raise MotionError(f"{file} has no frames")
    return np.array(rows), np.array(places)


def _cornell(rows: FloatArray) -> dict[str, FloatArray]:
    joints = {}
    for index, name in enumerate(CORNELL_JOINTS):
        start = 1 + 14 * index + 10 if index < 11 else 1 + 11 * 14 + 4 * (index - 11)
        joints[name] = _tracked(rows[:, start : start + 3], rows[:, start + 3])
    return joints


def _tracked(positions: FloatArray, confidence: FloatArray) -> FloatArray:
    lost = ~(confidence >= _LEAST_CONFIDENCE) | (positions == 0.0).all(axis=1)
    return np.where(lost[:, None], np.nan, positions)
