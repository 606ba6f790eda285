"""Stops that stop: in every state, from keys and network, on the way home too; the driver alone lifts them."""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.teleoperation.driver import Driver
from syda_gym.teleoperation.incoming.inbox import Inbox, Received
from syda_gym.teleoperation.incoming.network import UdpSource
from syda_gym.teleoperation.incoming.ordering import Ordering
from syda_gym.teleoperation.incoming.packets import Packet, encode_frame, encode_request
from syda_gym.teleoperation.incoming.sources import ReplaySource, Source
from syda_gym.teleoperation.live_run import run
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import ManySinks, MemorySink
from syda_gym.teleoperation.tick import LoopSettings, State, Tick
from tests.teleoperation.conftest import LimbMapping

Wave = Callable[[float], FloatArray]
DT = 1 / 30


class Motors(MemorySink):
    """Remembers its stops, and knows where it is."""

    def __init__(self) -> None:
        super().__init__()
        self.stops: list[int] = []
        self.position: FloatArray | None = None
        self.on_send: Callable[[], None] = lambda: None

    def send(self, decision: object) -> None:
        super().send(decision)  # type: ignore[arg-type]
        self.on_send()

    def stop(self) -> None:
        self.stops.append(len(self.decisions))

    def angles(self) -> FloatArray | None:
        return self.position


def test_a_stop_is_obeyed_in_the_very_tick_in_random_states(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot
) -> None:
    loop, rng, now = TeleoperationLoop(mapping, LoopSettings(calibration=0.0, hold=0.2)), np.random.default_rng(0), 0.0
    seen: dict[State, int] = {}
    for _ in range(120):
        for _ in range(int(rng.integers(3, 40))):
            now += DT
            control = rng.choice(["", "pause", "resume", "calibrate", "rest"], p=[0.9, 0.02, 0.04, 0.02, 0.02])
            frame = None if rng.random() < 0.1 else adult.standing() if rng.random() < 0.3 else wave(now)
            loop.step(Tick(now, frame, now, controls=(str(control),) if control else ()))
            if rng.random() < 0.05:
                now += 0.6
        seen[loop.state] = seen.get(loop.state, 0) + 1
        before, now = loop.command, now + DT
        others = ("resume", "rest", "calibrate", "pause")
        decision = loop.step(Tick(now, wave(now), now, controls=("stop", others[int(rng.integers(4))])))
        assert decision.state is State.STOPPED
        assert (decision.command == before).all(), "not one step further"
        assert (loop.step(Tick(now + DT, wave(now), now + DT)).command == before).all()
        now += 2 * DT
        position = pepper.clamp(before + rng.normal(scale=0.05, size=before.shape))[0]
        released = loop.step(Tick(now, controls=("release",), position=position))
        assert released.state is State.PAUSED
        assert (released.command == position).all(), "where the robot is, not where it was"
        now += DT
        loop.step(Tick(now, controls=("resume",)))
    assert len(seen) >= 5, seen


@pytest.mark.parametrize("how", ["key", "network", "signal", "pause"])
def test_a_stop_on_the_way_home_is_obeyed_within_a_tick(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, how: str
) -> None:
    sink, source = Motors(), UdpSource(adult, port=0)
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.0, soft_start=0.0, ease=0.02), start=None)
    asked: list[int] = []

    def act() -> None:
        home = [decision for decision in sink.decisions if decision.state is State.EASING]
        if len(home) != 5 or asked:
            return
        asked.append(len(sink.decisions))
        if how == "network":
            sock.sendto(encode_request(3, 0.0, "stop"), ("127.0.0.1", source.port))
        elif how == "signal":
            os.kill(os.getpid(), signal.SIGTERM)
        else:
            source.inbox.request("stop" if how == "key" else "pause")
        if how == "pause":
            threading.Timer(0.5, source.inbox.request, ["stop"]).start()

    sink.on_send = act
    with source, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        feeding = threading.Event()

        def feed() -> None:
            for index in range(100_000):
                if feeding.wait(DT):
                    return
                sock.sendto(encode_frame(index, index * DT, wave(1.5)), ("127.0.0.1", source.port))
                if index == 40:
                    source.inbox.close()  # as `q` does; frames go on coming

        thread = threading.Thread(target=feed)
        thread.start()
        run(source, loop, sink)
        feeding.set()
        thread.join()
    path, states = [d.command for d in sink.decisions], [d.state for d in sink.decisions]
    after = path[asked[0] + (1 if how == "signal" else 0) :]
    if how == "pause":
        assert State.PAUSED in states[asked[0] : asked[0] + 3]
        still = states.index(State.PAUSED) + 8
        assert (path[still] == path[-1]).all(), "it brakes and waits"
        assert sink.stops
        return
    assert sink.stops
    assert sink.stops[0] <= asked[0] + 2, "the sink is stopped before the next command"
    assert states[-1] is State.STOPPED
    assert states.count(State.STOPPED) > 3, "and it is said more than once, for the network may lose it"
    first = states.index(State.STOPPED)
    assert first <= asked[0] + 2
    assert all((command == path[first]).all() for command in after[2:])


def packet(sequence: int, sent: float, control: str | None = None) -> Packet:
    return Packet(sequence, sent, None if control else np.zeros(18), control=control)


