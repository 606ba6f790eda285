"""run: a source, the loop and a sink together in real time."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable

from syda_gym.teleoperation.incoming.anticipation import Anticipation
from syda_gym.teleoperation.incoming.inbox import Received
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.journal import Journal
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import Sink
from syda_gym.teleoperation.tick import Decision, State, Tick

__all__ = ["run"]

_GRACE = 1.5  # periods to wait for the frame after a frame
_HOMEWARD = 90.0  # s; the longest way to rest at the end of a run; slow joints and detours take their time


def run(
    source: Source,
    loop: TeleoperationLoop,
    sink: Sink,
    *,
    journal: Journal | None = None,
    statistics: LiveStatistics | None = None,
    on_decision: Callable[[Decision], None] | None = None,
    seconds: float | None = None,
    rest_at_end: bool = True,
) -> LiveStatistics:
    """Runs until the source ends, the time is over, or a KeyboardInterrupt; then eases to rest.

    A frame is acted on when it arrives. While none arrives the loop decides ``settings.rate`` times a second all the
    same, for the first time one and a half periods after a frame. The source and the sink must be started and open, the
    sink first, which may take a second; the source's clock is the loop's.

    Args:
        source: where frames come from.
        loop: what decides.
        sink: where commands go.
        journal: where every decision is written, after its command was sent.
        statistics: to go on counting; new ones if not given.
        on_decision: called after each command, for the screen.
        seconds: when to end.
        rest_at_end: whether to ease to rest at the end; an emergency stop is left as it is.

    Returns:
        The statistics.
    """
    stats = statistics or LiveStatistics()
    driver = _Driver(source, loop, sink, journal, stats, on_decision)
    frames = Anticipation(source, driver.rehearse)
    # What exists now stays; the collector need not look at it again in the middle of a frame.
    gc.collect()
    gc.freeze()
    try:
        end = None if seconds is None else source.clock() + seconds
        patience = period = 1.0 / loop.settings.rate
        while end is None or source.clock() < end:
            received = frames.take(patience)
            driver.step(received)
            # A stream of the loop's own rate must not find the loop just deciding that no frame came.
            patience = period if received.packet is None else _GRACE * period
            if source.inbox.closed:
                break
    except KeyboardInterrupt:
        pass
    finally:
        gc.unfreeze()
    if rest_at_end and loop.state is not State.STOPPED:
        driver.go_to_rest()
    if journal is not None:
        journal.flush()
    return stats


class _Driver:
    """One step of the real-time loop, and the way home."""

    def __init__(
        self,
        source: Source,
        loop: TeleoperationLoop,
        sink: Sink,
        journal: Journal | None,
        stats: LiveStatistics,
        on_decision: Callable[[Decision], None] | None,
    ) -> None:
        self.source = source
        self.loop = loop
        self.sink = sink
        self.journal = journal
        self.stats = stats
        self.on_decision = on_decision
        self._dropped = 0

    def step(self, received: Received) -> Decision:
        """Decides and sends; everything else comes after."""
        packet, clock = received.packet, self.source.clock
        tick = Tick(
            now=clock(),
            frame=None if packet is None else packet.frame,
            sent=None if packet is None else packet.sent,
            tracking=1.0 if packet is None else packet.tracking,
            controls=received.controls,
        )
        decision = self.loop.step(tick)
        if "stop" in received.controls:
            self.sink.stop()
        self.sink.send(decision)
        sent = clock()
        if packet is not None:
            self.stats.latency(sent - received.arrived)
            self.stats.bound = decision.bound
        self.stats.command(sent, decision.state.value)
        for reason in decision.reasons:
            self.stats.reasons[reason.split(":")[0] if reason.startswith(("frame", "mapping")) else reason] += 1
        if self.journal is not None:
            self._write(self.journal, tick, decision)
        if self.on_decision is not None:
            self.on_decision(decision)
        self.loop.settle()
        return decision

    def rehearse(self) -> None:
        """What ``step`` does with a frame, without effect."""
        self.source.rehearse()
        self.loop.rehearse()
        self.sink.rehearse()

    def go_to_rest(self) -> None:
        """Asks for rest and keeps deciding until the robot is there; frames are left unread."""
        begun = self.source.clock()
        controls: tuple[str, ...] = ("resume", "rest")
        while self.source.clock() - begun < _HOMEWARD:
            decision = self.step(Received(None, 0.0, controls))
            controls = ()
            if decision.state is State.RESTING:
                return
            time.sleep(1.0 / self.loop.settings.rate)

    def _write(self, journal: Journal, tick: Tick, decision: Decision) -> None:
        dropped = self.source.inbox.dropped
        total = sum(dropped.values())
        if total != self._dropped:
            journal.dropped(tick.now, dict(dropped))
            self._dropped = total
        journal.decided(tick, decision)
