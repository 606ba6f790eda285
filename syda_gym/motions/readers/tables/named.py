"""Tables whose header names joints (or numbers points) and axes, one frame or one point a line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError, nearest_name
from syda_gym.motions.readers.certainty import lost
from syda_gym.motions.readers.choice import best_way, by_points
from syda_gym.motions.readers.layouts import MEDIAPIPE_JOINTS
from syda_gym.motions.readers.markers import joint_points
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import Said
from syda_gym.motions.readers.tables.columns import Columns
from syda_gym.motions.readers.tables.grid import Grid
from syda_gym.motions.readers.tables.people import chosen, one_person
from syda_gym.motions.readers.times import Stamps, past_midnight, timecodes

__all__ = ["from_header", "from_names", "points_by_person"]

_KINDS = (
    ("mediapipe", {"left_eye_inner", "left_foot_index", "mouth_left"}), ("azure", {"spinenavel", "clavicle"}),
    ("kinect", {"spinebase", "spineshoulder", "shouldercenter", "hipcenter"}), ("openni", {"torso", "neck"}),
)  # fmt: skip


def from_header(grid: Grid, columns: Columns, said: Said, format: str | None = None) -> Recording:
    """Reads a table of one frame a line whose header was understood.

    Raises:
        MotionError: the joints of no arm are named; the message lists what was found.
    """
    identities = grid.words.get(columns.person)
    if identities is None and columns.person >= 0:
        identities = [f"{value:.17g}" for value in grid.values[:, columns.person]]
    rows, notes = one_person(grid.path, identities, len(grid.values), said)
    stamps = _stamps(grid, columns, said)
    if stamps is not None:
        stamps = Stamps(stamps.values[rows], stamps.unit, stamps.name)
    recording = from_names(grid, columns.points, said, rows, numbered=columns.numbered, format=format, notes=notes)
    recording.stamps = stamps
    recording.unit = recording.unit or columns.unit
    return recording


def from_names(
    grid: Grid,
    places: Mapping[str, Mapping[str, int]],
    said: Said,
    rows: NDArray[np.intp] | None = None,
    *,
    numbered: bool = False,
    format: str | None = None,
    notes: Sequence[str] = (),
) -> Recording:
    """Reads the columns of named or numbered points.

    Args:
        grid: the table.
        places: point to its columns ``x``, ``y``, ``z`` and perhaps ``c``.
        said: what a person says.
        rows: frames of the person; all if left out.
        numbered: the points have numbers instead of names.
        format: what the result is called; found by the names if left out.
        notes: notes to start from.
    """
    picked = grid.values if rows is None else grid.values[rows]
    lines = grid.lines if rows is None else grid.lines[rows]
    wanted, notes = points_by_person(grid, list(places), said, list(notes))
    names = [name for name, _ in wanted]
    if not wanted:
        return _only_said(grid, picked, lines, said, format or "table", notes)
    points = np.stack([picked[:, [places[key][axis] for axis in "xyz"]] for _, key in wanted], axis=1)
    sure = np.stack(
        [picked[:, places[key]["c"]] if "c" in places[key] else np.full(len(picked), np.nan) for _, key in wanted],
        axis=1,
    )
    points = np.where(lost(sure, said)[:, :, None], np.nan, points)
    needed = [places[key][axis] for _, key in wanted for axis in "xyz"]
    if numbered:
        grid.check(needed)
        best, doubt = best_way(grid.path, by_points(points, said, format), f"{points.shape[1]} numbered points")
        return Recording(
            grid.path, best.layout.format, best.joints, lines=lines, up=best.layout.up, names=list(places),
            notes=[*notes, f"read as {best.label}"], doubts=[doubt] if doubt else [], image=best.layout.image,
        )  # fmt: skip
    matched = joint_points(names)
    matched |= {
        joint: (_said_point(grid, joint, place, names),) for joint, place in said.joints.items() if not _triple(place)
    }
    kind = format or _kind(names, any("c" in axes for axes in places.values()))
    joints = {joint: points[:, list(indices)].mean(axis=1) for joint, indices in matched.items()}
    joints |= _said_columns(grid, picked, said)
    if not joints:
        raise MotionError(
            f"{grid.path}: no joint is named; the columns name {', '.join(names[:8]) or 'nothing'}. Say which is "
            f"which: --joints "
            "LShoulder=NAME"
        )
    grid.check([places[wanted[i][1]][axis] for indices in matched.values() for i in indices for axis in "xyz"])
    if kind == "openni":
        joints = {name: np.where((v == 0.0).all(axis=1)[:, None], np.nan, v) for name, v in joints.items()}
    return Recording(
        grid.path, kind, joints, lines=lines, up=(0.0, -1.0, 0.0) if kind in ("mediapipe", "azure") else (0.0, 1.0,
        0.0), names=names,
        notes=notes, image=kind in ("mediapipe", "table"),
    )  # fmt: skip


def _only_said(
    grid: Grid, values: FloatArray, lines: NDArray[np.int64], said: Said, kind: str, notes: list[str]
) -> Recording:
    """Nothing but columns that somebody named."""
    joints = _said_columns(grid, values, said)
    unknown = [joint for joint in said.joints if joint not in joints]
    if unknown or not joints:
        raise MotionError(
            f"{grid.path}: no column has the axis of a point in its name, so joints need three columns each: "
            f"--joints LShoulder=X,Y,Z; "
            f"{', '.join(unknown[:4]) or 'none'} {'has' if len(unknown) == 1 else 'have'} not"
        )
    return Recording(
        grid.path,
        kind,
        joints,
        lines=lines,
        names=[cell for cell in grid.header[-1] if cell] if grid.header else [],
        notes=notes,
    )


def points_by_person(
    grid: Grid, keys: Sequence[str], said: Said, notes: list[str]
) -> tuple[list[tuple[str, str]], list[str]]:
    """Points of one person where names begin with a person's name and a colon: pairs of name and key, and notes."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for key in keys:
        who, _, name = key.rpartition(":")
        groups.setdefault(who, []).append((name, key))
    arms = [
        who
        for who, pairs in groups.items()
        if {"LShoulder", "RShoulder"} & set(joint_points([name for name, _ in pairs]))
    ]
    if len(arms) < 2:
        return [(key.rpartition(":")[2] or key, key) for key in keys], notes
    index, more = chosen(grid.path, arms, said)
    return groups[arms[index]], [*notes, *more]


