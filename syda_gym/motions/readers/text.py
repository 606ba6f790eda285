"""Reading recordings that are text: size limits, and errors that name the line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError

__all__ = ["MAX_BYTES", "first_bytes", "numbers", "read_lines", "split_row"]

MAX_BYTES = 256 * 2**20
"""Larger text files are refused: half an hour of full-body motion capture is about 100 MB."""

_SEPARATORS = re.compile(r"[,;\s]+")


def read_lines(path: Path, kind: str) -> list[str]:
    """The lines of a text recording without line ends.

    Args:
        path: the file.
        kind: what it should be, for the message.

    Raises:
        MotionError: missing, too large, or not text.
    """
    if not path.is_file():
        raise MotionError(f"no file {path}; expected {kind}")
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise MotionError(f"{path} has {size >> 20} MB; at most {MAX_BYTES >> 20} MB are read. Cut it into pieces")
    content = path.read_bytes()
    if b"\0" in content:
        raise MotionError(f"{path} is binary, not text; expected {kind}")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")  # names may have accents; the numbers read the same
    if not text.strip():
        raise MotionError(f"{path} is empty; expected {kind}")
    return text.splitlines()


def first_bytes(path: Path, count: int = 4096) -> bytes:
    """The beginning of a file, empty if it cannot be read; for finding out its format."""
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError:
        return b""


def split_row(line: str) -> list[str]:
    """Cells of a line separated by commas, semicolons or white space; an empty cell at the end is dropped."""
    if "," in line or ";" in line:
        cells = [cell.strip() for cell in re.split(r"[,;]", line.strip())]
        return cells[:-1] if cells and not cells[-1] else cells
    return _SEPARATORS.split(line.strip())


def numbers(cells: Sequence[str], path: Path, line: int) -> FloatArray:
    """Cells as numbers; an empty cell or ``nan`` is a gap.

    Args:
        cells: text of the cells.
        path: file, for the message.
        line: line number from 1, for the message.

    Returns:
        ``(len(cells),)``, gaps as NaN.

    Raises:
        MotionError: a cell is no number, or infinite; the message names line and column.
    """
    values = np.empty(len(cells))
    for column, cell in enumerate(cells):
        try:
            values[column] = float(cell) if cell else np.nan
        except ValueError:
            raise MotionError(f"{path}, line {line}, column {column + 1}: {cell[:40]!r} is no number") from None
    if np.isinf(values).any():
        column = int(np.flatnonzero(np.isinf(values))[0])
        raise MotionError(f"{path}, line {line}, column {column + 1}: the number is infinite")
    return values
