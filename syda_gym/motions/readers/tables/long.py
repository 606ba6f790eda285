"""Tables of one point a line: frame, name or number of the point, x, y, z."""

from __future__ import annotations

import numpy as np

from syda_gym.errors import MotionError
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import Said
from syda_gym.motions.readers.tables.columns import Columns
from syda_gym.motions.readers.tables.grid import Grid
from syda_gym.motions.readers.tables.named import from_header
from syda_gym.motions.readers.tables.people import one_person

__all__ = ["from_long", "is_long"]

_MOST_POINTS = 600


def is_long(columns: Columns) -> bool:
    """Whether a header is that of one point a line."""
    return set(columns.axes) >= {"x", "y", "z"} and columns.point >= 0 and not columns.points


def from_long(grid: Grid, columns: Columns, said: Said, format: str | None = None) -> Recording:
    """Turns one point a line into one frame a line and reads that.

    Raises:
        MotionError: neither a frame nor a time tells the frames apart, or points come twice in a frame.
    """
    key = columns.frame if columns.frame >= 0 else columns.time
    if key < 0:
        raise MotionError(
            f"{grid.path}: one point a line, but no column counts the frames; expected one called frame or "
            f"timestamp, got "
            f"{', '.join(grid.header[-1][:8])}"
        )
    people = grid.words.get(columns.person)
    if people is None and columns.person >= 0:
        people = [f"{value:.17g}" for value in grid.values[:, columns.person]]
    rows, notes = one_person(grid.path, people, len(grid.values), said)
    grid.check([key, *[columns.axes[axis] for axis in "xyz"]])
    words = grid.words.get(columns.point)
    labels = [words[row] if words else f"{grid.values[row, columns.point]:.6g}" for row in rows]
    names = list(dict.fromkeys(labels))
    if len(names) > _MOST_POINTS:
        raise MotionError(f"{grid.path}: {len(names)} different points; at most {_MOST_POINTS} are read")
    frames, first, index = np.unique(grid.values[rows, key], return_index=True, return_inverse=True)
    if len(frames) * len(names) > 4 * len(rows) + 1000:
        raise MotionError(
            f"{grid.path}: {len(names)} points in {len(frames)} frames on {len(rows)} lines; most are missing"
        )
    width = 4 if "c" in columns.axes else 3
    table = np.full((len(frames), 1 + width * len(names)), np.nan)
    numbers = {name: position for position, name in enumerate(names)}
    point = np.array([numbers[label] for label in labels])
    for offset, axis in enumerate("xyz" + "c" * (width - 3)):
        table[index, 1 + width * point + offset] = grid.values[rows, columns.axes[axis]]
    clock = columns.time if columns.time >= 0 else key
    table[:, 0] = grid.values[rows, clock][first]
    numbered = all(name.isdigit() for name in names)
    order = sorted(names, key=int) if numbered else names
    points = {
        name: dict(
            zip("xyzc"[:width], range(1 + width * numbers[name], 1 + width * numbers[name] + width), strict=True)
        )
        for name in order
    }
    wide = Columns(
        points=points, numbered=numbered, time=0 if columns.time >= 0 else -1, time_unit=columns.time_unit,
        time_name=columns.time_name, frame=-1 if columns.time >= 0 else 0, unit=columns.unit,
    )  # fmt: skip
    header = [["time", *(f"{name} {axis}" for name in names for axis in "xyzc"[:width])]]
    folded = Grid(grid.path, header, table, {}, grid.lines[rows][first], {})
    recording = from_header(folded, wide, Said(**{**vars(said), "person": None}), format)
    recording.notes[:0] = [*notes, f"one point a line: {len(names)} points in {len(frames)} frames"]
    return recording
