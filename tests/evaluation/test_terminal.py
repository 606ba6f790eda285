"""Tables on a terminal: what is shown is whole, what is not shown is named."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from syda_gym.evaluation.report.model import Column, Table
from syda_gym.evaluation.statistics import Estimate
from syda_gym.evaluation.terminal import print_table

ROUTES = ["adult>pepper", "adult>kid>pepper"]


def shown(width: int, rows: int = 2) -> str:
    columns = [
        Column("Chain"),
        Column("Landmark error", "cm", 1, 100),
        Column("Success", "%", 0, 100),
        Column("Jitter", "mm/frame³", 2, 1000),
    ]
    cells = [[ROUTES[i % 2], Estimate(0.043, 0.038, 0.054), True, None] for i in range(rows)]
    out = io.StringIO()
    print_table(Table("Every chain", columns, cells, "Over [actions]."), Console(file=out, width=width))
    return out.getvalue()


@pytest.mark.parametrize("width", range(20, 100))
def test_no_cell_is_cut_and_every_column_is_shown_or_named(width: int) -> None:
    text = shown(width)
    assert all(len(line) <= width for line in text.splitlines())
    assert all(route in text for route in ROUTES)
    assert "…" not in text
    assert text.count("4.3 [3.8") == text.count("4.3 [3.8, 5.4]"), "nothing is cropped at the edge"
    assert text.count("yes") in (0, 2)
    words = " ".join(text.split())
    for title in ("Landmark", "Success", "Jitter"):
        assert words.count(title) == 1, "in a heading or in the caption, not in both"
    assert ("4.3 [3.8, 5.4]" in text) == ("Landmark" not in words.partition("also shows")[2])


def test_a_wide_terminal_shows_everything() -> None:
    text = shown(120)
    assert "also shows" not in text
    assert "[mm/frame³]" in text, "units are no markup"
    assert "Over [actions]." in text


@pytest.mark.parametrize(("rows", "left"), [(60, None), (75, "15 further rows")])
def test_many_rows_are_left_to_the_report(rows: int, left: str | None) -> None:
    assert ("further rows" in shown(120, rows)) == (left is not None)
    assert left is None or left in shown(120, rows)
