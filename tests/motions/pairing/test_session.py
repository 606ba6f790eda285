"""A recording session: an operator's files and a robot's prompts become a paired data set."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from syda_gym.cli.main import app
from syda_gym.errors import MotionError
from syda_gym.motions import MotionClip, Motions, generate, load_motions, operator_clips, pair_session, save_motions
from tests.motions import recordings as rec

pytestmark = pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")

ACTIONS = ["wave_high", "drum", "push_side"]


@pytest.fixture(scope="module")
def performed() -> Motions:
    return generate(["adult", "pepper"], actions=ACTIONS, variants=2)


@pytest.fixture
def operators(performed: Motions) -> list[MotionClip]:
    """Late by 0.5 s, with names as a person would give."""
    clips = []
    for clip in performed.clips("adult"):
        late = np.concatenate([np.repeat(clip.frames[:1], 15, axis=0), clip.frames])
        name = f"{clip.action.replace('_', ' ')} take{clip.recording[-1]}"
        clips.append(replace(clip, frames=late, recording=name, action=name, filled=None))
    return clips


def test_recordings_find_their_prompts_and_are_aligned(performed: Motions, operators: list[MotionClip]) -> None:
    firsts = [clip for clip in performed.clips("pepper") if clip.recording.endswith("-01")]
    session = pair_session([c for c in operators if c.recording.endswith("1")], firsts, name="mine")
    assert sorted(take.action for take in session.motions.takes) == sorted(ACTIONS)
    assert not session.left_out
    assert all(0.25 < found.lag < 0.75 for found in session.alignments.values())
    assert {entry.verdict for entry in session.quality} == {"good"}
    assert max(abs(entry.lag) for entry in session.quality) < 0.04
    pair = session.motions.pair("adult", "pepper")
    assert list(pair.folds("loao"))
    assert "median lag" in session.motions.notes[0]


def test_repeats_of_one_prompt(performed: Motions, operators: list[MotionClip]) -> None:
    prompts = [clip for clip in performed.clips("pepper") if clip.recording == "drum-01"]
    session = pair_session(operators, prompts)
    assert [take.action for take in session.motions.takes] == ["drum", "drum"]
    assert len(session.left_out) == 4
    assert "bears no prompt's name" in next(iter(session.left_out.values()))


def test_the_longest_name_wins(performed: Motions) -> None:
    clip = performed.clips("adult")[0]
    robot = performed.clips("pepper")[0]
    prompts = [replace(robot, recording=name, action=name) for name in ("wave", "wave_high", "wave_highest")]
    session = pair_session([replace(clip, recording="wave_high-3", action="wave_high-3")], prompts)
    assert session.motions.takes[0].action == "wave_high"


@pytest.mark.parametrize(
    ("name", "belongs"),
    [
        ("drum", True),
        ("Drum 2", True),
        ("drum_take3", True),
        ("DRUM-T01", True),
        ("drums", False),
        ("drum_solo", False),
    ],
)
def test_names_that_belong(performed: Motions, name: str, belongs: bool) -> None:
    clip = replace(performed.clips("adult")[0], recording=name, action=name)
    prompts = [replace(performed.clips("pepper")[0], recording="drum", action="drum")]
    if belongs:
        assert pair_session([clip], prompts).motions.takes[0].action == "drum"
    else:
        with pytest.raises(MotionError, match="no recording matches"):
            pair_session([clip], prompts)


def test_nothing_matches(performed: Motions, operators: list[MotionClip]) -> None:
    strangers = [replace(clip, recording="salute", action="salute") for clip in operators]
    with pytest.raises(MotionError, match="no recording matches a prompt"):
        pair_session(strangers, performed.clips("pepper"))
    with pytest.raises(MotionError, match="operators must be clips of one body, got none"):
        pair_session([], performed.clips("pepper"))


def test_files_of_one_operator_become_one_body(tmp_path: Path) -> None:
    rec.write_rows(tmp_path / "wave_high.csv", rec.kinect_rows())
    rec.write_rows(tmp_path / "wave_high-2.csv", rec.kinect_rows(unit=1.06))
    (tmp_path / "readme.md").write_text("not a recording")
    clips = operator_clips(tmp_path, name="me")
    assert [clip.recording for clip in clips] == ["wave_high-2", "wave_high"]
    assert clips[0].body is clips[1].body
    assert clips[0].body.reach == pytest.approx(1.03 * 0.581, abs=1e-3)
    shoulders = [clip.body.arm_points(clip.frames)[0, :, 0].mean(axis=0) for clip in clips]
    np.testing.assert_allclose(shoulders[0], shoulders[1], atol=1e-9)


def test_several_humans_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match="expected exactly one operator"):
        operator_clips(generate(["adult", "kid"], actions=["drum"], variants=1))
    with pytest.raises(MotionError, match="holds no recordings"):
        operator_clips(tmp_path)


def test_from_the_command_line(tmp_path: Path) -> None:
    prompts = generate(["pepper"], actions=["wave_high", "drum"], variants=1)
    save_motions(prompts, tmp_path / "prompts.npz")
    (tmp_path / "me").mkdir()
    rec.write_rows(tmp_path / "me" / "wave_high.csv", rec.kinect_rows(count=100))
    words = ["motions", "pair", str(tmp_path / "me"), str(tmp_path / "prompts.npz"), "--out", str(tmp_path / "set")]
    result = CliRunner(env={"COLUMNS": "160"}).invoke(app, words)
    assert result.exit_code == 0, (result.output, result.exception)
    assert "good" in result.output
    pair = load_motions(tmp_path / "set").pair("operator", "pepper")
    assert pair.action_names == ("wave_high",)
    assert len(pair) > 60
