"""PoseModel: a person's landmarks in one picture, by MediaPipe's PoseLandmarker, offline and on the CPU."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.catalog import user_folder
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MissingExtraError, MotionError

__all__ = ["MODEL_NAME", "MODEL_VARIABLE", "Picture", "Pose", "PoseModel", "find_model"]

Picture = NDArray[np.uint8]
"""``(height, width, 3)``, red, green, blue."""

MODEL_NAME = "pose_landmarker_full.task"
MODEL_VARIABLE = "SYDA_GYM_POSE_MODEL"
_PAGE = "https://ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker#models"
_COUNT = 33


@dataclass(frozen=True, eq=False)
class Pose:
    """What the model sees of one person.

    Attributes:
        world: landmarks ``(33, 3)`` [m] about the middle of the hips; x to the picture's right, y down, z away from the
            camera.
        image: the same landmarks in the picture ``(33, 2)``, as shares of its width and height.
        visibility: how sure the model is that it sees each landmark ``(33,)``, 0 to 1.
    """

    world: FloatArray
    image: FloatArray
    visibility: FloatArray


def find_model(path: str | os.PathLike[str] | None = None) -> Path:
    """Where the model file lies: ``path``, else ``$SYDA_GYM_POSE_MODEL``, else the default place.

    Args:
        path: the user's choice.

    Raises:
        MotionError: it is not there; the message says where the official one is published and where to put it.
    """
    default = user_folder().parent / "models" / MODEL_NAME
    chosen = Path(path or os.environ.get(MODEL_VARIABLE) or default).expanduser()
    if not chosen.is_file():
        raise MotionError(
            f"no pose model {chosen}; download {MODEL_NAME} (Pose landmarker, Full) from {_PAGE} and put it there, "
            f"name it with --model, or set ${MODEL_VARIABLE}. syda-gym itself downloads nothing"
        )
    return chosen


class PoseModel:
    """Finds one person in pictures that follow each other.

    Args:
        model: the ``.task`` file; ``None`` for the default place, see ``find_model``.

    Raises:
        MissingExtraError: mediapipe is not installed.
        MotionError: the model file is missing or is no such model.
    """

    def __init__(self, model: str | os.PathLike[str] | None = None) -> None:
        file = find_model(model)
        with _silence():  # MediaPipe's C++ writes to the terminal whatever one asks of it
            try:
                import mediapipe
                from mediapipe.tasks.python import BaseOptions, vision
            except ImportError as error:
                raise MissingExtraError("finding a person in pictures", "camera") from error
            options = vision.PoseLandmarkerOptions(
                base_options=BaseOptions(model_asset_path=str(file)), running_mode=vision.RunningMode.VIDEO
            )
            try:
                self._landmarker: Any = vision.PoseLandmarker.create_from_options(options)
            except Exception as error:  # MediaPipe raises RuntimeError, ValueError and more for a broken file
                raise MotionError(
                    f"{file} is no pose model that MediaPipe can load ({' '.join(str(error).split())[:120]}); download "
                    f"{MODEL_NAME} from {_PAGE}"
                ) from error
        self._image = mediapipe.Image
        self._format = mediapipe.ImageFormat.SRGB
        self._stamp = -1
        self._spoken = False
        self._lock = threading.Lock()

    def __call__(self, picture: Picture, time: float) -> Pose | None:
        """Looks at one picture.

        Args:
            picture: ``(height, width, 3)`` uint8.
            time: of the picture [s]; a later one than that of the picture before.

        Returns:
            The person, or ``None`` if none is seen.
        """
        with self._lock:
            if self._landmarker is None:
                return None
            self._stamp = max(self._stamp + 1, round(1e3 * time))  # the model insists that time goes on
            image = self._image(image_format=self._format, data=np.ascontiguousarray(picture))
            quiet = contextlib.nullcontext() if self._spoken else _silence()
            with quiet:
                found = self._landmarker.detect_for_video(image, self._stamp)
            self._spoken = self._spoken or bool(found.pose_world_landmarks)
        if not found.pose_world_landmarks:
            return None
        world, seen = found.pose_world_landmarks[0], found.pose_landmarks[0]
        table = np.array([(p.x, p.y, p.z, min(p.visibility, p.presence)) for p in world])
        if table.shape != (_COUNT, 4) or not np.isfinite(table).all():
            return None
        return Pose(table[:, :3], np.array([(p.x, p.y) for p in seen]), np.clip(table[:, 3], 0.0, 1.0))

    def close(self) -> None:
        """Frees the model; harmless when repeated."""
        with self._lock:
            landmarker, self._landmarker = self._landmarker, None
            if landmarker is not None:
                with _silence():
                    landmarker.close()

    def __enter__(self) -> PoseModel:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keeps what C++ code says on the standard error from the terminal, and Python's own words as they are."""
    try:
        kept = os.dup(2)
    except OSError:  # no standard error at all
        yield
        return
    sys.stderr.flush()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
