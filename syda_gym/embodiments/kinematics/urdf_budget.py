"""What a URDF may ask for, checked before its parsers see it: circles and long chains end their process."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from syda_gym.errors import EmbodimentError
from syda_gym.files import BUDGET, read_bytes

__all__ = ["check_urdf_tree"]

_MAX_BYTES = 32 * 2**20
_ENTITIES = re.compile(rb"<!(ENTITY|DOCTYPE)", re.IGNORECASE)
_LONG_NUMBER = re.compile(rb"\d{%d}" % (BUDGET.digits + 1))


def check_urdf_tree(file: Path) -> None:
    """Refuses circles, links with two parents, very many links and very long chains.

    Raises:
        EmbodimentError: the message names the link or the count.
    """
    data = read_bytes(file, _MAX_BYTES, "a plain URDF", EmbodimentError)
    if _ENTITIES.search(data) or data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise EmbodimentError(f"{file} declares entities or is no UTF-8; expected a plain URDF")
    if _LONG_NUMBER.search(data):
        raise EmbodimentError(f"{file}: a number has more than {BUDGET.digits} digits; expected a plain URDF")
    parents: dict[str, str] = {}
    links, depth = 0, 0
    try:
        parser: Any = ElementTree.XMLPullParser(("start", "end"))
        for start in range(0, len(data), 2**16):
            parser.feed(data[start : start + 2**16])
            for event, element in parser.read_events():
                depth += 1 if event == "start" else -1
                if depth > BUDGET.depth:
                    raise EmbodimentError(
                        f"{file} is nested more than {BUDGET.depth} levels deep; expected a plain URDF"
                    )
                if event == "start" and depth == 2 and element.tag == "link":
                    links += 1
                if event == "end" and depth == 1 and element.tag == "joint":
                    _enter(file, element, parents)
                if event == "end" and depth == 1:
                    element.clear()
                if max(links, len(parents)) > BUDGET.links:
                    raise EmbodimentError(f"{file} has more than {BUDGET.links} links or joints; that is no humanoid")
    except ElementTree.ParseError as error:
        raise EmbodimentError(f"{file} is not a URDF that can be read: {error}; expected a <robot> tree") from error
    _check_chains(file, parents)


def _enter(file: Path, element: Any, parents: dict[str, str]) -> None:
    ends = [element.find("parent"), element.find("child")]
    parent, child = ("" if end is None else end.get("link", "") for end in ends)
    if child in parents:
        raise EmbodimentError(f"{file}: link {child[:60]!r} is the child of two joints; expected a tree")
    if child:
        parents[child] = parent


def _check_chains(file: Path, parents: dict[str, str]) -> None:
    lengths: dict[str, int] = {}
    for start in parents:
        path = []
        link = start
        while link in parents and link not in lengths:
            path.append(link)
            if len(path) > BUDGET.links:
                raise EmbodimentError(f"{file}: the joints above link {start[:60]!r} go in a circle; expected a tree")
            link = parents[link]
        length = lengths.get(link, 0)
        for passed in reversed(path):
            length += 1
            lengths[passed] = length
        if length > BUDGET.chain:
            raise EmbodimentError(
                f"{file}: more than {BUDGET.chain} joints hang behind one another; that is no humanoid"
            )
