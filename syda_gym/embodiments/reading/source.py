"""read_source: the XML of a robot from a URDF, a xacro or an MJCF, or what the file is instead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from syda_gym.embodiments.reading.apart import converted_apart
from syda_gym.errors import EmbodimentError

__all__ = ["ROBOT_ENDINGS", "read_source"]

ROBOT_ENDINGS = (".urdf", ".xacro", ".xml", ".mjcf")
"""Endings of files that hold a robot, in small letters; what a file is, its content says."""

_MOST_BYTES = 32 * 2**20
_XACRO = "http://www.ros.org/wiki/xacro"
_OTHERS = {
    "sdf": "SDF, Gazebo's format; convert it, for example with `gz sdf -p` and a URDF exporter",
    "COLLADA": "a COLLADA mesh; name the URDF that uses it",
    "robotDescription": "an SRDF; name the URDF beside it",
}


def read_source(path: str | Path) -> Any:
    """The root element ``<robot>`` of a robot's file.

    Args:
        path: a URDF; a xacro where ``xacrodoc`` is installed; an MJCF where ``mujoco`` is installed.

    Returns:
        An lxml element whose descendants know their lines (of the URDF; of xacro and MJCF none).

    Raises:
        EmbodimentError: no such file, too large, or not a robot; the message says what it is and what to do.
        MissingExtraError: a xacro or an MJCF without what reads it.
    """
    file = Path(path)
    if not file.is_file():
        raise EmbodimentError(f"no URDF {file}; check the path")
    if file.stat().st_size > _MOST_BYTES:
        raise EmbodimentError(f"{file} is larger than {_MOST_BYTES >> 20} MB; that is no plain URDF")
    root = _parsed(file, file.read_bytes())
    if root.tag == "mujoco":
        return _parsed(file, converted_apart("mjcf", file))
    if root.tag == "robot" and _is_xacro(root):
        return _parsed(file, converted_apart("xacro", file))
    if root.tag != "robot":
        kind = _OTHERS.get(str(root.tag), f"an XML file with the root <{root.tag}>")
        raise EmbodimentError(f"{file} is not a URDF that can be read: it is {kind}; expected a <robot> tree")
    return root


def _parsed(file: Path, content: bytes) -> Any:
    from lxml import etree

    # Nothing outside the file is read, and no entity is expanded into a bomb.
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        return etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise EmbodimentError(
            f"{file} is not a URDF that can be read: it is no XML, {error}; expected a <robot> tree"
        ) from error


def _is_xacro(root: Any) -> bool:
    """Whether something in the tree is xacro's; a namespace that is declared and never used does not count."""
    if any(isinstance(element.tag, str) and element.tag.startswith(f"{{{_XACRO}}}") for element in root.iter()):
        return True
    return any("${" in str(value) for element in root.iter("joint", "link", "origin") for value in element.values())
