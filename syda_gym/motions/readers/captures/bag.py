"""Bags of ROS 1 and 2 and MCAP: people as frames of ``tf`` or as markers, opened by ``rosbags``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import BUDGET, check_size
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.captures.child import arrays_from_child
from syda_gym.motions.readers.choice import best_way, by_points
from syda_gym.motions.readers.markers import joint_points
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import NOTHING_SAID, Said
from syda_gym.motions.readers.skeleton import motions_from
from syda_gym.motions.readers.tables.people import chosen
from syda_gym.motions.readers.text import first_bytes
from syda_gym.motions.readers.times import Stamps

__all__ = ["is_bag", "read_bag"]

_MAGICS = (b"#ROSBAG V", b"\x89MCAP", b"SQLite format 3\x00")
_PER_BODY = 100  # the Azure Kinect driver numbers its markers 100 times the body plus the joint
_LONGEST_CHAIN = 60
_NUMBER = re.compile(r"^(.*?)[_\-\s]*(\d+)$")


def is_bag(path: Path) -> bool:
    """Whether a file is a bag, or a folder the bag of ROS 2."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() and any(path.glob("*.db3*")) | any(path.glob("*.mcap*"))
    return path.is_file() and any(first_bytes(path, 16).startswith(magic) for magic in _MAGICS)


