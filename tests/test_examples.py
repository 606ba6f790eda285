"""The examples run as a reader would run them: as scripts, from another folder."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "examples"
# Script -> arguments that keep it short, and a piece of what it prints.
RUNS: dict[str, tuple[list[str], str]] = {
    "make_and_step.py": ([], "mean landmark error"),
    "random_agent_video.py": (["film.mp4"], "film.mp4: 60 frames"),
    "fit_your_npz.py": ([], "unseen action"),
    "chain_by_hand.py": ([], "adult > kid > pepper"),
    "choose_a_route.py": ([], "record next"),
    "train_a_residual.py": (["6144"], "residual on unseen actions"),
    "sb3_from_scratch.py": (["1024"], "after 1024 steps"),
    "cleanrl_style_ppo.py": (["30720"], "return at the beginning"),
    "torchrl_ppo.py": (["2048"], "trained on 2048 steps"),
    "live_udp.py": (["4"], "median latency"),
    "new_robot.py": ([], "record next"),
}
# Script -> package that it needs and the house does not install.
NEEDS = {"torchrl_ppo.py": "torchrl"}
# Needs an environment of its own (RLlib pins another Gymnasium); it is parsed here and was run there.
APART = {"rllib_from_scratch.py"}


def test_every_example_is_tested() -> None:
    assert {path.name for path in FOLDER.glob("*.py")} == {*RUNS, *APART}


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.name)
def test_example_is_short_and_says_how_to_run_it(path: Path) -> None:
    text = path.read_text()
    assert len(text.splitlines()) <= 60
    assert f"examples/{path.name}" in (ast.get_docstring(ast.parse(text)) or "")


@pytest.mark.parametrize("script", sorted(RUNS))
def test_example_runs(script: str, tmp_path: Path) -> None:
    arguments, expected = RUNS[script]
    if script in NEEDS:
        pytest.importorskip(
            NEEDS[script], reason=f"SKIPPED LOUDLY: {NEEDS[script]} is not installed; {script} was not run"
        )
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg", "SYDA_GYM_HOME": str(tmp_path / "home")}
    result = subprocess.run(
        [sys.executable, FOLDER / script, *arguments],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert result.returncode == 0, result.stderr[-3000:]
    assert expected in result.stdout
    assert "Traceback" not in result.stderr
