"""Workbooks: what names a cell and what only looks like it."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from syda_gym.errors import MotionError
from syda_gym.motions.readers.own.workbook import read_sheets
from tests.motions.paper_workbooks import HUMAN, human_sheets, write_workbook

THEME = "xl/theme/theme1.xml"
SHEET = "xl/worksheets/sheet2.xml"


@pytest.fixture
def book(tmp_path: Path) -> Path:
    write_workbook(tmp_path / "book.xlsx", human_sheets())
    return tmp_path / "book.xlsx"


def rewrite(path: Path, member: str, before: bytes, after: bytes) -> None:
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    assert before in members[member]
    members[member] = members[member].replace(before, after, 1)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def test_a_theme_that_names_accent1_is_no_cell(book: Path) -> None:
    """Every spreadsheet program writes `<a:accent1>`: the letters are no column, the number is no row."""
    with zipfile.ZipFile(book) as archive:
        assert b"<a:accent1>" in archive.read(THEME)
    sheets = read_sheets(book, HUMAN)
    np.testing.assert_allclose(sheets["LElbow"], human_sheets()["LElbow"])


@pytest.mark.parametrize("name", [b"a:accent123456", b"x:row9999999", b"thm15:themeFamily"])
def test_names_of_other_elements_are_no_cells_either(book: Path, name: bytes) -> None:
    rewrite(book, THEME, b"</a:theme>", b"<" + name + b"/></a:theme>")
    assert set(read_sheets(book, HUMAN)) == set(HUMAN)


@pytest.mark.parametrize("extent", [b"A1:G9999999", b"A1:ZZZZ7", b"$A$1:$ZZZZ$7", b"G9999999"])
def test_a_sheet_that_says_it_is_huge_is_refused(book: Path, extent: bytes) -> None:
    """What follows the colon of a range is a cell, though what follows the colon of `a:accent1` is none."""
    rewrite(book, SHEET, b'ref="A1:G7"', b'ref="' + extent + b'"')
    with pytest.raises(MotionError, match=r"book\.xlsx: cell .* lies beyond"):
        read_sheets(book, HUMAN)
