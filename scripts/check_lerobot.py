"""Asks LeRobot's own loader about a data set that ``export-episodes --format lerobot`` wrote.

    python -m venv lerobot-venv && lerobot-venv/bin/pip install lerobot
    lerobot-venv/bin/python scripts/check_lerobot.py FOLDER

LeRobot pins an older PyTorch, hence the environment of its own; nothing of syda_gym is needed there.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq


def main(root: Path) -> None:
    """Reads rows, films and single episodes, and compares the rows with the files."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    info = json.loads((root / "meta" / "info.json").read_text())
    rows = [pq.read_table(file) for file in sorted(root.glob("data/*/*.parquet"))]
    actions = np.concatenate([np.array(table["action"].to_pylist(), dtype=np.float32) for table in rows])
    data: Any = LeRobotDataset("me/checked", root=root, video_backend="pyav")
    assert (len(data), data.num_episodes) == (info["total_frames"], info["total_episodes"])
    for index in np.linspace(0, len(data) - 1, 5).astype(int).tolist():
        item = data[index]
        np.testing.assert_array_equal(np.asarray(item["action"]), actions[index])
        shapes = {key: tuple(item[key].shape) for key in data.meta.camera_keys}
        print(f"row {index}: {item['task']!r}, films {shapes}")
    ahead = [step / data.fps for step in range(4)]
    some: Any = LeRobotDataset(
        "me/checked",
        root=root,
        video_backend="pyav",
        episodes=[data.num_episodes - 1],
        delta_timestamps={"action": ahead},
    )
    chunk = some[0]["action"]
    first = int(data.meta.episodes[data.num_episodes - 1]["dataset_from_index"])
    np.testing.assert_array_equal(np.asarray(chunk), actions[first : first + 4])
    assert set(data.meta.stats) >= {"action", "observation.state", *data.meta.camera_keys}
    print(f"{len(data)} rows in {data.num_episodes} episodes, read by LeRobot as they were written")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