def test_only_the_driver_sets_free_and_only_later_than_the_stop() -> None:
    order = Ordering()
    assert order.admit(packet(100, 5.0), 10.0, "driver") == ""
    assert order.admit(packet(104, 5.1, "stop"), 10.1, "driver") == ""
    assert order.admit(packet(104, 5.1, "stop"), 10.1, "driver") == "", "a stop once more is a stop"
    assert order.admit(packet(7, 1.0, "release"), 10.2, "driver", 10.1) == "stale"
    assert order.admit(packet(103, 5.05, "release"), 10.2, "driver", 10.1) == "stale", "it left before the stop"
    assert order.admit(packet(105, 5.2, "release"), 10.2, "anybody", 10.1) == "stranger"
    assert order.admit(packet(106, 5.15, "resume"), 10.25, "driver", 10.2) == "stale", "a stranger stopped meanwhile"
    assert order.admit(packet(107, 5.4, "release"), 10.4, "driver", 10.2) == ""
    assert order.admit(packet(107, 5.4, "release"), 10.5, "driver", 10.2) == "stale", "doubled"
    assert order.admit(packet(108, 5.5, "calibrate"), 11.3, "driver", 10.2) == "late"
    for control in ("stop", "pause", "rest"):
        assert order.admit(packet(1, 0.0, control), 20.0, "anybody") == ""
    assert Ordering().admit(packet(1, 0.0, "resume"), 1.0, "anybody") == "stranger", "nobody drives yet"


def test_a_full_inbox_has_room_for_a_stop_and_nothing_lifts_it() -> None:
    inbox = Inbox(clock=lambda: 7.0)
    for index in range(200):
        inbox.request(("pause", "resume")[index % 2])
    inbox.request("stop")
    assert inbox.take(0.0).controls[-1] == "stop"
    assert inbox.halted == 7.0
    for _ in range(100):
        inbox.request("stop")
    assert inbox.take(0.0).controls == ("stop",)


def test_calibrate_while_paused_stays_paused(mapping: LimbMapping, adult: HumanSkeleton) -> None:
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.3))
    loop.step(Tick(0.0, controls=("pause",)))
    for index in range(1, 60):
        control = ("calibrate",) if index == 1 else ()
        assert loop.step(Tick(index * DT, adult.standing(), controls=control)).state is State.PAUSED
    assert loop.calibration is not None
    assert loop.step(Tick(3.0, controls=("resume",))).state is State.HOLDING


def test_a_release_asks_where_the_robot_is(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot
) -> None:
    sink, loop = Motors(), TeleoperationLoop(mapping, LoopSettings(calibration=0.0))
    source = Source(adult, clock=time.monotonic)
    driver = Driver(source, loop, ManySinks([MemorySink(), sink]), None, LiveStatistics(), None)
    for index in range(30):
        driver.step(Received(Packet(index, index * DT, wave(1.5)), source.clock(), ()))
        time.sleep(0.005)
    driver.step(Received(None, 0.0, ("stop",)))
    assert len(sink.stops) == 1
    sink.position = pepper.rest.copy()  # somebody lowered the arms by hand
    driver.step(Received(None, 0.0, ("release",)))
    assert sink.decisions[-1].state is State.PAUSED
    assert (sink.decisions[-1].command == pepper.rest).all()
    driver.step(Received(None, 0.0, ("stop",)))
    sink.angles = lambda: (_ for _ in ()).throw(OSError("no route"))  # type: ignore[method-assign]
    driver.step(Received(None, 0.0, ("release",)))
    assert loop.state is State.STOPPED, "one that cannot tell where it is stays stopped"
    assert any("not released" in notice for notice in loop.notices)


def test_nobody_there_after_calibrate_eases_home(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave) -> None:
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.3))
    for index in range(100):
        loop.step(Tick(index * DT, adult.standing() if index < 20 else wave(index * DT)))
    loop.step(Tick(100 * DT, wave(3.3), controls=("calibrate",)))
    states = [loop.step(Tick((101 + index) * DT)).state for index in range(150)]
    assert states[0] is State.CALIBRATING
    assert states[-1] in (State.EASING, State.RESTING), "the watchdog is awake while nobody is calibrated"


@pytest.mark.parametrize("gap", [1.0, 60.0])
def test_after_a_stall_the_start_is_gentle(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, gap: float) -> None:
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.3))
    for index in range(100):
        decision = loop.step(Tick(index * DT, adult.standing() if index < 20 else wave(index * DT)))
    before, now = decision.command, 99 * DT + gap
    assert decision.factor == 1.0
    for index in range(3):
        decision = loop.step(Tick(now + index * DT, wave(4.8 + index * DT)))
        assert decision.factor < 0.35
    assert np.abs(decision.command - before).max() < 0.35 * 0.2 * mapping.target.speed.max()


def test_a_replay_that_ends_goes_home_and_can_be_stopped_there(
    mapping: LimbMapping, adult: HumanSkeleton, wave: Wave
) -> None:
    from syda_gym.motions.clip import MotionClip

    clip = MotionClip(adult, np.array([wave(1.0 + i / 30) for i in range(30)]), 30.0, "wave", "r1")
    sink, loop = Motors(), TeleoperationLoop(mapping, LoopSettings(calibration=0.0, soft_start=0.0, ease=0.02))
    with ReplaySource([clip]) as source:
        sink.on_send = lambda: (
            source.inbox.request("stop") if sink.decisions[-1].state is State.EASING and not sink.stops else None
        )
        run(source, loop, sink)
    assert sink.decisions[-1].state is State.STOPPED
    assert len(sink.stops) == 1
