"""teleoperate: everything between a user's words and a moving robot, in one call."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.how_to_read import AS_IT_STANDS, HowToRead
from syda_gym.teleoperation.addresses import make_sink, make_source
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.journal import Journal, Record
from syda_gym.teleoperation.live_run import run
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import ManySinks, Sink
from syda_gym.teleoperation.tick import Decision, LoopSettings

__all__ = ["Session", "teleoperate"]


@dataclass(frozen=True)
class Session:
    """What a run is made of; handed to ``on_start``."""

    loop: TeleoperationLoop
    source: Source
    sink: Sink
    statistics: LiveStatistics


def teleoperate(
    mapping: Mapping,
    source: str | Source = "replay:embedded",
    sinks: Sequence[str] | Sink = ("bullet",),
    *,
    settings: LoopSettings | None = None,
    token: str | None = None,
    speed: float = 1.0,
    actions: Sequence[str] = (),
    repeat: bool = False,
    origins: tuple[str, ...] = (),
    model: str | os.PathLike[str] | None = None,
    how: HowToRead = AS_IT_STANDS,
    journal: str | os.PathLike[str] | None = None,
    note: dict[str, Any] | None = None,
    seconds: float | None = None,
    on_start: Callable[[Session], None] | None = None,
    on_decision: Callable[[Decision], None] | None = None,
) -> LiveStatistics:
    """Drives a robot live until the source ends, the time is over, or the user interrupts.

    Args:
        mapping: from the operator's body to the robot.
        source: an address (see ``addresses.SOURCES``) or a source that is not started yet.
        sinks: addresses (see ``addresses.SINKS``) or a sink that is not open yet.
        settings: of the loop.
        token: secret for addresses beyond this machine.
        speed: of a replay.
        actions: that a replay plays.
        repeat: whether a replay begins again.
        origins: web pages that may connect to a WebSocket.
        model: file of the pose model of cameras and films; ``None`` for the default place.
        how: what a person says about the recording of a replay.
        journal: file to write every decision to; one that ends in ``.mcap`` is for looking at it, any other replays.
        note: free facts for the journal.
        seconds: when to end.
        on_start: called once everything is there and before frames flow.
        on_decision: called after each command.

    Returns:
        The statistics.

    Raises:
        SydaError: whatever cannot be opened; nothing moves then.
    """
    chosen = settings or LoopSettings()
    if not isinstance(sinks, Sink) and not sinks:
        raise OptionError("name at least one sink, for example 'bullet' or 'none'")
    made = (
        source
        if isinstance(source, Source)
        else make_source(
            source, mapping.source, token=token, speed=speed, actions=actions, calibration=chosen.calibration,
            repeat=repeat, origins=origins, model=model, how=how,
        )
    )  # fmt: skip
    probe = TeleoperationLoop(mapping, chosen)
    sink = sinks if isinstance(sinks, Sink) else make_sink(
        sinks, probe.robot, token=token, rate=chosen.rate, operator=mapping.source
    )  # fmt: skip
    with sink, ExitStack() as stack:
        made.hold()  # what cannot be opened is one line, before a page or a table is shown
        stack.callback(made.close)
        # A run begins where the robot's joints are rather than with a jump.
        start = sink.angles()
        loop = probe if start is None else TeleoperationLoop(mapping, chosen, start)
        _show_operator(sink, loop)
        written = None if journal is None else _record(Path(journal), loop, note)
        stats = LiveStatistics()
        try:
            if on_start is not None:
                on_start(Session(loop, made, sink, stats))
            with made:
                return run(
                    made, loop, sink, journal=written, statistics=stats, on_decision=on_decision, seconds=seconds
                )
        finally:
            if written is not None:
                try:
                    written.close()
                except TeleoperationError as error:  # the robot is home; the check of the journal will tell too
                    loop.notices.append(str(error))


def _record(path: Path, loop: TeleoperationLoop, note: dict[str, Any] | None) -> Record:
    if path.suffix != ".mcap":
        return Journal(path, loop, note)
    from syda_gym.teleoperation.bags.mcap_journal import McapJournal

    written: Record = McapJournal.of(path, loop, note)
    return written


def _show_operator(sink: Sink, loop: TeleoperationLoop) -> None:
    """Lets films and windows ask for the operator's frames."""
    for each in sink.sinks if isinstance(sink, ManySinks) else (sink,):
        accompany = getattr(each, "accompany", None)
        if accompany is not None:
            accompany(lambda: loop.frame)
