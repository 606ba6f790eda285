"""Workbooks of poses: one ``.xlsx`` a recording, one sheet a joint, seven numbers a row."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import BUDGET, check_size, open_archive, shortened

__all__ = ["read_sheets"]

_HEADER = ("TransX", "TransY", "TransZ", "RotX", "RotY", "RotZ", "RotW")
_MAX_BYTES = 64 * 2**20
_MAX_ROWS = 100_000
_MAX_COLUMN_LETTERS = 2  # columns A to ZZ
_REFERENCE = re.compile(rb"""(?:\br\s*=\s*["']|\bref\s*=\s*["']|(?<=\d):)\s*\$?([A-Za-z]{0,9})\$?(\d{1,12})""")
_SHARED = re.compile(rb"""\bt\s*=\s*["']s["']""")
_STRINGS = re.compile(rb"<(?:\w+:)?si[\s/>]")
_MOST_TEXT = 64 * 2**20  # bytes that shared strings may become when every cell has its own
_HIDDEN = re.compile(rb"""\b(?:r|ref)\s*=\s*["'][^"'<>]{0,40}&|<!(?:ENTITY|DOCTYPE)""")


def read_sheets(path: Path, names: Sequence[str]) -> dict[str, FloatArray]:
    """Reads the named sheets of one workbook.

    Returns:
        Sheet to ``(N, 7)``: position [m] and scalar-last quaternion; all sheets have equally many rows.

    Raises:
        MotionError: the workbook or a sheet is missing, damaged or too large; the message names sheet and row.
    """
    import python_calamine

    if not path.is_file():
        raise MotionError(f"no workbook {path}; the data set is incomplete")
    check_size(path, _MAX_BYTES, "a workbook of this data set", MotionError)
    try:
        _check_extent(path)
        book = python_calamine.CalamineWorkbook.from_path(str(path))
        known = set(book.sheet_names)
        rows = {name: book.get_sheet_by_name(name).to_python() for name in names if name in known}
    except MotionError:
        raise
    except Exception as error:  # calamine raises its own error types, which are no part of its public interface
        raise MotionError(f"{path} is not a readable .xlsx workbook: {str(error)[:400]}") from error
    for name in names:
        if name not in rows:
            raise MotionError(f"{path}: sheet {name!r} is missing; it has {shortened(sorted(known))}")
    result = {name: _table(path, name, rows[name]) for name in names}
    counts = {name: len(table) for name, table in result.items()}
    if len(set(counts.values())) > 1:
        raise MotionError(f"{path}: sheets have unequal row counts {counts}")
    return result


def _check_extent(path: Path) -> None:
    """Refuses workbooks whose reader would need far more than the file has.

    The reader makes every cell from the first to the last one of a sheet, and ends the whole process if it cannot.
    Where sheets are is said by the workbook itself, so every member counts as one: its last cell bounds its size, and
    all members together are bounded too. The reader also gives every cell its own copy of a string that cells share.
    """
    cells, sharing, strings = 0, 0, 0
    with open_archive(path, "an .xlsx workbook", MotionError, _MAX_BYTES) as archive:
        names = archive.namelist()
        if "xl/workbook.xml" not in names or any(name.endswith(("workbook.bin", "content.xml")) for name in names):
            raise MotionError(
                f"{path} is not a readable .xlsx workbook: it has no xl/workbook.xml; expected one of Excel 2007 or "
                f"later"
            )
        for name in names:
            content = archive.read(name)
            if content[:2] in (b"\xff\xfe", b"\xfe\xff") or _HIDDEN.search(content):
                raise MotionError(f"{path}: {name[:60]} hides where its cells are; that is no recording")
            rows = columns = 1
            for letters, digits in _REFERENCE.findall(content):
                if len(letters) > _MAX_COLUMN_LETTERS or len(digits) > 6 or int(digits) > _MAX_ROWS:
                    cell = (letters + digits)[:40].decode(errors="replace")
                    raise MotionError(f"{path}: cell {cell} lies beyond {_MAX_ROWS} rows; that is no recording")
                rows, columns = max(rows, int(digits)), max(columns, _column(letters))
            sharing += len(_SHARED.findall(content))
            if _STRINGS.search(content):
                strings = max(strings, len(content))
            if sharing * strings > _MOST_TEXT:
                raise MotionError(f"{path}: {sharing} cells share {strings >> 10} kB of text; that is no recording")
            cells += rows * columns
            if cells > BUDGET.cells:
                raise MotionError(
                    f"{path} spans more than {BUDGET.cells} cells, most of them empty; that is no recording"
                )


def _column(letters: bytes) -> int:
    number = 0
    for letter in letters.upper():
        number = 26 * number + letter - 64
    return number


def _table(path: Path, sheet: str, rows: list[list[object]]) -> FloatArray:
    if not rows or tuple(str(cell) for cell in rows[0][:7]) != _HEADER:
        raise MotionError(f"{path}, sheet {sheet!r}: first row must be {', '.join(_HEADER)}; got {shortened(rows[:1])}")
    try:
        table = np.array([row[:7] for row in rows[1:]], dtype=np.float64).reshape(-1, 7)
    except (TypeError, ValueError) as error:
        raise MotionError(f"{path}, sheet {sheet!r}: a cell is no number: {str(error)[:400]}") from error
    if len(table) == 0:
        raise MotionError(f"{path}, sheet {sheet!r}: no rows")
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        row, column = bad[0]
        raise MotionError(f"{path}, sheet {sheet!r}, row {row + 2}: {_HEADER[column]} is not a finite number")
    return table
