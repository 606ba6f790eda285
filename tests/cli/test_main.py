"""The command line: errors are one line and exit code 2, help is fast, commands do what they say."""

from __future__ import annotations

import re
import resource
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from syda_gym.cli.main import app

MAIN = [sys.executable, "-c", "from syda_gym.cli.main import main; main()"]


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*MAIN, *arguments], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("demo", "--motions", "paper:/no/such/folder"), "no folder"),
        (("benchmark", "/no/such/file.yaml"), "no benchmark configuration"),
        (("compare", "/no/a", "/no/b"), "benchmark.json is missing"),
    ],
)
def test_an_error_is_one_line_without_a_traceback(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = _run(*arguments)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    line = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(line) == 1
    assert words in line[0]


def test_help_loads_nothing_heavy():
    code = (
        "import sys\nfrom syda_gym.cli.main import app\nfrom typer.testing import CliRunner\n"
        "assert CliRunner().invoke(app, ['--help']).exit_code == 0\n"
        "heavy = {'torch', 'pybullet', 'stable_baselines3', 'matplotlib', 'pinocchio', 'scipy.stats', 'ray'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_version_and_no_command():
    runner = CliRunner()
    assert re.fullmatch(r"syda-gym \d+\.\d+\.\d+\S*\n", runner.invoke(app, ["--version"]).stdout)
    assert runner.invoke(app, []).exit_code == 2
    assert "No such command" in runner.invoke(app, ["demmo"]).output


def test_the_benchmark_command_shows_its_defaults_and_names_bad_keys(tmp_path):
    runner = CliRunner()
    shown = runner.invoke(app, ["benchmark", "--show"])
    assert "methods:" in shown.stdout
    assert "adult>kid>pepper" in shown.stdout
    file = tmp_path / "config.yaml"
    file.write_text("metods: [syda]")
    done = runner.invoke(app, ["benchmark", str(file)])
    assert "did you mean 'methods'" in str(done.exception)


def test_suggest_names_a_pair():
    done = CliRunner().invoke(app, ["suggest", "adult", "kid", "pepper", "--pair", "adult:kid"])
    assert done.exit_code == 0, done.output
    assert "pepper" in done.output
    wrong = CliRunner().invoke(app, ["suggest", "adult", "kid", "--pair", "adult"])
    assert wrong.exit_code == 2
    assert "--pair" in wrong.output


def test_help_is_fast():
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    assert _run("--help").returncode == 0
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 3.0  # processor time; about 0.6 s
