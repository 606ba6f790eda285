"""check: every fault of a robot's XML at once, each with its line, and what can be read in spite of small ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.reading.parts import JOINT_TYPES, Joint, Limit, Mimic
from syda_gym.errors import EmbodimentError, nearest_name

__all__ = ["Checked", "check"]

_MOST_EFFORT = 1e4  # N m; more is a placeholder: the strongest arm joints of machines have some thousand
_MOST_SPEED = 100.0  # rad/s; more is a placeholder
_MOST_FAULTS = 20


@dataclass(frozen=True, eq=False)
class Checked:
    """What a file holds.

    Attributes:
        links: link elements by name.
        joints: joints by name.
        notes: small faults that were mended, one sentence each.
        placeholders: joints with a stated effort or speed that no motor has, taken as unknown.
    """

    links: dict[str, Any]
    joints: dict[str, Joint]
    notes: tuple[str, ...]
    placeholders: tuple[str, ...]


def check(root: Any, path: Path) -> Checked:
    """Reads links and joints.

    Args:
        root: the element ``<robot>``.
        path: its file, for messages.

    Raises:
        EmbodimentError: names that are missing, double or unknown, numbers that are none, a tree that is none; the
            message lists them all with their lines.
    """
    return _Checker(root, path).result()


class _Checker:
    def __init__(self, root: Any, path: Path) -> None:
        self._root, self._path = root, path
        self._faults: list[tuple[int, str]] = []
        self._notes: list[str] = []
        self._placeholders: list[str] = []

    def result(self) -> Checked:
        links = self._read_links()
        joints = self._read_joints(links)
        if not self._faults:
            links = self._check_tree(links, joints)
            self._check_mimics(joints)
        if self._faults:
            self._refuse()
        if not joints:
            raise EmbodimentError(f"{self._path} has no joints; expected the URDF of a robot with at least one arm")
        return Checked(links, joints, tuple(self._notes), tuple(dict.fromkeys(self._placeholders)))

    def _refuse(self) -> None:
        told = [f"line {line}: {text}" if line else text for line, text in self._faults[:_MOST_FAULTS]]
        if len(self._faults) > _MOST_FAULTS:
            told.append(f"and {len(self._faults) - _MOST_FAULTS} more")
        count = "one fault" if len(self._faults) == 1 else f"{len(self._faults)} faults"
        raise EmbodimentError(f"{self._path} is not a URDF that can be read: {count}: " + "; ".join(told))

    def _fault(self, element: Any, text: str) -> None:
        self._faults.append((element.sourceline or 0, text))

    def _read_links(self) -> dict[str, Any]:
        links: dict[str, Any] = {}
        for element in self._root.findall("link"):
            name = element.get("name")
            if not name:
                self._fault(element, 'a <link> has no name; write name="..."')
            elif name in links:
                self._fault(element, f"link {name!r} is there twice; give one of them another name")
            else:
                links[name] = element
                self._check_mass(name, element)
        return links

    def _check_mass(self, name: str, link: Any) -> None:
        inertial = link.find("inertial")
        if inertial is None:
            return
        mass = inertial.find("mass")
        value = None if mass is None else _number(mass.get("value"))
        if mass is not None and (value is None or value < 0.0):
            self._fault(mass, f"link {name!r}: mass {mass.get('value')!r} must be a number that is not negative [kg]")
        self._check_origin(inertial, f"the <inertial> of link {name!r}")
        tensor = inertial.find("inertia")
        wrong = [k for k in _TENSOR if tensor is not None and _number(tensor.get(k, "0")) is None]
        if wrong:
            self._fault(tensor, f"link {name!r}: {wrong[0]}={tensor.get(wrong[0])!r} must be a number [kg m2]")

    def _check_origin(self, element: Any, where: str) -> None:
        origin = element.find("origin")
        for key, unit in (("xyz", "m"), ("rpy", "rad")) if origin is not None else ():
            text = origin.get(key)
            if text is not None and _numbers(text, 3) is None:
                self._fault(origin, f"{where}: {key}={text!r} must be three numbers [{unit}]")

    def _read_joints(self, links: dict[str, Any]) -> dict[str, Joint]:
        joints: dict[str, Joint] = {}
        for element in self._root.findall("joint"):
            name = element.get("name")
            if not name:
                self._fault(element, 'a <joint> has no name; write name="..."')
            elif name in joints:
                self._fault(element, f"joint {name!r} is there twice; give one of them another name")
            else:
                joint = self._read_joint(name, element, links)
                if joint is not None:
                    joints[name] = joint
        return joints

    def _read_joint(self, name: str, element: Any, links: dict[str, Any]) -> Joint | None:
        before = len(self._faults)
        kind = element.get("type")
        if kind not in JOINT_TYPES:
            self._fault(element, f"joint {name!r} has the type {kind!r}; {nearest_name(str(kind), JOINT_TYPES)}")
        ends = {}
        for end in ("parent", "child"):
            part = element.find(end)
            ends[end] = None if part is None else part.get("link")
            if not ends[end]:
                self._fault(element, f'joint {name!r} has no <{end} link="..."/>')
            elif ends[end] not in links:
                self._fault(
                    part, f"joint {name!r}: there is no {end} link {ends[end]!r}; {_nearest(str(ends[end]), links)}"
                )
        self._check_origin(element, f"joint {name!r}")
        axis = self._read_axis(name, element, kind)
        limit = self._read_limit(name, element)
        mimic = self._read_mimic(name, element)
        if len(self._faults) > before:
            return None
        line = element.sourceline or 0
        return Joint(name, str(kind), str(ends["parent"]), str(ends["child"]), axis, limit, mimic, line)

    def _read_axis(self, name: str, element: Any, kind: str | None) -> NDArray[np.float64]:
        part = element.find("axis")
        if part is None or kind in ("fixed", "floating"):
            return np.array([1.0, 0.0, 0.0])  # URDF's default
        found = _numbers(part.get("xyz", "1 0 0"), 3)
        length = 0.0 if found is None else float(np.linalg.norm(found))
        if found is None or length < 1e-6:
            self._fault(part, f"joint {name!r}: axis xyz={part.get('xyz')!r} must be a direction of three numbers")
            return np.array([1.0, 0.0, 0.0])
        return found if abs(length - 1.0) < 1e-9 else found / length

    def _read_limit(self, name: str, element: Any) -> Limit | None:
        part = element.find("limit")
        if part is None:
            return None
        values: dict[str, float | None] = {}
        for key in ("lower", "upper", "velocity", "effort"):
            text = part.get(key)
            values[key] = None if text is None else _number(text, finite=key in ("lower", "upper"))
            if text is not None and values[key] is None and (key in ("lower", "upper") or not _is_nan(text)):
                self._fault(part, f"joint {name!r}: {key}={text!r} must be a number")
        speed = self._real(name, values["velocity"], _MOST_SPEED)
        effort = self._real(name, values["effort"], _MOST_EFFORT)
        lower, upper = values["lower"], values["upper"]
        if (lower is None) != (upper is None):  # URDF's default of the other is 0
            lower, upper = lower or 0.0, upper or 0.0
        return Limit(lower, upper, speed, effort)

    def _real(self, name: str, value: float | None, most: float) -> float | None:
        """A stated speed or effort, ``None`` for the placeholders that converters write: 0, -1, 5e4, 1e9."""
        if value is None or (math.isfinite(value) and 0.0 < value < most):
            return value
        self._placeholders.append(name)
        return None

    def _read_mimic(self, name: str, element: Any) -> Mimic | None:
        part = element.find("mimic")
        if part is None:
            return None
        multiplier, offset = _number(part.get("multiplier", "1")), _number(part.get("offset", "0"))
        if multiplier is None or offset is None or not part.get("joint"):
            self._fault(part, f"joint {name!r}: <mimic> needs a joint, and numbers as multiplier and offset")
            return None
        return Mimic(part.get("joint"), multiplier, offset)

    def _check_tree(self, links: dict[str, Any], joints: dict[str, Joint]) -> dict[str, Any]:
        parent: dict[str, Joint] = {}
        for joint in joints.values():
            element = links[joint.child]
            if joint.child in parent:
                first = parent[joint.child].name
                self._fault(element, f"link {joint.child!r} hangs on two joints, {first!r} and {joint.name!r}")
            parent[joint.child] = joint
        parents = {joint.parent for joint in joints.values()}
        lonely = [name for name in links if name not in parent and name not in parents]
        if lonely and joints:
            self._notes.append(f"no joint holds link {', '.join(map(repr, lonely))}; left out")
        rest = {name: element for name, element in links.items() if not joints or name not in lonely}
        roots = [name for name in rest if name not in parent]
        for name in rest:
            seen, at = {name}, name
            while at in parent:
                at = parent[at].parent
                if at in seen:
                    self._fault(links[name], f"link {name!r} hangs on itself: its joints form a ring")
                    return rest
                seen.add(at)
        if len(roots) > 1:
            names = ", ".join(map(repr, roots))
            self._fault(links[roots[1]], f"the links form {len(roots)} trees, with the roots {names}; join them")
        return rest

    def _check_mimics(self, joints: dict[str, Joint]) -> None:
        lost = {
            name: joint.mimic.joint
            for name, joint in joints.items()
            if joint.mimic is not None and joint.mimic.joint not in joints
        }
        if lost:
            told = ", ".join(f"{name!r} of {leader!r}" for name, leader in lost.items())
            self._notes.append(f"joints that mimic others that are not there stand still: {told}")


_TENSOR = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def _number(text: str | None, finite: bool = True) -> float | None:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) or (not finite and not math.isnan(value)) else None


def _is_nan(text: str) -> bool:
    return text.strip().lower().lstrip("+-") == "nan"


def _numbers(text: str, count: int) -> NDArray[np.float64] | None:
    found = [_number(part) for part in text.split()]
    if len(found) != count or any(value is None for value in found):
        return None
    return np.array(found, dtype=np.float64)


def _nearest(name: str, links: dict[str, Any]) -> str:
    """The nearest link's name; a long list of all would hide the other faults."""
    told = nearest_name(name, links)
    return told.partition("? Known")[0] + "?" if told.startswith("did you mean") else "add it, or correct the name"
