"""The examples run as a reader would run them: as scripts, from another folder."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "examples"
# Script -> arguments that keep it short, and a piece of what it prints.
RUNS: dict[str, tuple[list[str], str]] = {
    "01_camera_to_pepper.py": (["3"], "film: camera_to_pepper.mp4"),
    "02_your_film.py": ([], "film: your_film.mp4"),
    "03_your_robot.py": ([], "film: your_robot.mp4"),
    "04_record_and_fit.py": ([], "error on unseen ones"),
    "05_which_body_to_pair.py": ([], "picture: which_body.png"),
    "06_make_and_step.py": ([], "film: make_and_step.mp4"),
    "07_train_a_residual.py": (["6144"], "residual on unseen actions"),
    "08_sb3_from_scratch.py": (["1024"], "after 1024 steps"),
    "09_benchmark_on_ray.py": (["1"], "page: benchmark_on_ray"),
    "10_export_to_lerobot.py": (["episodes", "2"], "film: episodes"),
    "cleanrl_style_ppo.py": (["10240"], "return at the beginning"),
    "torchrl_ppo.py": (["2048"], "trained on 2048 steps"),
    "live_udp.py": (["4"], "median latency"),
}
# Script -> package that it needs, and the extra it comes with.
NEEDS = {"10_export_to_lerobot.py": ("pyarrow", "'syda-gym[data]'"), "torchrl_ppo.py": ("torchrl", "torchrl")}
# Needs an environment of its own (RLlib pins another Gymnasium); it is parsed here and was run there.
APART = {"rllib_from_scratch.py"}


def test_every_example_is_tested() -> None:
    assert {path.name for path in FOLDER.glob("*.py")} == {*RUNS, *APART}


def test_the_numbered_ones_are_one_to_ten() -> None:
    assert [path.name[:2] for path in sorted(FOLDER.glob("[0-9]*.py"))] == [f"{number:02}" for number in range(1, 11)]


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.name)
def test_example_is_short_and_says_how_to_run_it(path: Path) -> None:
    text = path.read_text()
    assert len(text.splitlines()) <= 60
    assert f"examples/{path.name}" in (ast.get_docstring(ast.parse(text)) or "")


@pytest.mark.parametrize("script", sorted(RUNS))
def test_example_runs(script: str, tmp_path: Path) -> None:
    arguments, expected = RUNS[script]
    if script in NEEDS:
        module, package = NEEDS[script]
        pytest.importorskip(module, reason=f"SKIPPED LOUDLY: {script} needs pip install {package}")
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
    for name in re.findall(r"^(?:film|picture|page|saved): (\S+)$", result.stdout, re.MULTILINE):
        assert (tmp_path / name).stat().st_size > 1000, f"{name} was promised"
    assert "Traceback" not in result.stderr
