"""RobotDescription: the small YAML beside a URDF, checked key by key with the line of what is wrong."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from syda_gym.embodiments.embodiment import Side
from syda_gym.errors import EmbodimentError, nearest_name
from syda_gym.files import read_yaml, shortened

__all__ = ["POINTS", "ArmDescription", "CoupledLimit", "Point", "RobotDescription"]

Point = tuple[float, float, float]

POINTS = ("shoulder", "elbow", "wrist", "tip")
"""The points of an arm, from the body outward."""


@dataclass(frozen=True)
class ArmDescription:
    """Which links and joints of a URDF make one arm.

    Attributes:
        side: ``"left"`` or ``"right"``.
        joints: revolute joints from shoulder to wrist, in order.
        shoulder: link that carries the shoulder point.
        elbow: link that carries the elbow point.
        wrist: link that carries the wrist point.
        tip: link that carries the end of the arm (for the workspace).
        offsets: where a point lies in the frame of its link [m], by the point's name; absent at the link's origin.
    """

    side: Side
    joints: tuple[str, ...]
    shoulder: str
    elbow: str
    wrist: str
    tip: str
    offsets: Mapping[str, Point] = field(default_factory=dict)

    @property
    def links(self) -> tuple[str, str, str, str]:
        """Links that carry shoulder, elbow, wrist and tip."""
        return (self.shoulder, self.elbow, self.wrist, self.tip)

    @property
    def point_offsets(self) -> tuple[Point, Point, Point, Point]:
        """Where shoulder, elbow, wrist and tip lie in the frames of their links [m]."""
        zero = (0.0, 0.0, 0.0)
        shoulder, elbow, wrist, tip = (self.offsets.get(name, zero) for name in POINTS)
        return (shoulder, elbow, wrist, tip)


@dataclass(frozen=True)
class CoupledLimit:
    """Limits of ``joint`` that depend on the angle of ``by``, linear between the rows ``at`` [rad]."""

    joint: str
    by: str
    at: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]


@dataclass(frozen=True)
class RobotDescription:
    """The small hand-editable YAML beside a URDF: everything that the URDF alone does not say.

    Attributes:
        name: name in the catalog.
        urdf: the URDF file.
        torso: link in whose frame landmarks are expressed.
        height: stature [m].
        arms: one or two.
        coupled_limits: limits that depend on another joint.
        rest: joint name to angle [rad] of the pose to start from; 0 where absent.
        disabled_collisions: pairs of links whose contact does not count.
        axes: rows of the rotation from the torso link's frame to body axes (x forward, y left, z up); ``None`` if the
            link has body axes already, as most do.
    """

    name: str
    urdf: Path
    torso: str
    height: float
    arms: tuple[ArmDescription, ...]
    coupled_limits: tuple[CoupledLimit, ...] = ()
    rest: Mapping[str, float] = field(default_factory=dict)
    disabled_collisions: tuple[tuple[str, str], ...] = ()
    axes: tuple[tuple[float, float, float], ...] | None = None

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> RobotDescription:
        """Reads a description from YAML.

        Raises:
            EmbodimentError: missing file, unknown or missing keys; the message names them.
        """
        file = Path(path)
        if not file.is_file():
            raise EmbodimentError(f"no robot description {file}; write one with `syda-gym robot add URDF`")
        data = read_yaml(file, "a robot description (YAML)", EmbodimentError)  # within the budget for strangers' files
        try:
            node = yaml.compose(file.read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            raise EmbodimentError(f"{file} is not valid YAML: {error}") from error
        needed = {"name", "urdf", "torso", "height", "arms"}
        if not isinstance(data, dict) or not needed <= set(data):
            raise EmbodimentError(f"{file}: expected the keys {sorted(needed)}, got {shortened(data)}")
        reader = _Reader(file, data, node)
        reader.refuse_unknown(needed | {"coupled_limits", "rest", "disabled_collisions", "axes"})
        return cls(
            name=reader.value("name", str),
            urdf=reader.value("urdf", lambda value: (file.parent / str(value)).resolve()),
            torso=reader.value("torso", _name),
            height=reader.value("height", _height),
            arms=reader.rows("arms", _arm),
            coupled_limits=reader.rows("coupled_limits", _coupled_limit),
            rest=reader.value("rest", _angles, {}),
            disabled_collisions=reader.rows("disabled_collisions", _pair),
            axes=reader.value("axes", _rotation_rows, None),
        )


class _Reader:
    """Takes values out of a YAML document; what is wrong with one is told with its line."""

    def __init__(self, file: Path, data: dict[str, Any], node: Any) -> None:
        self._file, self._data = file, data
        self._nodes = {key.value: (key, value) for key, value in node.value}

    def refuse_unknown(self, allowed: set[str]) -> None:
        for key in set(self._data) - allowed:
            raise EmbodimentError(f"{self._where(str(key))}: unknown key {key!r}; {nearest_name(str(key), allowed)}")

    def value(self, key: str, convert: Callable[[Any], Any], default: Any = None) -> Any:
        found = self._data.get(key)
        if found is None and key not in _NEEDED:
            return default
        try:
            return convert(found)
        except _WRONG as error:
            raise EmbodimentError(
                f"{self._where(key)}: {key}: a wrong value or key: {_told(error)}; {_FORMAT}"
            ) from error

    def rows(self, key: str, convert: Callable[[Any], Any]) -> tuple[Any, ...]:
        found = self._data.get(key)
        if found is None and key not in _NEEDED:
            return ()
        if not isinstance(found, list):
            raise EmbodimentError(f"{self._where(key)}: {key}: a wrong value or key: expected a list, got {found!r}")
        results = []
        for index, entry in enumerate(found):
            try:
                results.append(convert(entry))
            except _WRONG as error:
                where = self._where(key, index, error)
                raise EmbodimentError(f"{where}: {key}: a wrong value or key: {_told(error)}; {_FORMAT}") from error
        return tuple(results)

    def _where(self, key: str, row: int | None = None, error: Exception | None = None) -> str:
        """File and line of a key, of one row below it, or of the part of the row that an error names."""
        name, value = self._nodes.get(key, (None, None))
        line = 0 if name is None else name.start_mark.line + 1
        if row is not None and isinstance(value, yaml.SequenceNode):
            node = value.value[row]
            line = node.start_mark.line + 1
            for part, _ in node.value if isinstance(node, yaml.MappingNode) else ():
                if error is not None and repr(part.value) in str(error):
                    line = part.start_mark.line + 1
        return f"{self._file}, line {line}" if line else str(self._file)


_NEEDED = ("name", "urdf", "torso", "height", "arms")
_WRONG = (TypeError, KeyError, ValueError, AttributeError, OverflowError)
_FORMAT = "see docs/your-robot.md for the format"


def _told(error: Exception) -> str:
    return f"{error} is missing" if isinstance(error, KeyError) else str(error)


def _name(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError(f"expected the name of a link, got {value!r}")
    return value


def _height(value: Any) -> float:
    if isinstance(value, bool) or not 0.0 < float(value) < 100.0:
        raise ValueError(f"expected a stature in metres, got {value!r}")
    return float(value)


def _angles(value: Any) -> dict[str, float]:
    angles = {str(joint): float(angle) for joint, angle in value.items()}
    for joint, angle in angles.items():
        if not np.isfinite(angle):
            raise ValueError(f"the angle of {joint!r} must be a number, got {angle}")
    return angles


def _pair(value: Any) -> tuple[str, str]:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"expected two names of links, got {value!r}")
    return (str(value[0]), str(value[1]))


def _arm(entry: Any) -> ArmDescription:
    if not isinstance(entry, dict):
        raise ValueError(f"an arm needs side, joints, shoulder, elbow, wrist and tip, got {entry!r}")
    known = ("side", "joints", *POINTS)
    for key in entry:
        if key not in known:
            raise ValueError(f"unknown key {str(key)!r}; {nearest_name(str(key), known)}")
    joints = entry["joints"]
    if not isinstance(joints, list) or not all(isinstance(name, str) for name in joints):
        raise ValueError(f"'joints' must list the names of joints, got {joints!r}")
    if not isinstance(entry["side"], str):
        raise ValueError(f"'side' must be left or right, got {entry['side']!r}")
    links, offsets = {}, {}
    for point in POINTS:
        links[point], offset = _point(point, entry[point])
        if offset is not None:
            offsets[point] = offset
    side: Any = entry["side"]  # which of the two it is, the class looks
    return ArmDescription(side, tuple(joints), **links, offsets=offsets)


def _point(name: str, value: Any) -> tuple[str, Point | None]:
    """A link's name, or ``{link: NAME, offset: [x, y, z]}``."""
    if isinstance(value, str):
        return value, None
    if not isinstance(value, dict) or not isinstance(value.get("link"), str) or set(value) - {"link", "offset"}:
        raise ValueError(f"{name!r} must be a link, or {{link: NAME, offset: [x, y, z]}}, got {value!r}")
    numbers = value.get("offset", [0.0, 0.0, 0.0])
    if not isinstance(numbers, list) or len(numbers) != 3 or not all(_is_place(number) for number in numbers):
        raise ValueError(f"{name!r}: offset must be three numbers of metres below 10, got {numbers!r}")
    return value["link"], (float(numbers[0]), float(numbers[1]), float(numbers[2]))


def _is_place(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 10.0


def _coupled_limit(entry: Any) -> CoupledLimit:
    at, lower, upper = (tuple(float(value) for value in entry[key]) for key in ("at", "lower", "upper"))
    if not 0 < len(at) == len(lower) == len(upper):
        raise ValueError(f"at, lower and upper of a coupled limit need equally many numbers, got {entry}")
    return CoupledLimit(str(entry["joint"]), str(entry["by"]), at, lower, upper)


def _rotation_rows(value: Any) -> tuple[tuple[float, float, float], ...]:
    rows = np.asarray(value, dtype=np.float64)
    if rows.shape != (3, 3) or not np.allclose(rows @ rows.T, np.eye(3), atol=1e-6) or np.linalg.det(rows) < 0.0:
        raise ValueError(f"axes must be the three rows of a rotation, got {value}")
    return tuple((float(x), float(y), float(z)) for x, y, z in rows)