def _stamps(grid: Grid, columns: Columns, said: Said) -> Stamps | None:
    column, unit, name = columns.time, columns.time_unit, columns.time_name
    if said.time is not None:
        header = [cell.lower() for cell in grid.header[-1]] if grid.header else []
        if said.time.isdigit() and int(said.time) < grid.values.shape[1]:
            column = int(said.time)
        elif said.time.lower() in header:
            column = header.index(said.time.lower())
        else:
            raise MotionError(
                f"{grid.path} has no column {said.time!r} of times; {nearest_name(said.time, header[:60])}"
            )
        name = said.time
    if column < 0 and columns.frame >= 0:
        column, name = columns.frame, "frame"
        if not np.isfinite(grid.values[:, column]).all():
            return None
    if column < 0 or column >= grid.values.shape[1]:
        return None
    if column in grid.words:
        codes = timecodes(grid.words[column])
        if codes is not None:
            return Stamps(codes, "s", name)
        grid.check([column])
    values = grid.values[:, column]
    if column in grid.clocks:
        return Stamps(past_midnight(values), "s", name)
    return Stamps(values, said.time_unit or unit, name)


def _kind(names: Sequence[str], sure: bool) -> str:
    bare = {"".join(c for c in name.lower() if c.isalnum()) for name in names}
    for kind, marks in _KINDS:
        if any(any(mark.replace("_", "") in name for name in bare) for mark in marks):
            return kind
    lower = {name.lower() for name in names}
    return "mediapipe" if sure and lower <= set(MEDIAPIPE_JOINTS) else "table"


def _said_point(grid: Grid, joint: str, place: str, names: Sequence[str]) -> int:
    lower = [name.lower() for name in names]
    if place.lower() in lower:
        return lower.index(place.lower())
    if place.isdigit() and int(place) < len(names):
        return int(place)
    raise MotionError(
        f"{grid.path} has no point {place!r} for {joint}; {nearest_name(place, [name[:60] for name in names[:200]])}"
    )


def _triple(place: str) -> bool:
    return place.count(",") == 2


def _said_columns(grid: Grid, values: FloatArray, said: Said) -> dict[str, FloatArray]:
    """Joints given as three columns, by names or numbers from 0."""
    header = [cell.strip().lower() for cell in grid.header[-1]] if grid.header else []
    joints = {}
    for joint, place in said.joints.items():
        if not _triple(place):
            continue
        columns = []
        for part in (one.strip() for one in place.split(",")):
            column = header.index(part.lower()) if part.lower() in header else int(part) if part.isdigit() else -1
            if not 0 <= column < grid.values.shape[1]:
                raise MotionError(f"{grid.path} has no column {part!r} for {joint}; {nearest_name(part, header[:60])}")
            columns.append(column)
        grid.check(columns)
        joints[joint] = values[:, columns]
    return joints
