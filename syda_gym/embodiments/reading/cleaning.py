"""clean_urdf: the same robot as XML that strict parsers take: every limit there, no name used twice, meshes found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from syda_gym.embodiments.reading.parts import Joint, Shape

__all__ = ["clean_urdf", "model_joint_names", "origin_attributes", "size_attributes"]

_TURN = "3.141592653589793"


def model_joint_names(joints: Mapping[str, Joint], links: Mapping[str, Any]) -> dict[str, str]:
    """Joint name to the name in a model whose joints and links share one space of names, as pinocchio's frames do."""
    taken = {*joints, *links}
    names = {}
    for name in joints:
        other = name
        while other in links or (other != name and other in taken):
            other += "__joint"
        names[name] = other
        taken.add(other)
    return names


def clean_urdf(
    links: Mapping[str, Any],
    joints: Mapping[str, Joint],
    elements: Mapping[str, Any],
    shapes: Mapping[str, tuple[Shape, ...]],
) -> str:
    """Text of the URDF with inertias and collision shapes, as pinocchio builds models from.

    Args:
        links: link elements by name.
        joints: joints by name.
        elements: joint elements by name.
        shapes: shapes by link; missing meshes are left out.

    Returns:
        XML in which numbers stand as in the file, so that nothing is rounded on the way.
    """
    from lxml import etree

    names = model_joint_names(joints, links)
    robot = etree.Element("robot", name="robot")
    for name, link in links.items():
        part = etree.SubElement(robot, "link", name=name)
        _add_inertial(etree, part, link)
        collisions = [shape for shape in shapes[name] if shape.role == "collision"]
        for element, shape in zip(_with_geometry(link, "collision", shapes[name]), collisions, strict=False):
            if not shape.missing:
                _add_shape(etree, part, element, shape)
    for name, joint in joints.items():
        part = etree.SubElement(robot, "joint", name=names[name], type=joint.type)
        for tag in ("origin", "parent", "child"):
            found = elements[name].find(tag)
            if found is not None:
                etree.SubElement(part, tag, dict(found.attrib))
        if joint.type not in ("fixed", "floating"):
            axis = elements[name].find("axis")
            etree.SubElement(part, "axis", {"xyz": "1 0 0"} if axis is None else dict(axis.attrib))
        if joint.type in ("revolute", "prismatic", "continuous"):
            etree.SubElement(part, "limit", _limit(joint))
    return str(etree.tostring(robot, encoding="unicode"))


def _limit(joint: Joint) -> dict[str, str]:
    limit = joint.limit
    lower = upper = None
    if limit is not None and joint.type != "continuous":
        lower, upper = limit.lower, limit.upper
    if lower is not None and upper is not None and lower > upper:
        lower, upper = upper, lower  # named as a fault where the joint is an arm's
    effort = 1e6 if limit is None or limit.effort is None else limit.effort
    speed = 1e6 if limit is None or limit.velocity is None else limit.velocity
    return {
        "lower": f"-{_TURN}" if lower is None else repr(lower),
        "upper": _TURN if upper is None else repr(upper),
        "effort": repr(effort),
        "velocity": repr(speed),
    }


def _add_inertial(etree: Any, part: Any, link: Any) -> None:
    inertial = link.find("inertial")
    mass = None if inertial is None else inertial.find("mass")
    if mass is None:
        return
    copy = etree.SubElement(part, "inertial")
    origin, tensor = inertial.find("origin"), inertial.find("inertia")
    if origin is not None:
        etree.SubElement(copy, "origin", dict(origin.attrib))
    etree.SubElement(copy, "mass", dict(mass.attrib))
    zero = {key: "0" for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")}
    etree.SubElement(copy, "inertia", zero if tensor is None else {**zero, **dict(tensor.attrib)})


def _with_geometry(link: Any, role: str, shapes: tuple[Shape, ...]) -> list[Any]:
    """The elements that became shapes; where some did not, none can be matched and all are written anew."""
    found = [element for element in link.findall(role)]
    return found if len(found) == sum(shape.role == role for shape in shapes) else [None] * len(shapes)


def _add_shape(etree: Any, part: Any, element: Any, shape: Shape) -> None:
    copy = etree.SubElement(part, shape.role)
    origin = None if element is None else element.find("origin")
    if origin is not None:
        etree.SubElement(copy, "origin", dict(origin.attrib))
    elif element is None:
        etree.SubElement(copy, "origin", origin_attributes(shape.placement))
    geometry = etree.SubElement(copy, "geometry")
    if shape.kind == "mesh":
        scale = " ".join(repr(value) for value in shape.size)
        etree.SubElement(geometry, "mesh", {"filename": str(shape.mesh), "scale": scale})
    elif element is not None:
        inner = next(child for child in element.find("geometry") if isinstance(child.tag, str))
        etree.SubElement(geometry, inner.tag, dict(inner.attrib))
    else:
        etree.SubElement(geometry, shape.kind, size_attributes(shape))


def origin_attributes(placement: Any) -> dict[str, str]:
    """``xyz`` and ``rpy`` of a homogeneous transform ``(4, 4)``."""
    r = placement[:3, :3]
    flat = math.hypot(r[0, 0], r[1, 0])
    if flat > 1e-9:
        roll, yaw = math.atan2(r[2, 1], r[2, 2]), math.atan2(r[1, 0], r[0, 0])
    else:  # roll and yaw turn about one axis
        roll, yaw = math.atan2(-r[1, 2], r[1, 1]), 0.0
    rpy = (roll, math.atan2(-r[2, 0], flat), yaw)
    return {
        "xyz": " ".join(f"{float(v):.12g}" for v in placement[:3, 3]),
        "rpy": " ".join(f"{float(v):.12g}" for v in rpy),
    }


def size_attributes(shape: Shape) -> dict[str, str]:
    """Attributes of a primitive's element."""
    if shape.kind == "box":
        return {"size": " ".join(f"{v:.9g}" for v in shape.size)}
    keys = ("radius", "length")
    return {key: f"{value:.9g}" for key, value in zip(keys, shape.size, strict=False)}
