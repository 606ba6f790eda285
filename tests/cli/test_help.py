"""Help names the values that options take, and loads nothing heavy for it."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator

import pytest
import typer
from typer.testing import CliRunner

from syda_gym.cli import names
from syda_gym.cli.main import app

PROGRAM = typer.main.get_command(app)


def commands(group: object = PROGRAM, before: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], object]]:
    """Every command with its words."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*before, name))
        else:
            yield (*before, name), command


ALL = dict(commands())

VALUES = {
    "--method": [*names.METHODS, "general", "interpolation", "procrustes"],
    "--disturbances": [*names.CELLS, *names.LEVELS, *names.SINGLE_DISTURBANCES],
    "--motions": names.FORMATS,
    "--definition": names.DEFINITIONS,
    "--predictor": names.PREDICTORS,
    "--protocol": names.PROTOCOLS,
    "--config": names.CONFIGS,
    "--algorithm": names.ALGORITHMS,
    "--kind": names.KINDS,
    "--physics": names.PHYSICS,
    "--reference": names.REFERENCES,
    "--figure": names.FIGURES,
    "--axes": names.AXES,
    "--agent": names.RIVALS,
    "--base": names.ACTING,
    "--source": ["replay:", "udp:", "ws:"],
    "--sink": ["bullet", "window", "video:", "udp:", "naoqi:", "none"],
}
"""What help says of an option wherever it stands."""


@pytest.mark.parametrize("words", ALL, ids=" ".join)
def test_values_stand_in_every_help(words):
    for parameter in ALL[words].params:
        for option in parameter.opts:
            for value in VALUES.get(option, ()):
                assert f"`{value}" in parameter.help or f"{value}" in parameter.help, f"{option} does not tell {value}"
        assert parameter.help, f"{parameter.name} has no help"


def test_values_are_printed():
    shown = CliRunner(env={"COLUMNS": "200"}).invoke(app, ["train", "--help"]).output
    assert "kernel_ridge" in shown
    assert "noise+latency" in shown


def test_one_option_is_one_thing_everywhere():
    """Options of one name have the same form, repetition and help text in every command, but for the files named here.

    A new command takes its options from `syda_gym.cli.options`; an option that means something else needs another name.
    """
    told_apart = {
        "--out": "a folder, a film, a graph or a file of motions",
        "--mapping": "export puts one into the graph",
        "--route": "a data set has one chain",
        "--robot": "demo and motions pair take a robot of the motions",
        "--operator": "motions convert turns the recorded one into it",
        "--method": "reproduce-paper takes several",
        "--workers": "benchmark knows clusters",
        "--motions": "teleop fits on what was recorded by default",
    }
    seen: dict[str, tuple[str, object]] = {}
    for words, command in ALL.items():
        for parameter in command.params:
            long = next((opt for opt in parameter.opts if opt.startswith("--")), None)
            if long is None:
                continue
            meaning = () if long in told_apart else (parameter.multiple, parameter.metavar, parameter.help)
            now = (" ".join(words), (tuple(parameter.opts), *meaning))
            first = seen.setdefault(long, now)
            assert now[1] == first[1], f"{long} differs between {first[0]} and {now[0]}"


def test_whoever_takes_a_persons_file_takes_all_that_can_be_said_of_it():
    said = {"--fps", "--joints", "--unit", "--up", "--person", "--layout"}
    has = {
        words: said & {opt for parameter in command.params for opt in parameter.opts} for words, command in ALL.items()
    }
    assert all(found in (set(), said) for found in has.values())
    assert {" ".join(words) for words, found in has.items() if found} == {
        "motions info", "motions convert", "motions pair", "teleop", "train", "tune", "evaluate", "play",
        "transferability", "route",
    }  # fmt: skip


def test_no_old_spelling_is_an_option_still():
    options = {opt for command in ALL.values() for parameter in command.params for opt in parameter.opts}
    assert not options & {"--from", "--to", "--disturbance", "--prompts"}


def test_the_help_of_all_commands_loads_nothing_heavy():
    code = f"""
import json, sys
from typer.testing import CliRunner
from syda_gym.cli.main import app
for words in {[list(words) for words in ALL]!r}:
    assert CliRunner().invoke(app, [*words, "--help"]).exit_code == 0, words
heavy = {{"torch", "pybullet", "stable_baselines3", "matplotlib", "pinocchio", "scipy", "ray", "pandas", "yourdfpy"}}
ours = [m for m in sys.modules if m.startswith("syda_gym.") and m.split(".")[1] not in ("cli", "errors")]
ours = [m for m in ours if m not in ("syda_gym.envs", "syda_gym.envs.family")]  # names and numbers
print(json.dumps([sorted(heavy & set(sys.modules)), ours]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [[], []]
