"""The one budget of all readers: what a file from a stranger may ask for before it is refused.

A reader measures first and reads afterwards: bytes on the disk and unpacked, nodes of a tree with its aliases
written out, numbers of a table, depth, digits. What stays within the budget is read in a few seconds and within 1 GB.
"""

from __future__ import annotations

import os
import reprlib
from dataclasses import dataclass
from pathlib import Path

from syda_gym.errors import StorageError, SydaError

__all__ = ["BUDGET", "Budget", "check_size", "read_bytes", "shortened"]


@dataclass(frozen=True)
class Budget:
    """What one file may ask for.

    Attributes:
        text: bytes of a text, for example a recording.
        settings: bytes of a hand-written file: robot descriptions, benchmark settings, layouts.
        packed: bytes of an archive.
        unpacked: bytes of all members of an archive.
        members: members of an archive.
        nodes: values of a tree such as JSON, every alias of YAML written out.
        described: the same for a hand-written file.
        elements: numbers of a table.
        depth: levels of a tree.
        digits: digits of one number.
        cells: cells of a workbook, empty ones included, because its reader makes them all.
        tensors: arrays in one file of weights.
        links: links or joints of a robot.
        chain: links of a robot behind one another.
    """

    text: int = 256 * 2**20
    settings: int = 2**18
    packed: int = 256 * 2**20
    unpacked: int = 512 * 2**20
    members: int = 10_000
    nodes: int = 10_000_000
    described: int = 20_000
    elements: int = 24_000_000
    depth: int = 100
    digits: int = 300
    cells: int = 4_000_000
    tensors: int = 4_000
    links: int = 600
    chain: int = 120


BUDGET = Budget()
"""The budget of every reader of this library."""


def check_size(
    path: str | os.PathLike[str], limit: int, what: str, error: type[SydaError] = StorageError, remedy: str = ""
) -> Path:
    """Refuses a file that is missing or too large.

    Args:
        path: the file.
        limit: bytes.
        what: what it should be, for the message.
        error: exception to raise.
        remedy: what to do about a large file.

    Returns:
        ``path``.

    Raises:
        SydaError: of the kind ``error``.
    """
    file = Path(path)
    try:
        found = file.is_file()
        size = file.stat().st_size if found else 0
    except (OSError, ValueError) as problem:  # a name longer than the file system takes, or with a zero byte in it
        raise error(f"no file {str(file)[:200]!r}: {problem}; expected {what}") from problem
    if not found:
        raise error(f"no file {file}; expected {what}")
    if size > limit:
        allowed = f"{limit >> 20} MB" if limit >= 1 << 20 else f"{limit >> 10} kB"
        came = f"{size >> 20} MB" if size >= 1 << 20 else f"{size >> 10} kB"
        raise error(f"{file} has {came}; at most {allowed} are read as {what}{remedy and '. ' + remedy}")
    return file


def read_bytes(path: str | os.PathLike[str], limit: int, what: str, error: type[SydaError] = StorageError) -> bytes:
    """The bytes of a file of at most ``limit`` bytes.

    Raises:
        SydaError: of the kind ``error``; missing, too large, or not readable.
    """
    file = check_size(path, limit, what, error)
    try:
        with file.open("rb") as opened:
            data = opened.read(limit + 1)  # a device or a file that grows has no size to check
    except OSError as problem:
        raise error(f"{file} cannot be read: {problem.strerror}") from problem
    if len(data) > limit:
        raise error(f"{file} grows while it is read; expected {what}")
    return data


_REPR = reprlib.Repr()
_REPR.maxlevel, _REPR.maxdict, _REPR.maxlist, _REPR.maxtuple = 2, 6, 6, 6
_REPR.maxstring = _REPR.maxother = 80


def shortened(value: object, limit: int = 160) -> str:
    """A value for a message: never more than ``limit`` characters, however much its aliases would make of it."""
    if isinstance(value, int) and not isinstance(value, bool) and value.bit_length() > 400:
        return f"a whole number of {value.bit_length()} bits"
    text = _REPR.repr(value)
    return text if len(text) <= limit else f"{text[: limit - 3]}..."
