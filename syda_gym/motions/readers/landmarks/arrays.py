"""Arrays of points, saved by numpy: ``.npy``, or ``.npz`` under whatever key.

``(T, P, 3)`` with P points, or with a fourth number for confidence; ``(T, people, P, 3)``; ``(T, 3 P)``; ``(T, 3,
P)``. Which order the points have is found by their number and by which order makes a person.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import BUDGET, open_archive, read_arrays
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.certainty import looks_like_certainty, without_lost
from syda_gym.motions.readers.choice import best_way, by_points
from syda_gym.motions.readers.layouts import LAYOUTS
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import NOTHING_SAID, Said
from syda_gym.motions.readers.skeleton import motions_from
from syda_gym.motions.readers.tables.people import chosen
from syda_gym.motions.readers.text import first_bytes
from syda_gym.motions.readers.times import Stamps

__all__ = ["is_arrays", "read_arrays_of_points"]

_TIMES = ("timestamps", "timestamp", "times", "time", "t")
_RATES = ("fps", "frame_rate", "framerate", "rate", "mocap_framerate", "mocap_frame_rate")
_LIKELY = ("pose_world_landmarks", "world_landmarks", "landmarks", "keypoints_3d", "keypoints3d", "joints3d",
"joints", "positions",
           "jtr", "Jtr", "poses_3d", "positions_3d", "keypoints")  # fmt: skip
_ANGLES = {"poses", "pose_body", "global_orient", "body_pose", "root_orient", "betas", "trans"}  # AMASS and SMPL
_COUNTS = {len(layout.joints) for layout in LAYOUTS}
_MOST_PEOPLE = 20


def is_arrays(path: Path) -> bool:
    """Whether a file is a ``.npy``, or an ``.npz`` that this library did not write."""
    start = first_bytes(path, 6)
    if start == b"\x93NUMPY":
        return True
    if start[:2] != b"PK":
        return False
    try:
        with open_archive(path, "arrays", MotionError) as archive:
            names = archive.namelist()
    except MotionError:
        return False
    return any(name.endswith(".npy") for name in names) and "meta.npy" not in names


def read_arrays_of_points(path: str | Path, said: Said = NOTHING_SAID, format: str | None = None) -> Motions:
    """Reads an array of points.

    Args:
        path: ``.npy`` or ``.npz``.
        said: what a person says about it.
        format: what a person called it; other orders are not tried.

    Returns:
        Motions of one human, ``"operator"``.

    Raises:
        MotionError: missing, damaged, no array of points (the message lists the arrays), or no person in it.
    """
    file = Path(path)
    arrays = read_arrays(file, "arrays of points (.npy or .npz)", MotionError)
    key, points, sure, notes = _points(file, arrays, said)
    if points.size > BUDGET.elements:
        raise MotionError(
            f"{file}: {key or 'the array'} holds {points.size} numbers; at most {BUDGET.elements} are read. Cut it"
        )
    if not said.joints and not said.order and np.isinf(points).any():
        frame = int(np.flatnonzero(np.isinf(points).any(axis=(1, 2)))[0])
        raise MotionError(f"{file}, frame {frame}: a coordinate is infinite")
    cleaned = without_lost(points, sure, said)
    ways = by_points(cleaned, said, format)
    if points.shape[1] == 3 and points.shape[2] == 3:
        ways = []
    best, doubt = best_way(file, ways, f"{points.shape[1]} points a frame in {key or 'the array'}")
    return motions_from(
        Recording(
            file, best.layout.format, best.joints, fps=_rate(file, arrays), stamps=_stamps(file, arrays, len(points),
            said),
            up=best.layout.up, names=[name for name in best.layout.joints if name != "-"],
            notes=[*notes, f"read as {best.label}" + (f" from {key}" if key else "")], doubts=[doubt] if doubt else [],
            image=best.layout.image,
        ),
        said,
    )  # fmt: skip


def _points(
    file: Path, arrays: Mapping[str, NDArray[Any]], said: Said
) -> tuple[str, FloatArray, FloatArray | None, list[str]]:
    """Key, points ``(T, P, 3)``, certainty ``(T, P)`` if there is one, and notes."""
    listed = ", ".join(
        f"{name or 'array'} {value.shape} {value.dtype}"[:80] for name, value in list(arrays.items())[:12]
    )
    order = [name for name in _LIKELY if name in arrays]
    if len(_ANGLES & set(arrays)) < 2:
        order += [name for name in arrays if name not in order]
    for name in order:
        value = arrays[name]
        if value.dtype.kind not in "fiu":
            continue
        shaped = _shaped(file, value, said)
        if shaped is not None:
            points, notes = shaped
            table = points.astype(np.float64)
            if table.shape[2] == 3:
                return name, table, None, notes
            if table.shape[2] >= 4 and looks_like_certainty(table[:, :, 3]):
                return name, table[:, :, :3], table[:, :, 3], notes
            return name, table[:, :, :3], None, notes
    if _ANGLES & set(arrays):
        raise MotionError(
            f"{file} holds the angles of an SMPL body, as AMASS publishes them ({listed}), not where its joints are; "
            f"compute the joints "
            "with the body model and save them as an array (T, 22, 3)"
        )
    raise MotionError(
        f"{file}: expected an array (frames, points, 3) or (frames, points, 4), got {listed or 'nothing'}"
    )


def _shaped(file: Path, value: NDArray[Any], said: Said) -> tuple[NDArray[Any], list[str]] | None:
    """An array as ``(T, P, 3 or more)``, or ``None`` if it is none of points."""
    counts = {len(said.order)} if said.order else set(range(3, 600)) if said.joints else _COUNTS
    shape = value.shape
    if value.ndim == 4 and 1 <= shape[1] <= _MOST_PEOPLE and shape[2] in counts and 3 <= shape[3] <= 8:
        index, notes = chosen(file, [f"place {place + 1}" for place in range(shape[1])], said)
        return value[:, index], notes
    if value.ndim == 3 and shape[1] in counts and 3 <= shape[2] <= 8:
        return value, []
    if value.ndim == 3 and shape[1] == 3 and shape[2] in counts:
        return value.transpose(0, 2, 1), ["the array has its axes before its points"]
    if value.ndim == 3 and shape[0] in counts and shape[2] == 3 and shape[1] not in counts:
        return value.transpose(1, 0, 2), ["the array has its points before its frames"]
    if value.ndim == 2 and shape[1] % 3 == 0 and shape[1] // 3 in counts:
        return value.reshape(len(value), -1, 3), []
    if value.ndim == 2 and shape[1] % 4 == 0 and shape[1] // 4 in counts:
        return value.reshape(len(value), -1, 4), []
    return None


def _rate(file: Path, arrays: Mapping[str, NDArray[Any]]) -> float | None:
    key = next((name for name in _RATES if name in arrays), None)
    if key is None:
        return None
    value = arrays[key]
    fps = float(value.reshape(-1)[0]) if value.dtype.kind in "fiu" and value.size == 1 else float("nan")
    if not 0.1 <= fps <= 1_500.0:
        raise MotionError(f"{file}: fps must be a number between 0.1 and 1500, got {str(value)[:60]}")
    return fps


def _stamps(file: Path, arrays: Mapping[str, NDArray[Any]], count: int, said: Said) -> Stamps | None:
    key = said.time or next((name for name in _TIMES if name in arrays), None)
    if key is None or key not in arrays:
        return None
    times = arrays[key]
    if times.dtype.kind not in "fiu" or times.size != count or times.ndim > 2:
        raise MotionError(f"{file}: {key} have shape {times.shape} for {count} frames")
    return Stamps(times.reshape(-1).astype(np.float64), said.time_unit, key)
