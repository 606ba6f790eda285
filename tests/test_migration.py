"""The page from 0.1 to 0.2: what its right columns name is there."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

PAGE = Path(__file__).resolve().parents[1] / "docs" / "migration.md"


def rows(columns: int) -> list[list[str]]:
    """Rows of the tables of modules, by their number of columns."""
    text = PAGE.read_text().partition("## Where things stand now")[2]
    cells = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| `")
    ]
    return [row for row in cells if len(row) == columns]


def test_modules_that_moved_are_where_the_page_says() -> None:
    moved = rows(2)
    assert len(moved) > 100
    for old, new in moved:
        assert re.fullmatch(r"`[\w.]+`", old), old
        importlib.import_module(f"syda_gym.{new.strip('`')}")


def test_names_that_moved_apart_are_where_the_page_says() -> None:
    apart = rows(3)
    assert len(apart) > 20
    for _, names, new in apart:
        if not re.fullmatch(r"`[\w.]+`", new) or new.startswith("`syda_gym."):
            continue  # gone, with what replaces it
        module = importlib.import_module(f"syda_gym.{new.strip('`')}")
        for name in re.findall(r"`(\w+)`", names):
            assert hasattr(module, name), f"{new} has no {name}"
