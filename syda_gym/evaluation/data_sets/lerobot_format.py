"""LeRobotDataset v3.0: where files lie and what ``meta/info.json`` says; the format's words and nothing else.

After the format's own documentation and loader (https://github.com/huggingface/lerobot, ``lerobot.datasets``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

__all__ = [
    "CODEBASE",
    "DATA",
    "EPISODES",
    "IMAGES",
    "INDEX",
    "INFO",
    "STATS",
    "TASKS",
    "VIDEOS",
    "Feature",
    "indices",
    "info_of",
    "video_feature",
]

CODEBASE = "v3.0"
INFO, STATS, TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
EPISODES = f"meta/episodes/{_FILE}.parquet"
DATA = f"data/{_FILE}.parquet"
VIDEOS = "videos/{video_key}/" + f"{_FILE}.mp4"
IMAGES = "observation.images."
"""What the name of a camera's feature begins with."""

_FILES_PER_CHUNK = 1000
_EPISODES_PER_FILE = (
    100  # about a megabyte of rows and a few dozen megabytes of film a file; the format allows 100, 500
)
_DATA_MB, _VIDEO_MB = 100, 500


@dataclass(frozen=True)
class Feature:
    """One column of the data set.

    Attributes:
        dtype: ``float32``, ``int64``, ``bool`` or ``video``.
        shape: of one row; ``(1,)`` for a number.
        names: of its parts, or ``None``.
        info: about a film.
    """

    dtype: str
    shape: tuple[int, ...]
    names: tuple[str, ...] | None = None
    info: dict[str, Any] | None = None

    def to_json(self) -> dict[str, Any]:
        """As ``info.json`` has it."""
        described = {
            "dtype": self.dtype,
            "shape": list(self.shape),
            "names": None if self.names is None else list(self.names),
        }
        return described if self.info is None else {**described, "info": self.info}


INDEX: dict[str, Feature] = {
    "timestamp": Feature("float32", (1,)),
    "frame_index": Feature("int64", (1,)),
    "episode_index": Feature("int64", (1,)),
    "index": Feature("int64", (1,)),
    "task_index": Feature("int64", (1,)),
}
"""Columns that every data set of the format has."""


def indices(episode: int) -> tuple[int, int]:
    """Chunk and file that an episode lies in, rows and films alike."""
    return divmod(episode // _EPISODES_PER_FILE, _FILES_PER_CHUNK)


def video_feature(width: int, height: int, fps: int) -> Feature:
    """The feature of one camera whose films are H.264."""
    return Feature(
        "video",
        (height, width, 3),
        ("height", "width", "channels"),
        {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": fps,
            "video.channels": 3,
            "has_audio": False,
        },
    )


def info_of(
    robot: str, fps: int, features: dict[str, Feature], *, episodes: int, frames: int, tasks: Sequence[str]
) -> dict[str, Any]:
    """What stands in ``meta/info.json``."""
    films = any(feature.dtype == "video" for feature in features.values())
    return {
        "codebase_version": CODEBASE,
        "robot_type": robot,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": len(tasks),
        "chunks_size": _FILES_PER_CHUNK,
        "data_files_size_in_mb": _DATA_MB,
        "video_files_size_in_mb": _VIDEO_MB,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": DATA,
        "video_path": VIDEOS if films else None,
        "features": {name: feature.to_json() for name, feature in features.items()},
    }
