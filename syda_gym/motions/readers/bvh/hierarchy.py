"""The text of a BVH file: its tree of joints and its table of channels, with the line of whatever is wrong."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import BUDGET
from syda_gym.motions.readers.text import numbers

__all__ = ["Hierarchy", "Joint", "read_hierarchy"]

_KIND = "a BVH file"
_MAX_JOINTS = 500
_CHANNEL = re.compile(r"([xyz])(position|rotation)", re.IGNORECASE)
_FRAMES = re.compile(r"frames\s*:?\s*(\d{1,9})\s*$", re.IGNORECASE)
_TIME = re.compile(r"frame\s*time\s*:?\s*(\S+)\s*$", re.IGNORECASE)


@dataclass
class Joint:
    """One joint of the tree.

    Attributes:
        name: as it stands in the file; it may have spaces.
        parent: index, -1 for a root.
        offset: from the parent ``(3,)``.
        channels: per channel axis 0..2 and whether it is a rotation, in the order of the columns.
        first: column of the first channel.
        line: where it stands.
    """

    name: str
    parent: int
    offset: FloatArray
    channels: list[tuple[int, bool]] = field(default_factory=list)
    first: int = 0
    line: int = 0


@dataclass
class Hierarchy:
    """A BVH file as read.

    Attributes:
        joints: parents stand before their children.
        values: ``(N, channels)``, rotations in degrees.
        frame_time: [s].
        lines: ``(N,)`` line of each frame.
        notes: what was odd.
    """

    joints: list[Joint]
    values: FloatArray
    frame_time: float
    lines: np.ndarray
    notes: list[str]


def read_hierarchy(file: Path, lines: list[str]) -> Hierarchy:
    """Reads the lines of a BVH file.

    Raises:
        MotionError: no BVH, truncated or damaged; the message names the line.
    """
    cursor = _next(lines, 0)
    if cursor >= len(lines) or not lines[cursor].strip().upper().startswith("HIERARCHY"):
        raise MotionError(f"{file}, line {cursor + 1}: expected HIERARCHY; this is not {_KIND}")
    joints, cursor = _tree(file, lines, cursor + 1)
    cursor, frames = _header(file, lines, cursor, _FRAMES, "Frames: <count>")
    cursor, time = _header(file, lines, cursor, _TIME, "Frame Time: <seconds>")
    notes: list[str] = []
    channels = sum(len(joint.channels) for joint in joints)
    values, places = _table(file, lines, cursor, int(frames), channels, notes)
    return Hierarchy(joints, values, _seconds(file, time, cursor), places, notes)


def _tree(file: Path, lines: list[str], cursor: int) -> tuple[list[Joint], int]:
    """Reads the tree; returns its joints and the line after ``MOTION``."""
    joints: list[Joint] = []
    stack: list[int] = []  # index of each open joint, -1 for an end site
    opened: int | None = None  # what the next brace opens
    seen: set[int] = set()  # joints whose channels were named
    column = 0
    for number in range(cursor, len(lines)):
        for part in _parts(lines[number]):
            words = part.split()
            place, word = f"{file}, line {number + 1}", words[0].upper()
            if (opened is not None) != (part == "{"):
                raise MotionError(
                    f"{place}: expected {'{' if opened is not None else 'a joint, OFFSET, CHANNELS or }'}, got "
                    f"{part[:60]!r}"
                )
            if part == "{" and opened is not None:
                stack.append(opened)
                opened = None
                if len(stack) > BUDGET.depth:
                    raise MotionError(
                        f"{place}: more than {BUDGET.depth} joints hang below one another; that is no person"
                    )
            elif word in ("ROOT", "JOINT"):
                name = part[len(word) :].strip()
                if not name or (word == "ROOT") != (not stack) or (word == "ROOT" and joints) or stack[-1:] == [-1]:
                    raise MotionError(
                        f"{place}: expected one ROOT, then JOINT with a name inside it; got {part[:60]!r}"
                    )
                if len(joints) >= _MAX_JOINTS:
                    raise MotionError(f"{file}: more than {_MAX_JOINTS} joints; at most {_MAX_JOINTS} are read")
                joints.append(Joint(name, stack[-1] if stack else -1, np.zeros(3), first=column, line=number + 1))
                opened = len(joints) - 1
            elif word == "END" and len(words) <= 3:
                opened = -1
            elif word == "OFFSET" and stack:
                _offset(file, number + 1, words, joints[stack[-1]] if stack[-1] >= 0 else None)
            elif word == "CHANNELS" and stack:
                index = stack[-1]
                if index < 0 or index in seen or index != len(joints) - 1:
                    raise MotionError(f"{place}: CHANNELS belongs to no joint, or comes twice")
                seen.add(index)
                joints[index].channels = _channels(place, words)
                joints[index].first = column
                column += len(joints[index].channels)
            elif part == "}":
                if not stack:
                    raise MotionError(f"{place}: a closing brace too many")
                stack.pop()
            elif word == "MOTION":
                if stack or not joints:
                    raise MotionError(
                        f"{place}: MOTION comes too early, "
                        f"{f'{len(stack)} braces are open' if joints else 'there is no joint'}"
                    )
                return joints, number + 1
            else:
                raise MotionError(f"{place}: {part[:60]!r} has no meaning in a BVH hierarchy")
    raise MotionError(f"{file}, line {len(lines)}: the file ends inside the hierarchy; it is truncated")


def _parts(line: str) -> list[str]:
    """A line cut before and after braces at its ends, for some tools write ``JOINT Spine {`` on one line."""
    text = line.strip()
    parts = []
    if text[:1] in ("{", "}") and len(text) > 1:
        parts, text = [text[0]], text[1:].strip()
    if text[-1:] in ("{", "}") and len(text) > 1:
        return [*parts, text[:-1].strip(), text[-1]]
    return [*parts, text] if text else parts


def _offset(file: Path, line: int, words: list[str], joint: Joint | None) -> None:
    if len(words) != 4:
        raise MotionError(f"{file}, line {line}: OFFSET needs three numbers, got {len(words) - 1}")
    offset = numbers(words[1:], file, line)
    if np.isnan(offset).any():
        raise MotionError(f"{file}, line {line}: an offset is not a number")
    if joint is not None:
        joint.offset = offset


def _channels(place: str, words: list[str]) -> list[tuple[int, bool]]:
    matches = [_CHANNEL.fullmatch(word) for word in words[2:]]
    found = [("xyz".index(match.group(1).lower()), match.group(2).lower() == "rotation") for match in matches if match]
    if len(words) < 2 or words[1] != str(len(words) - 2) or len(found) != len(matches) or len(set(found)) != len(found):
        raise MotionError(
            f"{place}: expected CHANNELS, their number, and as many of Xposition to Zposition and Xrotation to "
            f"Zrotation (CHANNELS 3 "
            f"with three rotations is usual); got {' '.join(words)[:90]!r}"
        )
    return found


def _header(file: Path, lines: list[str], cursor: int, pattern: re.Pattern[str], what: str) -> tuple[int, str]:
    cursor = _next(lines, cursor)
    match = pattern.match(lines[cursor].strip()) if cursor < len(lines) else None
    if match is None:
        came = f", got {lines[cursor].strip()[:60]!r}" if cursor < len(lines) else "; is the file truncated?"
        raise MotionError(f"{file}, line {min(cursor, len(lines) - 1) + 1}: expected '{what}'{came}")
    return cursor + 1, match.group(1)


def _table(
    file: Path, lines: list[str], cursor: int, frames: int, channels: int, notes: list[str]
) -> tuple[FloatArray, np.ndarray]:
    """The channels ``(N, channels)`` and the line of each frame; blank lines are nothing, rows may be broken."""
    rows = [number for number in range(cursor, len(lines)) if lines[number].strip()]
    if channels == 0:
        raise MotionError(f"{file}: the hierarchy has no CHANNELS; there is no motion in it")
    if frames * channels > BUDGET.elements:
        raise MotionError(f"{file}: {frames} frames of {channels} channels; at most {BUDGET.elements} numbers are read")
    values = _fast(lines, rows, channels)
    if values is None:
        joined = " ".join(lines[number] for number in rows).split()
        if frames and len(joined) == frames * channels and len(rows) != frames:
            values = numbers(joined, file, cursor + 1).reshape(frames, channels)
            rows = [cursor] * frames
            notes.append("rows are broken over several lines")
        else:
            values = _slow(file, lines, rows, channels, frames)
    if len(values) < frames:
        raise MotionError(
            f"{file}, line {len(lines)}: {len(values)} frames, but the header says {frames}; the file is truncated"
        )
    if len(values) > frames:
        notes.append(f"the header says {frames} frames, the file has {len(values)}; all were read")
    if not np.isfinite(values).all():
        row = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        kind = "the number is infinite" if np.isinf(values[row]).any() else "a channel is not a number (NaN)"
        raise MotionError(f"{file}, line {rows[row] + 1}: {kind}")
    return values, np.array(rows) + 1


def _fast(lines: list[str], rows: list[int], channels: int) -> FloatArray | None:
    """The whole table at once, if every row is as it should be."""
    if not rows:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            table = np.loadtxt([lines[number] for number in rows], dtype=np.float64, ndmin=2, comments=None)
    except (ValueError, IndexError, OverflowError):
        return None
    return table if table.shape == (len(rows), channels) else None


def _slow(file: Path, lines: list[str], rows: list[int], channels: int, frames: int) -> FloatArray:
    """Row by row, so that a message can name the line."""
    table = np.empty((len(rows), channels))
    for row, number in enumerate(rows):
        words = lines[number].split()
        if len(words) != channels:
            end = "; the file is truncated" if row == len(rows) - 1 else ""
            if row >= frames and row == len(rows) - 1:
                return table[:row]
            raise MotionError(
                f"{file}, line {number + 1}: {len(words)} numbers, the hierarchy has {channels} channels{end}"
            )
        table[row] = numbers(words, file, number + 1)
    return table


def _seconds(file: Path, text: str, line: int) -> float:
    """The time of a frame [s]: a number, with a comma in some countries, or a fraction such as ``1/30``."""
    above, slash, below = text.replace(",", ".").partition("/")
    try:
        time = float(above) / float(below) if slash else float(above)
    except (ValueError, ZeroDivisionError, OverflowError):
        time = float("nan")
    if not 1e-4 <= time <= 10.0:
        raise MotionError(f"{file}, line {line}: the frame time must be between 0.0001 and 10 s, got {text[:40]!r}")
    return time


def _next(lines: list[str], cursor: int) -> int:
    """The next line that is not empty."""
    while cursor < len(lines) and not lines[cursor].strip():
        cursor += 1
    return cursor
