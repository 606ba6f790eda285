"""A journal as MCAP, after the run: the same file that ``McapJournal`` would have written."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import SydaError, TeleoperationError
from syda_gym.files import atomic_path
from syda_gym.teleoperation.bags.mcap_journal import McapJournal
from syda_gym.teleoperation.calibration import Calibration, Calibrator
from syda_gym.teleoperation.incoming.frame_clock import FrameClock
from syda_gym.teleoperation.journal import read_journal
from syda_gym.teleoperation.tick import LoopSettings, Tick

__all__ = ["ExportedJournal", "export_journal"]


class ExportedJournal:
    """What was written.

    Attributes:
        path: the file.
        decisions: how many.
        damage: empty, or why the journal is not whole.
    """

    def __init__(self, path: Path, decisions: int, damage: str) -> None:
        self.path = path
        self.decisions = decisions
        self.damage = damage


def export_journal(journal: str | os.PathLike[str], out: str | os.PathLike[str]) -> ExportedJournal:
    """Writes a journal as MCAP, for Foxglove, Rerun and ROS.

    The operator is calibrated anew from the frames that the loop saw while it calibrated.

    Args:
        journal: ``.jsonl`` or ``.jsonl.gz``.
        out: the ``.mcap`` file.

    Raises:
        MissingExtraError: mcap or rosbags is not installed.
        TeleoperationError: not a journal, damaged, or of bodies that are not known here.
        StorageError: the file cannot be written.
    """
    head, decisions = read_journal(journal)
    try:
        robot, operator = catalog.from_spec(head["robot"]), catalog.from_spec(head["mapping"]["source"])
        settings = LoopSettings.from_json(head["settings"])
    except (SydaError, KeyError, TypeError) as error:
        raise TeleoperationError(
            f"{journal}, line 1: its bodies or settings are not known here: {error}; add the robot again with "
            "`syda-gym robot add`"
        ) from error
    if not isinstance(robot, Robot):
        raise TeleoperationError(f"{journal}, line 1: {robot.name!r} is no robot; the journal is damaged")
    person = _Person(operator, settings)
    facts = {name: head.get(name) for name in ("route", "mapping", "robot", "settings", "note")}
    count = 0
    with atomic_path(out) as temporary:
        temporary.unlink()  # a journal wants a new file
        with McapJournal(temporary, robot, operator, lambda: person.shown, facts) as written:
            for _, tick, decision in decisions:
                person.saw(tick)
                written.decided(tick, decision)
                count += 1
    return ExportedJournal(Path(out), count, decisions.damage)


class _Person:
    """The operator as the loop calibrated them; whoever takes over in the middle of a run is shown by their measures.

    Args:
        body: the mapping's source.
        settings: of the loop.
    """

    def __init__(self, body: Embodiment, settings: LoopSettings) -> None:
        self._new: Any = lambda: Calibrator(body, settings.calibration, settings.axes)
        self._calibrator = self._new()
        self._clock = FrameClock()
        self._calibration: Calibration | None = None
        self._features = body.n_features
        self.shown: FloatArray | None = None

    def saw(self, tick: Tick) -> None:
        """Takes one tick."""
        if "calibrate" in tick.controls:
            self._calibrator, self._calibration = self._new(), None
        frame = tick.frame
        if frame is None or frame.shape != (self._features,) or not np.isfinite(frame).all():
            return
        if self._calibration is None:
            self._clock.advance(tick.now, tick.sent)
            self._calibration = self._calibrator.add(self._clock.time, frame)
        self.shown = None if self._calibration is None else self._calibration.apply(frame)
