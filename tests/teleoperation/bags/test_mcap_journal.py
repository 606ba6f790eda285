"""Live runs as MCAP: read back by the ``mcap`` library, every topic, and by our own reader of bags."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import syda_gym
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.errors import TeleoperationError
from syda_gym.teleoperation.bags.export import export_journal
from syda_gym.teleoperation.bags.mcap_journal import TOPICS, McapJournal
from syda_gym.teleoperation.bags.messages import split_time
from syda_gym.teleoperation.journal import Journal
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.session import teleoperate
from syda_gym.teleoperation.tick import LoopSettings, Tick
from tests.teleoperation.conftest import LimbMapping

NEEDED = "SKIPPED LOUDLY: needs pip install 'syda-gym[ros]'"
reader = pytest.importorskip("mcap.reader", reason=NEEDED)
typesys = pytest.importorskip("rosbags.typesys", reason=NEEDED)

Wave = Callable[[float], FloatArray]


def play(folder: Path, mapping: LimbMapping, adult: HumanSkeleton, wave: Wave) -> FloatArray:
    """A run written both ways: calibration in centimetres, following, a silence, a pause, junk packets."""
    loop = TeleoperationLoop(mapping, LoopSettings())
    commands = []
    with Journal(folder / "run.jsonl", loop) as journal, McapJournal.of(folder / "live.mcap", loop) as bag:
        for index in range(240):
            now = 1000.0 + index / 30
            frame = 100.0 * (adult.standing() if index < 70 else wave((index - 70) / 30))
            quiet = 150 <= index < 190
            tick = Tick(now, None if quiet else frame, now - 0.01, 0.9, ("pause",) if index == 220 else ())
            decision = loop.step(tick)
            for each in (journal, bag):
                each.decided(tick, decision)
                if index == 100:
                    each.dropped(now, {"json": 3})
            commands.append(decision.command)
    return np.array(commands)


@pytest.fixture
def run(tmp_path: Path, mapping: LimbMapping, adult: HumanSkeleton, wave: Wave) -> tuple[Path, FloatArray]:
    return tmp_path, play(tmp_path, mapping, adult, wave)


def messages(path: Path) -> dict[str, list[tuple[float, Any]]]:
    """Topic to times [s] and messages, decoded by what the file itself says of its schemas."""
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    found: dict[str, list[tuple[float, Any]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file, validate_crcs=True).iter_messages():
            assert schema.name == TOPICS[channel.topic]
            if schema.encoding == "jsonschema":
                value: Any = json.loads(message.data)
                check(value, json.loads(schema.data))
            else:
                assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
                store.register(typesys.get_types_from_msg(schema.data.decode(), schema.name))
                value = store.deserialize_cdr(message.data, schema.name)
            found.setdefault(channel.topic, []).append((message.log_time * 1e-9, value))
    return found


def check(value: Any, schema: dict[str, Any]) -> None:
    """As a JSON schema's validator would, for the words that ours use; unknown keys are faults too."""
    kinds = {"object": dict, "array": list, "string": str, "number": int | float, "integer": int, "boolean": bool}
    wanted = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    assert any(value is None if kind == "null" else isinstance(value, kinds[kind]) for kind in wanted), (value, schema)
    if isinstance(value, dict):
        known = schema.get("properties", {})
        rest = schema.get("additionalProperties")
        for key, each in value.items():
            assert key in known or rest, f"{key} is not in the schema"
            check(each, known.get(key, rest))
    if isinstance(value, list):
        for each in value:
            check(each, schema["items"])


def test_commands_decisions_and_reasons_are_in_the_file(run: tuple[Path, FloatArray], mapping: LimbMapping) -> None:
    folder, commands = run
    found = messages(folder / "live.mcap")
    assert set(found) == set(TOPICS)
    joints = found["/joint_states"]
    assert np.array([m.position for _, m in joints]).tobytes() == commands.tobytes()
    assert tuple(joints[0][1].name) == mapping.target.joint_names
    assert joints[30][0] == pytest.approx(1001.0)
    assert joints[30][1].header.stamp.sec == 1001
    decisions = [m for _, m in found["/decision"]]
    assert {m["state"] for m in decisions} >= {"calibrating", "following", "holding", "easing", "paused"}
    assert decisions[160]["tracking"] is None
    assert decisions[160]["frame"] == []
    assert decisions[80]["age"] == pytest.approx(0.01)
    assert [m["controls"] for m in decisions].count(["pause"]) == 1
    assert found["/dropped"][0][1] == {"counts": {"json": 3}}
    words = [m.msg for _, m in found["/rosout"]]
    assert words[0].startswith("calibrating")
    assert any(text.startswith("following") for text in words)
    assert len(words) < 40, "only changes are said"
    assert "<robot" in found["/robot_description"][0][1].data


