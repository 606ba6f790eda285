"""Report tables on a terminal, as many columns as it is wide."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from syda_gym.evaluation.report.model import Cell, Column, Table
from syda_gym.evaluation.statistics import Estimate

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["print_table", "rich_table"]

_GAP, _EDGES = 3, 2  # characters between two columns, and beside the first and the last


def print_table(table: Table, console: Console) -> None:
    """Prints a table, no wider than the console; what does not fit is named below it.

    Args:
        table: what to show.
        console: where.
    """
    console.print(rich_table(table, console.width))


def rich_table(table: Table, width: int, *, most_rows: int = 60) -> Any:
    """A report's table as something that ``rich`` prints: a table that fits the terminal and the words below it.

    A cell is never cut: columns are shown from the left as long as they fit, the others are named below.

    Args:
        table: what to show.
        width: of the terminal [characters].
        most_rows: further rows are left to the report.
    """
    from rich import box
    from rich.console import Group
    from rich.table import Table as RichTable
    from rich.text import Text

    rows = table.rows[:most_rows]
    words = [[_words(cell, column) for cell, column in zip(row, table.columns, strict=True)] for row in rows]
    titles = [f"{column.title} [{column.unit}]" if column.unit else column.title for column in table.columns]
    widths = [_width(title, [row[i] for row in words]) for i, title in enumerate(titles)]
    count = _fitting(widths, width)
    # Left to itself, rich shares out a narrow terminal by the length of the headings and cuts the last cells.
    narrow = _fitting([max(len(title), one) for title, one in zip(titles, widths, strict=True)], width) < count
    shown = RichTable(title=Text(table.title, style="bold"), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for index, title in enumerate(titles[:count]):
        numeric = any(not isinstance(row[index], str | bool | None) for row in table.rows)
        side: Any = "right" if numeric else "left"
        shown.add_column(Text(title), justify=side, vertical="bottom", width=widths[index] if narrow else None)
    for index, row in enumerate(words):
        shown.add_row(*(_stiff(cell) for cell in row[:count]), style="bold" if index in table.strong else None)
    return Group(shown, *_below(table, titles[count:], len(rows)))


def _fitting(widths: list[int], width: int) -> int:
    """How many columns fit; the first is always shown."""
    used = _EDGES - _GAP
    for count, one in enumerate(widths):
        used += one + _GAP
        if used > width and count:
            return count
    return len(widths)


def _width(title: str, cells: list[str]) -> int:
    """A heading may break between words, a cell may not."""
    return max(len(word) for word in [*title.split(), *cells, ""])


def _stiff(cell: str) -> Any:
    from rich.text import Text

    return Text(cell, no_wrap=True, overflow="fold")


def _below(table: Table, hidden: list[str], rows: int) -> list[Any]:
    from rich.text import Text

    parts = []
    if len(table.rows) > rows:
        parts.append(f"{len(table.rows) - rows} further rows are in the report.")
    if hidden:
        parts.append(f"A wider terminal also shows: {', '.join(hidden)}.")
    words = " ".join([*parts, table.note]).strip()
    return [Text(f"{words}\n", style="dim")] if words else []


def _words(cell: Cell, column: Column) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "-"
    if isinstance(cell, str):
        return cell
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, Estimate):
        if math.isnan(cell.value):
            return "-"
        value, low, high = (number * column.scale for number in (cell.value, cell.low, cell.high))
        return f"{value:.{column.digits}f} [{low:.{column.digits}f}, {high:.{column.digits}f}]"
    return f"{cell * column.scale:g}" if isinstance(cell, int) else f"{cell * column.scale:.{column.digits}f}"
