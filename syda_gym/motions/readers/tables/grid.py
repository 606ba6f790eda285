"""Lines of text as a grid: which lines are a header, what separates cells, which columns hold numbers."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.readers.said import Said
from syda_gym.motions.readers.text import GAPS

__all__ = ["Grid", "cells_of", "numeric", "read_grid"]

_MOST_HEADER = 60  # lines before the first frame
_SPACES = re.compile(r"[ \t]+")
_ENDS = {"END", "END,", "END;"}
_CLOCK = re.compile(r"(?:(\d+):)?(\d{1,2}):(\d{1,2}(?:\.\d+)?)$")
_REMARKS = ("#", "%", "//")  # how lines begin that are remarks, wherever they stand
_MOST_COLUMNS = 20_000


@dataclass
class Grid:
    """A table as it stands in a file.

    Attributes:
        path: the file.
        header: cells of the lines before the first frame; none if the file begins with numbers.
        values: ``(N, columns)``; NaN where a cell is empty or no number.
        words: column to its cells, for columns that hold words.
        lines: ``(N,)`` line of each row, from 1.
        bad: column to the first line whose cell is a word among numbers.
        clocks: columns that hold times of day, which begin again at midnight.
    """

    path: Path
    header: list[list[str]]
    values: FloatArray
    words: dict[int, list[str]]
    lines: NDArray[np.int64]
    bad: dict[int, tuple[int, str]]
    clocks: set[int] = field(default_factory=set)

    def check(self, columns: list[int]) -> None:
        """Refuses columns with words among their numbers.

        Raises:
            MotionError: the message names line and column.
        """
        for column in columns:
            if column in self.bad:
                line, cell = self.bad[column]
                raise MotionError(f"{self.path}, line {line}, column {column + 1}: {cell[:40]!r} is no number")
            infinite = np.flatnonzero(np.isinf(self.values[:, column]))
            if len(infinite):
                line = int(self.lines[infinite[0]])
                raise MotionError(f"{self.path}, line {line}, column {column + 1}: the number is infinite")


def read_grid(path: Path, lines: list[str], said: Said) -> Grid:
    """Reads lines as a grid.

    Raises:
        MotionError: no frames, or rows of unequal length.
    """
    separator, decimal_comma = _separator(lines, said)
    first = _first_frame(lines, separator, decimal_comma, said)
    if first is None:
        sample = lines[0].strip()[:80]
        raise MotionError(
            f"{path} has no frames: no line of numbers in its first {min(len(lines), _MOST_HEADER)} lines; it begins "
            f"with {sample!r}"
        )
    header = [cells_of(line, separator) for line in lines[:first] if line.strip() and not said.skip_lines]
    # A header that stands there again, where a tool was restarted.
    again = {line.strip() for line in lines[:first] if any(letter.isalpha() for letter in line)}
    kept = [n for n in range(first, len(lines)) if _is_frame(lines[n].strip(), again)]
    count = len(cells_of(lines[kept[0]], separator, decimal_comma))
    if count > _MOST_COLUMNS:
        raise MotionError(f"{path}: {count} columns; at most {_MOST_COLUMNS} are read")
    fast = _fast(lines, kept, separator, decimal_comma, count)
    if fast is not None:
        return Grid(path, header, fast, {}, np.array(kept) + 1, {})
    return _slow(path, header, lines, kept, separator, decimal_comma, count)


def _is_frame(line: str, header: set[str]) -> bool:
    return bool(line) and line.upper() not in _ENDS and not line.startswith(_REMARKS) and line not in header


def cells_of(line: str, separator: str | None, decimal_comma: bool = False) -> list[str]:
    """Cells of a line; an empty cell at the end is dropped."""
    text = line.strip("\r\n")
    if separator is None:
        return _SPACES.split(text.strip())
    if separator != "\t":
        text = text.strip()
    cells = [cell.strip().strip('"').strip() for cell in text.split(separator)]
    if len(cells) > 1 and not cells[-1]:
        cells.pop()
    return [cell.replace(",", ".") for cell in cells] if decimal_comma else cells


def numeric(cell: str) -> bool:
    """Whether a cell is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _separator(lines: list[str], said: Said) -> tuple[str | None, bool]:
    """What stands between cells (``None`` for blanks), and whether commas are decimal points."""
    if said.separator is not None:
        return (None if said.separator == " " else said.separator), said.separator == ";"
    sample = [line for line in lines[-6:] if line.strip()] + [line for line in lines[:8] if line.strip()]
    text = "\n".join(sample)
    if ";" in text:
        return ";", "," in text and not re.search(r"\d\.\d", text)
    if "\t" in text and "," in text and not re.search(r"\d\.\d", text) and re.search(r"\d,\d", text):
        return "\t", True
    if "," in text:
        return ",", False
    return ("\t", False) if text.count("\t") >= len(sample) else (None, False)


