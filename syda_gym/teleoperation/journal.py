"""Journal: every tick and decision of a run in a file, from which the same commands follow again, bit for bit."""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import json
import math
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import SydaError, TeleoperationError
from syda_gym.mappings.mapping import Mapping
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import Decision, LoopSettings, State, Tick

__all__ = ["FORMAT", "Journal", "JournalLines", "Record", "ReplayReport", "read_journal", "replay_journal"]

FORMAT = "syda-gym teleoperation journal 2"
_MAX_LINE = 1 << 20
_EVERY = 1.0  # s between two marks


class Record(Protocol):
    """What a run may be written to, decision by decision."""

    def decided(self, tick: Tick, decision: Decision) -> None:
        """Writes one tick and its decision."""

    def dropped(self, now: float, counts: dict[str, int]) -> None:
        """Writes how many packets have been dropped by ``now``, by reason."""

    def flush(self) -> None:
        """Hands everything to the operating system."""

    def close(self) -> None:
        """Ends the file; harmless when repeated, or after ``abandon``."""

    def abandon(self) -> None:
        """Lets go of the file as it is, after an error."""


class Journal:
    """Writes one JSON line per tick: what came in, what was decided.

    A Python float written by ``json`` reads back as the same float, so nothing is lost. Unlike other files of this
    library the journal is written as it goes, for it must survive a crash; names ending in ``.gz`` are compressed.

    Once a second a mark with the checksum of all lines so far is written and everything is handed to the operating
    system; the last line is such a mark that says how many decisions there are. A file without it was cut off.

    Args:
        path: a new file.
        loop: the loop whose decisions are written.
        note: free facts for the first line, for example how the mapping was made.

    Raises:
        TeleoperationError: the file exists or cannot be written.
    """

    def __init__(
        self, path: str | os.PathLike[str], loop: TeleoperationLoop, note: dict[str, Any] | None = None
    ) -> None:
        self.path = Path(path)
        self._sum = hashlib.sha256()
        self._ticks = 0
        self._marked = -math.inf
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file: IO[str] = _open(self.path, "xt")
        except OSError as error:
            raise TeleoperationError(
                f"cannot write the journal {self.path}: {error.strerror}; choose a new file in a folder you may write"
            ) from error
        self._write(
            {
                "format": FORMAT,
                "settings": loop.settings.to_json(),
                "route": list(loop.mapping.route),
                "mapping": loop.mapping.card.to_json(),
                "robot": loop.robot.spec(),
                "start": loop.command.tolist(),
                "note": note or {},
            }
        )

    def decided(self, tick: Tick, decision: Decision) -> None:
        """Writes one tick and its decision.

        Raises:
            OSError: the disk is full, for example.
        """
        line: dict[str, Any] = {"t": tick.now, "state": decision.state.value, "q": decision.command.tolist()}
        if tick.frame is not None:
            line["frame"] = tick.frame.tolist()
            line["sent"] = tick.sent
            line["tracking"] = tick.tracking
        if tick.controls:
            line["controls"] = list(tick.controls)
        if tick.left is not None:
            line["left"] = tick.left
        if tick.leaving is not None:
            line["leaving"] = tick.leaving
        if tick.position is not None:
            line["position"] = tick.position.tolist()
        if not math.isnan(decision.bound):
            line["bound"] = decision.bound if math.isfinite(decision.bound) else None
        if decision.factor != 1.0:
            line["factor"] = decision.factor
        if decision.reasons:
            line["reasons"] = list(decision.reasons)
        self._write(line)
        self._ticks += 1
        if tick.now - self._marked >= _EVERY:
            self._marked = tick.now
            self._mark("mark")
            self.flush()

    def dropped(self, now: float, counts: dict[str, int]) -> None:
        """Writes how many packets have been dropped by ``now`` before they reached the loop, by reason."""
        self._write({"t": now, "dropped": counts})

    def flush(self) -> None:
        """Hands everything to the operating system."""
        self._file.flush()

    def close(self) -> None:
        """Writes the end mark and ends the file; harmless when repeated, or after ``abandon``.

        Raises:
            TeleoperationError: the end could not be written; a check of the file will say so too.
        """
        if self._file.closed:
            return
        try:
            self._mark("end")
            self._file.close()
        except OSError as error:
            self.abandon()
            raise TeleoperationError(
                f"the journal {self.path} could not be ended: {error.strerror or error}"
            ) from error

    def abandon(self) -> None:
        """Lets go of the file as it is, after an error; it has no end mark then."""
        with contextlib.suppress(OSError, ValueError):
            self._file.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _mark(self, kind: str) -> None:
        self._write({kind: self._ticks, "sha256": self._sum.hexdigest()})

    def _write(self, value: dict[str, Any]) -> None:
        line = json.dumps(value, separators=(",", ":")) + "\n"
        self._sum.update(line.encode())
        self._file.write(line)


@dataclass(frozen=True)
class ReplayReport:
    """What a replay found.

    Attributes:
        ticks: decisions compared.
        same: how many of them were the same, bit for bit.
        first_difference: line of the first other decision, ``None`` if all are the same.
        commands: the replayed commands ``(ticks, n)`` [rad].
        damage: empty, or why the file is not whole: cut off, or other than it was written.
    """

    ticks: int
    same: int
    first_difference: int | None
    commands: FloatArray
    damage: str = ""

    @property
    def exact(self) -> bool:
        """Whether there were decisions and all of them were the same."""
        return self.ticks == self.same > 0


