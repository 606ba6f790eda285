"""From words to a moving robot: addresses, the simulated robot, keys and the command line."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from syda_gym.cli.main import app
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MotionError, OptionError, SydaError, TeleoperationError
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.teleoperation.addresses import make_sink, make_source, read_token
from syda_gym.teleoperation.incoming.network import UdpSource, WebSocketSource
from syda_gym.teleoperation.incoming.sources import ReplaySource
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.outgoing.bullet import BulletSink
from syda_gym.teleoperation.outgoing.naoqi import NaoqiSink
from syda_gym.teleoperation.outgoing.sinks import ManySinks, MemorySink, UdpSink
from syda_gym.teleoperation.session import Session, teleoperate
from syda_gym.teleoperation.tick import Decision, LoopSettings, State
from tests.teleoperation.conftest import LimbMapping


def test_addresses_become_sources(adult: HumanSkeleton) -> None:
    replay = make_source("replay:embedded", adult, actions=["wave_high"], calibration=1.0)
    assert isinstance(replay, ReplaySource)
    assert {clip.action for clip in replay.clips} == {"wave_high"}
    assert replay.stand == pytest.approx(1.25)
    udp = make_source("udp:9999", adult)
    assert isinstance(udp, UdpSource)
    assert (udp.host, udp.port) == ("127.0.0.1", 9999)
    assert isinstance(make_source("ws:[::1]:0", adult), WebSocketSource)
    away = make_source("udp:192.0.2.7:9999", adult, token="a long secret")
    assert isinstance(away, UdpSource)
    assert away.host == "192.0.2.7"
    for spec, message in (
        ("upd:9999", "did you mean 'udp'"),
        ("udp:localhost:http", "expected HOST:PORT"),
        ("udp:192.0.2.7:9999", "give a token"),
        ("udp:99999", "port must be"),
    ):
        with pytest.raises(OptionError, match=message):
            make_source(spec, adult)
    with pytest.raises(OptionError, match="did you mean 'wave_high'"):
        make_source("replay:embedded", adult, actions=["wave_hihg"])
    with pytest.raises(MotionError, match="no motions"):
        make_source("replay:/none.bvh", adult)


def test_a_foreign_recording_is_replayed_by_its_joints(adult: HumanSkeleton, shared_dir: Path) -> None:
    for name in ("kinect/laban_Ges01_wavehand.csv", "bvh/cmu_01_01.bvh"):
        source = make_source(f"replay:{shared_dir / 'data' / name}", adult)
        assert isinstance(source, ReplaySource)
        assert source.seconds > 3.0


def test_addresses_become_sinks(pepper: Robot, tmp_path: Path) -> None:
    many = make_sink(["none", "udp:9880", "naoqi:tcp://192.0.2.9:9559"], pepper)
    assert isinstance(many, ManySinks)
    assert [type(sink) for sink in many.sinks] == [MemorySink, UdpSink, NaoqiSink]
    video = make_sink([f"video:{tmp_path / 'a.mp4'}"], pepper)
    assert isinstance(video, BulletSink)
    for spec, message in (
        ("bulet", "did you mean 'bullet'"),
        ("video:a.avi", "end in .mp4"),
        ("udp:1.2.3.4:1", "token"),
    ):
        with pytest.raises(OptionError, match=message):
            make_sink([spec], pepper)
    if not os.environ.get("DISPLAY") and sys.platform.startswith("linux"):
        with pytest.raises(OptionError, match="needs a display"):
            make_sink(["window"], pepper).open()


def test_tokens_come_from_files(tmp_path: Path) -> None:
    assert read_token(None) is None
    (tmp_path / "token").write_text(" a long secret\n")
    assert read_token(tmp_path / "token") == "a long secret"
    (tmp_path / "empty").write_text("\n")
    with pytest.raises(TeleoperationError, match="is empty"):
        read_token(tmp_path / "empty")
    with pytest.raises(TeleoperationError, match="cannot read"):
        read_token(tmp_path / "none")


def test_the_simulated_robot_follows_and_is_filmed(pepper: Robot, tmp_path: Path) -> None:
    goal = pepper.clamp(pepper.rest + 0.3)[0]
    with BulletSink(pepper, video=tmp_path / "film.mp4", camera={"width": 160, "height": 120}) as sink:
        assert isinstance(sink, BulletSink)
        assert np.abs(sink.angles() - pepper.rest).max() < 0.02
        end = time.monotonic() + 60.0
        while np.abs(sink.angles() - goal).max() > 0.03:
            sink.send(Decision(0.0, State.FOLLOWING, goal))
            assert time.monotonic() < end
            time.sleep(0.05)
        sink.stop()
        held = sink.angles()
        sink.send(Decision(0.0, State.STOPPED, pepper.rest))
        time.sleep(0.2)
        assert np.abs(sink.angles() - held).max() < 0.02, "after an emergency stop it stays where it is"
    assert (tmp_path / "film.mp4").stat().st_size > 1000
    with pytest.raises(TeleoperationError, match="not open"):
        sink.angles()
    with pytest.raises(OptionError, match="rate must be"):
        BulletSink(pepper, rate=0.0)


def test_a_video_that_cannot_be_written_is_told_and_stops_nothing(pepper: Robot, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    sink = BulletSink(pepper, video=tmp_path / "file" / "film.mp4", camera={"width": 64, "height": 64})
    with sink:
        end, news = time.monotonic() + 60.0, list[str]()
        while not news and time.monotonic() < end:
            sink.send(Decision(0.0, State.FOLLOWING, pepper.rest))
            news += sink.news()
            time.sleep(0.02)
        assert news[0].startswith("film dropped")
        goal = pepper.clamp(pepper.rest + 0.3)[0]
        while np.abs(sink.angles() - goal).max() > 0.03:
            sink.send(Decision(0.0, State.FOLLOWING, goal))
            assert time.monotonic() < end, "the robot goes on without its film"
            time.sleep(0.02)


def test_a_run_starts_where_the_robot_is(mapping: LimbMapping, pepper: Robot) -> None:
    lifted = pepper.clamp(pepper.rest - 0.4)[0]

    class Lifted(MemorySink):
        def angles(self) -> np.ndarray:
            return lifted

    sink, started = Lifted(), list[Session]()
    stats = teleoperate(
        mapping, "replay:embedded", sink, settings=LoopSettings(calibration=0.5), seconds=0.4, on_start=started.append
    )
    assert np.abs(sink.decisions[0].command - lifted).max() < 1e-12
    assert sink.decisions[-1].state is State.RESTING
    assert stats.commands == len(sink.decisions)
    with pytest.raises(OptionError, match="at least one sink"):
        teleoperate(mapping, "replay:embedded", [])


def test_mappings_are_chosen_by_name(tmp_path: Path) -> None:
    chain, notices = choose_mapping("adult", "pepper", route=("adult", "kid", "pepper"), motions="embedded")
    assert chain.route == ("adult", "kid", "pepper")
    assert not notices
    with pytest.raises(OptionError, match="is no method"):
        choose_mapping("adult", "pepper", mapping="sida")
    with pytest.raises(TeleoperationError, match="live commands need a robot"):
        choose_mapping("adult", "kid")


def test_statistics_stay_small_and_right() -> None:
    stats = LiveStatistics(window=100)
    assert np.isnan(stats.percentile(50))
    assert stats.rate == 0.0
    for index in range(1000):
        stats.latency(0.001 * (index % 100))
        stats.command(index / 50, "following")
    assert stats.rate == pytest.approx(50.0)
    assert stats.percentile(100) == pytest.approx(0.099)
    assert stats.summary()["latency_p50_ms"] == pytest.approx(49.5)


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_keys_become_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    import pty

    from syda_gym.teleoperation.incoming.inbox import Inbox
    from syda_gym.teleoperation.screen import keyboard

    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        inbox = Inbox()
        with keyboard(inbox) as reading:
            assert reading
            os.write(ours, b"p x")
            got: tuple[str, ...] = ()
            end = time.monotonic() + 60.0
            while len(got) < 2 and time.monotonic() < end:
                got += inbox.take(0.1).controls
            assert got == ("pause", "stop")
            os.write(ours, b"q")
            while not inbox.closed and time.monotonic() < end:
                time.sleep(0.02)
            assert inbox.closed
    os.close(ours)


def test_the_command_line_runs_journals_and_checks(tmp_path: Path) -> None:
    journal = tmp_path / "run.jsonl"
    common = ["teleop", "--method", "geometric"]
    live = ["--sink", "none", "--action", "wave_high", "--calibration", "0.5", "--speed", "3"]
    result = CliRunner().invoke(app, [*common, *live, "--journal", str(journal)])
    assert result.exit_code == 0, result.output
    assert "latency median" in result.output
    assert "'following'" in result.output, "a fast replay is calibrated all the same"
    result = CliRunner().invoke(app, [*common, "--check-journal", str(journal)])
    assert result.exit_code == 0, result.output
    assert "are the same, bit for bit" in result.output
    lines = journal.read_text().splitlines()
    lines[-1] = lines[-1].replace('"q":[', '"q":[0.5,')[: len(lines[-1])]
    changed = lines[20].replace('"state":"', '"state":"resting","was":"')
    journal.write_text("\n".join([*lines[:20], changed, *lines[21:-1]]) + "\n")
    assert CliRunner().invoke(app, [*common, "--check-journal", str(journal)]).exit_code == 1


def test_the_command_line_adds_shows_and_lists_robots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from syda_gym.cli.main import app
    from syda_gym.embodiments import catalog
    from syda_gym.files import asset

    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path))
    monkeypatch.setattr(catalog, "_makers", dict(catalog._makers))
    result = CliRunner().invoke(app, ["robot", "add", str(asset("robots", "nao.urdf")), "--name", "mine"])
    assert result.exit_code == 0, result.output
    assert "record next" in result.output
    assert (tmp_path / "robots" / "mine.yaml").is_file()
    shown = CliRunner().invoke(app, ["robot", "show", "mine"])
    assert shown.exit_code == 0
    assert "LElbowRoll" in shown.output.replace("\n", "")
    assert "mine" in CliRunner().invoke(app, ["robot", "list"]).output
    catalog._build.cache_clear()


def test_the_command_line_records_a_pair(tmp_path: Path) -> None:
    from syda_gym.cli.main import app
    from syda_gym.motions import read_dataset

    out = tmp_path / "pairs"
    options = ["--sink", "none", "--action", "wave_high", "--countdown", "0.1", "--calibration", "0.5"]
    result = CliRunner().invoke(app, ["record", "--out", str(out), "--source", "replay:embedded", *options])
    assert result.exit_code == 0, result.output
    assert "mimic the robot now" in result.output
    assert "wave_high" in result.output
    assert len(read_dataset(out).pair("adult", "pepper")) > 40


def test_a_source_that_cannot_be_opened_is_said_before_anything_is_shown(
    adult: HumanSkeleton, pepper: Robot, tmp_path: Path
) -> None:
    """No page is opened, no table drawn, no journal begun for a run that cannot be."""
    begun: list[Session] = []
    journal = tmp_path / "run.jsonl"
    source = UdpSource(adult, "127.0.0.1", 0)
    source.hold()
    taken = UdpSource(adult, "127.0.0.1", source.port)
    with source, pytest.raises(TeleoperationError, match=str(source.port)):
        teleoperate(LimbMapping(adult, pepper), taken, MemorySink(), journal=journal, on_start=begun.append)
    assert not begun
    assert not journal.exists()
    done = CliRunner(env={"COLUMNS": "200"}).invoke(
        app, ["teleop", "--method", "geometric", "--source", "camera:97", "--sink", "none"]
    )
    assert isinstance(done.exception, SydaError)
    assert "latency" not in done.output


def test_a_source_is_held_once_and_freed_in_any_case(adult: HumanSkeleton, pepper: Robot) -> None:
    source = UdpSource(adult, "127.0.0.1", 0)

    def fails(_: Session) -> None:
        raise RuntimeError("the page")

    with pytest.raises(RuntimeError, match="the page"):
        teleoperate(LimbMapping(adult, pepper), source, MemorySink(), on_start=fails)
    again = UdpSource(adult, "127.0.0.1", source.port)
    again.hold()
    again.hold()
    again.close()
