"""What a person says about a file where looking into it does not tell, or tells wrongly."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from syda_gym.errors import OptionError, nearest_name
from syda_gym.files import read_yaml, shortened
from syda_gym.motions.readers.joint_names import JOINTS
from syda_gym.motions.readers.times import UNITS as TIME_UNITS

__all__ = ["NOTHING_SAID", "UNITS", "Said", "told"]

UNITS = {
    "m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048, "cmu": 0.0254 / 0.45,
    "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0, "centimetres": 0.01, "centimeters": 0.01,
    "millimetres": 0.001, "millimeters": 0.001, "inch": 0.0254, "inches": 0.0254, "feet": 0.3048,
}  # fmt: skip
"""Units of length by name, in metres."""

_AXES = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True)
class Said:
    """What a person says about a file; everything may be left out.

    Attributes:
        joints: canonical joint (``LShoulder``, ``RHand``, ``Head``, ...) to its name in the file, to the number of its
            point (from 0), or to its three columns ``x,y,z`` (names or numbers from 0).
        unit: metres per unit of the file.
        up: the axis that points up.
        fps: frames per second of a file without times, or with times that are not to be used.
        person: which of several people, from 1; ``None`` takes the first and says so.
        order: canonical joints in the order in which a file without names has them; ``-`` is a point that is not used.
        columns: numbers a point has in a file without names: 3, or more if a confidence or an orientation follows.
        skip: columns before the first point.
        skip_lines: lines before the first frame.
        separator: what stands between cells.
        time: column of times, its name or number.
        time_unit: one of ``s``, ``ms``, ``us``, ``ticks``, ``ns``.
        confidence: below which a point counts as lost.
        left_handed: whether the file's axes are left-handed, as Unity's are.
        inferred: take what a Kinect inferred as tracked.
    """

    joints: Mapping[str, str] = field(default_factory=dict)
    unit: float | None = None
    up: tuple[float, float, float] | None = None
    fps: float | None = None
    person: int | None = None
    order: tuple[str, ...] = ()
    columns: int = 3
    skip: int = 0
    skip_lines: int = 0
    separator: str | None = None
    time: str | None = None
    time_unit: str | None = None
    confidence: float | None = None
    left_handed: bool = False
    inferred: bool = False


NOTHING_SAID = Said()
"""When nobody said anything."""


def told(
    joints: Mapping[str, object] | None = None,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
    person: int | None = None,
    layout: str | os.PathLike[str] | None = None,
) -> Said:
    """Checks what a person says.

    Args:
        joints: canonical joint to name, number or columns in the file.
        unit: one of ``UNITS``, or metres per unit.
        up: ``x``, ``-y``, ``+z``, ...
        fps: frames per second.
        person: from 1.
        layout: a YAML file that describes a format of one's own; what is given beside it goes first.

    Returns:
        The same, checked.

    Raises:
        OptionError: an unknown joint, unit or axis, or a rate or person out of range.
    """
    said = NOTHING_SAID if layout is None else _layout(layout)
    if joints:
        said = replace(said, joints={**said.joints, **_joints(joints)})
    if unit is not None:
        said = replace(said, unit=_unit(unit))
    if up is not None:
        said = replace(said, up=_up(up))
    if fps is not None:
        said = replace(said, fps=_number("fps", fps, 0.01, 1000.0))
    if person is not None:
        said = replace(said, person=_whole("person", person, 1, 1000))
    return said


def _layout(path: str | os.PathLike[str]) -> Said:
    data = read_yaml(path, "a layout (YAML with 'joints' or 'order')", OptionError)
    takers: dict[str, Callable[[object], tuple[str, Any]]] = {
        "joints": lambda value: ("joints", _joints(value)),
        "order": lambda value: ("order", _order(value)),
        "unit": lambda value: ("unit", _unit(value)),
        "up": lambda value: ("up", _up(value)),
        "fps": lambda value: ("fps", _number("fps", value, 0.01, 1000.0)),
        "person": lambda value: ("person", _whole("person", value, 1, 1000)),
        "columns": lambda value: ("columns", _whole("columns", value, 3, 50)),
        "skip": lambda value: ("skip", _whole("skip", value, 0, 10_000)),
        "skip_lines": lambda value: ("skip_lines", _whole("skip_lines", value, 0, 10_000)),
        "separator": lambda value: ("separator", _separator(value)),
        "time": lambda value: ("time", str(value)[:100]),
        "time_unit": lambda value: ("time_unit", _choice("time_unit", value, TIME_UNITS)),
        "confidence": lambda value: ("confidence", _number("confidence", value, 0.0, 1e6)),
        "left_handed": lambda value: ("left_handed", value is True),
    }
    if not isinstance(data, Mapping) or not data:
        raise OptionError(f"{path}: expected keys and values such as 'joints:'; known keys: {', '.join(takers)}")
    values: dict[str, Any] = {}
    for key, value in data.items():
        if key not in takers:
            raise OptionError(f"{path}: unknown key {shortened(key)}; {nearest_name(str(key)[:40], takers)}")
        try:
            name, checked = takers[key](value)
        except OptionError as error:
            raise OptionError(f"{path}: {error}") from error
        values[name] = checked
    return Said(**values)


def _joints(value: object) -> dict[str, str]:
    if not isinstance(value, Mapping) or not value:
        raise OptionError(f"joints: expected joint: name in the file, got {shortened(value)}")
    found = {}
    for joint, place in value.items():
        _choice("joints", joint, JOINTS)
        if isinstance(place, list | tuple) and len(place) == 3:
            place = ",".join(str(part)[:100] for part in place)
        if not isinstance(place, str | int) or isinstance(place, bool) or not str(place).strip():
            raise OptionError(
                f"joints: {joint} needs a name, a number or three columns x,y,z of the file; got {shortened(place)}"
            )
        found[str(joint)] = str(place).strip()[:400]
    return found


def _order(value: object) -> tuple[str, ...]:
    names = re.split(r"[,\s]+", value.strip()) if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or not 3 <= len(names) <= 1000:
        raise OptionError(f"order: expected a list of joints, got {shortened(value)}")
    for name in names:
        if name != "-":
            _choice("order", name, JOINTS)
    return tuple(str(name) for name in names)


def _unit(value: object) -> float:
    if isinstance(value, str) and value.strip().lower() in UNITS:
        return UNITS[value.strip().lower()]
    try:
        return _number("unit", value, 1e-9, 1e3)
    except OptionError:
        raise OptionError(
            f"unit: expected one of {', '.join(UNITS)} or metres per unit of the file; got {shortened(value)}"
        ) from None


def _up(value: object) -> tuple[float, float, float]:
    text = str(value).strip().lower() if isinstance(value, str) else ""
    sign = -1.0 if text.startswith("-") else 1.0
    axis = text.lstrip("+-")
    if axis not in _AXES or len(text) > 2:
        raise OptionError(f"up: expected an axis such as y, z or -y; got {shortened(value)}")
    places = [0.0, 0.0, 0.0]
    places[_AXES[axis]] = sign
    return (places[0], places[1], places[2])


def _number(name: str, value: object, low: float, high: float) -> float:
    try:
        number = float(value) if isinstance(value, str | int | float) and not isinstance(value, bool) else float("nan")
    except (ValueError, OverflowError):
        number = float("nan")
    if not (np.isfinite(number) and low <= number <= high):
        raise OptionError(f"{name} must be a number between {low:g} and {high:g}, got {shortened(value)}")
    return number


def _whole(name: str, value: object, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise OptionError(f"{name} must be a whole number between {low} and {high}, got {shortened(value)}")
    return value


def _choice(name: str, value: object, known: Any) -> str:
    if not isinstance(value, str) or value not in known:
        raise OptionError(f"{name}: {shortened(value)} is unknown; {nearest_name(str(value)[:40], known)}")
    return value


def _separator(value: object) -> str:
    names = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " "}
    text = names.get(str(value), str(value))
    if len(text) != 1:
        raise OptionError(f"separator: expected one of {', '.join(names)} or one character, got {shortened(value)}")
    return text
