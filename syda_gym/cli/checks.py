"""Checks of what a user typed, made while the command line is read: nothing is loaded, fitted or created before.

Each is made for one option's ``callback``; what it refuses is told with the option's own name and the nearest name that
would have worked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import typer

from syda_gym.cli.names import ACTING, CELLS, LEVELS, METHODS, RIVALS, SHIPPED_AGENTS, SINGLE_DISTURBANCES
from syda_gym.errors import nearest_name

__all__ = [
    "address",
    "agents",
    "agents_or",
    "between",
    "bundle",
    "disturbances",
    "ending",
    "folder",
    "methods",
    "multiple",
    "named_or_file",
    "npz_or_folder",
    "one_of",
    "pairs",
    "route",
    "several",
    "workers",
]

Check = Callable[[Any], Any]


def one_of(known: Collection[str], what: str) -> Check:
    """A name out of ``known``; an empty one stands for the default.

    Args:
        known: the names.
        what: the word for it, for example ``"method"``.
    """

    def check(value: str | None) -> str | None:
        if value and value not in known:
            raise typer.BadParameter(f"unknown {what} {value!r}; {nearest_name(value, known)}")
        return value

    return check


def several(known: Collection[str] | None = None, what: str = "name") -> Check:
    """Names of an option that may be repeated and comma-separated, as one flat list.

    Args:
        known: the names that exist; any name if ``None``.
        what: the word for one.
    """

    def check(values: Sequence[str] | None) -> list[str]:
        names = _split(values)
        for name in names:
            if known is not None and name not in known:
                raise typer.BadParameter(f"unknown {what} {name!r}; {nearest_name(name, known)}")
        return names

    return check


def between(low: float, high: float, unit: str = "", *, open_low: bool = False) -> Check:
    """A number in a range; not a number is refused too.

    Args:
        low: the smallest value.
        high: the largest; may be infinite.
        unit: for the message.
        open_low: whether ``low`` itself is out of range.
    """
    words = f" {unit}" if unit else ""

    def check(value: float | None) -> float | None:
        if value is None:
            return None
        fits = (value > low if open_low else value >= low) and value <= high and math.isfinite(value)
        if fits:
            return value
        least = f"above {low:g}" if open_low else f"at least {low:g}"
        most = f" and at most {high:g}" if math.isfinite(high) else ""
        raise typer.BadParameter(f"must be {least}{most}{words}, got {value:g}")

    return check


def multiple(step: float, low: float, high: float, unit: str) -> Check:
    """A whole multiple of ``step`` in a range.

    Args:
        step: what divides it.
        low: the smallest value.
        high: the largest.
        unit: for the message.
    """
    inside = between(low, high, unit)

    def check(value: float) -> float:
        inside(value)
        if abs(value / step - round(value / step)) > 1e-9:
            below = math.floor(value / step) * step
            raise typer.BadParameter(
                f"must be a whole multiple of {step:g} {unit}, got {value:g}; nearest: {below:g} or {below + step:g}"
            )
        return value

    return check


def ending(*endings: str) -> Check:
    """A file to write that ends as it must."""

    def check(path: Path | None) -> Path | None:
        if path is not None and not path.name.endswith(endings):
            raise typer.BadParameter(f"must end in {' or '.join(endings)}, got {path.name!r}")
        if path is not None and path.is_dir():
            raise typer.BadParameter(f"{path} is a folder; name a file in it")
        return path

    return check


def folder(path: Path | None) -> Path | None:
    """A folder to write to; a file of that name is in the way."""
    if path is not None and path.exists() and not path.is_dir():
        raise typer.BadParameter(f"{path} is a file; name a folder")
    return path


def npz_or_folder(path: Path) -> Path:
    """Where motions are written: a ``.npz`` file, or a folder, whose name has no ending."""
    if path.suffix and path.suffix != ".npz" and not path.is_dir():
        raise typer.BadParameter(f"must end in .npz, or be a folder without an ending; got {path.name!r}")
    (ending(".npz") if path.suffix == ".npz" else folder)(path)
    return path


def methods(values: str | Sequence[str] | None) -> Any:
    """``NAME`` or ``NAME:PRESET``; several of them for an option that may be repeated."""
    single = isinstance(values, str)
    names = [values] if isinstance(values, str) else _split(values)
    for text in names:
        name, colon, preset = text.partition(":")
        if name not in METHODS:
            raise typer.BadParameter(f"unknown method {name!r}; {nearest_name(name, METHODS)}")
        if colon and preset not in METHODS[name]:
            raise typer.BadParameter(f"method {name!r} has no preset {preset!r}; {nearest_name(preset, METHODS[name])}")
    return values if single or values is None else names


def agents(values: str | Sequence[str] | None) -> Any:
    """A known agent's name, or the path of a stored bundle; also several of them."""
    for text in [values] if isinstance(values, str) else values or ():
        if text not in ACTING and not _is_bundle(text):
            raise typer.BadParameter(
                f"no agent {text!r}: neither a bundle's path nor a name; {nearest_name(text, ACTING)}"
            )
    return values