class JournalLines:
    """Line number, tick and decision of each decision in a journal; made by ``read_journal``, to be walked once.

    A last line that was cut off by a crash ends the walk.

    Attributes:
        damage: after the walk, empty or why the file is not whole.
    """

    def __init__(self, source: Path, file: IO[str], first: str) -> None:
        self.damage = ""
        self._source = source
        self._file = file
        self._sum = hashlib.sha256(first.encode())
        self._ticks = 0
        self._ended = False

    def __iter__(self) -> Iterator[tuple[int, Tick, Decision]]:
        number = 1
        with self._file:
            while (text := self._read()) is not None:
                number += 1
                if self._ended:
                    self.damage = self.damage or f"line {number} stands behind the end mark"
                try:
                    line = json.loads(text)
                    if "sha256" in line:
                        self._compare(line, number)
                    elif "dropped" not in line:
                        yield number, _tick(line), _decision(line)
                        self._ticks += 1
                except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
                    raise TeleoperationError(f"{self._source}, line {number}: not a decision: {error!r}") from error
                self._sum.update(text.encode())
        if not self._ended:
            self.damage = self.damage or "it has no end mark: the run crashed, or the file was cut off"

    def _read(self) -> str | None:
        try:
            text = self._file.readline(_MAX_LINE)
        except (OSError, EOFError, UnicodeDecodeError, zlib.error) as error:
            if not isinstance(error, EOFError):
                self.damage = self.damage or f"unreadable from here on: {error}"
            return None  # a compressed journal whose writer was killed
        return text if text.endswith("\n") else None

    def _compare(self, line: dict[str, Any], number: int) -> None:
        same = line["sha256"] == self._sum.hexdigest() and line.get("end", line.get("mark")) == self._ticks
        if not same:
            self.damage = self.damage or f"what stands above line {number} is not what was written (checksum)"
        self._ended = self._ended or "end" in line


def read_journal(path: str | os.PathLike[str]) -> tuple[dict[str, Any], JournalLines]:
    """Reads a journal.

    Returns:
        The first line, and the lines after it.

    Raises:
        TeleoperationError: no such file, not a journal, or a broken line; the message names the line.
    """
    source = Path(path)
    if not source.is_file():
        raise TeleoperationError(f"no journal {source}; check the path")
    file = _open(source, "rt")
    try:
        first = file.readline(_MAX_LINE)
        head = json.loads(first)
    except (ValueError, OSError, EOFError, RecursionError, zlib.error) as error:
        file.close()
        raise TeleoperationError(f"{source} is not a journal: {error}") from error
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        file.close()
        raise TeleoperationError(f"{source} is not a journal; expected a first line with format {FORMAT!r}")
    return head, JournalLines(source, file, first)


def replay_journal(path: str | os.PathLike[str], mapping: Mapping) -> ReplayReport:
    """Feeds the ticks of a journal to a new loop and compares its decisions with those written.

    Args:
        path: the journal.
        mapping: the mapping of that run.

    Raises:
        TeleoperationError: not a journal, or a mapping of another route or fit.
    """
    head, decisions = read_journal(path)
    for key, kind in (("route", list), ("mapping", dict), ("settings", dict), ("start", list)):
        if not isinstance(head.get(key), kind):
            raise TeleoperationError(
                f"{path}, line 1: expected {key!r} to be a {kind.__name__}; the journal is damaged"
            )
    if list(mapping.route) != head["route"] or json.loads(json.dumps(mapping.card.to_json())) != head["mapping"]:
        route, method = " > ".join(map(str, head["route"])), head["mapping"].get("method")
        raise TeleoperationError(
            f"the journal was written with {route} ({method}); the mapping given is {mapping!r} or another fit "
            "of it; give the mapping of that run"
        )
    try:
        settings, start = LoopSettings.from_json(head["settings"]), np.array(head["start"], dtype=np.float64)
        loop = TeleoperationLoop(mapping, settings, start)
    except (SydaError, TypeError, ValueError) as error:
        raise TeleoperationError(f"{path}, line 1: no settings of a loop: {error}") from error
    ticks = same = 0
    first: int | None = None
    commands = []
    for number, tick, written in decisions:
        decided = loop.step(tick)
        ticks += 1
        commands.append(decided.command)
        if decided.state == written.state and decided.command.tobytes() == written.command.tobytes():
            same += 1
        elif first is None:
            first = number
    return ReplayReport(ticks, same, first, np.array(commands).reshape(ticks, loop.robot.n_features), decisions.damage)


def _tick(line: dict[str, Any]) -> Tick:
    frame = line.get("frame")
    return Tick(
        now=float(line["t"]),
        frame=None if frame is None else np.array(frame, dtype=np.float64),
        sent=None if line.get("sent") is None else float(line["sent"]),
        tracking=float(line.get("tracking", 1.0)),
        controls=tuple(line.get("controls", ())),
        left=None if line.get("left") is None else float(line["left"]),
        leaving=None if line.get("leaving") is None else float(line["leaving"]),
        position=None if line.get("position") is None else np.array(line["position"], dtype=np.float64),
    )


def _decision(line: dict[str, Any]) -> Decision:
    bound = line.get("bound", float("nan"))
    return Decision(
        now=float(line["t"]),
        state=State(line["state"]),
        command=np.array(line["q"], dtype=np.float64),
        bound=float("inf") if bound is None else float(bound),
        factor=float(line.get("factor", 1.0)),
        reasons=tuple(line.get("reasons", ())),
    )


def _open(path: Path, mode: str) -> IO[str]:
    if path.suffix == ".gz":
        return gzip.open(path, mode, compresslevel=1, encoding="utf-8")  # type: ignore[return-value]
    return open(path, mode, encoding="utf-8")
