"""Video: pictures to an ``.mp4`` by the ffmpeg that imageio-ffmpeg brings along."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.errors import OptionError, StorageError
from syda_gym.files import atomic_path

__all__ = ["write_video"]


def write_video(
    path: str | os.PathLike[str], pictures: Iterable[ArrayLike], fps: float = 30.0, *, key_frame_every: int = 0
) -> Path:
    """Writes an H.264 video that any browser plays.

    Args:
        path: ends in ``.mp4``.
        pictures: ``(height, width, 3)`` uint8 each, all of one size; odd sizes are cropped by one pixel, which H.264
            asks for.
        fps: pictures per second.
        key_frame_every: a picture of its own at least every so many, for those who jump about in the film; 0 leaves it
            to the encoder, whose film is smaller.

    Returns:
        The path.

    Raises:
        OptionError: no picture, pictures of different sizes or types, or a wrong ending.
        StorageError: the file cannot be written.
    """
    import imageio_ffmpeg

    target = Path(path)
    if target.suffix != ".mp4":
        raise OptionError(f"videos end in .mp4, got {target.name!r}")
    if not (np.isfinite(fps) and fps > 0.0):
        raise OptionError(f"fps must be positive, got {fps}")
    iterator = iter(pictures)
    first = _checked(next(iterator, None), None)
    height, width = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2
    with atomic_path(target) as temporary:
        writer = imageio_ffmpeg.write_frames(
            str(temporary),
            (width, height),
            fps=fps,
            codec="libx264",
            quality=8,
            macro_block_size=2,
            ffmpeg_log_level="error",
            # A browser can start before it has the whole file; pictures that wait for later ones would shift the rest.
            output_params=["-movflags", "+faststart"]
            + (["-g", str(key_frame_every), "-bf", "0"] if key_frame_every else []),
        )
        try:
            writer.send(None)
            writer.send(np.ascontiguousarray(first[:height, :width]))
            for picture in iterator:
                writer.send(np.ascontiguousarray(_checked(picture, first.shape)[:height, :width]))
        except (OSError, RuntimeError) as error:
            raise StorageError(f"ffmpeg could not write {target}: {error}") from error
        finally:
            writer.close()
        # ffmpeg may die without a word, on a full disk for example; what it left then is no film.
        if not _whole(temporary):
            raise StorageError(f"ffmpeg left no whole film for {target}; is the disk full?")
    return target


def _whole(path: Path) -> bool:
    """Whether an ``.mp4`` consists of whole boxes, an index (``moov``) and pictures (``mdat``) among them."""
    size, place, found = path.stat().st_size, 0, set()
    with path.open("rb") as file:
        while place + 8 <= size:
            file.seek(place)
            head = file.read(16)
            length, kind = int.from_bytes(head[:4], "big"), head[4:8]
            length = int.from_bytes(head[8:16], "big") if length == 1 else length
            if length < 8 or place + length > size:
                return False
            found.add(kind)
            place += length
    return place == size and {b"moov", b"mdat"} <= found


def _checked(picture: Any, shape: tuple[int, ...] | None) -> Any:
    if picture is None:
        raise OptionError("a video needs at least one picture; render the episode with render_mode='rgb_array'")
    array = np.asarray(picture)
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype != np.uint8 or min(array.shape[:2]) < 2:
        raise OptionError(f"pictures must be (height, width, 3) uint8, got {array.shape} {array.dtype}")
    if shape is not None and array.shape != shape:
        raise OptionError(f"all pictures must have one size; got {array.shape} after {shape}")
    return array
