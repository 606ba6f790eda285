"""Episodes as a LeRobotDataset v3.0, for imitation learning (https://github.com/huggingface/lerobot)."""

from __future__ import annotations

import json
import os
import secrets
import shutil
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.errors import MissingExtraError, OptionError, StorageError, nearest_name
from syda_gym.evaluation.data_sets import lerobot_format as layout
from syda_gym.evaluation.data_sets.lerobot_format import Feature
from syda_gym.evaluation.data_sets.lerobot_statistics import Colours, Statistics, statistics_of
from syda_gym.evaluation.data_sets.playing import Played, play
from syda_gym.evaluation.data_sets.scene import Exported, Scene, episode_seeds
from syda_gym.files import write_json, write_text

__all__ = ["export_lerobot"]

_ARROW = {"float32": "float32", "int64": "int64", "bool": "bool_"}


def export_lerobot(
    path: str | os.PathLike[str],
    scene: Scene,
    *,
    episodes: int = 0,
    cameras: Sequence[str] = ("front",),
    progress: Callable[[float], None] | None = None,
) -> Exported:
    """Plays episodes and stores them as ``LeRobotDataset("NAME", root=path)`` reads them.

    A row holds what was there before a command: ``observation.state`` (joint angles [rad], then joint speeds [rad/s]),
    ``observation.environment_state`` (the operator's newest frame, then the mapping's command [rad]) and one picture a
    camera; ``action`` is the command [rad] that followed; ``next.reward``, ``next.done`` and ``next.success`` what came
    of it. The task is the clip's action in words.

    Args:
        path: a new folder; it appears when it is complete.
        scene: what is played.
        episodes: how many; 0 for one a clip.
        cameras: names in ``lerobot_films.CAMERAS``; none for no films.
        progress: called with the share that is done.

    Raises:
        MissingExtraError: pyarrow is not installed.
        OptionError: an unknown camera, a control rate that is no whole number, or options that the environment refuses.
        StorageError: the folder exists, or it cannot be written.
    """
    try:
        import pyarrow
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("exporting episodes for LeRobot", "data") from error
    from syda_gym.evaluation.data_sets.lerobot_films import CAMERAS

    for camera in cameras:
        if camera not in CAMERAS:
            raise OptionError(f"unknown camera {camera!r}; {nearest_name(camera, CAMERAS)}")
    folder = Path(path)
    if folder.exists():
        raise StorageError(f"{folder} exists; choose a new folder, or remove that one")
    tell = progress or (lambda share: None)
    temporary = folder.with_name(f".{folder.name}-{secrets.token_hex(6)}")
    try:
        temporary.mkdir(parents=True)
        steps = _write(temporary, folder.name, scene, episodes, list(dict.fromkeys(cameras)), tell)
        os.replace(temporary, folder)
    except OSError as error:
        raise StorageError(f"cannot write {folder}: {error}; choose a folder you may write") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return Exported(len(steps), sum(steps), folder)


def _write(
    folder: Path, name: str, scene: Scene, episodes: int, cameras: list[str], tell: Callable[[float], None]
) -> list[int]:
    """Writes everything and returns the length of each episode."""
    from syda_gym.agents.classical.rivals import make_rival
    from syda_gym.agents.interface import Interface
    from syda_gym.embodiments.catalog import resolve
    from syda_gym.envs.teleop import SydaTeleopEnv
    from syda_gym.evaluation.data_sets.lerobot_films import CAMERAS, film_episodes

    env = SydaTeleopEnv(**scene.environment())
    try:
        fps = round(env.control_hz)
        if fps != env.control_hz:
            raise OptionError(f"LeRobot wants a whole number of frames per second, got control_hz={env.control_hz}")
        robot, operator = env.robot, resolve(env.options.operator)
        actor = make_rival(scene.agent, Interface.of(env))
        parts = 1 + len(cameras)
        todo = list(episode_seeds(scene.seed, len(env.clip_names), episodes))
        played = []
        for clip, seed in todo:
            played.append(play(env, actor, clip, seed))
            tell(len(played) / len(todo) / parts)
        labels = [entry.name for entry in env.layout.entries[env.layout["operator"]]]
    finally:
        env.close()
    colours: dict[str, list[Colours]] = {}
    features = _features(robot.joint_names, labels)
    for place, camera in enumerate(cameras):
        key, view = layout.IMAGES + camera, CAMERAS[camera]
        colours[key] = film_episodes(folder, key, view, played, robot, operator, fps)
        features[key] = layout.video_feature(view.width // 2 * 2, view.height // 2 * 2, fps)
        tell((2 + place) / parts)
    features |= layout.INDEX
    tasks = list(dict.fromkeys(_task(episode) for episode in played))
    rows = _rows(played, tasks, fps)
    _write_rows(folder, features, rows, [len(episode) for episode in played])
    _write_tasks(folder, tasks)
    _write_episodes(folder, played, rows, colours, fps)
    statistics: dict[str, Statistics] = {
        key: statistics_of(np.concatenate([episode[key] for episode in rows])) for key in rows[0]
    }
    statistics |= {key: Colours.together(seen).statistics() for key, seen in colours.items()}
    write_json(folder / layout.STATS, statistics)
    frames = sum(len(episode) for episode in played)
    described = layout.info_of(robot.name, fps, features, episodes=len(played), frames=frames, tasks=tasks)
    write_text(folder / layout.INFO, json.dumps(described, indent=4) + "\n")  # features in the order of the columns
    write_text(folder / "README.md", _card(name, scene, len(played), frames))
    return [len(episode) for episode in played]


def _features(joints: Sequence[str], operator: Sequence[str]) -> dict[str, Feature]:
    state = (*(f"{joint}.pos" for joint in joints), *(f"{joint}.vel" for joint in joints))
    shown = (*(label.removesuffix(", newest packet") for label in operator), *(f"{joint}.base" for joint in joints))
    return {
        "observation.state": Feature("float32", (len(state),), state),
        "observation.environment_state": Feature("float32", (len(shown),), shown),
        "action": Feature("float32", (len(joints),), tuple(f"{joint}.pos" for joint in joints)),
        "next.reward": Feature("float32", (1,)),
        "next.done": Feature("bool", (1,)),
        "next.success": Feature("bool", (1,)),
    }


def _task(episode: Played) -> str:
    """What the robot shall do, in words; files name actions ``wave_high``."""
    return f"Follow the operator: {episode.action.replace('_', ' ')}."


def _rows(played: Sequence[Played], tasks: Sequence[str], fps: int) -> list[dict[str, NDArray[Any]]]:
    """Numeric columns of each episode."""
    result, start = [], 0
    for number, episode in enumerate(played):
        length = len(episode)
        last = np.arange(length) == length - 1
        frame = np.arange(length, dtype=np.int64)
        result.append(
            {
                "observation.state": np.concatenate([episode.q, episode.qd], axis=1).astype(np.float32),
                "observation.environment_state": np.concatenate([episode.operator, episode.base], axis=1).astype(
                    np.float32
                ),
                "action": episode.command.astype(np.float32),
                "next.reward": episode.reward.astype(np.float32),
                "next.done": last,
                "next.success": last & episode.success,
                "timestamp": (frame / fps).astype(np.float32),
                "frame_index": frame,
                "episode_index": np.full(length, number, dtype=np.int64),
                "index": start + frame,
                "task_index": np.full(length, tasks.index(_task(episode)), dtype=np.int64),
            }
        )
        start += length
    return result


def _write_rows(
    folder: Path, features: dict[str, Feature], rows: Sequence[dict[str, NDArray[Any]]], lengths: Sequence[int]
) -> None:
    import pyarrow as pa

    def column(name: str, numbers: Sequence[int]) -> Any:
        values, feature = np.concatenate([rows[number][name] for number in numbers]), features[name]
        kind = getattr(pa, _ARROW[feature.dtype])()
        if values.ndim == 1:
            return pa.array(values, type=kind)
        return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1), type=kind), feature.shape[0])

    for (chunk, file), numbers in groupby(range(len(lengths)), layout.indices):
        some = list(numbers)
        table = pa.table({name: column(name, some) for name in rows[0]})
        _write_table(table, folder / layout.DATA.format(chunk_index=chunk, file_index=file))


