"""Old spellings work, say once on stderr what is written now, and leave everything else as it is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from syda_gym.cli.main import app
from syda_gym.cli.spellings import OLD_SPELLINGS, rewritten
from syda_gym.motions import load_motions

PROGRAM = typer.main.get_command(app)


def read(words: str) -> dict[str, object]:
    """The values that a command gets, without running it."""
    parts = words.split()
    context, group = PROGRAM.make_context("syda-gym", list(parts)), PROGRAM
    while hasattr(group, "commands"):
        name = parts.pop(0)
        group = group.commands[name]
        context = group.make_context(name, list(parts), parent=context)
        if hasattr(group, "commands"):
            continue
    return dict(context.params)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("route --from kid --to nao", "route --operator kid --robot nao", "--operator instead of --from"),
        ("route --to=nao", "route --robot nao", "--robot instead of --to"),
        ("train --preset teleop", "train --config teleop", "--config instead of --preset"),
        ("train --mapping ridge", "train --method ridge", "--method instead of --mapping"),
        ("evaluate lead --mapping ridge", "evaluate lead --method ridge", "--method instead of --mapping"),
        ("play --mapping nearest", "play --method nearest", "--method instead of --mapping"),
        ("teleop --mapping geometric", "teleop --method geometric", "--method instead of --mapping"),
        (
            "export-episodes a/b-v0 --disturbance link:test",
            "export-episodes a/b-v0 --disturbances link:test",
            "--disturbances instead of --disturbance",
        ),
        (
            "reproduce-paper -m x --method syda/paper --method ridge/general",
            "reproduce-paper -m x --method syda:paper,ridge:general",
            "--method syda:paper instead of --method syda/paper",
        ),
        ("record pairs --prompts embedded", "record --out pairs --motions embedded", "--motions instead of --prompts"),
        ("record pairs", "record --out pairs", "--out pairs instead of the argument OUT"),
        ("motions convert a.csv b.npz --fps 30", "motions convert a.csv --out b.npz --fps 30", "--out b.npz"),
        ("motions pair a b c --robot nao", "motions pair a b --out c --robot nao", "--out c instead of"),
    ],
)
def test_old_and_new_mean_the_same(old, new, said, capsys):
    expected = read(new)
    assert "warning" not in capsys.readouterr().err
    assert read(old) == expected
    told = capsys.readouterr()
    assert said in told.err
    assert told.out == ""
    assert all(line.startswith("warning: write ") for line in told.err.splitlines())


def test_every_old_spelling_is_tried_above():
    marks = test_old_and_new_mean_the_same.pytestmark[0].args[1]
    tried = " ".join(f"{old} {said}" for old, _, said in marks)
    for old in OLD_SPELLINGS:
        assert old.old in tried, f"no case for {old.command} {old.old}"


def test_values_that_mean_the_new_thing_stay(tmp_path: Path, capsys):
    assert read(f"teleop --mapping {tmp_path}")["mapping"] == tmp_path
    assert read("train --preset paper")["preset"] == "paper"
    assert read("train --preset paper")["config"] == ""
    assert read("reproduce-paper -m x --method syda:paper")["method"] == ["syda:paper"]
    assert capsys.readouterr().err == ""


def test_nothing_behind_two_dashes_is_an_option():
    olds = [old for old in OLD_SPELLINGS if old.command == "route"]
    assert rewritten(olds, ["--", "--from", "a"]) == (["--", "--from", "a"], [])
    assert rewritten(olds, ["--from"]) == (["--from"], [])


def test_an_old_command_runs_and_json_stays_json():
    words = ["route", "--from", "adult", "--to", "pepper", "--pair", "adult:pepper", "--definition", "paper", "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["routes"][0]["bodies"] == ["adult", "pepper"]
    assert done.stderr.count("warning: ") == 2


def test_an_old_argument_is_still_written_to(tmp_path: Path):
    done = CliRunner().invoke(app, ["motions", "convert", "embedded", str(tmp_path / "a.npz"), "--fps", "5"])
    assert done.exit_code == 0, done.output
    assert load_motions(tmp_path / "a.npz").takes[0].fps == 5.0
    assert "--out" in done.stderr
