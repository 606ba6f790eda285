"""Logs of a training: TensorBoard, and one CSV file that a resumed training carries on."""

from __future__ import annotations

import csv
import importlib
from pathlib import Path
from typing import Any

__all__ = ["training_logger"]

_STEPS = "time/total_timesteps"


def training_logger(folder: Path, resumed_at: int | None) -> Any:
    """A Stable-Baselines3 logger.

    Args:
        folder: of ``progress.csv`` and TensorBoard's files.
        resumed_at: steps of the checkpoint that the training goes on from: rows up to there are kept, later ones are of
            a leg that is trained again. ``None`` begins a new file.
    """
    from stable_baselines3.common.logger import CSVOutputFormat, Logger, TensorBoardOutputFormat

    class Carried(CSVOutputFormat):  # type: ignore[misc]
        """Begins with the rows of the training before."""

        def __init__(self, path: Path) -> None:
            names, rows = ([], []) if resumed_at is None else _rows_until(path, resumed_at)
            super().__init__(str(path))
            if names:
                self.keys = names
                csv.writer(self.file, lineterminator="\n").writerows([names, *rows])
                self.file.flush()

    folder.mkdir(parents=True, exist_ok=True)
    formats: list[Any] = [Carried(folder / "progress.csv")]
    try:
        importlib.import_module("tensorboard")
    except ImportError:
        return Logger(str(folder), formats)
    return Logger(str(folder), [*formats, TensorBoardOutputFormat(str(folder))])


def _rows_until(path: Path, steps: int) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a log that are not later than some steps; nothing if it cannot be read."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            names, *rows = csv.reader(file)
        place = names.index(_STEPS)
        return names, [row for row in rows if len(row) == len(names) and float(row[place]) <= steps]
    except (OSError, ValueError, csv.Error):
        return [], []
