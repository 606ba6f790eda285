"""Tables without a header: every way to cut a line into joints is tried, and the one that makes a person is taken."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.readers.certainty import looks_like_certainty, without_lost
from syda_gym.motions.readers.choice import Way, best_way, points_to_joints
from syda_gym.motions.readers.layouts import CORNELL_JOINTS, LAYOUTS, Layout
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import Said
from syda_gym.motions.readers.tables.grid import Grid
from syda_gym.motions.readers.tables.people import one_person
from syda_gym.motions.readers.times import Stamps

__all__ = ["from_numbers", "may_be_positions"]

_WIDTHS = (3, 4, 7, 8)  # x y z; with confidence; with quaternion; with both
_MOST_BEFORE, _MOST_BEHIND = 4, 1
_LOOKED_AT = 200  # frames on which the ways are compared
_CORNELL_COLUMNS = 1 + 11 * 14 + 4 * 4
_ODD = 0.6  # what speaks against a way that leaves columns over or has a certainty that is none


def may_be_positions(columns: int, format: str | None = None) -> bool:
    """Whether so many columns can be joints in some order."""
    return columns == _CORNELL_COLUMNS or any(True for _ in _cuts(columns, format, Said()))


def from_numbers(grid: Grid, said: Said, format: str | None = None) -> Recording:
    """Reads a table of nothing but numbers.

    Raises:
        MotionError: no way to read it makes a person; the message lists the ways.
    """
    columns = grid.values.shape[1]
    sample = np.unique(np.linspace(0, len(grid.values) - 1, _LOOKED_AT).astype(int))
    ways, cuts = [], []
    for before, layout, width, extra in _cuts(columns, format, said):
        points, sure = _points(grid.values[sample], before, layout, width)
        if width in (4, 8) and sure is not None and not looks_like_certainty(sure):
            continue
        label = (
            f"{layout.name}"
            + (f" after {before} columns" if before else "")
            + (f" of {width} numbers" if width != 3 else "")
        )
        ways.append(Way(label, layout, points_to_joints(without_lost(points, sure, said), layout, said), extra))
        cuts.append((before, width))
    if columns == _CORNELL_COLUMNS and not said.order:
        layout = Layout("Cornell rows", "openni", CORNELL_JOINTS, zero_is_gap=True)
        points, sure = _cornell(grid.values[sample])
        ways.append(Way(layout.name, layout, points_to_joints(without_lost(points, sure, said), layout, said)))
        cuts.append((1, 0))
    best, doubt = best_way(grid.path, ways, f"{columns} columns of numbers")
    before, width = cuts[ways.index(best)]
    grid.check(list(range(before, columns if width == 0 else before + width * len(best.layout.joints))))
    return _recording(grid, said, best, before, width, doubt)


def _recording(grid: Grid, said: Said, best: Way, before: int, width: int, doubt: str | None) -> Recording:
    notes = [f"read as {best.label}"]
    grid.check([column for column in range(before) if np.isfinite(grid.values[:, column]).mean() > 0.5])
    lead = grid.values[:, :before]
    rows, note = one_person(grid.path, _identities(lead), len(lead), said)
    notes += note
    values, lead = grid.values[rows], lead[rows]
    points, sure = _cornell(values) if width == 0 else _points(values, before, best.layout, width)
    if sure is not None and width == 4 and best.layout.format == "kinect":
        _check_states(grid, rows, sure)
        if not said.inferred:
            notes.append("inferred joints count as untracked")
    joints = points_to_joints(without_lost(points, sure, said), best.layout, said)
    return Recording(
        grid.path, best.layout.format, joints, stamps=_times(lead, said), lines=grid.lines[rows],
        up=best.layout.up, notes=notes, doubts=[doubt] if doubt else [], image=best.layout.image,
        names=[name for name in best.layout.joints if name != "-"],
    )  # fmt: skip


def _cuts(columns: int, format: str | None, said: Said) -> Iterator[tuple[int, Layout, int, float]]:
    """Columns before the first joint, order, numbers a joint, and what speaks against it."""
    if said.order:
        yield said.skip, Layout("the order that was given", format or "table", said.order), said.columns, 0.0
        return
    layouts = [layout for layout in LAYOUTS if format in (None, layout.format)] or list(LAYOUTS)
    counts = {len(layout.joints) for layout in layouts}
    if said.joints and all(place.isdigit() for place in said.joints.values()):
        wanted = 1 + max(int(place) for place in said.joints.values())
        free = [(before, count) for before in range(_MOST_BEFORE + 1) for count in [(columns - before) // 3]
                if (columns - before) % 3 == 0 and count >= wanted and count not in counts]  # fmt: skip
        for before, count in free[:2]:
            yield before, Layout(f"{count} joints", format or "table", ("-",) * count), 3, _ODD * before
    for layout in layouts:
        for width in _WIDTHS:
            rest = columns - width * len(layout.joints)
            if 0 <= rest <= _MOST_BEFORE + _MOST_BEHIND:
                for before in range(min(rest, _MOST_BEFORE) + 1):
                    if rest - before <= _MOST_BEHIND:
                        yield before, layout, width, 0.2 * rest + (_ODD if rest > before else 0.0)


def _points(values: FloatArray, before: int, layout: Layout, width: int) -> tuple[FloatArray, FloatArray | None]:
    """Points ``(N, P, 3)`` and their certainty ``(N, P)``."""
    count = len(layout.joints)
    table = values[:, before : before + width * count].reshape(len(values), count, width)
    return table[:, :, :3], table[:, :, width - 1] if width in (4, 8) else None


def _cornell(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rows of CAD-60 and CAD-120: eleven joints with orientations, four without."""
    starts = [1 + 14 * index + 10 if index < 11 else 1 + 11 * 14 + 4 * (index - 11) for index in range(15)]
    points = np.stack([values[:, start : start + 3] for start in starts], axis=1)
    return points, np.stack([values[:, start + 3] for start in starts], axis=1)