def _write_tasks(folder: Path, tasks: Sequence[str]) -> None:
    """Tasks, the text being the table's index as pandas marks one: the format's loader looks it up by that."""
    import pyarrow as pa

    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())})
    marked = {
        "index_columns": ["task"],
        "column_indexes": [
            {"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
        ],
        "columns": [
            {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64",
             "metadata": None},
            {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object", "metadata": None},
        ],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.0.0",
    }  # fmt: skip
    _write_table(table.replace_schema_metadata({"pandas": json.dumps(marked)}), folder / layout.TASKS)


def _write_episodes(
    folder: Path,
    played: Sequence[Played],
    rows: Sequence[dict[str, NDArray[Any]]],
    colours: dict[str, list[Colours]],
    fps: int,
) -> None:
    import pyarrow as pa

    entries: list[dict[str, Any]] = []
    start, since = 0, 0.0
    for number, episode in enumerate(played):
        chunk, file = layout.indices(number)
        if number and (chunk, file) != layout.indices(number - 1):
            since = 0.0
        entry: dict[str, Any] = {
            "episode_index": number,
            "tasks": [_task(episode)],
            "length": len(episode),
            "motion": episode.motion,
            "seed": episode.seed,
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": start,
            "dataset_to_index": start + len(episode),
        }
        statistics = {key: statistics_of(values) for key, values in rows[number].items()}
        for key, seen in colours.items():
            entry[f"videos/{key}/chunk_index"], entry[f"videos/{key}/file_index"] = chunk, file
            entry[f"videos/{key}/from_timestamp"] = since
            entry[f"videos/{key}/to_timestamp"] = since + len(episode) / fps
            statistics[key] = seen[number].statistics()
        for key, figures in statistics.items():
            entry |= {f"stats/{key}/{figure}": value for figure, value in figures.items()}
        entry["meta/episodes/chunk_index"], entry["meta/episodes/file_index"] = 0, 0
        entries.append(entry)
        start, since = start + len(episode), since + len(episode) / fps
    path = folder / layout.EPISODES.format(chunk_index=0, file_index=0)
    _write_table(pa.Table.from_pylist(entries), path)


def _write_table(table: Any, path: Path) -> None:
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path, compression="snappy")


def _card(name: str, scene: Scene, episodes: int, frames: int) -> str:
    """What the data set is, where a hub shows it."""
    return (
        "---\ntask_categories:\n- robotics\ntags:\n- LeRobot\n- syda-gym\nconfigs:\n- config_name: default\n"
        "  data_files: data/*/*.parquet\n---\n\n"
        f"# {name}\n\n{episodes} episodes, {frames} frames of `SydaTeleop-v0` in LeRobotDataset {layout.CODEBASE}: "
        f"{scene.words()}\n\nMethod {scene.method}, agent {scene.agent}. A row holds what was there before a command: "
        "`observation.state` are joint angles [rad] and speeds [rad/s], `observation.environment_state` is the "
        "operator's newest frame and what the mapping asks for [rad], `action` is the command [rad].\n\n"
        f'`LeRobotDataset("{name}", root="FOLDER")` reads it.\n'
    )
