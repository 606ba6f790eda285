"""Whatever fails beside the robot is dropped with a line, and the robot is never abandoned in motion."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.errors import TeleoperationError
from syda_gym.motions.clip import MotionClip
from syda_gym.teleoperation.incoming.inbox import Received
from syda_gym.teleoperation.incoming.sources import ReplaySource
from syda_gym.teleoperation.journal import Journal, replay_journal
from syda_gym.teleoperation.live_run import run
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.naoqi import NaoqiSink
from syda_gym.teleoperation.outgoing.sinks import ManySinks, MemorySink
from syda_gym.teleoperation.tick import Decision, LoopSettings, State
from tests.teleoperation.conftest import LimbMapping

Wave = Callable[[float], FloatArray]


class Fails(MemorySink):
    """Fails from a number of commands on."""

    def __init__(self, after: int) -> None:
        super().__init__()
        self.after, self.stops = after, 0

    def send(self, decision: Decision) -> None:
        super().send(decision)
        if len(self.decisions) > self.after:
            raise ConnectionError("cable out")

    def stop(self) -> None:
        self.stops += 1


@pytest.fixture
def source(adult: HumanSkeleton, wave: Wave) -> ReplaySource:
    return ReplaySource([MotionClip(adult, np.array([wave(1.0 + i / 30) for i in range(30)]), 30.0, "wave", "r1")])


@pytest.fixture
def loop(mapping: LimbMapping) -> TeleoperationLoop:
    return TeleoperationLoop(mapping, LoopSettings(calibration=0.0, soft_start=0.0, ease=1.0))


def home(sink: MemorySink, loop: TeleoperationLoop) -> bool:
    last = sink.decisions[-1]
    return last.state is State.RESTING and bool(np.abs(last.command - loop.robot.rest).max() < 1e-3)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a disk that is always full")
def test_a_full_disk_ends_the_journal_and_not_the_robot(source: ReplaySource, loop: TeleoperationLoop) -> None:
    class Full(Journal):
        def __init__(self) -> None:
            super().__init__(f"/tmp/syda-gym-test-{os.getpid()}-{time.monotonic_ns()}.jsonl", loop)
            self.path.unlink()
            self._file.close()
            self._file = open("/dev/full", "w")  # noqa: SIM115 - the journal closes it

    sink = MemorySink()
    with source:
        run(source, loop, sink, journal=Full())
    assert home(sink, loop)
    assert any("journal dropped" in notice and "No space" in notice for notice in loop.notices)


def test_a_screen_that_fails_is_dropped(source: ReplaySource, loop: TeleoperationLoop) -> None:
    calls: list[Decision] = []

    def screen(decision: Decision) -> None:
        calls.append(decision)
        raise OSError(5, "Input/output error")  # a terminal that was closed

    sink = MemorySink()
    with source:
        run(source, loop, sink, on_decision=screen)
    assert len(calls) == 1
    assert home(sink, loop)
    assert any("screen dropped" in notice for notice in loop.notices)


def test_one_of_several_sinks_is_left_out_and_the_others_go_on(source: ReplaySource, loop: TeleoperationLoop) -> None:
    good, bad = MemorySink(), Fails(5)
    many = ManySinks([bad, good])
    with source, many:
        run(source, loop, many)
        assert home(good, loop)
        assert len(bad.decisions) == 6
        assert bad.stops == 1, "it may hear a stop, if nothing else"
        many.stop()
        assert bad.stops == 2, "and hears the next one too"
    assert any("Fails GONE: cable out" in notice for notice in loop.notices)


def test_a_robot_that_is_gone_is_stopped_shown_and_told(source: ReplaySource, loop: TeleoperationLoop) -> None:
    sink, shown = Fails(10), list[str]()
    with source, pytest.raises(TeleoperationError, match="cable out"):
        run(source, loop, sink, on_decision=lambda _: shown.extend(loop.notices))
    assert sink.stops == 1
    assert any("ROBOT GONE" in notice for notice in shown)


def test_a_stop_that_fails_is_told_and_the_loop_stops_all_the_same(
    source: ReplaySource, loop: TeleoperationLoop
) -> None:
    class Deaf(MemorySink):
        def stop(self) -> None:
            raise RuntimeError("socket disconnected")

    sink = Deaf()
    with source:
        source.inbox.request("stop")
        run(source, loop, sink, seconds=0.3)
    assert {decision.state for decision in sink.decisions} == {State.STOPPED}
    assert any("USE THE ROBOT'S SWITCH" in notice for notice in loop.notices)


def test_a_source_that_fails_is_a_silent_one(source: ReplaySource, loop: TeleoperationLoop) -> None:
    sink, plain = MemorySink(), source.take

    def take(timeout: float) -> Received:
        if 5 < len(sink.decisions) < 60:
            raise RuntimeError("camera unplugged")
        return plain(timeout)

    source.take = take  # type: ignore[method-assign]
    with source:
        run(source, loop, sink)
    assert State.HOLDING in {decision.state for decision in sink.decisions}
    assert any("camera unplugged" in notice for notice in loop.notices)
    assert home(sink, loop)


def test_a_failure_that_nobody_foresaw_still_brings_the_robot_home(
    source: ReplaySource, loop: TeleoperationLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    sink, plain, broken = MemorySink(), loop.settle, [True]

    def settle() -> None:
        if len(sink.decisions) == 20 and broken.pop():
            raise MemoryError("odd")
        plain()

    monkeypatch.setattr(loop, "settle", settle)
    broken.insert(0, False)
    with source, pytest.raises(MemoryError):
        run(source, loop, sink)
    assert home(sink, loop)


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signals_end_gently_and_never_between_a_command_and_its_record(
    mapping: LimbMapping, source: ReplaySource, loop: TeleoperationLoop, tmp_path: Path, name: str
) -> None:
    number = getattr(signal, name)
    before = signal.getsignal(number)

    class Slow(MemorySink):
        def send(self, decision: Decision) -> None:
            super().send(decision)
            if len(self.decisions) == 12:
                os.kill(os.getpid(), number)  # a command is out, its record is not
                time.sleep(0.01)

    sink = Slow()
    with source, Journal(tmp_path / "run.jsonl.gz", loop) as journal:
        run(source, loop, sink, journal=journal)
    assert signal.getsignal(number) == before
    assert home(sink, loop)
    assert sink.decisions[13].state in (State.EASING, State.RESTING), "it ended there and then"
    report = replay_journal(tmp_path / "run.jsonl.gz", mapping)
    assert report.exact
    assert not report.damage
    assert report.ticks == len(sink.decisions), "each command has its record"


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_a_compressed_journal_is_on_the_disk_every_second(tmp_path: Path) -> None:
    program = """
