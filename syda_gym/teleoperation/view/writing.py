"""Recorder: what operator and robot did while the record button was on, as a motion file."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import SydaError
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.readers.own.npz import save_motions
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import Decision

__all__ = ["Recorder"]

_LEAST = 10  # frames
_MOST = 100_000  # frames; an hour at 30 Hz, after which the oldest part is kept and no more is taken


class Recorder:
    """Collects frames and commands of a run; the file can be replayed, looked at, and fitted on.

    Args:
        loop: of the run.
        folder: where files are written.

    Attributes:
        message: what a person should know: being recorded, where it was written, or why not.
        path: of the last file that was written, or ``None``.
    """

    def __init__(self, loop: TeleoperationLoop, folder: Path) -> None:
        self._loop, self._folder = loop, folder
        self._rows: list[tuple[float, FloatArray, FloatArray]] = []
        self._lock = threading.Lock()
        self.running = False
        self.message = ""
        self.path: Path | None = None

    def toggle(self) -> None:
        """Begins to record, or ends and writes."""
        if self.running:
            self.finish()
        else:
            with self._lock:
                self._rows = []
            self.message = "recording"
            self.running = True

    def add(self, decision: Decision) -> None:
        """Keeps the frame that the loop has just acted on; called by the loop's thread."""
        frame = self._loop.frame if decision.frame_used else None
        if frame is not None and len(self._rows) < _MOST:
            self._rows.append((decision.now, frame, decision.command))

    def finish(self) -> None:
        """Ends and writes."""
        self.running = False
        with self._lock:
            rows, self._rows = self._rows, []
        if len(rows) < _LEAST:
            self.message = f"nothing recorded: {len(rows)} frames moved the robot, at least {_LEAST} are needed"
            return
        try:
            self.path = self._write(rows)
        except SydaError as error:
            self.message = f"not recorded: {error}"
            return
        self.message = f"recorded {len(rows)} frames: {self.path}"

    def _write(self, rows: list[tuple[float, FloatArray, FloatArray]]) -> Path:
        times = np.array([row[0] for row in rows])
        fps = self._loop.settings.rate
        even = np.arange(times[0], times[-1], 1.0 / fps)
        source, robot = self._loop.mapping.source, self._loop.robot
        frames = {
            source.name: _resampled(even, times, np.stack([row[1] for row in rows])),
            robot.name: _resampled(even, times, np.stack([row[2] for row in rows])),
        }
        name = time.strftime("recorded-%Y%m%d-%H%M%S")
        take = Take(name, name, fps, frames)
        motions = Motions(name, (take,), {source.name: source, robot.name: robot})
        return save_motions(motions, self._folder / f"{name}.npz")


def _resampled(even: FloatArray, times: FloatArray, values: FloatArray) -> FloatArray:
    return np.stack([np.interp(even, times, column) for column in values.T], axis=1)