def test_the_operator_is_shown_calibrated(run: tuple[Path, FloatArray], adult: HumanSkeleton, wave: Wave) -> None:
    folder, _ = run
    for name in ("live.mcap", "later.mcap"):
        if name == "later.mcap":
            export_journal(folder / "run.jsonl", folder / name)
        found = messages(folder / name)
        now, message = next((t, m) for t, m in found["/tf"] if t > 1004.0)
        points = {t.child_frame_id: t.transform.translation for t in message.transforms}
        expected = adult.arm_points(wave(now - 1000.0 - 70 / 30))[0]
        for side, arm in zip(("left", "right"), expected, strict=True):
            for part, point in zip(("shoulder", "elbow", "hand"), arm, strict=True):
                seen = points[f"{side}_{part}"]
                np.testing.assert_allclose([seen.x, seen.y, seen.z], point, atol=0.02)
        scene = next(m for t, m in found["/operator"] if t == pytest.approx(now))
        assert len(scene["entities"][0]["spheres"]) == 6
        assert len(scene["entities"][0]["lines"]) == 3


def test_a_journal_exported_later_is_what_was_written_live(run: tuple[Path, FloatArray]) -> None:
    folder, _ = run
    exported = export_journal(folder / "run.jsonl", folder / "later.mcap")
    assert (exported.decisions, exported.damage) == (240, "")
    live, later = messages(folder / "live.mcap"), messages(folder / "later.mcap")
    assert live["/decision"] == later["/decision"]
    until = 1000.0 + 219.5 / 30  # paused from then on, and a paused loop keeps the frame that it had
    shown = [entry for entry in live["/operator"] if entry[0] < until]
    assert len(shown) > 100
    assert shown == [entry for entry in later["/operator"] if entry[0] < until]
    assert [m.msg for _, m in live["/rosout"]] == [m.msg for _, m in later["/rosout"]]


def test_our_own_reader_of_bags_finds_the_operator(run: tuple[Path, FloatArray], adult: HumanSkeleton) -> None:
    """Although the file holds JSON as well, which readers of ROS bags refuse."""
    folder, _ = run
    clip = syda_gym.load_motions(f"bag:{folder / 'live.mcap'}").clips("operator")[0]
    assert len(clip.frames) > 100
    np.testing.assert_allclose(clip.body.arm_lengths, adult.arm_lengths, rtol=0.02)


def test_metadata_says_what_the_run_was(run: tuple[Path, FloatArray]) -> None:
    with (run[0] / "live.mcap").open("rb") as file:
        data = next(entry for entry in reader.make_reader(file).iter_metadata() if entry.name == "syda_gym").metadata
    assert json.loads(data["route"]) == ["adult", "pepper"]
    assert json.loads(data["settings"])["rate"] == 30.0


def test_a_live_run_may_write_it_itself(tmp_path: Path, mapping: LimbMapping) -> None:
    path = tmp_path / "run.mcap"
    stats = teleoperate(
        mapping, "replay:embedded", ("none",), settings=LoopSettings(calibration=0.3), speed=4.0,
        actions=["wave_high"], journal=path, seconds=1.5,
    )  # fmt: skip
    assert len(messages(path)["/joint_states"]) == stats.summary()["commands"]
    with pytest.raises(TeleoperationError, match="choose a new file"):
        teleoperate(mapping, "replay:embedded", ("none",), journal=path, seconds=0.1)


def test_what_is_no_journal_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text("{}\n")
    with pytest.raises(TeleoperationError, match="not a journal"):
        export_journal(tmp_path / "a.jsonl", tmp_path / "a.mcap")
    assert {path.name for path in tmp_path.iterdir()} == {"a.jsonl"}


def test_times_are_split_without_a_carry() -> None:
    assert split_time(1.9999999999) == (2, 0)
    assert split_time(12.25) == (12, 250_000_000)