import numpy as np, os, signal, sys
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.embodiments import catalog
from syda_gym.teleoperation import Journal, LoopSettings, Tick, TeleoperationLoop
loop = TeleoperationLoop(unfitted(catalog.get("adult"), catalog.get("pepper")), LoopSettings(calibration=0.0))
journal = Journal(sys.argv[1], loop)
for index in range(300):
    tick = Tick(index / 30, catalog.get("adult").standing())
    journal.decided(tick, loop.step(tick))
os.kill(os.getpid(), signal.SIGKILL)
"""
    path = tmp_path / "run.jsonl.gz"
    subprocess.run([sys.executable, "-c", program, str(path)], check=False)
    from syda_gym.embodiments import catalog
    from syda_gym.mappings.methods.unfitted import unfitted

    report = replay_journal(path, unfitted(catalog.get("adult"), catalog.get("pepper")))  # type: ignore[arg-type]
    assert report.exact
    assert report.ticks >= 270, "all but the last second"
    assert "no end mark" in report.damage


def test_the_last_word_to_a_naoqi_robot_is_the_stop(mapping: LimbMapping) -> None:
    said: list[str] = []

    class Motion:
        def setAngles(self, names: list[str], angles: list[float], speed: float) -> None:  # noqa: N802
            time.sleep(0.02)
            said.append("setAngles")

        def killAll(self, _async: bool = False) -> None:  # noqa: N802
            assert _async, "a stop must not wait for the network"
            said.append("killAll")

    import threading

    sink = NaoqiSink(mapping.target)  # type: ignore[arg-type]
    sink._motion = Motion()
    sink._thread = threading.Thread(target=sink._run, daemon=True)
    sink._thread.start()
    sink.send(Decision(0.0, State.FOLLOWING, mapping.target.rest))  # type: ignore[attr-defined]
    time.sleep(0.01)
    sink.stop()
    sink.send(Decision(0.0, State.STOPPED, mapping.target.rest))  # type: ignore[attr-defined]
    time.sleep(0.1)
    sink.close()
    assert said == ["killAll", "setAngles", "killAll"]
