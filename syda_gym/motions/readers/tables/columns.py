"""What the columns of a header are: joint and axis, a number of a point and axis, times, people, confidence."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from syda_gym.motions.readers.times import clock_unit

__all__ = ["Columns", "find_columns"]

_AXES = {"x": "x", "y": "y", "z": "z", "tx": "x", "ty": "y", "tz": "z", "px": "x", "py": "y", "pz": "z", "posx": "x",
         "posy": "y", "posz": "z", "transx": "x", "transy": "y", "transz": "z"}  # fmt: skip
_SURE = {"c", "v", "conf", "confidence", "vis", "visibility", "score", "tracked", "state", "trackingstate",
"likelihood", "prob",
         "quality"}  # fmt: skip
_UNITS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "metres": 1.0, "meters": 1.0, "inches": 0.0254}
_PLAIN = {
    "pos",
    "position",
    "positions",
    "translation",
    "trans",
    "coord",
    "coordinate",
    "coordinates",
    "world",
    "global",
}
_TURNS = {"rot", "rotation", "quat", "quaternion", "orientation", "orient", "q", "euler", "angle", "angles", "vel",
"velocity", "acc",
          "acceleration", "gyro", "mag", "normal", "force", "moment", "rx", "ry", "rz", "std", "var", "size",
          "depthx", "colorx"}  # fmt: skip
_POINT = {"landmark", "landmarks", "lm", "kp", "keypoint", "keypoints", "joint", "joints", "point", "points", "pose",
"j", "p", "pt",
          "world", "marker", "n", "no", "id", "body", "skeleton"}  # fmt: skip
_PEOPLE = {"person", "personid", "bodyid", "body", "trackingid", "trackid", "userid", "user", "subject", "subjectid",
"player", "playerid",
           "skeletonid", "poseid"}  # fmt: skip
_FRAMES = {
    "frame",
    "frames",
    "frameid",
    "frameno",
    "framenumber",
    "frameindex",
    "index",
    "idx",
    "nframe",
    "frameidx",
    "sample",
}
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z][a-z]*|[a-z]+|\d+")
_LONGEST = 200


@dataclass
class Columns:
    """What the columns of a header are.

    Attributes:
        points: name of the point to its columns ``x``, ``y``, ``z``, and ``c`` for confidence.
        numbered: whether the points have numbers instead of names; ``points`` then has them in order.
        time: column of times, -1 if there is none.
        time_unit: where the name says it.
        time_name: how the file calls it.
        frame: column that counts frames.
        person: column that tells people apart.
        unit: metres per unit, where the names say it.
        point: column with the name of the point, in tables of one point a line.
        axes: columns ``x``, ``y``, ``z`` (and ``c``) of such tables.
    """

    points: dict[str, dict[str, int]] = field(default_factory=dict)
    numbered: bool = False
    time: int = -1
    time_unit: str | None = None
    time_name: str = "timestamp"
    frame: int = -1
    person: int = -1
    unit: float | None = None
    point: int = -1
    axes: dict[str, int] = field(default_factory=dict)


def find_columns(header: Sequence[str]) -> Columns:
    """Reads one line of names."""
    result = Columns()
    points: dict[str, dict[str, int]] = {}
    for column, cell in enumerate(header):
        name = cell.strip()[:_LONGEST]
        bare = "".join(c for c in name.lower() if c.isalnum())
        is_clock, unit = clock_unit(name)
        if is_clock and result.time < 0:
            result.time, result.time_unit, result.time_name = column, unit, name
        elif bare in _FRAMES and result.frame < 0:
            result.frame = column
        elif bare in _PEOPLE and result.person < 0:
            result.person = column
        elif bare in ("x", "y", "z", *_SURE):
            result.axes.setdefault(bare if bare in "xyz" else "c", column)
        else:
            point, axis, size = _split(name)
            if axis:
                points.setdefault(point, {}).setdefault(axis, column)
                result.unit = result.unit or size
            elif result.point < 0 and bare in ("landmark", "joint", "keypoint", "name", "jointname", "landmarkname",
            "part", "landmarkid",
                                               "jointid", "landmarkindex", "jointtype", "bodypart", "marker", "point",
                                               "id", "type",
                                               "jointindex", "landmarkidx"):  # fmt: skip
                result.point = column
    complete = {name: axes for name, axes in points.items() if {"x", "y", "z"} <= set(axes)}
    if not complete:
        complete = _by_last_letter(header)
    numbers = {name: int(name) for name in complete if name.isdigit()}
    if len(numbers) >= max(5, len(complete) // 2):
        result.numbered = True
        complete = {name: complete[name] for name in sorted(numbers, key=lambda one: numbers[one])}
    result.points = complete
    return result


def _split(name: str) -> tuple[str, str, float | None]:
    """Point, axis (``x``, ``y``, ``z`` or ``c``) and unit of a column; no axis if it is none of a point."""
    words = _WORDS.findall(name)
    lower = [word.lower() for word in words]
    size = None
    if len(lower) > 2 and lower[-1] in _UNITS and lower[-2] in _AXES:
        size = _UNITS[lower[-1]]
        words, lower = words[:-1], lower[:-1]
    for place in (-1, 0, -2):
        if len(lower) < 2 or len(lower) + place < 0:
            continue
        word = lower[place]
        axis = _AXES.get(word) or ("c" if word in _SURE and (place != 0 or len(lower) == 2) else "")
        if not axis or (place == -2 and not lower[-1].isdigit()):
            continue
        rest = [w for i, w in enumerate(lower) if i != (place if place >= 0 else len(lower) + place)]
        if set(rest) & _TURNS:
            return "", "", None
        if axis == "c":
            rest = [w for w in rest if w not in ("tracking", "landmark")] or rest
        kept = [w for w in rest if w not in _PLAIN] or rest
        digits = [w for w in kept if w.isdigit()]
        if len(digits) == 1 and all(w in _POINT or w.isdigit() for w in kept):
            return str(int(digits[0])) if len(digits[0]) < 6 else "", axis, size
        return _original(name, kept), axis, size
    return "", "", None


def _original(name: str, kept: list[str]) -> str:
    """The part of a name that is the point, as it stands in the file as far as possible."""
    words = _WORDS.findall(name)
    lower = [word.lower() for word in words]
    for start in range(len(lower) - len(kept) + 1):
        if lower[start : start + len(kept)] == kept:
            first = name.lower().find(kept[0])
            place = 0
            for word in words[: start + len(kept)]:
                place = name.find(word, place) + len(word)
            return name[(0 if start == 0 else first) : place].strip(" _.:-/")
    return " ".join(kept)


def _by_last_letter(header: Sequence[str]) -> dict[str, dict[str, int]]:
    """Names that end in x, y and z without anything between: ``LSHOX``, ``LSHOY``, ``LSHOZ``."""
    groups: dict[str, dict[str, int]] = {}
    for column, cell in enumerate(header):
        name = cell.strip()[:_LONGEST]
        if len(name) > 1 and name[-1].lower() in "xyz":
            groups.setdefault(name[:-1].strip(" _.:-/"), {}).setdefault(name[-1].lower(), column)
    return {name: axes for name, axes in groups.items() if len(axes) == 3 and name}
