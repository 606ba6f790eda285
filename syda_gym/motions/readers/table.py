"""Tables with a header that names joints and axes: one frame a line.

A column is ``<joint><separator><x|y|z|confidence>`` such as ``left_shoulder_x``, ``LeftShoulder.y``, ``elbow_l:z`` or
``HEAD conf``; other columns are ignored, but for one of time (``time``, ``timestamp``, ``t``, ``seconds``, ``millis``,
``time_ms``, ``timestamp_us``).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.readers.joint_names import match_joints
from syda_gym.motions.readers.skeleton import Recording
from syda_gym.motions.readers.text import numbers, split_row

__all__ = ["is_header", "read_table"]

_COLUMN = re.compile(
    r"^(.*?)[\s._:/\-]*(?:pos(?:ition)?)?[\s._:/\-]*([xyz]|c|v|conf(?:idence)?|vis(?:ibility)?|score|tracked)$", re.I
)
_CLOCKS = {
    "time": 1.0, "times": 1.0, "timestamp": 1.0, "t": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "times_s": 1.0,
    "time_s": 1.0, "timestamp_s": 1.0, "millis": 1e-3, "ms": 1e-3, "time_ms": 1e-3, "timestamp_ms": 1e-3,
    "us": 1e-6, "time_us": 1e-6, "timestamp_us": 1e-6, "ns": 1e-9, "time_ns": 1e-9, "timestamp_ns": 1e-9,
}  # fmt: skip


def is_header(line: str) -> bool:
    """Whether a line names at least one joint's three axes."""
    return any(len(axes & {"x", "y", "z"}) == 3 for axes in map(set, _columns(split_row(line)).values()))


def read_table(
    path: Path,
    lines: list[str],
    kind: str,
    *,
    least: float = 0.5,
    zero_is_gap: bool = False,
    notes: list[str] | None = None,
) -> Recording:
    """Reads the lines of a table with a header.

    Args:
        path: file, for messages.
        lines: header first.
        kind: format name of the recording.
        least: confidence below which a joint counts as untracked.
        zero_is_gap: whether a position of exactly (0, 0, 0) means untracked.
        notes: notes to start from.

    Raises:
        MotionError: no joints in the header, or a row that does not fit.
    """
    header = split_row(lines[0])
    columns = _columns(header)
    complete = {name: axes for name, axes in columns.items() if {"x", "y", "z"} <= set(axes)}
    matched = match_joints(list(complete))
    if not matched:
        raise MotionError(
            f"{path}, line 1: no joint is named; expected columns such as left_shoulder_x, left_shoulder_y and "
            f"left_shoulder_z, got {', '.join(header[:6])}"
        )
    rows, places = [], []
    for index, line in enumerate(lines[1:], start=2):
        if not line.strip() or line.strip() == "END":
            continue
        cells = split_row(line)
        if len(cells) != len(header):
            raise MotionError(f"{path}, line {index}: {len(cells)} columns, the header has {len(header)}")
        wanted = [cell if column in _needed(complete, header) else "" for column, cell in enumerate(cells)]
        rows.append(numbers(wanted, path, index))
        places.append(index)
    if not rows:
        raise MotionError(f"{path} has a header but no frames")
    table = np.array(rows)
    joints = {}
    for joint, name in matched.items():
        axes = complete[name]
        position = table[:, [axes["x"], axes["y"], axes["z"]]]
        lost = np.zeros(len(table), dtype=bool)
        if "c" in axes:
            lost |= ~(table[:, axes["c"]] >= least)
        if zero_is_gap:
            lost |= (position == 0.0).all(axis=1)
        joints[joint] = np.where(lost[:, None], np.nan, position)
    return Recording(
        path, kind, joints, timestamps=_clock(header, table), lines=np.array(places), names=tuple(complete),
        notes=list(notes or []),
    )  # fmt: skip


def _columns(header: list[str]) -> dict[str, dict[str, int]]:
    """Joint name to its axes (``x``, ``y``, ``z`` and ``c`` for confidence) to column."""
    found: dict[str, dict[str, int]] = {}
    for column, cell in enumerate(header):
        match = _COLUMN.match(cell.strip().strip('"'))
        if match and match.group(1):
            axis = match.group(2).lower()
            found.setdefault(match.group(1), {}).setdefault(axis if axis in ("x", "y", "z") else "c", column)
    return found


def _needed(columns: dict[str, dict[str, int]], header: list[str]) -> set[int]:
    clocks = {column for column, cell in enumerate(header) if cell.strip().lower() in _CLOCKS}
    return {column for axes in columns.values() for column in axes.values()} | clocks


def _clock(header: list[str], table: FloatArray) -> FloatArray | None:
    for column, cell in enumerate(header):
        factor = _CLOCKS.get(cell.strip().lower())
        if factor is not None:
            times: FloatArray = table[:, column] * factor
            # A plain "timestamp" may be in milli-, micro- or nanoseconds: frames come 1 to 1000 times a second.
            step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
            while factor == 1.0 and step > 2.0:
                times, step = times * 1e-3, step * 1e-3
            return times
    return None
