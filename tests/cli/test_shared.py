"""Tables show units and every other bracket; they are made in one place."""

from __future__ import annotations

import ast
from pathlib import Path

from typer.testing import CliRunner

import syda_gym.cli
from syda_gym.cli.main import app
from syda_gym.cli.shared import say_written, show_table


def test_units_and_brackets_are_shown(capsys):
    show_table(("error [mm]", "joint [mrad]"), [("[red]1[/]", "a[b]")], title="of [x]", note="J = [mm]")
    shown = capsys.readouterr().out
    for words in ("error [mm]", "joint [mrad]", "[red]1[/]", "a[b]", "of [x]", "J = [mm]"):
        assert words in shown


def test_paths_are_shown_as_they_are(capsys):
    say_written("stored", "runs[1]/agent", "(done)")
    assert "stored: runs[1]/agent (done)" in capsys.readouterr().out


def test_no_command_makes_a_table_of_its_own():
    """A heading such as [mm] is markup to rich; only the shared functions know how to show it."""
    for file in Path(syda_gym.cli.__file__).parent.glob("*.py"):
        modules = [node.module for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.ImportFrom)]
        assert file.name == "shared.py" or "rich.table" not in modules, f"{file.name} makes its own table"


def test_evaluate_tells_units_and_what_j_is():
    words = ["evaluate", "lead", "--clips", "1", "--physics", "servo"]
    done = CliRunner(env={"COLUMNS": "200"}).invoke(app, words)
    assert done.exit_code == 0, done.output
    for text in (
        "landmark error [mm]",
        "joint error [mrad]",
        "jitter [mm/frame³]",
        "contacts [%]",
        "J = landmark error",
    ):
        assert text in done.stdout
    assert "0.05 x joint error [mrad]" in done.stdout
