"""Driver: one step of the real-time loop, and what is done when something beside the robot fails."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import TeleoperationError
from syda_gym.teleoperation.incoming.inbox import Received
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.journal import Record
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import Sink
from syda_gym.teleoperation.safety.punctuality import SPACING
from syda_gym.teleoperation.tick import Decision, State, Tick

__all__ = ["Driver"]

_NOTICES = 30  # that are kept
_PAUSE = 0.02  # s; a source that fails at once must not make the loop spin


class _Takes(Protocol):
    def take(self, timeout: float) -> Received: ...


class Driver:
    """Decides and sends; everything else comes after, and must not keep the robot from being commanded.

    Args:
        source: where frames and requests come from.
        loop: what decides.
        sink: where commands go.
        journal: what is written; dropped if it fails.
        stats: what is counted.
        on_decision: called after each command; dropped if it fails.

    Attributes:
        gone: empty, or why the robot takes no commands any more.
    """

    def __init__(
        self,
        source: Source,
        loop: TeleoperationLoop,
        sink: Sink,
        journal: Record | None,
        stats: LiveStatistics,
        on_decision: Callable[[Decision], None] | None,
    ) -> None:
        self.source = source
        self.loop = loop
        self.sink = sink
        self.gone = ""
        self._journal = journal
        self._stats = stats
        self._on_decision = on_decision
        self._dropped = 0
        self._left: float | None = None
        self._leaving: float | None = None

    def take(self, frames: _Takes, timeout: float) -> Received:
        """What came; a source that fails is a silent one."""
        try:
            return frames.take(timeout)
        except Exception as error:
            self._tell(f"source: {error!r}")
            time.sleep(min(_PAUSE, timeout))
            return Received(None, 0.0, ())

    @property
    def early(self) -> float:
        """How long it is until the next command may leave [s]: commands too close together would jerk on the wire."""
        if self._left is None:
            return 0.0
        return self._left + SPACING / self.loop.settings.rate - self.source.clock()

    def spaced(self, received: Received) -> Received:
        """What came, and what comes until it is time for the next command; an emergency stop does not wait."""
        end = time.monotonic() + self.early
        while (received.packet is not None or received.controls) and "stop" not in received.controls:
            early = end - time.monotonic()
            if early <= 0.0 or self.source.inbox.closed:
                break
            more = self.take(self.source, early)
            if more.packet is not None and received.packet is not None:
                self.source.inbox.drop("overtaken")
            kept = received if more.packet is None else more
            received = Received(kept.packet, kept.arrived, received.controls + more.controls)
        return received

    def step(self, received: Received) -> Decision:
        """Decides and sends."""
        packet, clock, controls = received.packet, self.source.clock, received.controls
        if "stop" in controls:
            self.stop()  # before anything else
        position = None
        if "release" in controls and (self.loop.state is State.STOPPED or "stop" in controls):
            position, controls = self._ask(controls)
        tick = Tick(
            now=clock(),
            frame=None if packet is None else packet.frame,
            sent=None if packet is None else packet.sent,
            tracking=1.0 if packet is None else packet.tracking,
            controls=controls,
            left=self._left,
            leaving=self._leaving,
            position=position,
        )
        decision = self.loop.step(tick)
        self._leaving = clock()
        self._send(decision)
        sent = self._left = clock()
        if packet is not None:
            self._stats.latency(sent - received.arrived)
            self._stats.bound = decision.bound
        self._stats.command(sent, decision.state.value)
        for reason in decision.reasons:
            self._stats.reasons[reason.split(":")[0] if reason.startswith(("frame", "mapping")) else reason] += 1
        self._record(tick, decision)
        for notice in (*self.source.news(), *self.sink.news()):
            self._tell(notice)
        if self._on_decision is not None:
            try:
                self._on_decision(decision)
            except Exception as error:
                self._on_decision = None
                self._tell(f"screen dropped: {error!r}")
        self.loop.settle()
        return decision

    def rehearse(self) -> None:
        """What ``step`` does with a frame, without effect."""
        self.source.rehearse()
        self.loop.rehearse()
        self.sink.rehearse()

    def stop(self) -> None:
        """Emergency stop of the sink; one that fails is told."""
        try:
            self.sink.stop()
        except Exception as error:
            self._tell(f"the robot's own stop failed: {error!r}; USE THE ROBOT'S SWITCH")

    def flush(self) -> None:
        """Hands the journal to the operating system."""
        if self._journal is not None:
            try:
                self._journal.flush()
            except Exception as error:
                self._drop_journal(error)

    def raise_if_gone(self) -> None:
        """Tells the caller that the robot was lost.

        Raises:
            TeleoperationError: it was.
        """
        if self.gone:
            raise TeleoperationError(self.gone)

    def _send(self, decision: Decision) -> None:
        if self.gone:
            return
        try:
            self.sink.send(decision)
        except Exception as error:
            self.gone = str(error) if isinstance(error, TeleoperationError) else f"the robot is gone: {error!r}"
            self._tell(f"ROBOT GONE: {self.gone}")
            self.stop()

    def _ask(self, controls: tuple[str, ...]) -> tuple[FloatArray | None, tuple[str, ...]]:
        """Where the robot is; one that should tell and cannot is not released."""
        try:
            return self.sink.angles(), controls
        except Exception as error:
            self._tell(f"not released, for the robot does not tell where it is: {error!r}")
            return None, tuple(control for control in controls if control != "release")

    def _record(self, tick: Tick, decision: Decision) -> None:
        if self._journal is None:
            return
        dropped = self.source.inbox.dropped
        total = sum(dropped.values())
        try:
            if total != self._dropped:
                self._journal.dropped(tick.now, dict(dropped))
                self._dropped = total
            self._journal.decided(tick, decision)
        except Exception as error:
            self._drop_journal(error)

    def _drop_journal(self, error: Exception) -> None:
        assert self._journal is not None  # the caller looked; for the type checker
        self._tell(f"journal dropped, it ends here: {error}")
        journal, self._journal = self._journal, None
        journal.abandon()

    def _tell(self, notice: str) -> None:
        notices = self.loop.notices
        if notice not in notices and len(notices) < _NOTICES:
            notices.append(notice)
