"""MVNX, what Xsens MVN exports: where each segment begins, frame by frame, as XML."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import BUDGET, read_bytes
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import NOTHING_SAID, Said
from syda_gym.motions.readers.skeleton import motions_from
from syda_gym.motions.readers.tables.people import chosen
from syda_gym.motions.readers.text import first_bytes
from syda_gym.motions.readers.times import Stamps

__all__ = ["is_mvnx", "read_mvnx"]

# A segment begins at its upper joint.
_JOINTS = {
    "Pelvis": "Pelvis", "L5": "Torso", "Neck": "Neck", "Head": "Head",
    **{f"{long}{segment}": f"{long[0]}{joint}" for long in ("Left", "Right") for segment, joint in (
        ("UpperArm", "Shoulder"), ("ForeArm", "Elbow"), ("Hand", "Hand"), ("UpperLeg", "Hip"), ("LowerLeg", "Knee"),
        ("Foot", "Foot"), ("Toe", "Toe"))},
}  # fmt: skip
_UP = (0.0, 0.0, 1.0)


class _Subject:
    """What one subject of the file holds."""

    def __init__(self, label: str, rate: str) -> None:
        self.label = label
        self.rate = rate
        self.segments: list[str] = []
        self.rows: list[FloatArray] = []
        self.times: list[float] = []
        self.frames = 0


def is_mvnx(path: Path) -> bool:
    """Whether a file is XML whose first element is ``mvnx``."""
    start = first_bytes(path, 4096)
    return b"<mvnx" in start and start.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<")


def read_mvnx(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads an MVNX file.

    Args:
        path: the file.
        said: what a person says about it.

    Returns:
        Motions of one human, ``"operator"``.

    Raises:
        MotionError: missing, too large, damaged, or exported without positions of segments.
    """
    file = Path(path)
    content = read_bytes(file, BUDGET.text, "an MVNX file", MotionError)
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise MotionError(f"{file} declares entities, which no export of Xsens does; it is not read")
    subjects = _subjects(file, content)
    if not subjects:
        raise MotionError(f"{file} has no subject; expected an MVNX file of Xsens MVN")
    index, notes = chosen(file, [subject.label for subject in subjects], said)
    subject = subjects[index]
    if not subject.rows:
        raise MotionError(
            f"{file}: {subject.frames} frames without the position of a segment; export again with "
            "'segment position', or export BVH"
        )
    points = np.stack(subject.rows)
    joints = {_JOINTS[name]: points[:, place] for place, name in enumerate(subject.segments) if name in _JOINTS}
    joints |= {joint: points[:, _place(file, subject, joint, name)] for joint, name in said.joints.items()}
    rate = _number(subject.rate)
    timed = rate is None and len(set(subject.times)) > 1
    return motions_from(
        Recording(
            file, "mvnx", joints, fps=rate, stamps=Stamps(np.array(subject.times), "ms", "time") if timed else None,
            up=_UP, unit=1.0, names=tuple(subject.segments), notes=notes,
        ),
        said,
    )  # fmt: skip


def _subjects(file: Path, content: bytes) -> list[_Subject]:
    """Every subject; elements are forgotten as soon as they are read."""
    parser: Any = ElementTree.XMLPullParser(("start", "end"))
    subjects: list[_Subject] = []
    kind = ""
    try:
        for start in range(0, len(content), 1 << 20):
            parser.feed(content[start : start + (1 << 20)])
            for event, element in parser.read_events():
                tag = element.tag.rpartition("}")[2]
                if event == "start":
                    if tag == "subject":
                        subjects.append(_Subject(element.get("label", "")[:60], element.get("frameRate", "")))
                    elif tag == "frame":
                        kind = element.get("type", "normal")
                    continue
                if subjects:
                    _take(file, subjects[-1], tag, kind, element)
                if tag in ("frame", "segment", "sensor", "joint", "point"):
                    element.clear()
        parser.close()
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # LookupError: an encoding that does not exist
        raise MotionError(f"{file} is no whole XML: {error}; export it again") from error
    return subjects


def _take(file: Path, subject: _Subject, tag: str, kind: str, element: ElementTree.Element) -> None:
    if tag == "segment":
        subject.segments.append(element.get("label", "")[:60])
    elif tag == "frame" and kind == "normal":  # the others are poses of the calibration
        subject.frames += 1
        place = element.find("{*}position")
        if place is None:
            return
        numbers = np.array((place.text or "").split())
        where = f"{file}, frame {element.get('index', subject.frames)!s:.20}"
        try:
            row = numbers.astype(np.float64)
        except ValueError as error:
            raise MotionError(f"{where}: a position is no number: {error!s:.100}") from error
        if len(row) != 3 * len(subject.segments):
            raise MotionError(f"{where}: {len(row)} numbers for {len(subject.segments)} segments; expected three each")
        if subject.frames * len(row) > BUDGET.elements:
            raise MotionError(f"{file} holds more than {BUDGET.elements} numbers; cut it into pieces")
        subject.rows.append(row.reshape(-1, 3))
        subject.times.append(_number(element.get("time", "")) or 0.0)


def _place(file: Path, subject: _Subject, joint: str, name: str) -> int:
    if name in subject.segments:
        return subject.segments.index(name)
    if name.isdigit() and int(name) < len(subject.segments):
        return int(name)
    raise MotionError(f"{file} has no segment {name!r} for {joint}; it has {', '.join(subject.segments)}")


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) and value > 0.0 else None