def agents_or(*words: str) -> Check:
    """A known agent's name, the path of a stored bundle, one of some words, or nothing."""

    def check(value: str | None) -> Any:
        return value if not value or value in words else agents(value)

    return check


def bundle(text: str) -> str:
    """A shipped agent's name, or the path of a stored bundle; rivals are not stored."""
    if text in SHIPPED_AGENTS or _is_bundle(text):
        return text
    why = "has no file" if text in RIVALS else "is neither a bundle's path nor a shipped agent"
    raise typer.BadParameter(f"{text!r} {why}; {nearest_name(text, SHIPPED_AGENTS)}")


def named_or_file(known: Collection[str], what: str, *endings: str) -> Check:
    """A known name, or a file that exists.

    Args:
        known: the names.
        what: the word for it.
        endings: of files.
    """

    def check(value: str) -> str:
        if not value or value in known:
            return value
        if value.endswith(endings):
            if not Path(value).is_file():
                raise typer.BadParameter(f"no file {value}; name one, or one of {', '.join(known)}")
            return value
        raise typer.BadParameter(f"unknown {what} {value!r}; {nearest_name(value, known)}, or a file {endings[0]}")

    return check


def address(written: Sequence[str], what: str) -> Check:
    """The kind of a source or sink, before the first colon.

    Args:
        written: how they are written, for example ``udp:PORT``.
        what: ``"source"`` or ``"sink"``.
    """
    kinds = {text.partition(":")[0].partition("[")[0] for text in written}

    def check(values: Any) -> Any:
        for text in [values] if isinstance(values, str) else values or ():
            kind = text.partition(":")[0]
            if kind not in kinds:
                raise typer.BadParameter(f"unknown {what} {text!r}; {nearest_name(kind, kinds)}")
        return values

    return check


def route(value: str | None) -> str | None:
    """``auto``, or bodies ``a,b,c`` or ``a>b>c``, which become ``a,b,c``."""
    if not value or value == "auto":
        return value
    bodies = [body.strip() for body in value.replace(">", ",").split(",")]
    if len(bodies) < 2 or not all(bodies):
        raise typer.BadParameter(f"write auto, or bodies such as adult,kid,pepper; got {value!r}")
    return ",".join(bodies)


def pairs(values: Sequence[str] | None) -> list[str]:
    """Pairs ``A:B``, repeated or comma-separated."""
    found = _split(values)
    for text in found:
        ends = text.split(":")
        if len(ends) != 2 or not all(end.strip() for end in ends):
            raise typer.BadParameter(f"takes two bodies as A:B, for example adult:kid; got {text!r}")
    return found


def disturbances(value: str) -> str:
    """``none``, ``teleop[:CELL[:LEVEL]]`` or ``NAME[:LEVEL]``."""
    head, *rest = value.split(":")
    if head not in ("none", "teleop", *SINGLE_DISTURBANCES):
        hint = nearest_name(head, ("none", "teleop", *SINGLE_DISTURBANCES))
        if head in CELLS:
            hint = f"did you mean 'teleop:{value}'? {hint.rpartition('? ')[2]}"
        raise typer.BadParameter(f"unknown disturbances {head!r}; {hint}")
    if head == "teleop" and rest:
        cell = rest.pop(0)
        if cell not in CELLS:
            raise typer.BadParameter(f"unknown cell {cell!r}; {nearest_name(cell, CELLS)}")
    if rest and rest[0] not in LEVELS:
        raise typer.BadParameter(f"unknown level {rest[0]!r}; {nearest_name(rest[0], LEVELS)}")
    if len(rest) > 1 or (head == "none" and rest):
        raise typer.BadParameter(f"write none, teleop:CELL:LEVEL or NAME:LEVEL; got {value!r}")
    return value


def workers(value: str) -> str:
    """A number of processes, ``ray`` or ``ray:ADDRESS``."""
    text = value.strip()
    if text == "ray" or text.startswith("ray:") or (text.isascii() and text.isdigit() and 1 <= int(text) <= 1024):
        return text
    raise typer.BadParameter(f"must be a number from 1 to 1024, ray or ray:ADDRESS, got {value!r}")


def _is_bundle(text: str) -> bool:
    """Whether it is a bundle, or plainly a path; whether that exists is told where it is read."""
    if "/" in text or text.endswith((".json", ".safetensors")):
        return True
    path = Path(text)
    try:
        return bool(path.name) and path.with_suffix(".json").is_file()
    except OSError:  # a name longer than the file system takes
        return False


def _split(values: Sequence[str] | None) -> list[str]:
    parts = (part.strip() for value in values or () for part in value.split(","))
    return list(dict.fromkeys(part for part in parts if part))
