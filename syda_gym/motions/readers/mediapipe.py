"""MediaPipe pose landmarks, dumped as JSON, CSV or npz: 33 landmarks a frame with visibility.

Only *world* landmarks (metres, origin between the hips) can be used; image landmarks have no depth in metres and are
refused. Axes: x to the image's right, y down, z away from the camera.
https://ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker

- **JSON**: a list of frames, or an object with the list under ``frames`` (and ``fps``). A frame is a list of 33
  landmarks, or an object with them under ``pose_world_landmarks`` (or ``world_landmarks``, ``landmarks``) and a time
  under ``timestamp_ms`` or ``timestamp`` [s]. A landmark is ``{"x", "y", "z", "visibility"}`` or
  ``[x, y, z, visibility]``. An empty list is a frame without a person. JSON lines work as well.
- **CSV**: a header that names joints and axes, see ``table``.
- **npz**: ``world_landmarks`` (or ``pose_world_landmarks``, ``landmarks``) of shape ``(N, 33, 3)`` or with visibility
  ``(N, 33, 4)``, and ``timestamps`` [s] ``(N,)`` or ``fps``.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.skeleton import Recording, motions_from
from syda_gym.motions.readers.table import is_header, read_table
from syda_gym.motions.readers.text import MAX_BYTES, first_bytes, read_lines

__all__ = ["is_mediapipe", "read_mediapipe"]

_COUNT = 33
_USED = {
    "Nose": 0, "LShoulder": 11, "RShoulder": 12, "LElbow": 13, "RElbow": 14, "LHand": 15, "RHand": 16,
    "LHip": 23, "RHip": 24, "LKnee": 25, "RKnee": 26, "LFoot": 27, "RFoot": 28, "LToe": 31, "RToe": 32,
}  # fmt: skip
_EARS = (7, 8)
_KEYS = (
    "pose_world_landmarks",
    "poseWorldLandmarks",
    "world_landmarks",
    "worldLandmarks",
    "landmarks",
    "pose_landmarks",
)
_LEAST_VISIBILITY = 0.5
_UP = (0.0, -1.0, 0.0)


def is_mediapipe(path: Path) -> bool:
    """Whether a file is a landmark dump by content: JSON, an ``.npz`` with landmarks, or a table that names joints."""
    start = first_bytes(path)
    if start[:2] == b"PK":
        try:
            with zipfile.ZipFile(path) as archive:
                return any(f"{key}.npy" in archive.namelist() for key in _KEYS)
        except (OSError, zipfile.BadZipFile):
            return False
    text = start.decode("utf-8", "replace").lstrip("\ufeff \r\n\t")
    if text[:1] in ("[", "{"):
        return True
    lines = text.splitlines()
    return bool(lines) and path.suffix.lower() == ".csv" and is_header(lines[0])


def read_mediapipe(path: str | Path) -> Motions:
    """Reads a dump of MediaPipe world landmarks.

    Args:
        path: ``.json``, ``.jsonl``, ``.csv`` or ``.npz`` file.

    Returns:
        Motions of one human, ``"operator"``; landmarks of visibility below 0.5 are gaps, filled and flagged as
        ``skeleton.motions_from`` says.

    Raises:
        MotionError: missing, too large, malformed (the message names frame or line), or image landmarks.
    """
    file = Path(path)
    start = first_bytes(file)
    if start[:2] == b"PK":
        recording = _from_npz(file)
    else:
        lines = read_lines(file, "MediaPipe landmarks (.json, .csv or .npz)")
        recording = _from_json(file, lines) if lines[0].lstrip()[:1] in ("[", "{") else _from_csv(file, lines)
    return motions_from(recording)


def _from_csv(file: Path, lines: list[str]) -> Recording:
    recording = read_table(file, lines, "mediapipe", least=_LEAST_VISIBILITY)
    recording.up = _UP
    shoulders = [recording.joints[name] for name in ("LShoulder", "RShoulder") if name in recording.joints]
    hips = [recording.joints[name] for name in ("LHip", "RHip") if name in recording.joints]
    if shoulders and len(hips) == 2:
        _refuse_image(file, np.stack([*shoulders, *hips], axis=1), np.mean(hips, axis=0))
    return recording


def _from_npz(file: Path) -> Recording:
    if file.stat().st_size > MAX_BYTES:
        raise MotionError(f"{file} is larger than {MAX_BYTES >> 20} MB; cut it into pieces")
    try:
        with zipfile.ZipFile(file) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > 4 * MAX_BYTES:
            raise MotionError(f"{file} unpacks to {size >> 20} MB; cut it into pieces")
        with np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except MotionError:
        raise
    except Exception as error:  # damaged archives raise zip, zlib, value, memory and end-of-file errors alike
        raise MotionError(f"{file} is no readable .npz file: {error}") from error
    key = next((name for name in _KEYS if name in arrays), None)
    if key is None:
        raise MotionError(f"{file}: expected an array {' or '.join(_KEYS[2::2])}, got {', '.join(arrays) or 'nothing'}")
    table = arrays[key]
    if table.dtype.kind not in "fiu" or table.ndim != 3 or table.shape[1] != _COUNT or table.shape[2] not in (3, 4, 5):
        raise MotionError(f"{file}: {key} has shape {table.shape}, expected (N, {_COUNT}, 3) or (N, {_COUNT}, 4)")
    times = arrays.get("timestamps", arrays.get("times"))
    if times is not None and (times.dtype.kind not in "fiu" or times.shape != (len(table),)):
        raise MotionError(f"{file}: timestamps have shape {times.shape} for {len(table)} frames")
    stamps = None if times is None else times.astype(np.float64)
    return _recording(file, table[:, :, :4].astype(np.float64), stamps, _rate(file, arrays.get("fps")))


def _rate(file: Path, value: Any) -> float | None:
    if value is None:
        return None
    try:
        fps = float(value)
    except (TypeError, ValueError):
        fps = float("nan")
    if not 0.1 <= fps <= 10_000.0:
        raise MotionError(f"{file}: fps must be a number between 0.1 and 10000, got {value!r}")
    return fps


def _from_json(file: Path, lines: list[str]) -> Recording:
    document = _parse(file, lines)
    fps = None
    if isinstance(document, dict):
        fps = _rate(file, document.get("fps"))
        document = document.get("frames", document)
    if not isinstance(document, list):
        raise MotionError(
            f"{file}: expected a list of frames, or an object with one under 'frames'; got a single object"
        )
    frames, times = [], []
    for index, entry in enumerate(document):
        landmarks, time = entry, None
        if isinstance(entry, dict):
            key = next((name for name in _KEYS if name in entry), None)
            if key is None:
                raise MotionError(
                    f"{file}, frame {index}: expected a key {_KEYS[0]!r}, got {', '.join(map(str, entry))[:80]}"
                )
            if key == "pose_landmarks":
                raise MotionError(f"{file}, frame {index}: only image landmarks; dump pose_world_landmarks instead")
            landmarks, time = entry[key], _time(file, index, entry)
        frames.append(_frame(file, index, landmarks))
        times.append(time)
    if not frames:
        raise MotionError(f"{file} has no frames")
    known = [time is not None for time in times]
    if any(known) and not all(known):
        raise MotionError(f"{file}, frame {known.index(False)}: the time is missing, other frames have one")
    stamps = np.array(times, dtype=np.float64) if all(known) else None
    return _recording(file, np.stack(frames), stamps, fps)


def _parse(file: Path, lines: list[str]) -> Any:
    try:
        return json.loads("\n".join(lines))
    except RecursionError as error:
        raise MotionError(f"{file} is nested too deeply to be landmarks") from error
    except ValueError as error:
        whole = error
    values = []
    for index, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            values.append(json.loads(line))
        except (ValueError, RecursionError) as error:
            place = index if values else getattr(whole, "lineno", index)
            reason = error if values else whole
            raise MotionError(f"{file}, line {place}: no valid JSON: {reason}; is the file truncated?") from error
    return values


def _time(file: Path, index: int, entry: dict[str, Any]) -> float | None:
    for key, factor in (("timestamp_ms", 1e-3), ("timestampInMilliseconds", 1e-3), ("timestamp", 1.0), ("time", 1.0)):
        if key in entry:
            value = entry[key]
            if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e15:
                raise MotionError(f"{file}, frame {index}: {key} is no number: {str(value)[:40]!r}")
            return float(value) * factor
    return None


def _frame(file: Path, index: int, landmarks: Any) -> FloatArray:
    """One frame ``(33, 4)``; all gaps if no person was seen."""
    # The solutions of MediaPipe wrap landmarks once more: in a list of persons, or under the key "landmark".
    if isinstance(landmarks, dict) and "landmark" in landmarks:
        landmarks = landmarks["landmark"]
    if isinstance(landmarks, list) and len(landmarks) == 1 and isinstance(landmarks[0], list):
        landmarks = landmarks[0]
    if landmarks is None or landmarks == []:
        return np.full((_COUNT, 4), np.nan)
    if not isinstance(landmarks, list) or len(landmarks) != _COUNT:
        count = len(landmarks) if isinstance(landmarks, list) else type(landmarks).__name__
        raise MotionError(f"{file}, frame {index}: expected {_COUNT} landmarks, got {count}")
    rows = np.empty((_COUNT, 4))
    for number, landmark in enumerate(landmarks):
        if isinstance(landmark, dict):
            values = [landmark.get("x"), landmark.get("y"), landmark.get("z"), landmark.get("visibility", 1.0)]
        elif isinstance(landmark, list) and len(landmark) in (3, 4, 5):
            values = [*landmark, 1.0][:4]
        else:
            values = [None]
        if any(
            isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e9 for value in values
        ):
            raise MotionError(
                f"{file}, frame {index}, landmark {number}: expected x, y, z and visibility as numbers, "
                f"got {str(landmark)[:80]}"
            )
        rows[number] = values
    return rows


def _recording(file: Path, table: FloatArray, times: FloatArray | None, fps: float | None) -> Recording:
    positions = table[:, :, :3].copy()
    if np.isinf(positions).any():
        frame = int(np.flatnonzero(np.isinf(positions).any(axis=(1, 2)))[0])
        raise MotionError(f"{file}, frame {frame}: a coordinate is infinite")
    if table.shape[2] > 3:
        positions[~(table[:, :, 3] >= _LEAST_VISIBILITY)] = np.nan
    joints = {name: positions[:, index] for name, index in _USED.items()}
    joints["Head"] = positions[:, _EARS].mean(axis=1)
    hips = positions[:, [23, 24]].mean(axis=1)
    _refuse_image(file, positions[:, [11, 12, 23, 24]], hips)
    names = ("left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist")
    return Recording(file, "mediapipe", joints, fps=fps, timestamps=times, up=_UP, names=names)


def _refuse_image(file: Path, trunk: FloatArray, hips: FloatArray) -> None:
    """World landmarks have their origin between the hips; image landmarks lie in 0..1."""
    seen = trunk[np.isfinite(trunk).all(axis=(1, 2))]
    middle = hips[np.isfinite(hips).all(axis=1)]
    if len(seen) and len(middle):
        inside = ((seen[:, :, :2] > 0.0) & (seen[:, :, :2] < 1.0)).mean()
        if inside > 0.95 and float(np.median(np.linalg.norm(middle[:, :2], axis=1))) > 0.15:
            raise MotionError(
                f"{file}: these are image landmarks (all within 0..1, hips away from the origin), whose depth is "
                "unknown; dump pose_world_landmarks instead"
            )
