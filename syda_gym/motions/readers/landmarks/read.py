"""Reading landmarks from JSON: MediaPipe, TF.js, Azure Kinect, Kinect, OpenPose, MMPose, ZED, Nuitrack and the like.

A frame holds people, a person holds points, a point has x, y, z; how they are nested is found by looking. Only places
in space can be used; places in a picture have no depth and are refused.
https://ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import BUDGET, parse_json, read_bytes, shortened
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.certainty import without_lost
from syda_gym.motions.readers.choice import best_way, by_points
from syda_gym.motions.readers.landmarks.people_json import Person, frames_of, people_of, time_of
from syda_gym.motions.readers.layouts import LAYOUTS
from syda_gym.motions.readers.markers import joint_points
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import NOTHING_SAID, Said
from syda_gym.motions.readers.skeleton import motions_from
from syda_gym.motions.readers.tables.people import chosen
from syda_gym.motions.readers.text import first_bytes
from syda_gym.motions.readers.times import Stamps

__all__ = ["is_json", "landmark_recording", "read_json_landmarks"]

_MAX_BYTES = BUDGET.text
_MOST_VALUES = BUDGET.elements


def is_json(path: Path) -> bool:
    """Whether a file begins as JSON does."""
    return first_bytes(path, 64).decode("utf-8", "replace").lstrip("\ufeff \r\n\t")[:1] in ("[", "{")


def read_json_landmarks(path: str | Path, said: Said = NOTHING_SAID, format: str | None = None) -> Motions:
    """Reads a JSON dump of landmarks, or one JSON document a line.

    Args:
        path: the file.
        said: what a person says about it.
        format: what a person called it.

    Returns:
        Motions of one human, ``"operator"``; landmarks of visibility below 0.5 are gaps, filled and flagged as
        ``skeleton.motions_from`` says.

    Raises:
        MotionError: missing, too large, malformed (the message names the frame), or places in a picture.
    """
    file = Path(path)
    data = read_bytes(file, _MAX_BYTES, "landmarks as JSON", MotionError)
    if b"\0" in data:
        raise MotionError(f"{file} is binary, not text; expected landmarks as JSON")
    if not data.strip():
        raise MotionError(f"{file} is empty; expected landmarks as JSON")
    return motions_from(landmark_recording(file, data, said, format), said)


def landmark_recording(file: Path, data: bytes, said: Said, format: str | None = None) -> Recording:
    """The joints of JSON, before units and axes are found.

    Raises:
        MotionError: see ``read_json_landmarks``.
    """
    frames, about = frames_of(file, _parsed(file, data))
    if not frames:
        raise MotionError(f"{file} has no frames")
    if len(frames) == 1 and isinstance(frames[0], Mapping) and "people" in frames[0]:
        people = frames[0]["people"]
        deep = isinstance(people, list) and any(isinstance(p, Mapping) and p.get("pose_keypoints_3d") for p in people)
        raise MotionError(
            f"{file} holds one frame, as OpenPose writes one file a frame"
            + (
                "; join them into a list of frames first"
                if deep
                else ", and places in a picture, whose depth is unknown. Use a tracker that gives positions in space, "
                "or read the film itself: film:FILE"
            )
        )
    named = about.get("joint_names")
    common = (
        tuple(str(name)[:100] for name in named)
        if isinstance(named, list) and all(isinstance(n, str) for n in named)
        else ()
    )
    seen = [people_of(file, index, frame, common) for index, frame in enumerate(frames)]
    _check_amount(file, seen)
    people, notes = _one(file, seen, said)
    stamps = _stamps(file, frames)
    sizes = Counter(len(person.points) for person in people if person is not None)
    if not sizes:
        raise MotionError(
            f"{file}: nobody is in any of the {len(frames)} frames; a shoulder is tracked in 0 % of the frames"
        )
    count = sizes.most_common(1)[0][0]
    table = np.full((len(frames), count, 4), np.nan)
    for index, person in enumerate(people):
        if person is not None:
            if len(person.points) != count:
                raise MotionError(
                    f"{file}, frame {index}: expected {count} landmarks as in other frames, got {len(person.points)}"
                )
            table[index] = person.points
    names = next((person.names for person in people if person is not None), ())
    recording = _recording(file, table, names, said, format)
    recording.stamps, recording.fps = stamps, _rate(file, about.get("fps", about.get("frame_rate")))
    recording.notes[:0] = notes
    return recording


def _recording(file: Path, table: FloatArray, names: tuple[str, ...], said: Said, format: str | None) -> Recording:
    points = without_lost(table[:, :, :3], table[:, :, 3], said)
    matched = joint_points(names) if names else {}
    for joint, place in said.joints.items():
        if place in names:
            matched[joint] = (names.index(place),)
        elif place.isdigit() and int(place) < points.shape[1]:
            matched[joint] = (int(place),)
        else:
            raise MotionError(
                f"{file} has no point {place!r} for {joint}; it has "
                f"{', '.join(names[:20]) or f'{points.shape[1]} points'}"
            )
    if {"LShoulder", "LElbow", "LHand"} <= set(matched) or {"RShoulder", "RElbow", "RHand"} <= set(matched):
        joints = {joint: points[:, list(indices)].mean(axis=1) for joint, indices in matched.items()}
        kind = format or (
            "azure" if points.shape[1] == 32 and names else "mediapipe" if points.shape[1] == 33 else "keypoints"
        )
        return Recording(file, kind, joints, up=(0.0, -1.0, 0.0), names=names, image=kind != "azure")
    ways = by_points(points, said, format)
    if not ways and format is None:
        known = ", ".join(sorted({str(len(layout.joints)) for layout in LAYOUTS}, key=int))
        raise MotionError(
            f"{file}, frame 0: expected 33 landmarks of MediaPipe or one of {known} points, got {points.shape[1]}"
        )
    best, doubt = best_way(file, ways, f"{points.shape[1]} points a frame")
    return Recording(
        file, best.layout.format, best.joints, up=best.layout.up, names=names or ("left_shoulder", "left_elbow",
        "left_wrist"),
        notes=[f"read as {best.label}"], doubts=[doubt] if doubt else [], image=best.layout.image,
    )  # fmt: skip


def _parsed(file: Path, data: bytes) -> Any:
    lines = data.strip().split(b"\n")
    if len(lines) > 1 and lines[0].strip()[:1] in (b"{", b"[") and lines[0].strip()[-1:] in (b"}", b"]"):
        values = _each_line(file, lines)
        if values is not None:
            return values
    return parse_json(data, str(file), MotionError, "is the file truncated?")


def _each_line(file: Path, lines: list[bytes]) -> list[Any] | None:
    """One document a line, or ``None`` if the first two lines are none."""
    if sum(line.count(mark) for line in lines for mark in (b",", b"[", b"{")) > BUDGET.nodes:
        raise MotionError(f"{file} holds more than {BUDGET.nodes} values; cut it into pieces")
    values: list[Any] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            values.append(json.loads(line))
        except (ValueError, RecursionError) as error:
            if len(values) < 2:
                return None
            raise MotionError(
                f"{file}, line {number}: no valid JSON: {str(error)[:120]}; is the file truncated?"
            ) from error
    return values


def _check_amount(file: Path, seen: list[list[Person]]) -> None:
    if sum(person.points.size for people in seen for person in people) > _MOST_VALUES:
        raise MotionError(f"{file} holds more than {_MOST_VALUES} numbers; cut it into pieces")


def _one(file: Path, seen: list[list[Person]], said: Said) -> tuple[list[Person | None], list[str]]:
    """One person of every frame: by identity if people have one, else by place in the list."""
    told = all(person.identity is not None for people in seen for person in people)
    labels = list(
        dict.fromkeys(
            (person.identity or "") if told else f"place {place + 1}"
            for people in seen
            for place, person in enumerate(people)
        )
    )
    if not labels:
        return [None] * len(seen), []
    index, notes = chosen(file, labels, said)
    if told:
        return [next((p for p in people if p.identity == labels[index]), None) for people in seen], notes
    return [people[index] if index < len(people) else None for people in seen], notes


def _stamps(file: Path, frames: list[Any]) -> Stamps | None:
    times = [time_of(file, index, frame) for index, frame in enumerate(frames)]
    known = [time is not None for time in times]
    if not any(known):
        return None
    if not all(known):
        raise MotionError(f"{file}, frame {known.index(False)}: the time is missing, other frames have one")
    found = [time for time in times if time is not None]
    return Stamps(np.array([time[0] for time in found]), found[0][1], found[0][2])


def _rate(file: Path, value: Any) -> float | None:
    if value is None:
        return None
    try:
        fps = float(value) if isinstance(value, int | float | str) else float("nan")
    except (ValueError, OverflowError):
        fps = float("nan")
    if not 0.1 <= fps <= 1_500.0:
        raise MotionError(f"{file}: fps must be a number between 0.1 and 1500, got {shortened(value, 60)}")
    return fps
