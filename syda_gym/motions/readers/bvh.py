"""Biovision hierarchies (BVH) through upc-pymotion; joints are found by name (CMU, Mixamo, LAFAN and the like).

The file's structure is checked line by line first, so that a damaged file is told by its line; then ``pymotion`` reads
it and turns its Euler angles into rotations.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MissingExtraError, MotionError
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.joint_names import match_joints
from syda_gym.motions.readers.skeleton import Recording, motions_from
from syda_gym.motions.readers.text import first_bytes, numbers, read_lines

__all__ = ["is_bvh", "read_bvh"]

_KIND = "a BVH file"
_MAX_JOINTS = 500
_POSITIONS = ["Xposition", "Yposition", "Zposition"]
_ROTATIONS = ["Xrotation", "Yrotation", "Zrotation"]


@dataclass
class _Structure:
    """What the check found: joint names, channels, and where the frames are."""

    names: list[str]
    channels: int
    frames: int
    frame_time: float
    first_line: int


def is_bvh(path: Path) -> bool:
    """Whether a file begins with ``HIERARCHY``."""
    return first_bytes(path, 64).lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"HIERARCHY")


def read_bvh(path: str | Path) -> Motions:
    """Reads a BVH file.

    Args:
        path: the ``.bvh`` file.

    Returns:
        Motions of one human, ``"operator"``, at the file's frame rate, in metres, seen from its own body.

    Raises:
        MotionError: missing, too large, truncated or damaged (the message names the line), or without arms.
        MissingExtraError: ``upc-pymotion`` is not installed.
    """
    file = Path(path)
    structure = _check(file, read_lines(file, _KIND))
    positions = _positions(file, structure)
    matched = match_joints(structure.names)
    joints = {joint: positions[:, structure.names.index(name)] for joint, name in matched.items()}
    structure_lines = structure.first_line + np.arange(structure.frames)
    notes = ["joints: " + ", ".join(f"{joint} = {matched[joint]}" for joint in matched if joint[1:] in _ARM_PARTS)]
    start = 0
    if _begins_with_calibration(joints):
        start = 1
        notes.append("the first frame is a calibration pose that the motion does not continue; dropped")
    return motions_from(
        Recording(
            file,
            "bvh",
            {joint: values[start:] for joint, values in joints.items()},
            fps=1.0 / structure.frame_time,
            lines=structure_lines[start:],
            names=tuple(structure.names),
            notes=notes,
        )
    )


def _begins_with_calibration(joints: dict[str, FloatArray]) -> bool:
    """Whether a hand jumps by half an arm between the first two frames and nowhere near as far later (CMU's T pose)."""
    for side in "LR":
        arm = [joints.get(side + part) for part in _ARM_PARTS]
        if any(values is None or len(values) < 4 for values in arm):
            continue
        shoulder, elbow, hand = (values for values in arm if values is not None)
        length = np.linalg.norm(elbow[1] - shoulder[1]) + np.linalg.norm(hand[1] - elbow[1])
        jumps = np.linalg.norm(np.diff(hand - shoulder, axis=0), axis=1)
        if jumps[0] > 0.5 * length and jumps[0] > 3.0 * jumps[1:].max():
            return True
    return False


_ARM_PARTS = ("Shoulder", "Elbow", "Hand")


def _positions(file: Path, structure: _Structure) -> FloatArray:
    """Joint positions ``(N, joints, 3)`` in the file's units by pymotion's reader and quaternions."""
    try:
        from pymotion.io.bvh import BVH
        from pymotion.rotations import quat_np as quaternions
    except ImportError as error:
        raise MissingExtraError("reading BVH", "bvh") from error
    bvh = BVH()
    try:
        bvh.load(str(file))
        rotations, local, parents, _, _, _ = bvh.get_data()
    except Exception as error:  # pymotion raises whatever its parsing runs into
        raise MotionError(f"{file}: pymotion cannot read it: {error}") from error
    if list(bvh.data["names"]) != structure.names:
        raise MotionError(f"{file}: pymotion reads other joints than the hierarchy holds; are names split by spaces?")
    # Joints with six channels move against their parents, which pymotion's own forward kinematics leaves out.
    result = np.array(local, dtype=np.float64)
    turns = np.array(rotations, dtype=np.float64)
    for joint in range(1, len(structure.names)):
        parent = int(parents[joint])
        result[:, joint] = result[:, parent] + quaternions.mul_vec(turns[:, parent], result[:, joint])
        turns[:, joint] = quaternions.mul(turns[:, parent], turns[:, joint])
    if not np.isfinite(result).all():
        frame = int(np.flatnonzero(~np.isfinite(result).all(axis=(1, 2)))[0])
        raise MotionError(f"{file}, line {structure.first_line + frame}: a joint position is not finite")
    return result


def _check(file: Path, lines: list[str]) -> _Structure:
    """Walks the file and says at which line it is no BVH."""
    words = [line.split() for line in lines]
    cursor = _next(words, 0)
    if cursor >= len(lines) or words[cursor] != ["HIERARCHY"]:
        raise MotionError(f"{file}, line {cursor + 1}: expected HIERARCHY; this is not {_KIND}")
    names, channels, cursor = _hierarchy(file, words, cursor + 1)
    header = {}
    for key, pattern in (("frames", r"Frames:?\s+(\d+)\s*$"), ("time", r"Frame\s+Time:?\s+([-+.\deE]+)\s*$")):
        cursor = _next(words, cursor)
        match = re.match(pattern, lines[cursor].strip()) if cursor < len(lines) else None
        if match is None:
            what = "Frames: <count>" if key == "frames" else "Frame Time: <seconds>"
            raise MotionError(
                f"{file}, line {min(cursor, len(lines) - 1) + 1}: expected '{what}'; is the file truncated?"
            )
        header[key] = match.group(1)
        cursor += 1
    frames, time = int(header["frames"]), _seconds(file, header["time"], cursor)
    first = _next(words, cursor)
    _check_frames(file, lines, words, first, frames, channels)
    return _Structure(names, channels, frames, time, first + 1)


def _hierarchy(file: Path, words: list[list[str]], cursor: int) -> tuple[list[str], int, int]:
    """Checks the tree; returns joint names, number of channels, and the line after ``MOTION``."""
    names: list[str] = []
    channels, depth = 0, 0
    expects_brace = False
    end_site: int | None = None
    waiting: list[str] = []  # joints that still need channels
    while cursor < len(words):
        row, place = words[cursor], f"{file}, line {cursor + 1}"
        cursor += 1
        if not row:
            continue
        if expects_brace != (row == ["{"]):
            raise MotionError(
                f"{place}: expected {'{' if expects_brace else 'a joint, OFFSET, CHANNELS or }'}, got {row[0]!r}"
            )
        if row == ["{"]:
            depth, expects_brace = depth + 1, False
        elif row[0] in ("ROOT", "JOINT"):
            if len(row) < 2 or (row[0] == "ROOT") != (not names) or (row[0] == "JOINT" and depth == 0):
                raise MotionError(
                    f"{place}: expected one ROOT, then JOINT with a name inside it; got {' '.join(row)!r}"
                )
            names.append(row[1])
            waiting.append(row[1])
            expects_brace = True
        elif row[:2] == ["End", "Site"]:
            end_site, expects_brace = depth + 1, True
        elif row[0] == "OFFSET":
            if len(row) != 4:
                raise MotionError(f"{place}: OFFSET needs three numbers, got {len(row) - 1}")
            if np.isnan(numbers(row[1:], file, cursor)).any():
                raise MotionError(f"{place}: an offset is not a number")
        elif row[0] == "CHANNELS":
            channels += _check_channels(place, row, first=len(names) == 1)
            if not waiting or waiting.pop() != names[-1]:
                raise MotionError(f"{place}: CHANNELS belongs to no joint, or comes twice")
        elif row == ["}"]:
            end_site = None if end_site == depth else end_site
            depth -= 1
            if depth < 0:
                raise MotionError(f"{place}: a closing brace too many")
        elif row == ["MOTION"]:
            if depth or not names or waiting:
                missing = f"joint {waiting[0]!r} has no CHANNELS" if waiting else f"{depth} braces are open"
                raise MotionError(f"{place}: MOTION comes too early, {missing if names else 'there is no joint'}")
            _check_names(file, names)
            return names, channels, cursor
        else:
            raise MotionError(f"{place}: {' '.join(row)[:60]!r} has no meaning in a BVH hierarchy")
    raise MotionError(f"{file}, line {len(words)}: the file ends inside the hierarchy; it is truncated")


def _check_names(file: Path, names: list[str]) -> None:
    if len(names) > _MAX_JOINTS:
        raise MotionError(f"{file}: {len(names)} joints; at most {_MAX_JOINTS} are read")
    for name in names:
        if names.count(name) > 1:
            raise MotionError(f"{file}: joint {name!r} occurs {names.count(name)} times; names must be distinct")


def _check_channels(place: str, row: list[str], first: bool) -> int:
    kinds = row[2:]
    rotations = kinds[-3:]
    good = (
        len(row) > 1
        and row[1] == str(len(kinds))
        and len(kinds) in (3, 6)
        and sorted(rotations) == _ROTATIONS
        and (len(kinds) == 3 or sorted(kinds[:3]) == _POSITIONS)
    )
    if not good:
        raise MotionError(
            f"{place}: expected CHANNELS 3 with three rotations, or 6 with three positions before them; got "
            f"{' '.join(row)[:90]!r}"
        )
    return len(kinds)


def _check_frames(file: Path, lines: list[str], words: list[list[str]], first: int, frames: int, channels: int) -> None:
    rows = list(range(first, len(lines)))
    while rows and not words[rows[-1]]:
        rows.pop()
    if len(rows) != frames:
        raise MotionError(
            f"{file}, line {len(lines)}: {len(rows)} frames, but the header says {frames}"
            + ("; the file is truncated" if len(rows) < frames else "")
        )
    for index in rows:
        if len(words[index]) != channels:
            end = "; the file is truncated" if index == rows[-1] else ""
            raise MotionError(
                f"{file}, line {index + 1}: {len(words[index])} numbers, the hierarchy has {channels} channels{end}"
            )
        if np.isnan(numbers(words[index], file, index + 1)).any():
            raise MotionError(f"{file}, line {index + 1}: a channel is not a number (NaN)")


def _seconds(file: Path, text: str, line: int) -> float:
    try:
        time = float(text)
    except ValueError:
        time = float("nan")
    if not 1e-4 <= time <= 10.0:
        raise MotionError(f"{file}, line {line}: the frame time must be between 0.0001 and 10 s, got {text}")
    return time


def _next(words: list[list[str]], cursor: int) -> int:
    """The next line that is not empty."""
    while cursor < len(words) and not words[cursor]:
        cursor += 1
    return cursor
