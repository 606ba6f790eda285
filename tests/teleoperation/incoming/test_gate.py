"""Strangers cannot shut the listeners, wash out the driver, or take the loop's time."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import socket
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.teleoperation.incoming.gate import JunkGate
from syda_gym.teleoperation.incoming.network import UdpSource, WebSocketSource
from syda_gym.teleoperation.incoming.packets import encode_frame, encode_request
from syda_gym.teleoperation.live_run import run
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import MemorySink
from syda_gym.teleoperation.tick import LoopSettings
from tests.teleoperation.conftest import LimbMapping

Wave = Callable[[float], FloatArray]
PATIENCE = 60.0


def wait_for(what: Callable[[], bool]) -> bool:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if what():
            return True
        time.sleep(0.02)
    return False


def test_bare_connections_do_not_shut_the_websocket(adult: HumanSkeleton, wave: Wave) -> None:
    client = pytest.importorskip("websockets.sync.client")
    with WebSocketSource(adult, port=0) as source, contextlib.ExitStack() as stack:
        for _ in range(191):
            bare = stack.enter_context(socket.socket())
            bare.settimeout(5.0)
            with contextlib.suppress(OSError):
                bare.connect(("127.0.0.1", source.port))
        assert wait_for(lambda: source.inbox.dropped["connections"] > 150)
        stack.close()

        def answers() -> bool:
            try:
                with client.connect(f"ws://127.0.0.1:{source.port}", open_timeout=2) as connection:
                    connection.send("garbage")
                    return bool(json.loads(connection.recv(timeout=5)) == {"dropped": "json"})
            except Exception:  # refused in one way or another, as long as the rate is used up
                return False

        assert wait_for(answers), "a person can still connect"


def test_a_connection_that_sends_junk_is_closed(adult: HumanSkeleton) -> None:
    client = pytest.importorskip("websockets.sync.client")
    exceptions = pytest.importorskip("websockets.exceptions")
    with WebSocketSource(adult, port=0) as source, client.connect(f"ws://127.0.0.1:{source.port}") as connection:
        with pytest.raises(exceptions.ConnectionClosed):  # noqa: PT012 - it comes in time
            for _ in range(5000):
                connection.send("garbage")
                connection.recv(timeout=PATIENCE)
        assert 100 <= source.inbox.dropped["json"] <= 400


@pytest.mark.parametrize("how", ["a frame of 4 EiB", "fragments without end", "a compressed one"])
def test_a_message_without_end_is_cut_off_and_the_driver_heard(adult: HumanSkeleton, wave: Wave, how: str) -> None:
    client = pytest.importorskip("websockets.sync.client")
    exceptions = pytest.importorskip("websockets.exceptions")
    sent = 0

    def endless() -> Iterator[str]:
        nonlocal sent
        while True:
            sent += 1000
            yield "x" * 1000

    with WebSocketSource(adult, port=0) as source:
        address = f"ws://127.0.0.1:{source.port}"
        with client.connect(address, compression="deflate") as connection:
            assert connection.protocol.extensions == [], "nothing is unpacked"
            with pytest.raises(exceptions.ConnectionClosed):  # noqa: PT012 - it comes in time
                if how == "fragments without end":
                    connection.send(endless())
                elif how == "a frame of 4 EiB":
                    connection.socket.sendall(b"\x81\xff" + (2**62).to_bytes(8, "big") + b"mask" + b"x" * 100)
                else:  # a bit that says so
                    connection.socket.sendall(b"\xc1\x85mask" + b"x" * 5)
                connection.recv(timeout=PATIENCE)
        assert sent < 50_000_000
        with client.connect(address) as connection:
            connection.send(encode_frame(0, 0.0, wave(0.0)).decode())
            assert source.take(PATIENCE).packet is not None


@pytest.mark.parametrize("kind", [UdpSource, WebSocketSource])
def test_a_listener_that_dies_is_said_and_started_anew(
    kind: type[UdpSource] | type[WebSocketSource], adult: HumanSkeleton, wave: Wave
) -> None:
    if kind is WebSocketSource:
        client = pytest.importorskip("websockets.sync.client")
    with kind(adult, port=0) as source:
        port, news = source.port, list[str]()
        if isinstance(source, UdpSource):
            assert source._socket is not None
            source._socket.close()
        else:
            server = source._server  # the listener may notice the first of the two already
            server.socket.close()
            with contextlib.suppress(OSError):
                os.write(server.shutdown_notifier, b"x")  # as a server that could not accept any more

        def revived() -> bool:
            if isinstance(source, UdpSource):
                source.take(0.01)
            news.extend(source.news())
            return bool(news)

        assert wait_for(revived)
        assert f"the listener on port {port} died" in news[0]
        if kind is WebSocketSource:
            with client.connect(f"ws://127.0.0.1:{port}") as connection:
                connection.send(encode_frame(0, 0.0, wave(0.0)).decode())
                assert source.take(PATIENCE).packet is not None
        else:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
                sock.sendto(encode_frame(0, 0.0, wave(0.0)), ("127.0.0.1", port))
                assert source.take(PATIENCE).packet is not None


def test_who_sends_junk_is_not_read_for_a_while_except_for_a_stop(adult: HumanSkeleton, wave: Wave) -> None:
    now = [0.0]
    source = UdpSource(adult, clock=lambda: now[0])
    for _ in range(400):
        source._accept(b"{" * 3000, "flooder")
    assert source.inbox.dropped["json"] <= 101
    assert source.inbox.dropped["unread"] >= 299
    assert source._accept(encode_request(0, 0.0, "pause"), "flooder") is not None
    assert source._accept(encode_request(0, 0.0, "stop"), "flooder") is None
    assert source._accept(encode_frame(0, 0.0, wave(0.0)), "driver") is None, "others are read"
    for index in range(2000):
        source._accept(b"{", ("many", index))
    assert source._accept(encode_frame(1, 0.01, wave(0.0)), "driver") is None, "the driver, flood or not"
    assert source._accept(encode_frame(1, 0.01, wave(0.0)), "newcomer") is not None
    assert source._accept(encode_request(9, 0.0, "stop"), "newcomer") is None
    now[0] = 2.0
    assert source._accept(encode_request(0, 0.0, "pause"), "flooder") is None, "after a while it is read again"
    gate = JunkGate()
    for index in range(10_000):
        gate.refused(index, 0.0)
    assert len(gate._left) <= 256


def _flood(port: int, seconds: float) -> None:
    junk = [b"[" * 16_000, b'{"v":1,"seq":5,"t":1,"frame":[NaN]}', b"\xff" * 40]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for one in junk * 20:
                with contextlib.suppress(OSError):
                    sock.sendto(one, ("127.0.0.1", port))


def test_a_flood_does_not_slow_the_loop_below_half_its_rate(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave
) -> None:
    counts = []
    for flooded in (False, True):
        loop, sink = TeleoperationLoop(mapping, LoopSettings(calibration=0.0)), MemorySink()
        with UdpSource(adult, port=0) as source:
            process = multiprocessing.get_context("spawn").Process(target=_flood, args=(source.port, 20.0))
            if flooded:
                process.start()
                assert wait_for(lambda: bool(source.take(0.01)) and source.inbox.dropped.total() > 100)
            run(source, loop, sink, seconds=3.0, rest_at_end=False)
            if flooded:
                process.kill()
                process.join()
        counts.append(len(sink.decisions))
    assert counts[1] > 0.5 * counts[0]
    assert np.isfinite(counts).all()
