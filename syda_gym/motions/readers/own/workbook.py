"""Workbooks of poses: one ``.xlsx`` a recording, one sheet a joint, seven numbers a row."""

from __future__ import annotations

import re
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError

__all__ = ["read_sheets"]

_HEADER = ("TransX", "TransY", "TransZ", "RotX", "RotY", "RotZ", "RotW")
_MAX_BYTES = 64 * 2**20
_MAX_ROWS = 100_000
_MAX_COLUMN_LETTERS = 2  # columns A to ZZ
_REFERENCE = re.compile(rb"""\br\s*=\s*["']\s*([A-Za-z]*)(\d+)""")


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
    if path.stat().st_size > _MAX_BYTES:
        raise MotionError(f"{path} is larger than {_MAX_BYTES >> 20} MB; that is no recording of this data set")
    try:
        _check_extent(path)
        book = python_calamine.CalamineWorkbook.from_path(str(path))
        known = set(book.sheet_names)
        rows = {name: book.get_sheet_by_name(name).to_python() for name in names if name in known}
    except MotionError:
        raise
    except Exception as error:  # calamine raises its own error types, which are no part of its public interface
        raise MotionError(f"{path} is not a readable .xlsx workbook: {error}") from error
    for name in names:
        if name not in rows:
            raise MotionError(f"{path}: sheet {name!r} is missing; it has {sorted(known)}")
    result = {name: _table(path, name, rows[name]) for name in names}
    counts = {name: len(table) for name, table in result.items()}
    if len(set(counts.values())) > 1:
        raise MotionError(f"{path}: sheets have unequal row counts {counts}")
    return result


def _check_extent(path: Path) -> None:
    """Refuses cells far out: the reader allocates every cell up to the last one and would end the whole process."""
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(member.file_size for member in archive.infolist()) > _MAX_BYTES:
                raise MotionError(f"{path} unpacks to more than {_MAX_BYTES >> 20} MB; that is no recording")
            sheets = [archive.read(name) for name in archive.namelist() if "/worksheets/" in name]
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError) as error:
        raise MotionError(f"{path} is not a readable .xlsx workbook: {error}") from error
    for content in sheets:
        for letters, digits in _REFERENCE.findall(content):
            if len(letters) > _MAX_COLUMN_LETTERS or len(digits) > 6 or int(digits) > _MAX_ROWS:
                cell = (letters + digits)[:40].decode(errors="replace")
                raise MotionError(f"{path}: cell {cell} lies beyond {_MAX_ROWS} rows; that is no recording")


def _table(path: Path, sheet: str, rows: list[list[object]]) -> FloatArray:
    if not rows or tuple(str(cell) for cell in rows[0][:7]) != _HEADER:
        raise MotionError(f"{path}, sheet {sheet!r}: first row must be {', '.join(_HEADER)}; got {rows[:1]}")
    try:
        table = np.array([row[:7] for row in rows[1:]], dtype=np.float64).reshape(-1, 7)
    except (TypeError, ValueError) as error:
        raise MotionError(f"{path}, sheet {sheet!r}: a cell is no number: {error}") from error
    if len(table) == 0:
        raise MotionError(f"{path}, sheet {sheet!r}: no rows")
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        row, column = bad[0]
        raise MotionError(f"{path}, sheet {sheet!r}, row {row + 2}: {_HEADER[column]} is not a finite number")
    return table
