"""Ctrl-C and SIGTERM, sent to real runs of every long command: one line that says where to go on, and nobody left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import pytest

from syda_gym.motions import save_motions
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX knows them")

MAIN = [sys.executable, "-c", "from syda_gym.cli.main import main; main()"]
PATIENCE = 600.0  # s, for a busy machine to get to work
STOP = 60.0  # s from the signal to the end


@pytest.fixture(scope="module")
def motions(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A few actions of three bodies as a file."""
    slow = load_motions("embedded", fps=10)
    actions = sorted({take.action for take in slow.takes})[::8]
    bodies = ("adult", "kid", "pepper")
    takes = tuple(
        type(take)(take.recording, take.action, take.fps, {b: take.frames[b] for b in bodies}, take.mirrored)
        for take in slow.takes
        if take.action in actions
    )
    path = tmp_path_factory.mktemp("motions") / "few.npz"
    save_motions(Motions("few", takes, {b: slow.bodies[b] for b in bodies}, slow.families, synthetic=True), path)
    return f"npz:{path}"


def session_of(leader: int) -> list[int]:
    """Everybody whom a command started, however deep, and the command itself."""
    lines = subprocess.run(["ps", "-eo", "pid=,sid=,stat="], capture_output=True, text=True).stdout.splitlines()
    rows = [line.split() for line in lines]
    return [int(pid) for pid, session, state in rows if int(session) == leader and not state.startswith("Z")]


def stopped(arguments: list[str], ready: Callable[[int], bool], how: signal.Signals) -> tuple[int, str]:
    """Runs a command until it is ready, stops it, and returns its exit code and what it said."""
    command = subprocess.Popen(
        [*MAIN, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + PATIENCE
    try:
        while not ready(command.pid):
            assert command.poll() is None, f"it ended too early: {command.communicate()[1]}"
            assert time.monotonic() < deadline, "it never got to work"
            time.sleep(0.05)
        time.sleep(1.0)  # into the work
        assert command.poll() is None, f"it ended too early: {command.communicate()[1]}"
        # A terminal sends Ctrl-C to the command and to everybody it started; a service manager asks the command.
        (os.killpg if how == signal.SIGINT else os.kill)(command.pid, how)
        _, said = command.communicate(timeout=STOP)
        deadline = time.monotonic() + STOP
        while session_of(command.pid):
            assert time.monotonic() < deadline, f"left behind: {session_of(command.pid)}"
            time.sleep(0.05)
    finally:
        for process in session_of(command.pid):
            os.kill(process, signal.SIGKILL)
    return command.returncode, said


def check(code: int, said: str, how: signal.Signals, words: str) -> None:
    assert code == 128 + how, said
    assert "Traceback" not in said
    lines = [line for line in said.splitlines() if "interrupted" in line]
    assert len(lines) == 1
    assert words in lines[0]


BOTH = pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])


@BOTH
def test_benchmark(motions, tmp_path, how):
    config, out = tmp_path / "config.yaml", tmp_path / "out"
    # One cell that is soon done, and others that take their time.
    config.write_text(
        "{routes: ['adult>pepper', 'kid>pepper', 'adult>kid'], methods: [geometric, direct], folds: 3,"
        "physics: servo, fit: {geometric: {confidence: false}}}"
    )
    arguments = ["benchmark", str(config), "--motions", motions, "--out", str(out), "--workers", "1"]
    code, said = stopped(arguments, lambda _: bool(list(out.glob("cells/*.json"))), how)
    check(code, said, how, "the same command goes on from there")
    assert not list(out.rglob(".*"))  # no lock and nothing half-written


@BOTH
def test_reproduce_paper(motions, tmp_path, how):
    out = tmp_path / "out"
    arguments = ["reproduce-paper", "--motions", motions, "--out", str(out), "--workers", "2", "--protocol", "loao"]
    for name in ("syda/general", "syda/nested"):
        arguments += ["--method", name]
    # The command, whoever tracks its resources, and two workers.
    code, said = stopped(arguments, lambda command: len(session_of(command)) >= 4, how)
    check(code, said, how, "the same command goes on from there")
    assert not list(out.rglob(".*"))


@BOTH
def test_train_stopped_in_its_first_leg_leaves_a_checkpoint(motions, tmp_path, how):
    out = tmp_path / "out"
    arguments = ["train", "--motions", motions, "--out", str(out), "--base", "lead", "--steps", "50000000"]
    code, said = stopped(arguments, lambda _: (out / "checkpoint.safetensors").is_file(), how)
    check(code, said, how, "stands at 0 steps; the same command with --resume goes on from there")
    assert not list(out.glob(".*"))


@BOTH
def test_demo(motions, tmp_path, how):
    out = tmp_path / "out"
    arguments = ["demo", "--motions", motions, "--out", str(out)]
    code, said = stopped(arguments, lambda _: (out / ".syda-gym.lock").is_file(), how)
    check(code, said, how, "run the demo again")
    assert not list(out.glob("*"))
