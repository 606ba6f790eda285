"""Tables whose header takes several lines: names above axes, as OptiTrack, Vicon, Qualisys and TRC files have."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from syda_gym.errors import MotionError
from syda_gym.motions.readers.markers import joint_points
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import Said
from syda_gym.motions.readers.tables.grid import Grid, numeric
from syda_gym.motions.readers.tables.named import from_names
from syda_gym.motions.readers.times import Stamps, clock_unit

__all__ = ["from_stacked", "is_stacked"]

_AXIS = re.compile(r"(?:t|p|pos\s*)?([xyzw])\d*(?:\s*[(\[].*)?$", re.IGNORECASE)
_UNITS = {"m": 1.0, "meters": 1.0, "metres": 1.0, "mm": 0.001, "millimeters": 0.001, "millimetres": 0.001, "cm": 0.01,
          "centimeters": 0.01, "centimetres": 0.01, "inches": 0.0254}  # fmt: skip
_RATES = (
    "capture frame rate",
    "export frame rate",
    "camerarate",
    "datarate",
    "frequency",
    "frame rate",
    "framerate",
    "sample rate",
)
_SKIPPED = {"frame", "frame#", "sub frame", "time", "time (seconds)", "", "name", "id", "type", "parent"}


def is_stacked(grid: Grid) -> bool:
    """Whether one line of the header is nothing but axes, with another above it."""
    return len(grid.header) >= 2 and _axis_line(grid) is not None


def from_stacked(grid: Grid, said: Said, format: str | None = None) -> Recording:
    """Reads a table with names above axes.

    Raises:
        MotionError: no line of the header names joints or markers.
    """
    place = _axis_line(grid)
    axes = grid.header[place] if place is not None else []
    kinds = [row for row in grid.header if {"rotation", "position"} & {cell.lower() for cell in row}]
    turned = kinds[-1] if kinds else []
    best: dict[str, dict[str, int]] = {}
    best_count = -1
    for row in reversed(grid.header[:place]):
        points = _points(row, axes, turned, grid.values.shape[1])
        count = len(joint_points([name.rpartition(":")[2] for name in points]))
        if count > best_count:
            best, best_count = points, count
    if best_count < 1 and not said.joints:
        named = [cell for row in grid.header for cell in row if len(cell) > 1 and not numeric(cell)]
        raise MotionError(
            f"{grid.path}: the header names no joint or marker that is known; it has {', '.join(named[:10])}"
        )
    recording = from_names(
        grid, best, said, format=format or _format(grid), notes=[f"{len(best)} points named above their axes"]
    )
    recording.unit = _unit(grid)
    recording.fps = _rate(grid)
    recording.stamps = _stamps(grid)
    recording.image = False
    return recording


def _axis_line(grid: Grid) -> int | None:
    for index in range(len(grid.header) - 1, 0, -1):
        cells = [cell for cell in grid.header[index] if cell]
        named = [cell for cell in cells if _AXIS.match(cell)]
        if len(named) >= 6 and len(named) >= 0.7 * len(cells):
            return index
    return None


def _points(row: Sequence[str], axes: Sequence[str], turned: Sequence[str], columns: int) -> dict[str, dict[str, int]]:
    """Point to its columns; a name stands once above its columns or above each of them."""
    shift = _shift(row, axes, columns)
    names: list[str] = []
    last = ""
    for column in range(min(columns, len(axes) if len(axes) > shift else columns)):
        cell = row[column].strip() if column < len(row) else ""
        last = cell or last
        names.append(last)
    found: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        match = _AXIS.match(axes[column + shift]) if column + shift < len(axes) else None
        kind = turned[column].lower() if column < len(turned) else ""
        if not match or kind.startswith("rot") or name.lower() in _SKIPPED:
            continue
        found.setdefault(name, {}).setdefault(match.group(1).lower(), column)
    return {name: places for name, places in found.items() if {"x", "y", "z"} <= set(places)}


def _shift(row: Sequence[str], axes: Sequence[str], columns: int) -> int:
    """TRC files leave out the empty cells before the axes: the first axis then belongs to the first marker."""
    first_name = next((i for i, cell in enumerate(row) if cell.lower() not in _SKIPPED), 0)
    first_axis = next((i for i, cell in enumerate(axes) if _AXIS.match(cell)), 0)
    return first_axis - first_name if first_axis < first_name else 0


def _format(grid: Grid) -> str:
    start = " ".join(grid.header[0][:2]).lower()
    if "pathfiletype" in start:
        return "trc"
    return "optitrack" if start.startswith("format version") else "table"


def _unit(grid: Grid) -> float | None:
    for number, row in enumerate(grid.header):
        lower = [cell.lower() for cell in row]
        for index, cell in enumerate(lower):
            if cell in ("length units", "units", "unit"):
                below = grid.header[number + 1] if number + 1 < len(grid.header) else []
                for value in (
                    lower[index + 1] if index + 1 < len(lower) else "",
                    below[index].lower() if index < len(below) else "",
                ):
                    if value in _UNITS:
                        return _UNITS[value]
    for row in grid.header:
        found = [cell.lower() for cell in row if cell]
        known = [cell for cell in found if cell in _UNITS]
        if len(known) >= 3 and len(known) >= 0.7 * len(found):
            return _UNITS[known[0]]
    return None


def _rate(grid: Grid) -> float | None:
    for number, row in enumerate(grid.header):
        lower = [cell.lower() for cell in row]
        for index, cell in enumerate(lower):
            if cell not in _RATES:
                continue
            below = grid.header[number + 1] if number + 1 < len(grid.header) else []
            for value in (row[index + 1] if index + 1 < len(row) else "", below[index] if index < len(below) else ""):
                if numeric(value) and 1.0 <= float(value) <= 10_000.0:
                    return float(value)
    # Vicon writes the rate alone on the second line.
    for row in grid.header[:3]:
        filled = [cell for cell in row if cell]
        if len(filled) == 1 and numeric(filled[0]) and 1.0 <= float(filled[0]) <= 10_000.0:
            return float(filled[0])
    return None


def _stamps(grid: Grid) -> Stamps | None:
    for row in reversed(grid.header):
        for index, cell in enumerate(row[:4]):
            is_clock, unit = clock_unit(cell)
            if is_clock and index < grid.values.shape[1] and np.isfinite(grid.values[:, index]).all():
                return Stamps(grid.values[:, index], unit, cell)
    return None
