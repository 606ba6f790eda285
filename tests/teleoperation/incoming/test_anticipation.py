"""Anticipation: awake when the next frame is due, asleep otherwise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.teleoperation.incoming import anticipation
from syda_gym.teleoperation.incoming.anticipation import Anticipation
from syda_gym.teleoperation.incoming.frame_clock import FrameClock
from syda_gym.teleoperation.incoming.inbox import Received
from syda_gym.teleoperation.incoming.packets import Packet
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import LoopSettings, Tick
from tests.teleoperation.conftest import LimbMapping

Wave = Callable[[float], FloatArray]


class Scripted(Source):
    """Delivers at given times of a simulated clock, which its waiting moves on."""

    def __init__(self, body: HumanSkeleton, times: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
        super().__init__(body)
        self.now, self.times, self.waits = 0.0, times, list[float]()
        monkeypatch.setattr(anticipation.time, "monotonic", lambda: self.now)

    def take(self, timeout: float) -> Received:
        self.waits.append(timeout)
        end = self.now + max(timeout, 1e-4)  # looking takes time too
        if self.times and self.times[0] <= end:
            self.now = max(self.now, self.times.pop(0))
            return Received(Packet(0, self.now, np.zeros(18)), self.now, ())
        self.now = end
        return Received(None, 0.0, ())


@pytest.mark.parametrize("threaded", [False, True])
def test_it_rehearses_just_before_an_even_stream_s_next_frame(
    adult: HumanSkeleton, monkeypatch: pytest.MonkeyPatch, threaded: bool
) -> None:
    source = Scripted(adult, [index / 30 for index in range(40)], monkeypatch)
    source.threaded = threaded
    rehearsed: list[float] = []

    def rehearse() -> None:
        rehearsed.append(source.now)
        source.now += 0.001

    frames = Anticipation(source, rehearse)
    taken = [frames.take(0.05) for _ in range(40)]
    assert all(received.packet is not None for received in taken)
    assert [received.arrived for received in taken] == pytest.approx([index / 30 for index in range(40)], abs=2e-4)
    assert len(rehearsed) == 30, "once it knows the period, once a frame"
    before = np.arange(10, 40) / 30 - rehearsed
    assert (before > 0.0013).all()
    assert (before < 0.003).all(), "just in time"
    watched = sum(wait == 0.0 for wait in source.waits)
    assert watched == 0 if threaded else 60 < watched < 600, "a source's own thread must get its turn"


def test_an_uneven_stream_is_waited_for_asleep(adult: HumanSkeleton, monkeypatch: pytest.MonkeyPatch) -> None:
    times = np.cumsum(np.random.default_rng(0).uniform(0.005, 0.06, 60)).tolist()
    source = Scripted(adult, list(times), monkeypatch)
    frames = Anticipation(source, lambda: pytest.fail("there is nothing to be ready for"))
    assert [frames.take(0.1).arrived for _ in times] == times
    assert frames.take(0.1).packet is None


def test_a_stream_that_ends_is_given_up_in_time(adult: HumanSkeleton, monkeypatch: pytest.MonkeyPatch) -> None:
    source = Scripted(adult, [index / 30 for index in range(20)], monkeypatch)
    frames = Anticipation(source, lambda: None)
    for _ in range(20):
        frames.take(0.05)
    before = source.now
    assert frames.take(0.05).packet is None
    assert source.now - before == pytest.approx(0.05, abs=3e-4), "it waits no longer than it was told"


def test_a_rehearsal_changes_no_bit(mapping: LimbMapping, adult: HumanSkeleton, wave: Wave, pepper: Robot) -> None:
    loops = [TeleoperationLoop(mapping, LoopSettings(calibration=0.5)) for _ in range(2)]
    requests = {100: ("pause",), 110: ("resume",), 200: ("rest",), 365: ("resume",), 390: ("stop",)}
    states = set()
    for index in range(400):
        frame = adult.standing() if index < 25 else wave(index / 30)
        mapping.bound = 0.4 if 140 < index < 180 else 0.05
        for _ in range(index % 3):
            loops[1].rehearse()
        tick = Tick(index / 30, None if 220 < index < 300 else frame, index / 30, controls=requests.get(index, ()))
        plain, rehearsed = (loop.step(tick) for loop in loops)
        assert plain.command.tobytes() == rehearsed.command.tobytes()
        assert (plain.state, plain.factor, plain.reasons) == (rehearsed.state, rehearsed.factor, rehearsed.reasons)
        states.add(plain.state)
    assert len(states) >= 5, "what a run may see"
    assert np.abs(plain.command - pepper.rest).max() > 0.2
    mapping.broken = ValueError("no")
    loops[1].rehearse()


def test_frames_are_timed_by_the_sender_unless_its_clock_is_odd() -> None:
    def passed(sent: list[float | None]) -> list[float]:
        clock = FrameClock()
        return [clock.advance(0.1 * index, time) for index, time in enumerate(sent)]

    assert passed([5.0, 5.04, 5.08]) == pytest.approx([0.0, 0.04, 0.04]), "the sender's time"
    assert passed([5.0, 5.0, 4.0]) == pytest.approx([0.0, 0.1, 0.1]), "it stands still, it goes back"
    assert passed([None, 1.0, None]) == pytest.approx([0.0, 0.1, 0.1]), "it is not told"
    assert passed([0.0, 40.0, 80.0]) == pytest.approx([0.0, 0.1, 0.1]), "it counts milliseconds"
