"""Writes a report as one HTML file that opens from disk without a network."""

from __future__ import annotations

import base64
import json
import math
import os
from html import escape
from pathlib import Path

from syda_gym.evaluation.report.graph import graph_svg
from syda_gym.evaluation.report.model import (
    BarPlot,
    Block,
    Cell,
    Column,
    CurvePlot,
    Headline,
    Picture,
    Playback,
    Report,
    RouteGraph,
    Section,
    Table,
    Text,
)
from syda_gym.evaluation.report.playback import pack_playback
from syda_gym.evaluation.report.plots import bar_svg, curve_svg
from syda_gym.evaluation.statistics import Estimate
from syda_gym.files import write_text

__all__ = ["report_html", "write_report"]

_ASSETS = Path(__file__).parent / "assets"
_MANY_COLUMNS = 8  # from more a table is set closer and may be wider than the text
_FILTER_FROM = 12  # tables with at least so many rows get a search box


def write_report(report: Report, folder: str | os.PathLike[str], name: str = "report.html") -> Path:
    """Writes ``folder/name`` atomically.

    Args:
        report: what to say.
        folder: created if need be.
        name: file name.

    Returns:
        The path of the page.

    Raises:
        StorageError: the folder cannot be written or the disk is full; an older page stays as it was.
    """
    return write_text(Path(folder) / name, report_html(report))


def report_html(report: Report) -> str:
    """The page as text."""
    parts = {
        "title": escape(report.title),
        "subtitle": escape(report.subtitle),
        "css": _asset("report.css"),
        "js": _asset("report.js") + _asset("playback.js"),
        "contents": "".join(
            f'<a href="#s{index}">{escape(section.title)}</a>' for index, section in enumerate(report.sections)
        ),
        "headlines": "".join(_headline(headline) for headline in report.headlines),
        "sections": "".join(_section(index, section) for index, section in enumerate(report.sections)),
        "provenance": "".join(
            f"<dt>{escape(key)}</dt><dd>{escape(value)}</dd>" for key, value in report.provenance.items()
        ),
    }
    page = _asset("page.html")
    # One pass over the template, so that text of the report which looks like a slot stays text.
    pieces = page.split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        key, rest = piece.split("}}", 1)
        filled.append(parts[key] + rest)
    return "".join(filled)


def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")


def _headline(headline: Headline) -> str:
    return (
        f'<div class="headline {headline.tone}"><div class="label">{escape(headline.label)}</div>'
        f'<div class="value">{escape(headline.value)}</div><div class="note">{escape(headline.note)}</div></div>'
    )


def _section(index: int, section: Section) -> str:
    blocks = "".join(_block(block) for block in section.blocks)
    return f'<section id="s{index}"><h2>{escape(section.title)}</h2>{blocks}</section>'


def _block(block: Block) -> str:
    if isinstance(block, Text):
        return f"<p>{escape(block.text)}</p>"
    if isinstance(block, Table):
        return _table(block)
    if isinstance(block, Playback):
        return _playback(block)
    if isinstance(block, Picture):
        body = _picture(block)
    elif isinstance(block, BarPlot):
        body = _for_both(bar_svg(block), bar_svg(block, narrow=True))
    elif isinstance(block, CurvePlot):
        body = _for_both(curve_svg(block), curve_svg(block, narrow=True))
    else:
        assert isinstance(block, RouteGraph)
        body = _for_both(graph_svg(block), graph_svg(block, narrow=True))
    note = f'<p class="note">{escape(block.note)}</p>' if block.note else ""
    return f'<figure><figcaption>{escape(block.title)}</figcaption><div class="scroll">{body}</div>{note}</figure>'


def _for_both(wide: str, narrow: str) -> str:
    """One drawing for a screen and one for a phone; the style sheet shows one of them."""
    return f'<div class="on-wide">{wide}</div><div class="on-narrow">{narrow}</div>'


