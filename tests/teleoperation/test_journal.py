"""A journal replays into the same commands, bit for bit."""

from __future__ import annotations

import gzip
import json
import resource
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import TeleoperationError
from syda_gym.teleoperation.journal import Journal, read_journal, replay_journal
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import LoopSettings, Tick
from tests.teleoperation.conftest import LimbMapping

Wave = Callable[[float], FloatArray]


def play(path: Path, mapping: LimbMapping, adult: HumanSkeleton, wave: Wave) -> FloatArray:
    """A run with everything in it: calibration, noise, jitter, silence, low confidence, requests."""
    loop, rng = TeleoperationLoop(mapping, LoopSettings(cutoff=1.5)), np.random.default_rng(0)
    now, commands = 1e5, []
    controls = {250: ("pause",), 260: ("resume",), 300: ("stop",), 310: ("release", "resume"), 330: ("rest",)}
    with Journal(path, loop, {"made": "for a test"}) as journal:
        for index in range(380):
            now += float(rng.uniform(0.02, 0.05))
            frame = adult.standing() if index < 90 else wave((index - 90) / 30)
            quiet = 180 <= index < 240
            tick = Tick(
                now,
                None if quiet else frame + rng.normal(scale=0.004, size=18),
                None if index % 7 == 0 else now - 0.01,
                float(rng.uniform(0.3, 1.0)),
                controls.get(index, ()),
            )
            decision = loop.step(tick)
            journal.decided(tick, decision)
            commands.append(decision.command)
            if index % 50 == 0:
                journal.dropped(now, {"json": index})
    return np.array(commands)


@pytest.mark.parametrize("name", ["run.jsonl", "run.jsonl.gz"])
def test_a_replay_gives_the_same_bits(
    tmp_path: Path, mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, name: str
) -> None:
    commands = play(tmp_path / name, mapping, adult, wave)
    report = replay_journal(tmp_path / name, mapping)
    assert report.exact
    assert not report.damage
    assert (report.ticks, report.first_difference) == (380, None)
    assert report.commands.tobytes() == commands.tobytes()


def test_a_changed_command_or_frame_is_found(
    tmp_path: Path, mapping: LimbMapping, adult: HumanSkeleton, wave: Wave
) -> None:
    play(tmp_path / "run.jsonl", mapping, adult, wave)
    lines = (tmp_path / "run.jsonl").read_text().splitlines()
    where = next(i for i, line in enumerate(lines) if i > 150 and '"frame":[' in line)
    changed = json.loads(lines[where])
    changed["frame"][4] += 1e-6
    lines[where] = json.dumps(changed)
    (tmp_path / "run.jsonl").write_text("\n".join(lines) + "\n")
    report = replay_journal(tmp_path / "run.jsonl", mapping)
    assert not report.exact
    assert "not what was written" in report.damage
    assert report.first_difference == where + 1


def test_a_journal_cut_off_by_a_crash_is_read_up_to_there(
    tmp_path: Path, mapping: LimbMapping, adult: HumanSkeleton, wave: Wave
) -> None:
    for name in ("run.jsonl", "run.jsonl.gz"):
        play(tmp_path / name, mapping, adult, wave)
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) * 2 // 3])
        report = replay_journal(tmp_path / name, mapping)
        assert report.exact
        assert 100 < report.ticks < 380
        assert "no end mark" in report.damage


def test_another_mapping_another_file_or_a_broken_line_is_refused(
    tmp_path: Path, mapping: LimbMapping, adult: HumanSkeleton, pepper: Robot, wave: Wave
) -> None:
    path = tmp_path / "run.jsonl"
    play(path, mapping, adult, wave)
    with pytest.raises(TeleoperationError, match="give the mapping of that run"):
        replay_journal(path, LimbMapping(pepper, pepper))
    with pytest.raises(TeleoperationError, match="choose a new file"):
        Journal(path, TeleoperationLoop(mapping))
    with pytest.raises(TeleoperationError, match="no journal"):
        read_journal(tmp_path / "none.jsonl")
    (tmp_path / "other.txt").write_text("hello\n")
    with pytest.raises(TeleoperationError, match="not a journal"):
        read_journal(tmp_path / "other.txt")
    (tmp_path / "other.jsonl.gz").write_text("hello\n")
    with pytest.raises(TeleoperationError, match="not a journal"):
        read_journal(tmp_path / "other.jsonl.gz")
    lines = path.read_text().splitlines()
    lines[5] = '{"t": 1.0}'
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(TeleoperationError, match="line 6: not a decision"):
        replay_journal(path, mapping)


@pytest.mark.parametrize(
    ("key", "value"), [("mapping", None), ("settings", {"rate": [1]}), ("settings", {"speed": "x"}), ("start", ["a"])]
)
def test_a_first_line_with_values_of_other_kinds_is_refused(
    tmp_path: Path, mapping: LimbMapping, key: str, value: object
) -> None:
    path = tmp_path / "run.jsonl"
    Journal(path, TeleoperationLoop(mapping)).close()
    path.write_text(json.dumps(json.loads(path.read_text().splitlines()[0]) | {key: value}) + "\n")
    with pytest.raises(TeleoperationError, match="line 1: "):
        replay_journal(path, mapping)


def test_a_compressed_line_without_end_is_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "bomb.jsonl.gz"
    with gzip.open(path, "wb", compresslevel=1) as file:
        for _ in range(256):
            file.write(bytes(2**20))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(TeleoperationError, match="not a journal"):
        read_journal(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 << 10, "kilobytes"
