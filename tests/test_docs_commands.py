"""Every ``syda-gym`` command of README and documentation runs, page by page, or it is listed here why not.

Commands that are only parsed (by ``test_docs.py``) stand in ``PARSED`` with the reason and, where there is one, the
test that runs the same thing smaller.
"""

from __future__ import annotations

import shlex
import shutil
import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

import syda_gym
from syda_gym.cli.main import app
from syda_gym.files import asset
from syda_gym.motions import write_dataset
from tests.motions import recordings
from tests.test_docs import commands

# Beginning of a command -> why it is not run.
PARSED = {
    "syda-gym demo": "minutes; `make demo` in CI",
    "syda-gym train": "minutes; tests/agents/test_work.py",
    "syda-gym tune": "minutes; tests/agents/test_work.py",
    "syda-gym benchmark study.yaml": "minutes to hours; tests/evaluation/benchmark",
    "syda-gym benchmark examples/paper_benchmark.yaml": "needs the paper's recordings; tests/evaluation",
    "syda-gym benchmark examples/route_choice.yaml": "minutes; tests/evaluation/benchmark/test_choice.py",
    "syda-gym compare study other": "needs two benchmarks; tests/evaluation/benchmark",
    "syda-gym suggest adult kid pepper --pair kid:pepper --benchmark": "needs a benchmark; tests/evaluation",
    "syda-gym export-episodes": "needs the extra data; tests/evaluation/data_sets",
    "syda-gym reproduce-paper": "needs the paper's recordings; tests/evaluation/paper",
    "syda-gym transferability --validate": "minutes; tests/evaluation/prediction",
    "syda-gym route --operator adult --robot nao": "fits and plays every link; tests/routes/test_measured.py",
    "syda-gym fit": "needs recordings of a person; tests/routes/piloting",
    "syda-gym motions info lab.txt": "needs a recording of a format of one's own; tests/motions/readers",
    "syda-gym motions info lab.csv": "needs a recording of a format of one's own; tests/motions/readers",
    "syda-gym teleop --source replay:lab.csv": "needs a file of one's own; tests/cli/groups/test_reading.py",
    "syda-gym record": "needs a person; tests/teleoperation/setup",
    "syda-gym motions pair": "needs recordings of a person; tests/motions/pairing",
    "syda-gym teleop --source camera --view": "needs a camera; tests/teleoperation/incoming/test_camera.py",
    "syda-gym teleop --source film:me.mp4 --view": "needs a film; tests/teleoperation/incoming/test_camera.py",
    "syda-gym teleop --robot nao --source udp:9870 --sink naoqi:tcp://nao.local:9559": "needs a robot; test_naoqi.py",
    "syda-gym teleop --source udp:9870 --sink window": "needs a screen",
    "syda-gym teleop --robot my-robot --source udp:9870 --sink window": "needs a screen",
}
# Beginning of a command -> options added to make it short; the last of two equal options counts.
SHORTER = {
    "syda-gym evaluate": "--clips 1 --physics servo",
    "syda-gym teleop --check-journal": "",
    "syda-gym teleop": "--seconds 1",
    "syda-gym export": "--agent-only",  # the mapping as a graph: tests/agents/test_work.py
}
# Names that the pages leave to the reader.
REPLACED = {"left_hand": "l_wrist", "right_hand": "r_wrist"}


def listed(command: str, table: dict[str, str]) -> str | None:
    """The entry of the longest beginning that fits."""
    found = [start for start in table if command == start or command.startswith(start + " ")]
    return max(found, key=len) if found else None


def pages() -> dict[str, list[str]]:
    """Page to its commands that are run, in the order in which they stand."""
    result: dict[str, list[str]] = {}
    for page, command in commands():
        command = shlex.join(shlex.split(command, comments=True))
        if command.startswith("syda-gym ") and listed(command, PARSED) is None:
            result.setdefault(page, []).append(command)
    return result


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One user's folder for all pages, with its cache of sampled workspaces."""
    return tmp_path_factory.mktemp("home")


@pytest.fixture
def place(tmp_path: Path, home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the pages take for granted."""
    monkeypatch.setenv("SYDA_GYM_HOME", str(home))
    monkeypatch.chdir(tmp_path)
    recordings.write_rows(tmp_path / "wave.csv", recordings.kinect_rows())
    shutil.copy(asset("robots", "nao.urdf"), tmp_path / "my_robot.urdf")
    (tmp_path / "runs" / "full").mkdir(parents=True)
    for suffix in (".json", ".safetensors"):
        shutil.copy(asset("agents", f"adult-pepper-full{suffix}"), tmp_path / "runs" / "full" / f"agent{suffix}")
    few = syda_gym.load_motions("embedded", fps=5)
    write_dataset(syda_gym.Motions("my-pairs", few.takes[:2], few.bodies, few.families, synthetic=True), "my-pairs")
    return tmp_path


def test_reasons_are_those_of_commands_on_the_pages() -> None:
    known = [shlex.join(shlex.split(command, comments=True)) for _, command in commands()]
    for start in (*PARSED, *SHORTER):
        assert any(command == start or command.startswith(start + " ") for command in known), f"no page has {start!r}"


@pytest.mark.parametrize("page", sorted(pages()))
@pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")
def test_commands_of_a_page_run(page: str, place: Path) -> None:
    port = free_port()
    for command in pages()[page]:
        start = listed(command, SHORTER)
        words = shlex.split(command)[1:] + shlex.split(SHORTER[start] if start else "")
        words = [REPLACED.get(word, word).replace("9870", str(port)).replace("9871", str(port)) for word in words]
        result = CliRunner(env={"COLUMNS": "160"}).invoke(app, words)
        assert result.exit_code == 0, f"{command}\n{result.output[-2000:]}\n{result.exception!r}"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