def _check_states(grid: Grid, rows: np.ndarray, sure: FloatArray) -> None:
    known = sure[np.isfinite(sure)]
    wrong = np.flatnonzero((~np.isin(sure, (0, 1, 2, 3)) & np.isfinite(sure)).any(axis=1))
    if len(wrong) and (known == 2.0).mean() > 0.05:
        raise MotionError(f"{grid.path}, line {grid.lines[rows][wrong[0]]}: a tracking state is none of 0, 1 and 2")


def _identities(lead: FloatArray) -> FloatArray | None:
    """The column before the joints that tells people apart: few whole numbers that come back, and no clock."""
    for column in lead.T:
        known = np.unique(column[np.isfinite(column)])
        few = 1 < len(known) <= 6 and (known == np.round(known)).all() and len(column) > 3 * len(known)
        if few and (np.diff(column) < 0).any():
            identities: FloatArray = column
            return identities
    return None


def _times(lead: FloatArray, said: Said) -> Stamps | None:
    """The column before the joints that grows: times, or the number of the frame."""
    counting = None
    for index, column in enumerate(lead.T):
        grows = np.isfinite(column).all() and (np.diff(column) >= 0).all() and (np.diff(column) > 0).any()
        if not grows and said.time != str(index):
            continue
        stamps = Stamps(column, said.time_unit, f"column {index + 1}")
        if said.time == str(index):
            return stamps
        whole = (column == np.round(column)).all() and float(np.median(np.diff(column))) == 1.0
        if not whole and said.time is None:
            return stamps
        counting = counting or stamps
    if counting is None and lead.shape[1] and np.isfinite(lead).any():
        falling = [
            column for column in lead.T if np.isfinite(column).any() and len(np.unique(column)) > 0.5 * len(column)
        ]
        if falling:  # a clock that runs backward somewhere is a fault to be named, not a column to be left out
            return Stamps(falling[0], said.time_unit, "the first column")
    return counting if said.time is None else None
