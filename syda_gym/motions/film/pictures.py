"""Pictures from a film or a camera, one after the other."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from syda_gym.errors import MissingExtraError, MotionError
from syda_gym.motions.film.pose_model import Picture

__all__ = ["CameraPictures", "FilmPictures", "Pictures", "Shot"]

_WIDTH, _HEIGHT = 640, 480
_LARGEST_SIDE = 640  # pixels; the model looks at 256, more only costs time


class Shot(NamedTuple):
    """One picture, and when it was taken [s] by the film's time; a camera's has none."""

    picture: Picture
    time: float | None


class Pictures(Protocol):
    """Where pictures come from; a camera of one's own needs these two methods and no more."""

    def read(self) -> Shot | None:
        """Waits for the next picture; ``None`` at a film's end, or when the camera is gone."""

    def close(self) -> None:
        """Frees the device or file."""


class FilmPictures:
    """The pictures of a film file.

    Args:
        path: ``.mp4``, ``.mov``, ``.avi``, ``.mkv`` or ``.webm``.

    Attributes:
        fps: pictures per second.
        count: how many pictures there are, as the file says; 0 if it does not.

    Raises:
        MissingExtraError: OpenCV, which comes with mediapipe, is not installed.
        MotionError: no such file, or no film.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        cv2 = _opencv()
        self.path = Path(path)
        if not self.path.is_file():
            raise MotionError(f"no film {self.path}; expected a file such as film.mp4")
        self._cv2 = cv2
        self._capture = cv2.VideoCapture(str(self.path))
        self.fps = float(self._capture.get(cv2.CAP_PROP_FPS)) if self._capture.isOpened() else 0.0
        self.count = max(0, int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))) if self._capture.isOpened() else 0
        if not 0.5 <= self.fps <= 1000.0:
            self.close()
            raise MotionError(f"{self.path} is no film that can be read; expected .mp4, .mov, .avi, .mkv or .webm")
        self._read = 0

    def read(self) -> Shot | None:
        """The next picture, or ``None`` at the end."""
        good, picture = self._capture.read()
        if not good:
            return None
        time = self._read / self.fps
        self._read += 1
        return Shot(_rgb(self._cv2, picture), time)

    def skip(self) -> bool:
        """Passes over a picture without decoding its colours; false at the end."""
        self._read += 1
        return bool(self._capture.grab())

    def close(self) -> None:
        """Closes the file; harmless when repeated."""
        self._capture.release()


class CameraPictures:
    """The pictures of a camera of this machine.

    Args:
        number: of the camera, 0 for the first.

    Raises:
        MissingExtraError: OpenCV, which comes with mediapipe, is not installed.
        MotionError: no such camera, or it gives no picture.
    """

    def __init__(self, number: int = 0) -> None:
        cv2 = _opencv()
        self._cv2 = cv2
        self._capture = cv2.VideoCapture(number)
        self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, _WIDTH)
        self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, _HEIGHT)
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if not self._capture.isOpened() or self.read() is None:
            self.close()
            raise MotionError(
                f"no picture from camera {number}; {_cameras()}. Is it plugged in, free, and may you read it? Without "
                "a camera: --source film:FILE.mp4 or --source replay:embedded"
            )

    def read(self) -> Shot | None:
        """Waits for the next picture; ``None`` when the camera is gone."""
        good, picture = self._capture.read()
        return Shot(_rgb(self._cv2, picture), None) if good else None

    def close(self) -> None:
        """Frees the camera; harmless when repeated."""
        self._capture.release()


def _opencv() -> Any:
    # One clear error of ours instead of a dozen lines of the drivers; read when OpenCV is loaded.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "FATAL")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ.setdefault("OPENCV_VIDEOIO_PRIORITY_OBSENSOR", "0")
    try:
        import cv2
    except ImportError as error:
        raise MissingExtraError("reading films and cameras", "camera") from error
    return cv2


def _rgb(cv2: Any, picture: Any) -> Picture:
    height, width = picture.shape[:2]
    share = _LARGEST_SIDE / max(height, width)
    if share < 1.0:
        picture = cv2.resize(picture, (round(share * width), round(share * height)), interpolation=cv2.INTER_AREA)
    result: Picture = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
    return result


def _cameras() -> str:
    if not sys.platform.startswith("linux"):
        return "check which cameras the system knows"
    found = sorted(Path("/dev").glob("video*"))
    return f"the system knows {', '.join(map(str, found))}" if found else "the system knows no camera (/dev/video*)"
