"""Sources, loop and sinks together over loopback, with a network that loses, doubles, reorders and sends garbage."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.motions.clip import MotionClip
from syda_gym.teleoperation.incoming.network import UdpSource, WebSocketSource
from syda_gym.teleoperation.incoming.packets import encode_frame, encode_request
from syda_gym.teleoperation.incoming.sources import ReplaySource, Source
from syda_gym.teleoperation.journal import Journal, replay_journal
from syda_gym.teleoperation.live_run import run
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import ManySinks, MemorySink, UdpSink
from syda_gym.teleoperation.safety.punctuality import SPACING
from syda_gym.teleoperation.tick import Decision, LoopSettings, State
from tests.teleoperation.conftest import LimbMapping

Wave = Callable[[float], FloatArray]


PATIENCE = 60.0  # s; how long a test waits for what must come, on however busy a machine


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(PATIENCE)
        yield sock


class Network:
    """Sends packets over loopback, each when the one before was dealt with, and moves a clock of its own on."""

    def __init__(self) -> None:
        self.now = 0.0
        self.stats = LiveStatistics()

    def clock(self) -> float:
        return self.now

    def send(self, source: Source, port: int, packets: list[bytes], pause: float = 0.01) -> threading.Thread:
        """Sends in a thread and then closes the inbox."""

        def handled() -> int:
            return self.stats.frames + sum(source.inbox.dropped.values())

        def run() -> None:
            end = time.monotonic() + PATIENCE
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
                for number, packet in enumerate(packets):
                    self.now += pause
                    sock.sendto(packet, ("127.0.0.1", port))
                    while handled() <= number and time.monotonic() < end:
                        time.sleep(0.0005)
            source.inbox.close()

        thread = threading.Thread(target=run)
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
    with source, Journal(tmp_path / "run.jsonl", loop) as journal:
        time.sleep(0.2)  # a listener who is late misses nothing
        stats = run(source, loop, sink, journal=journal)
    assert source.seconds == pytest.approx(2.0)
    assert sink.decisions[-1].now - sink.decisions[0].now > 1.99
    late = source.inbox.dropped["overtaken"]  # by the next, where other work shares the machine
    assert stats.frames + late == 62, "of standing and waving, none is lost"
    assert late < 20
    assert stats.states["following"] >= 30 - late
    assert sink.decisions[-1].state is State.RESTING, "at the end it goes home"
    apart = np.diff([decision.now for decision in sink.decisions])
    assert apart.min() > 0.99 * SPACING / loop.settings.rate, "at the turn for home too: a hasty step makes it creep"
    check(sink, pepper)
    assert replay_journal(tmp_path / "run.jsonl", mapping).exact


def test_a_recording_waits_for_a_loop_that_is_late(adult: HumanSkeleton, wave: Wave) -> None:
    clip = MotionClip(adult, np.array([wave(i / 200) for i in range(12)]), 200.0, "wave", "r1")
    with ReplaySource([clip]) as source:
        seen, arrived = [], []
        while not source.inbox.closed:
            received = source.inbox.take(PATIENCE)
            if received.packet is not None:
                seen.append(received.packet.sequence)
                arrived.append(received.arrived)
            if len(seen) == 6:
                time.sleep(0.1)
    assert seen == list(range(12))
    assert (np.diff(arrived)[:5] > 0.0).all()
    assert not source.inbox.dropped


def test_udp_in_udp_out(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot, listener: socket.socket
) -> None:
    memory, network = MemorySink(), Network()
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.0))
    packets = [encode_frame(i, i * 0.01, wave(i * 0.01)) for i in range(100)]
    with (
        UdpSource(adult, port=0, clock=network.clock) as source,
        ManySinks([memory, UdpSink(pepper, port=listener.getsockname()[1])]) as sink,
    ):
        thread = network.send(source, source.port, packets)
        stats = run(source, loop, sink, statistics=network.stats, rest_at_end=False)
        thread.join()
    assert stats.frames == 100
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
    loop, sink, network = TeleoperationLoop(mapping, LoopSettings(calibration=0.0)), MemorySink(), Network()
    with UdpSource(adult, port=0, clock=network.clock) as source:
        thread = network.send(source, source.port, packets, pause=0.005)
        stats = run(source, loop, sink, statistics=network.stats, rest_at_end=False)
        thread.join()
        dropped = source.inbox.dropped
    assert {"json", "oversized", "duplicate", "reordered"} <= set(dropped)
    assert dropped["value"] + dropped["shape"] + dropped["version"] > 0
    assert stats.frames > 100
    assert stats.frames + sum(dropped.values()) == len(packets), "each was used or is accounted for"
    check(sink, pepper)


def test_requests_arrive_and_a_stop_reaches_the_sink(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave) -> None:
    stops: list[float] = []

    class Motors(MemorySink):
        def stop(self) -> None:
            stops.append(time.monotonic())
            source.inbox.close()

    loop, sink = TeleoperationLoop(mapping, LoopSettings(calibration=0.0)), Motors()
    packets = [encode_frame(i, i * 0.01, wave(0.5)) for i in range(20)]
    packets += [encode_request(20, 0.2, "stop"), *(encode_frame(21 + i, 0.21, wave(0.5)) for i in range(9))]
    with UdpSource(adult, port=0) as source, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for packet in packets:
            sock.sendto(packet, ("127.0.0.1", source.port))
        run(source, loop, sink, seconds=PATIENCE)
    assert len(stops) == 1
    assert sink.decisions[-1].state is State.STOPPED, "it stays stopped, the end of the run included"


def test_a_request_from_this_side_wakes_a_source_that_waits_for_the_network(adult: HumanSkeleton) -> None:
    with UdpSource(adult, port=0) as source:
        for act, expected in ((lambda: source.inbox.request("pause"), ("pause",)), (source.inbox.close, ())):
            timer = threading.Timer(0.05, act)
            timer.start()
            began = time.monotonic()
            assert source.take(PATIENCE).controls == expected
            assert time.monotonic() - began < PATIENCE, "it did not wait for a packet"
            timer.join()
        assert source.take(PATIENCE).packet is None, "closed, it waits no more"


def test_a_command_packet_is_json(pepper: Robot, listener: socket.socket) -> None:
    odd = replace(pepper.description, name='50 % "off"')
    sink = UdpSink(Robot(odd), port=listener.getsockname()[1], token="a secret of 100 %")
    command = np.linspace(-1.0, 1.0, pepper.n_features) / 3.0
    with sink:
        sink.rehearse()
        for now in (0.1, 2.0):
            sink.send(Decision(now, State.HOLDING, command))
            sink.rehearse()
    received = [json.loads(listener.recv(65536)) for _ in range(2)]
    joints = dict(zip(pepper.joint_names, command.tolist(), strict=True))
    assert received == [
        {"v": 1, "seq": seq, "t": now, "robot": '50 % "off"', "state": "holding", "joints": joints,
         "token": "a secret of 100 %"}
        for seq, now in enumerate((0.1, 2.0))
    ]  # fmt: skip


def test_a_websocket_takes_the_same_packets_from_one_sender(adult: HumanSkeleton, wave: Wave) -> None:
    client = pytest.importorskip("websockets.sync.client")
    exceptions = pytest.importorskip("websockets.exceptions")
    with WebSocketSource(adult, port=0, token="a long secret", origins=("http://localhost:8000",)) as source:
        url = f"ws://127.0.0.1:{source.port}"
        with client.connect(url) as connection:
            connection.send(encode_frame(0, 0.0, wave(0.0), token="a long secret").decode())
            received = source.inbox.take(PATIENCE)
            assert received.packet is not None
            assert (received.packet.frame == wave(0.0)).all()
            connection.send("garbage")
            assert json.loads(connection.recv(timeout=PATIENCE)) == {"dropped": "json"}
            connection.send(encode_frame(1, 0.0, wave(0.0)))
            assert json.loads(connection.recv(timeout=PATIENCE)) == {"dropped": "token"}
            with client.connect(url) as other:
                other.send(encode_frame(9, 0.0, wave(0.0), token="a long secret"))
                assert json.loads(other.recv(timeout=PATIENCE)) == {"dropped": "stranger"}
            connection.send(b"x" * 20_000)
            with pytest.raises(exceptions.ConnectionClosed):
                connection.recv(timeout=PATIENCE)
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
