"""Report tables on a terminal."""

from __future__ import annotations

import math
from typing import Any

from syda_gym.evaluation.report.model import Cell, Column, Table
from syda_gym.evaluation.statistics import Estimate

__all__ = ["rich_table"]


def rich_table(table: Table, *, most_rows: int = 60, most_columns: int | None = None) -> Any:
    """A report's table as a ``rich.table.Table``.

    Args:
        table: what to show.
        most_rows: further rows are left to the report.
        most_columns: further columns are left to the report.
    """
    from rich.table import Table as RichTable
    from rich.text import Text

    note = table.note
    if len(table.rows) > most_rows:
        note = f"{len(table.rows) - most_rows} further rows are in the report. {note}"
    shown = RichTable(title=table.title, caption=note or None, title_justify="left", caption_justify="left")
    for index, column in enumerate(table.columns[:most_columns]):
        numeric = any(not isinstance(row[index], str | bool | None) for row in table.rows)
        unit = f" [{column.unit}]" if column.unit else ""
        shown.add_column(Text(f"{column.title}{unit}"), justify="right" if numeric else "left")
    for index, row in enumerate(table.rows[:most_rows]):
        cells = [Text(_words(cell, column)) for cell, column in zip(row, table.columns, strict=True)]
        shown.add_row(*cells[:most_columns], style="bold" if index in table.strong else None)
    return shown


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
