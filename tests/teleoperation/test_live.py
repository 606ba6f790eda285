"""Sources, loop and sinks together over loopback, with a network that loses, doubles, reorders and sends garbage."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from conftest import LimbMapping

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.motions.clip import MotionClip
from syda_gym.teleoperation.journal import Journal, replay_journal
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.packets import encode_frame, encode_request
from syda_gym.teleoperation.runner import run
from syda_gym.teleoperation.sinks import ManySinks, MemorySink, UdpSink
from syda_gym.teleoperation.sources import ReplaySource, UdpSource, WebSocketSource
from syda_gym.teleoperation.tick import LoopSettings, State

Wave = Callable[[float], FloatArray]


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(2.0)
        yield sock


def sender(
    port: int, packets: list[bytes], pause: float = 0.005, after: Callable[[], None] | None = None
) -> threading.Thread:
    """Sends in a thread; ``after`` all has arrived however busy the machine is."""

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            for packet in packets:
                sock.sendto(packet, ("127.0.0.1", port))
                time.sleep(pause)
        if after is not None:
            time.sleep(0.5)
            after()

    thread = threading.Thread(target=send)
    thread.start()
    return thread


def check(sink: MemorySink, robot: Robot) -> None:
    times = np.array([decision.now for decision in sink.decisions])
    path = np.array([decision.command for decision in sink.decisions])
    assert not robot.violations(path, 0.0).any()
    assert (np.abs(np.diff(path, axis=0)) <= robot.speed * np.diff(times)[:, None]).all()


def test_a_recording_drives_the_robot_at_its_own_speed(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot, tmp_path: Path
) -> None:
    frames = np.array([wave(i / 30) for i in range(30)])
    clip = MotionClip(adult, frames, 30.0, "wave", "r1")
    source, sink = ReplaySource([clip], stand=1.0), MemorySink()
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.8, ease=1.0))
    began = time.monotonic()
    with source, Journal(tmp_path / "run.jsonl", loop) as journal:
        stats = run(source, loop, sink, journal=journal)
    assert source.seconds == pytest.approx(2.0)
    assert 2.0 < time.monotonic() - began < 30.0
    assert stats.states["following"] > 5
    assert sink.decisions[-1].state is State.RESTING, "at the end it goes home"
    check(sink, pepper)
    assert replay_journal(tmp_path / "run.jsonl", mapping).exact


def test_udp_in_udp_out(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot, listener: socket.socket
) -> None:
    memory = MemorySink()
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.0))
    packets = [encode_frame(i, i * 0.01, wave(i * 0.01)) for i in range(100)]
    with (
        UdpSource(adult, port=0) as source,
        ManySinks([memory, UdpSink(pepper, port=listener.getsockname()[1])]) as sink,
    ):
        thread = sender(source.port, packets, 0.01, source.inbox.close)
        stats = run(source, loop, sink, seconds=30.0, rest_at_end=False)
        thread.join()
    assert stats.frames > 10
    check(memory, pepper)
    first = json.loads(listener.recv(65536))
    assert first["robot"] == "pepper"
    assert list(first["joints"]) == list(pepper.joint_names)
    seen = [first, *(json.loads(listener.recv(65536)) for _ in range(8))]
    assert [one["seq"] for one in seen] == list(range(9))
    assert list(seen[8]["joints"].values()) == list(memory.decisions)[8].command.tolist(), "bit for bit"


def test_a_bad_network_breaks_nothing(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot) -> None:
    rng = np.random.default_rng(0)
    packets: list[bytes] = []
    for i in range(250):
        if rng.random() > 0.3:
            packets.append(encode_frame(i, i * 0.005, wave(i * 0.02) + rng.normal(scale=0.01, size=18)))
        if rng.random() < 0.15 and packets:
            packets.append(packets[-1])
        if rng.random() < 0.15 and len(packets) > 3:
            packets[-1], packets[-3] = packets[-3], packets[-1]
        junk = [rng.bytes(50), b"x" * 30_000, b"{}", b'{"v":1,"seq":1,"t":0,"frame":[NaN]}', b""]
        if rng.random() < 0.3:
            packets.append(junk[int(rng.integers(len(junk)))])
    loop, sink = TeleoperationLoop(mapping, LoopSettings(calibration=0.0)), MemorySink()
    with UdpSource(adult, port=0) as source:
        thread = sender(source.port, packets, after=source.inbox.close)
        stats = run(source, loop, sink, seconds=60.0, rest_at_end=False)
        thread.join()
        dropped = source.inbox.dropped
    assert {"json", "oversized", "duplicate", "reordered"} <= set(dropped)
    assert dropped["value"] + dropped["shape"] + dropped["version"] > 0
    assert stats.frames > 10
    check(sink, pepper)


def test_requests_arrive_and_a_stop_reaches_the_sink(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave) -> None:
    stops: list[float] = []

    class Motors(MemorySink):
        def stop(self) -> None:
            stops.append(time.monotonic())

    loop, sink = TeleoperationLoop(mapping, LoopSettings(calibration=0.0)), Motors()
    packets = [encode_frame(i, i * 0.01, wave(0.5)) for i in range(20)]
    packets += [encode_request(20, 0.2, "stop"), *(encode_frame(21 + i, 0.21, wave(0.5)) for i in range(9))]
    with UdpSource(adult, port=0) as source:
        sender(source.port, packets, 0.01).join()
        run(source, loop, sink, seconds=0.5)
    assert len(stops) == 1
    assert sink.decisions[-1].state is State.STOPPED, "it stays stopped, the end of the run included"


def test_a_websocket_takes_the_same_packets_from_one_sender(adult: HumanSkeleton, wave: Wave) -> None:
    client = pytest.importorskip("websockets.sync.client")
    exceptions = pytest.importorskip("websockets.exceptions")
    with WebSocketSource(adult, port=0, token="a long secret", origins=("http://localhost:8000",)) as source:
        url = f"ws://127.0.0.1:{source.port}"
        with client.connect(url) as connection:
            connection.send(encode_frame(0, 0.0, wave(0.0), token="a long secret").decode())
            received = source.inbox.take(2.0)
            assert received.packet is not None
            assert (received.packet.frame == wave(0.0)).all()
            connection.send("garbage")
            assert json.loads(connection.recv(timeout=2.0)) == {"dropped": "json"}
            connection.send(encode_frame(1, 0.0, wave(0.0)))
            assert json.loads(connection.recv(timeout=2.0)) == {"dropped": "token"}
            with client.connect(url) as other:
                other.send(encode_frame(9, 0.0, wave(0.0), token="a long secret"))
                assert json.loads(other.recv(timeout=2.0)) == {"dropped": "stranger"}
            connection.send(b"x" * 20_000)
            with pytest.raises(exceptions.ConnectionClosed):
                connection.recv(timeout=2.0)
        with pytest.raises(exceptions.InvalidStatus):
            client.connect(url, origin="http://evil.example")
        client.connect(url, origin="http://localhost:8000").close()


@pytest.mark.parametrize("kind", [UdpSource, WebSocketSource])
def test_only_loopback_without_a_token(kind: type[UdpSource] | type[WebSocketSource], adult: HumanSkeleton) -> None:
    with pytest.raises(OptionError, match="give a token"):
        kind(adult, host="0.0.0.0")
    with pytest.raises(OptionError, match="at least 8"):
        kind(adult, host="0.0.0.0", token="short")
    assert kind(adult, host="0.0.0.0", token="long enough").host == "0.0.0.0"
    assert kind(adult, host="::1").host == "::1"


def test_addresses_that_cannot_be_used_are_named(adult: HumanSkeleton, pepper: Robot, listener: socket.socket) -> None:
    taken = listener.getsockname()[1]
    with pytest.raises(TeleoperationError, match=f"cannot listen on udp 127.0.0.1:{taken}"):
        UdpSource(adult, port=taken).start()
    with pytest.raises(OptionError, match="port must be"):
        UdpSink(pepper, port=0)
    with pytest.raises(OptionError, match="give a token"):
        UdpSink(pepper, host="192.0.2.1")
    with pytest.raises(TeleoperationError, match="not open"):
        UdpSink(pepper).send(None)  # type: ignore[arg-type]


def test_of_many_sinks_all_are_stopped_even_if_one_fails() -> None:
    stopped: list[int] = []

    class Bad(MemorySink):
        def stop(self) -> None:
            raise RuntimeError("no")

    class Good(MemorySink):
        def stop(self) -> None:
            stopped.append(1)

    with pytest.raises(RuntimeError, match="no"):
        ManySinks([Bad(), Good()]).stop()
    assert stopped == [1]


def test_a_replay_needs_one_body_and_a_speed(adult: HumanSkeleton) -> None:
    clip = MotionClip(adult, adult.standing()[None], 30.0, "a", "r")
    with pytest.raises(OptionError, match="exactly one body"):
        ReplaySource([])
    with pytest.raises(OptionError, match="replay speed"):
        ReplaySource([clip], speed=0.0)
    source = ReplaySource([clip], repeat=True)
    source.start()
    with pytest.raises(TeleoperationError, match="started already"):
        source.start()
    source.close()
