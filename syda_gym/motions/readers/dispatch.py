"""Reading a file whose kind is told by its content, under the name that a person gave it or that was found."""

from __future__ import annotations

from pathlib import Path

from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.landmarks.arrays import read_arrays_of_points
from syda_gym.motions.readers.landmarks.read import is_json, read_json_landmarks
from syda_gym.motions.readers.said import NOTHING_SAID, Said
from syda_gym.motions.readers.skeleton import motions_from
from syda_gym.motions.readers.tables.read import table_recording
from syda_gym.motions.readers.text import first_bytes

__all__ = ["read_azure", "read_keypoints", "read_mediapipe"]


def read_mediapipe(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads 33 world landmarks of MediaPipe: JSON, JSON lines, tables in every style of columns, ``.npy``, ``.npz``.

    Raises:
        MotionError: missing, damaged, other points, or places in a picture.
    """
    return _read(Path(path), said, "mediapipe")


def read_azure(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads 32 joints of Azure Kinect: JSON of the offline processor, or tables.

    Raises:
        MotionError: missing, damaged, or other points.
    """
    return _read(Path(path), said, "azure")


def read_keypoints(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads points in space of other trackers: COCO, Human3.6M, SMPL, OpenPose and more, as JSON, arrays or tables.

    Raises:
        MotionError: missing, damaged, or no known order of points.
    """
    return _read(Path(path), said, None)


def _read(file: Path, said: Said, format: str | None) -> Motions:
    start = first_bytes(file, 8)
    if start[:2] == b"PK" or start[:6] == b"\x93NUMPY":
        return read_arrays_of_points(file, said, format)
    if not file.is_file():
        raise MotionError(f"no file {file}; expected landmarks")
    if is_json(file):
        return read_json_landmarks(file, said, format)
    return motions_from(table_recording(file, said, format), said)