def _first_frame(lines: list[str], separator: str | None, decimal_comma: bool, said: Said) -> int | None:
    """The first of two like lines that are mostly numbers."""
    if said.skip_lines:
        return said.skip_lines if said.skip_lines < len(lines) else None
    candidates = [n for n in range(len(lines[: 4 * _MOST_HEADER])) if lines[n].strip()][:_MOST_HEADER]
    rows = [cells_of(lines[n], separator, decimal_comma) for n in candidates]
    shares = [sum(numeric(cell) for cell in row) / max(1, sum(bool(cell) for cell in row)) for row in rows]
    for place, (number, row) in enumerate(zip(candidates, rows, strict=True)):
        if len(row) < 3 or shares[place] < 0.3:
            continue
        following = rows[place + 1] if place + 1 < len(rows) else row
        if place + 1 < len(rows) and shares[place + 1] < 0.3 and len(following) > 1:
            continue  # numbers of a header (identities, rates), with words below them
        if shares[place] >= 0.6 or (
            len(following) == len(row) and abs(shares[place] - shares[min(place + 1, len(rows) - 1)]) < 0.1
        ):
            # A line of a header that has numbers (rates, dates) is shorter than the frames below it.
            if len(following) > 2 * len(row) and shares[min(place + 1, len(rows) - 1)] < 1.0:
                continue
            if place + 1 < len(rows) and len(row) < 0.5 * max(len(other) for other in rows[place:]):
                continue
            return number
    return None


def _fast(
    lines: list[str], kept: list[int], separator: str | None, decimal_comma: bool, count: int
) -> FloatArray | None:
    """Every cell a number: read at once."""
    text = [lines[n].strip().rstrip(separator or " ") if separator != "\t" else lines[n] for n in kept]
    if decimal_comma:
        text = [line.replace(",", ".") for line in text]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            table = np.loadtxt(text, delimiter=separator, dtype=np.float64, ndmin=2, comments=None)
    except (ValueError, IndexError, OverflowError, TypeError):
        return None
    return table if table.shape == (len(kept), count) and np.isfinite(table).all() else None


def _slow(
    path: Path,
    header: list[list[str]],
    lines: list[str],
    kept: list[int],
    separator: str | None,
    decimal_comma: bool,
    count: int,
) -> Grid:
    """Row by row: empty cells, words, dates, rows that end early."""
    wanted = max([count, *(len(row) for row in header)]) if header else count
    if header and len(header[-1]) == count + 1 and not header[-1][-1]:
        wanted = count
    values = np.full((len(kept), wanted), np.nan)
    words: dict[int, list[str]] = {}
    bad: dict[int, tuple[int, str]] = {}
    clocks: set[int] = set()
    for index, number in enumerate(kept):
        row = cells_of(lines[number], separator, decimal_comma)
        if (
            len(row) != count
            and not (header and len(row) == wanted)
            and not _padded(row, count, wanted, separator, header)
        ):
            end = "; is the file truncated?" if number == kept[-1] else ""
            before = f"the header has {wanted}" if header else f"the lines before have {count}"
            raise MotionError(f"{path}, line {number + 1}: {len(row)} columns, {before}{end}")
        for column, cell in enumerate(row[:wanted]):
            try:
                values[index, column] = float(cell) if cell else np.nan
            except ValueError:
                if cell.lower() in GAPS:
                    continue
                moment = _moment(cell)
                if moment is not None:
                    values[index, column] = moment
                    if ":" in cell[:3]:
                        clocks.add(column)
                    continue
                if column not in words:
                    words[column] = [""] * len(kept)
                words[column][index] = cell
                bad.setdefault(column, (number + 1, cell))
    return Grid(path, header, values, words, np.array(kept) + 1, bad, clocks)


def _padded(row: list[str], count: int, wanted: int, separator: str | None, header: list[list[str]]) -> bool:
    """Rows whose last cells are empty lose them; rows separated by blanks cannot."""
    return (
        separator is not None
        and bool(header)
        and len(row) <= wanted
        and (wanted - len(row)) % 3 == 0
        and len(row) > 0.5 * wanted
    )


def _moment(cell: str) -> float | None:
    """Seconds of a date or a time of day."""
    match = _CLOCK.match(cell)
    if match:
        return 3600.0 * float(match.group(1) or 0) + 60.0 * float(match.group(2)) + float(match.group(3))
    if len(cell) < 12 or not cell[:4].isdigit() or len(cell) > 40:
        return None
    try:
        return datetime.fromisoformat(cell).timestamp()
    except (ValueError, OverflowError, OSError):
        return None
