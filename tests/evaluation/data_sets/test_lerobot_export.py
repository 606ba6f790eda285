"""Episodes as a LeRobotDataset v3.0, read back by the format's published schema: every file, column and figure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syda_gym.errors import OptionError, StorageError
from syda_gym.evaluation.data_sets import lerobot_format
from syda_gym.evaluation.data_sets.lerobot_export import export_lerobot
from syda_gym.evaluation.data_sets.lerobot_statistics import QUANTILES, Colours, statistics_of
from syda_gym.evaluation.data_sets.playing import play
from syda_gym.evaluation.data_sets.scene import Scene, episode_seeds

pq = pytest.importorskip("pyarrow.parquet", reason="SKIPPED LOUDLY: needs pip install 'syda-gym[data]'")

SCENE = Scene(
    seed=3,
    disturbance="teleop:noise:test",
    options={"physics": "servo", "actions": ["wave_high", "drum"], "mapping": "geometric", "preset": None},
)
EPISODES = 3
CAMERA = "observation.images.scene"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lerobot") / "waves"
    shares: list[float] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lerobot_format, "_EPISODES_PER_FILE", 2)
        exported = export_lerobot(path, SCENE, episodes=EPISODES, cameras=["scene"], progress=shares.append)
    assert exported.path == path
    assert exported.episodes == EPISODES
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    return path


def info(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "meta" / "info.json").read_text())


def table(folder: Path, kind: str) -> Any:
    import pyarrow as pa

    parts = sorted((folder / kind).glob("chunk-*/file-*.parquet"))
    return pa.concat_tables([pq.read_table(part) for part in parts])


def test_info_says_what_lies_where(folder: Path) -> None:
    said, rows = info(folder), table(folder, "data")
    assert said["codebase_version"] == "v3.0"
    assert said["robot_type"] == "pepper"
    assert said["fps"] == 30
    assert said["total_episodes"] == EPISODES
    assert said["total_frames"] == rows.num_rows
    assert said["total_tasks"] == 2
    assert said["splits"] == {"train": f"0:{EPISODES}"}
    for episode, (chunk, file) in enumerate([(0, 0), (0, 0), (0, 1)]):
        data = pq.read_table(folder / said["data_path"].format(chunk_index=chunk, file_index=file))
        assert episode in data["episode_index"].to_pylist()
        assert (folder / said["video_path"].format(video_key=CAMERA, chunk_index=chunk, file_index=file)).is_file()
    assert {path.name for path in folder.iterdir()} == {"data", "meta", "videos", "README.md"}


def test_every_column_is_what_its_feature_says(folder: Path) -> None:
    features, rows = info(folder)["features"], table(folder, "data")
    assert [name for name, feature in features.items() if feature["dtype"] != "video"] == rows.column_names
    for name in rows.column_names:
        feature, kind = features[name], rows.schema.field(name).type
        if feature["shape"] == [1]:
            assert str(kind) == {"float32": "float", "int64": "int64", "bool": "bool"}[feature["dtype"]]
            continue
        assert kind.list_size == feature["shape"][0] == len(feature["names"]) == len(set(feature["names"]))
        assert str(kind.value_type) == "float"
    film = features[CAMERA]
    assert film["shape"] == [360, 480, 3]
    assert film["info"]["video.codec"] == "h264"


def test_rows_are_the_episodes_as_they_were_played(folder: Path) -> None:
    """Played again with the same seeds: the state before each command, the command, and what came of it."""
    from syda_gym.agents.agent import BaseAlone
    from syda_gym.agents.interface import Interface
    from syda_gym.envs.teleop import SydaTeleopEnv

    env, rows = SydaTeleopEnv(**SCENE.environment()), table(folder, "data")
    starts = 0
    for number, (clip, seed) in enumerate(episode_seeds(SCENE.seed, len(env.clip_names), EPISODES)):
        played = play(env, BaseAlone(Interface.of(env)), clip, seed)
        stored = rows.slice(starts, len(played))
        assert set(stored["episode_index"].to_pylist()) == {number}
        state = np.array(stored["observation.state"].to_pylist(), dtype=np.float32)
        shown = np.array(stored["observation.environment_state"].to_pylist(), dtype=np.float32)
        action = np.array(stored["action"].to_pylist(), dtype=np.float32)
        n = env.robot.n_features
        np.testing.assert_array_equal(state[:, :n], played.q.astype(np.float32))
        np.testing.assert_array_equal(shown[:, -n:], played.base.astype(np.float32))
        np.testing.assert_array_equal(action, played.command.astype(np.float32))
        np.testing.assert_allclose(action, shown[:, -n:], atol=1e-5)  # the base alone
        np.testing.assert_array_equal(stored["next.reward"].to_numpy(), played.reward.astype(np.float32))
        np.testing.assert_array_equal(stored["frame_index"].to_numpy(), np.arange(len(played)))
        np.testing.assert_allclose(stored["timestamp"].to_numpy(), np.arange(len(played)) / 30, atol=1e-6)
        assert stored["next.done"].to_pylist() == [False] * (len(played) - 1) + [True]
        assert stored["next.success"].to_pylist()[-1] is played.success
        # A command is followed: what comes next is nearer to it than what was there.
        assert np.abs(state[1:, :n] - action[:-1]).mean() < np.abs(state[:-1, :n] - action[:-1]).mean()
        starts += len(played)
    env.close()
    assert starts == rows.num_rows
    np.testing.assert_array_equal(rows["index"].to_numpy(), np.arange(starts))


def test_tasks_are_looked_up_by_their_words(folder: Path) -> None:
    tasks = pq.read_table(folder / "meta" / "tasks.parquet")
    marked = json.loads(tasks.schema.metadata[b"pandas"])
    assert marked["index_columns"] == ["task"]
    words = dict(zip(tasks["task_index"].to_pylist(), tasks["task"].to_pylist(), strict=True))
    assert sorted(words.values()) == ["Follow the operator: drum.", "Follow the operator: wave high."]
    for episode in table(folder, "meta/episodes").to_pylist():
        rows = table(folder, "data").slice(episode["dataset_from_index"], episode["length"])
        assert {words[index] for index in rows["task_index"].to_pylist()} == set(episode["tasks"])


def test_episodes_say_where_their_rows_and_pictures_are(folder: Path) -> None:
    import imageio_ffmpeg

    episodes = table(folder, "meta/episodes").to_pylist()
    assert [e["episode_index"] for e in episodes] == list(range(EPISODES))
    assert [(e["data/chunk_index"], e["data/file_index"]) for e in episodes] == [(0, 0), (0, 0), (0, 1)]
    ends = {}
    for episode in episodes:
        assert episode["dataset_to_index"] - episode["dataset_from_index"] == episode["length"]
        place = (episode[f"videos/{CAMERA}/chunk_index"], episode[f"videos/{CAMERA}/file_index"])
        assert episode[f"videos/{CAMERA}/from_timestamp"] == pytest.approx(ends.get(place, 0.0))
        ends[place] = episode[f"videos/{CAMERA}/to_timestamp"]
        assert (episode["meta/episodes/chunk_index"], episode["meta/episodes/file_index"]) == (0, 0)
    for (chunk, file), end in ends.items():
        path = folder / info(folder)["video_path"].format(video_key=CAMERA, chunk_index=chunk, file_index=file)
        frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
        assert frames == round(end * 30)
        assert seconds == pytest.approx(end, abs=0.04)


def test_statistics_are_those_of_rows_and_pictures(folder: Path) -> None:
    said = json.loads((folder / "meta" / "stats.json").read_text())
    rows, episodes = table(folder, "data"), table(folder, "meta/episodes").to_pylist()
    assert set(said) == {*rows.column_names, CAMERA}
    action = np.array(rows["action"].to_pylist())
    np.testing.assert_allclose(said["action"]["mean"], action.mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(said["action"]["std"], action.std(axis=0), atol=1e-6)
    np.testing.assert_allclose(said["action"]["q90"], np.quantile(action, 0.9, axis=0), atol=1e-6)
    assert said["action"]["count"] == [len(action)]
    for figure in ("min", "max", "mean", "std", *QUANTILES):
        assert np.shape(said[CAMERA][figure]) == (3, 1, 1)
        assert 0.0 <= np.min(said[CAMERA][figure]) <= np.max(said[CAMERA][figure]) <= 1.0
        column = [e[f"stats/action/{figure}"] for e in episodes]
        assert np.shape(column) == (EPISODES, action.shape[1])
    means = np.array([e["stats/action/mean"] for e in episodes])
    lengths = np.array([e["length"] for e in episodes])
    np.testing.assert_allclose(lengths @ means / lengths.sum(), said["action"]["mean"], atol=1e-6)


def test_figures_of_colours_are_those_of_the_pixels() -> None:
    rng = np.random.default_rng(0)
    pictures = rng.integers(3, 250, (5, 30, 40, 3), dtype=np.uint8)
    halves = [Colours(), Colours()]
    for index, picture in enumerate(pictures):
        halves[index % 2].look(picture)
    found = Colours.together(halves).statistics()
    pixels = pictures[:, ::3, ::3].reshape(-1, 3) / 255.0
    for figure, expected in statistics_of(pixels).items():
        if figure != "count":
            np.testing.assert_allclose(np.reshape(found[figure], 3), expected, atol=2 / 255)
    np.testing.assert_allclose(np.reshape(found["std"], 3), pixels.std(axis=0), atol=1e-9)
    assert found["count"] == [5]


def test_what_cannot_be_exported_is_refused_and_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="choose a new folder"):
        export_lerobot(folder, SCENE)
    with pytest.raises(OptionError, match="did you mean 'front'"):
        export_lerobot(tmp_path / "a", SCENE, cameras=["frnt"])
    half = Scene(options={**SCENE.options, "control_hz": 37.5, "physics_hz": 300.0})
    with pytest.raises(OptionError, match="whole number"):
        export_lerobot(tmp_path / "a", half, episodes=1)
    assert not list(tmp_path.iterdir())
