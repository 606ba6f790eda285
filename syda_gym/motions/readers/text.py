"""Reading recordings that are text: size limits, and errors that name the line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import BUDGET, read_bytes

__all__ = ["GAPS", "MAX_BYTES", "first_bytes", "numbers", "read_lines", "split_row"]

MAX_BYTES = BUDGET.text
"""Larger text files are refused: half an hour of full-body motion capture is about 100 MB."""

GAPS = {"", "nan", "-nan", "-nan(ind)", "null", "none", "na", "n/a", "#n/a", "-", "?", "undefined"}
"""What tools write where a number is not known."""

_SEPARATORS = re.compile(r"[,;\s]+")


def read_lines(path: Path, kind: str) -> list[str]:
    """The lines of a text recording without line ends.

    UTF-8 and UTF-16 with a mark are told by it; anything else that is no UTF-8 is read as Latin-1: names may have
    accents, the numbers read the same.

    Args:
        path: the file.
        kind: what it should be, for the message.

    Raises:
        MotionError: missing, too large, or not text.
    """
    content = read_bytes(path, MAX_BYTES, f"{kind}; cut it into pieces", MotionError)
    if sum(content.count(mark) for mark in (b" ", b",", b";", b"\t", b"\n")) > 2 * BUDGET.elements:
        raise MotionError(f"{path} holds more than {BUDGET.elements} numbers; cut it into pieces")
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = content.decode("utf-16", errors="replace")
    else:
        if b"\0" in content:
            raise MotionError(f"{path} is binary, not text; expected {kind}")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
    if not text.strip():
        raise MotionError(f"{path} is empty; expected {kind}")
    # Not ``splitlines``, which also splits at marks that stand inside names (vertical tab, next line, ...).
    return text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n").split("\n")


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
            if cell.strip().lower() not in GAPS:
                raise MotionError(f"{path}, line {line}, column {column + 1}: {cell[:40]!r} is no number") from None
            values[column] = np.nan
    if np.isinf(values).any():
        column = int(np.flatnonzero(np.isinf(values))[0])
        raise MotionError(f"{path}, line {line}, column {column + 1}: the number is infinite")
    return values
