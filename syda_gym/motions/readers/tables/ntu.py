"""Skeletons of NTU RGB+D: the number of frames, then per frame the number of bodies, and 25 joints for each of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.readers.certainty import without_lost
from syda_gym.motions.readers.choice import points_to_joints
from syda_gym.motions.readers.layouts import KINECT_JOINTS, layouts_of
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import Said
from syda_gym.motions.readers.tables.people import chosen
from syda_gym.motions.readers.text import numbers

__all__ = ["from_ntu", "is_ntu"]

_JOINTS = len(KINECT_JOINTS)
_MOST_BODIES = 6  # that a Kinect sees


def is_ntu(lines: list[str]) -> bool:
    """Whether lines begin with counts of frames, bodies and joints."""
    rows = [line.split() for line in lines[:40] if line.strip()]
    if len(rows) < 3 or len(rows[0]) != 1 or not rows[0][0].isdigit():
        return False
    place = 1
    while place < len(rows) and rows[place] == ["0"]:
        place += 1
    if place >= len(rows):
        return len(rows) > 10
    return (
        len(rows[place]) == 1 and rows[place][0].isdigit() and int(rows[place][0][:3]) <= _MOST_BODIES
        and (place + 2 >= len(rows) or rows[place + 2] == [str(_JOINTS)])
    )  # fmt: skip


def from_ntu(path: Path, lines: list[str], said: Said) -> Recording:
    """Reads the lines of an NTU skeleton; bodies are told apart by their tracking ids.

    Raises:
        MotionError: truncated or damaged; the message names the line.
    """
    kept = [number for number, line in enumerate(lines) if line.strip()]
    cursor = 0

    def take() -> tuple[list[str], int]:
        nonlocal cursor
        if cursor >= len(kept):
            raise MotionError(f"{path}, line {len(lines)}: the file ends inside a frame; it is truncated")
        number = kept[cursor]
        cursor += 1
        return lines[number].split(), number + 1

    def count(most: int, what: str) -> int:
        words, line = take()
        if len(words) != 1 or not words[0].isdigit() or len(words[0]) > 9 or int(words[0]) > most:
            raise MotionError(f"{path}, line {line}: expected the number of {what}, got {' '.join(words)[:40]!r}")
        return int(words[0])

    frames = count(1_000_000, "frames")
    bodies: dict[str, list[tuple[int, FloatArray]]] = {}
    places = []
    for frame in range(frames):
        places.append(kept[min(cursor, len(kept) - 1)] + 1)
        for _ in range(count(_MOST_BODIES, "bodies")):
            head, line = take()
            if len(head) < 2:
                raise MotionError(f"{path}, line {line}: expected a body's id and states, got {' '.join(head)[:40]!r}")
            joints = count(_JOINTS, "joints")
            if joints != _JOINTS:
                raise MotionError(f"{path}, line {line + 1}: {joints} joints; expected {_JOINTS}")
            rows = np.empty((_JOINTS, 4))
            for index in range(_JOINTS):
                words, line = take()
                if len(words) not in (11, 12):
                    end = "; is the file truncated?" if cursor >= len(kept) else ""
                    raise MotionError(f"{path}, line {line}: {len(words)} numbers of a joint; expected 12{end}")
                values = numbers([*words[:3], words[-1]], path, line)
                rows[index] = values
            bodies.setdefault(head[0][:40], []).append((frame, rows))
    if not bodies:
        raise MotionError(f"{path}: nobody was seen in {frames} frames")
    people = sorted(bodies, key=lambda one: -len(bodies[one])) if said.person is None else list(bodies)
    index, notes = chosen(path, people, said)
    table = np.full((frames, _JOINTS, 4), np.nan)
    for frame, rows in bodies[people[index]]:
        table[frame] = rows
    # The ids of the data set change when the sensor loses somebody; frames outside of a body's time are left out.
    seen = np.flatnonzero(np.isfinite(table[:, 0, 0]))
    part = slice(seen[0], seen[-1] + 1)
    layout = layouts_of(_JOINTS, "kinect")[0]
    joints_of = points_to_joints(without_lost(table[part, :, :3], table[part, :, 3], said), layout, said)
    return Recording(
        path, "ntu", joints_of, fps=30.0, lines=np.array(places)[part], names=KINECT_JOINTS,
        notes=[*notes, *([] if said.inferred else ["inferred joints count as untracked"]), "30 frames per second, as "
        "the data set has"],
    )  # fmt: skip