def read_bag(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads the people of a bag.

    Frames of ``tf`` (as ``openni_tracker`` and others send them, ``left_shoulder_1`` and the like), else markers of one
    point each (as the Azure Kinect driver sends them) or lists of points.

    Args:
        path: ``.bag``, ``.mcap``, ``.db3``, or the folder of a ROS 2 bag.
        said: what a person says about it.

    Returns:
        Motions of one human, ``"operator"``, with timestamps.

    Raises:
        MotionError: missing, damaged, or nobody in it; the message lists the topics.
        MissingExtraError: ``rosbags`` is not installed.
    """
    file = Path(path)
    if file.is_dir():
        for part in file.iterdir():
            check_size(part, BUDGET.text, "a part of a bag", MotionError)
    else:
        check_size(file, BUDGET.text, "a bag of ROS", MotionError)
    found = arrays_from_child("open_bag", file, "reading bags of ROS", "ros", "rosbags")
    recording = _from_transforms(file, found, said) or _from_markers(file, found, said)
    if recording is None:
        topics = ", ".join(str(topic) for topic in found["topics"] if topic) or "no topic"
        frames = ", ".join(str(name) for name in found["frames"][:12] if name)
        raise MotionError(
            f"{file}: nobody is in it: no frames of tf or markers make an arm; it has {topics}; frames: "
            f"{frames or 'none'}"
        )
    return motions_from(recording, said)


def _from_transforms(file: Path, found: dict[str, NDArray[Any]], said: Said) -> Recording | None:
    names = [str(name) for name in found["frames"][:-1]]
    people: dict[str, dict[str, int]] = {}
    for index, name in enumerate(names):
        who, joint = _who(name)
        people.setdefault(who, {})[joint] = index
    whole = {
        who: joints for who, joints in people.items() if _has_arm(joint_points(list(joints))) or _said_arm(said, names)
    }
    if not whole:
        return None
    number, notes = chosen(file, list(whole), said)
    listed = list(whole[list(whole)[number]])
    indices = {joint: whole[list(whole)[number]][listed[points[0]]] for joint, points in joint_points(listed).items()}
    for joint, name in said.joints.items():
        if name.lstrip("/") in names:
            indices[joint] = names.index(name.lstrip("/"))
    times, positions = _followed(found["transforms"], list(indices.values()))
    if len(times) < 2:
        return None
    joints = {joint: positions[:, place] for place, joint in enumerate(indices)}
    return Recording(
        file, "bag", joints, stamps=Stamps(times, "s", "stamp of tf"), up=(0.0, 0.0, 1.0), unit=1.0, names=names,
        notes=[*notes, "joints: frames of tf " + ", ".join(names[index] for index in indices.values())],
    )  # fmt: skip


def _who(name: str) -> tuple[str, str]:
    """Person and joint of a frame: ``left_elbow_1``, ``user_1/left_elbow``, ``left_elbow``."""
    space, _, last = name.rpartition("/")
    match = _NUMBER.match(last)
    if match and _has_joint(match.group(1)):
        return f"{space}{match.group(2)}", match.group(1)
    return space, last


def _has_joint(name: str) -> bool:
    return bool(joint_points([name]))


def _has_arm(points: dict[str, tuple[int, ...]]) -> bool:
    return any({f"{side}{part}" for part in ("Shoulder", "Elbow", "Hand")} <= set(points) for side in "LR")


def _said_arm(said: Said, names: Sequence[str]) -> bool:
    return any(name.lstrip("/") in names for name in said.joints.values())


def _followed(rows: FloatArray, wanted: list[int]) -> tuple[FloatArray, FloatArray]:
    """Times, and positions ``(N, wanted, 3)`` in the frame at the root, sampled whenever a wanted frame was sent."""
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    latest: dict[int, tuple[int, FloatArray, FloatArray]] = {}
    for row in rows[rows[:, 10] > 0]:
        latest[int(row[1])] = (int(row[2]), row[3:6], _turn(row[6:10]))
    moving = rows[rows[:, 10] == 0]
    times, positions = [], []
    wanted_set = set(wanted)
    for start, stop in _runs(moving[:, 0]):
        sent = set()
        for row in moving[start:stop]:
            latest[int(row[1])] = (int(row[2]), row[3:6], _turn(row[6:10]))
            sent.add(int(row[1]))
        if sent & wanted_set:
            times.append(float(moving[start, 0]))
            positions.append([_place(latest, index) for index in wanted])
    return np.array(times), np.array(positions).reshape(len(times), len(wanted), 3)


def _runs(times: FloatArray) -> list[tuple[int, int]]:
    """Rows of one moment: stamps that differ by less than 5 ms, for some trackers stamp every joint anew."""
    edges = [0, *(np.flatnonzero(np.diff(times) > 0.005) + 1).tolist(), len(times)]
    return [(start, stop) for start, stop in zip(edges[:-1], edges[1:], strict=True) if stop > start]


def _turn(quaternion: FloatArray) -> FloatArray:
    if not np.isfinite(quaternion).all() or np.linalg.norm(quaternion) < 1e-6:
        return np.eye(3)
    matrix: FloatArray = Rotation.from_quat(quaternion).as_matrix()
    return matrix


def _place(latest: dict[int, tuple[int, FloatArray, FloatArray]], index: int) -> FloatArray:
    point: FloatArray = np.zeros(3)
    if index not in latest:
        return np.full(3, np.nan)
    for _ in range(_LONGEST_CHAIN):
        if index not in latest:
            return point
        index, move, turn = latest[index]
        point = turn @ point + move
    return np.full(3, np.nan)  # a circle of frames


def _from_markers(file: Path, found: dict[str, NDArray[Any]], said: Said) -> Recording | None:
    rows = found["markers"]
    if len(rows) < 2:
        return None
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    spaces = [str(name) for name in found["spaces"]]
    named = joint_points([space.replace("|", " ").strip() for space in spaces])
    lists = rows[:, 3] >= 0
    if lists.any():
        rows = rows[lists]
        who, point = rows[:, 2].astype(np.int64), rows[:, 3].astype(np.int64)
    elif _has_arm(named):
        who, point = np.zeros(len(rows), dtype=np.int64), rows[:, 1].astype(np.int64)
    else:
        number = rows[:, 2].astype(np.int64)
        who, point = (
            (number // _PER_BODY, number % _PER_BODY) if number.max() >= _PER_BODY else (np.zeros_like(number), number)
        )
    people = [int(one) for one in dict.fromkeys(who.tolist())]
    index, notes = chosen(file, [f"body {one}" for one in people], said)
    rows, point = rows[who == people[index]], point[who == people[index]]
    count = int(point.max()) + 1
    if not 3 <= count <= 200:
        return None
    times, table = [], []
    for start, stop in _runs(rows[:, 0]):
        frame = np.full((count, 3), np.nan)
        frame[point[start:stop]] = rows[start:stop, 4:7]
        times.append(float(rows[start, 0]))
        table.append(frame)
    points = np.array(table)
    stamps = Stamps(np.array(times), "s", "stamp of markers")
    if _has_arm(named) and not lists.any():
        joints = {joint: points[:, list(indices)].mean(axis=1) for joint, indices in named.items()}
        return Recording(file, "bag", joints, stamps=stamps, up=(0.0, 0.0, 1.0), unit=1.0, names=spaces, notes=notes)
    best, doubt = best_way(file, by_points(points, said), f"markers of {count} points")
    return Recording(
        file, "bag", best.joints, stamps=stamps, up=best.layout.up, unit=1.0, notes=[*notes, f"markers read as "
        f"{best.label}"],
        doubts=[doubt] if doubt else [],
    )  # fmt: skip