def _picture(picture: Picture) -> str:
    source = _data(picture.kind, picture.data)
    if picture.kind.startswith("video/"):
        poster = picture.variants.get("poster")
        first = f' poster="{_data("image/png", poster)}"' if poster else ""
        return f'<video controls loop muted playsinline preload="metadata"{first} src="{source}"></video>'
    if not picture.variants:
        return _img(picture, picture.data, "")
    light = _one_theme(picture, picture.data, picture.variants.get("narrow"), "on-light")
    dark = picture.variants.get("dark", picture.data)
    return light + _one_theme(picture, dark, picture.variants.get("narrow-dark"), "on-dark")


def _one_theme(picture: Picture, wide: bytes, narrow: bytes | None, theme: str) -> str:
    if narrow is None:
        return _img(picture, wide, theme)
    return _img(picture, wide, f"{theme} on-wide") + _img(picture, narrow, f"{theme} on-narrow")


def _img(picture: Picture, data: bytes, classes: str) -> str:
    kind = f' class="{classes}"' if classes else ""
    return f'<img{kind} alt="{escape(picture.title, quote=True)}" src="{_data(picture.kind, data)}">'


def _data(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _table(table: Table) -> str:
    heads = "".join(
        _head(column, any(not isinstance(row[index], str | bool | None) for row in table.rows))
        for index, column in enumerate(table.columns)
    )
    strong = set(table.strong)
    rows = "".join(
        f"<tr{' class=strong' if index in strong else ''}>"
        + "".join(_labelled(_cell(cell, column), column) for cell, column in zip(row, table.columns, strict=True))
        + "</tr>"
        for index, row in enumerate(table.rows)
    )
    search = (
        f'<input type="search" class="filter" placeholder="Filter {len(table.rows)} rows" aria-label="Filter rows">'
        if len(table.rows) >= _FILTER_FROM
        else ""
    )
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    dense = " dense" if len(table.columns) > _MANY_COLUMNS else ""
    return (
        f'<figure class="table{dense}"><figcaption>{escape(table.title)}</figcaption>{search}<div class="scroll tall">'
        f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>{note}</figure>"
    )


def _head(column: Column, numeric: bool) -> str:
    style = " class=number" if numeric else ""
    unit = f' <span class="unit">[{escape(column.unit)}]</span>' if column.unit else ""
    tip = f' title="{escape(column.tip, quote=True)}"' if column.tip else ""
    return f'<th scope="col"{style}{tip}><button type="button">{escape(column.title)}{unit}</button></th>'


def _labelled(cell: str, column: Column) -> str:
    """The cell with its column's name: on a phone rows are cards, and each cell a line of one."""
    unit = f" [{column.unit}]" if column.unit else ""
    return cell.replace("<td", f'<td data-label="{escape(column.title + unit, quote=True)}"', 1)


def _cell(cell: Cell, column: Column) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return '<td class="number" data-v="">&ndash;</td>'
    if isinstance(cell, bool):
        return f'<td data-v="{int(cell)}">{"yes" if cell else "no"}</td>'
    if isinstance(cell, str):
        return f"<td>{escape(cell)}</td>"
    if isinstance(cell, Estimate):
        if math.isnan(cell.value):
            return '<td class="number" data-v="">&ndash;</td>'
        value, low, high = (number * column.scale for number in (cell.value, cell.low, cell.high))
        interval = f'<span class="interval">[{low:.{column.digits}f}, {high:.{column.digits}f}]</span>'
        return f'<td class="number" data-v="{value:.8g}">{value:.{column.digits}f} {interval}</td>'
    value = cell * column.scale
    shown = f"{value:g}" if isinstance(cell, int) else f"{value:.{column.digits}f}"
    return f'<td class="number" data-v="{value:.8g}">{shown}</td>'


def _playback(playback: Playback) -> str:
    # "</" would end the script element early if a name held it.
    content = json.dumps(pack_playback(playback), separators=(",", ":")).replace("</", "<\\/")
    note = f'<p class="note">{escape(playback.note)}</p>' if playback.note else ""
    controls = _asset("playback.html")
    return (
        f'<figure class="playback"><figcaption>{escape(playback.title)}</figcaption>{controls}'
        f'<script type="application/json">{content}</script>{note}</figure>'
    )
