"""Plots with intervals as inline SVG: their colours are CSS variables, so that they follow the page's theme."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from html import escape

from syda_gym.evaluation.report.model import BarPlot, CurvePlot
from syda_gym.evaluation.statistics import Estimate

__all__ = ["COLOURS", "bar_svg", "curve_svg", "standalone"]

COLOURS = 8
"""Number of series colours in the style sheet (Okabe and Ito's palette, told apart by the colour-blind)."""

_MOST_BARS = 40
_MOST_NARROW_BARS = 20  # on a phone; more stand in two rows, one below the other
_LETTER = 7.4  # pixels that a letter takes
_STANDALONE_STYLE = """
svg { --ink: #1c2430; --soft: #5b6675; --line: #d5dbe3; background: #fff;
  --s0: #0072b2; --s1: #e69f00; --s2: #009e73; --s3: #cc79a7; --s4: #56b4e9; --s5: #d55e00; --s6: #8f8a00; --s7:
  #7a7a7a; }
text { font: 13px system-ui, 'DejaVu Sans', sans-serif; fill: var(--ink); }
.soft { fill: var(--soft); font-size: 12px; } .grid { stroke: var(--line); } .whisker { stroke: var(--ink); }
"""


def bar_svg(plot: BarPlot, *, narrow: bool = False) -> str:
    """Bars in groups; with very many of them, or more series than colours, one row of dots a series.

    Args:
        plot: what to draw.
        narrow: half as wide, for a phone, with letters of the same size.
    """
    if len(plot.groups) * len(plot.series) > _MOST_BARS or len(plot.series) > COLOURS:
        return _rows(plot, narrow)
    if narrow and len(plot.groups) * len(plot.series) > _MOST_NARROW_BARS and len(plot.groups) > 3:
        half = (len(plot.groups) + 1) // 2
        return "".join(_bars(_part(plot, part), narrow, plot) for part in (slice(0, half), slice(half, None)))
    return _bars(plot, narrow)


def curve_svg(plot: CurvePlot, *, narrow: bool = False) -> str:
    """Curves with interval bands.

    Args:
        plot: what to draw.
        narrow: half as wide, for a phone.
    """
    names = list(plot.series)
    canvas = _Canvas(_width(narrow), 340, left=_left(narrow), right=16, top=44, bottom=52)
    canvas.make_room_for(names)
    values = [v * plot.scale for e in plot.series.values() for one in e for v in (one.value, one.low, one.high)]
    canvas.y_axis(values, plot.y_label)
    spread = (max(plot.x) - min(plot.x)) or 1.0
    place = [canvas.left + 14 + (canvas.inner_width - 28) * (x - min(plot.x)) / spread for x in plot.x]
    free = -math.inf
    for x, at in zip(plot.x, place, strict=True):
        words = f"{x:g}"
        if at - 4.2 * len(words) > free:  # numbers that would run into the one before are left out
            canvas.text(at, canvas.bottom + 20, words, anchor="middle", soft=True)
            free = at + 4.2 * len(words)
    canvas.text(canvas.left + canvas.inner_width / 2, canvas.bottom + 42, plot.x_label, anchor="middle", soft=True)
    for index, (name, estimates) in enumerate(plot.series.items()):
        colour = f"var(--s{index % COLOURS})"
        points = [(at, e) for at, e in zip(place, estimates, strict=True) if math.isfinite(e.value)]
        upper = [f"{at:.1f},{canvas.y(e.high * plot.scale):.1f}" for at, e in points]
        lower = [f"{at:.1f},{canvas.y(e.low * plot.scale):.1f}" for at, e in reversed(points)]
        canvas.add(f'<polygon points="{" ".join(upper + lower)}" fill="{colour}" opacity="0.16"/>')
        line = " ".join(f"{at:.1f},{canvas.y(e.value * plot.scale):.1f}" for at, e in points)
        canvas.add(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2.2"/>')
        for at, e in points:
            canvas.add(
                f'<circle cx="{at:.1f}" cy="{canvas.y(e.value * plot.scale):.1f}" r="3.6" fill="{colour}">'
                f"<title>{escape(name)}: {_words(e, plot.scale)}</title></circle>"
            )
    canvas.legend(list(plot.series))
    return canvas.svg(plot.title)


def standalone(svg: str) -> str:
    """An inline plot as a file of its own, in light colours."""
    head, tail = svg.split(">", 1)
    return f'<?xml version="1.0"?>\n{head}><style>{_STANDALONE_STYLE}</style>{tail}\n'


def _part(plot: BarPlot, part: slice) -> BarPlot:
    """Some of the groups."""
    series = {name: list(estimates)[part] for name, estimates in plot.series.items()}
    return replace(plot, groups=list(plot.groups)[part], series=series)


def _wrapped(groups: Sequence[str], room: float) -> list[list[str]] | None:
    """Names in lines that fit below their bars; ``None`` if a word does not, or three lines are not enough."""
    letters = max(1, int(room / _LETTER))
    lines = [textwrap.wrap(group, letters, break_long_words=False, break_on_hyphens=False) for group in groups]
    fits = all(len(line) <= letters for rows in lines for line in rows) and max(len(rows) for rows in lines) <= 3
    return lines if fits else None


def _bars(plot: BarPlot, narrow: bool, whole: BarPlot | None = None) -> str:
    """Bars in groups.

    Args:
        plot: what to draw.
        narrow: for a phone.
        whole: of which ``plot`` is a part, for one scale in all of them.
    """
    room = _width(narrow) - _left(narrow) - 12
    names = _wrapped(plot.groups, 0.94 * room / len(plot.groups))
    # Slanted names go to the left, beyond the edge of a phone if they are long.
    below = 20 + 16 * max(len(rows) for rows in names) if names else 88
    canvas = _Canvas(_width(narrow), 284 + below, left=_left(narrow), right=12, top=24, bottom=below)
    if len(plot.series) > 1 or next(iter(plot.series)):
        canvas.make_room_for(list(plot.series))
    series = (whole or plot).series.values()
    values = [v * plot.scale for es in series for e in es for v in (e.value, e.high)]
    canvas.y_axis([0.0, *values], plot.label)
    group_width = canvas.inner_width / len(plot.groups)
    bar_width = min(46.0, 0.78 * group_width / len(plot.series))
    for g, group in enumerate(plot.groups):
        middle = canvas.left + (g + 0.5) * group_width
        for row, words in enumerate(names[g] if names else [group]):
            canvas.text(
                middle, canvas.bottom + (21 + 16 * row if names else 14), words, anchor="middle", slanted=names is None
            )
        for s, (name, estimates) in enumerate(plot.series.items()):
            x = middle + (s - len(plot.series) / 2) * bar_width
            _bar(canvas, x, bar_width, estimates[g], plot.scale, s, f"{name}, {group}")
    if len(plot.series) > 1 or next(iter(plot.series)):
        canvas.legend(list(plot.series))
    return canvas.svg(plot.title)


def _bar(canvas: _Canvas, x: float, width: float, e: Estimate, scale: float, series: int, name: str) -> None:
    if not math.isfinite(e.value):
        return
    top = canvas.y(e.value * scale)
    height = max(0.5, canvas.bottom - top)
    canvas.add(
        f'<rect x="{x + 1:.1f}" y="{top:.1f}" width="{width - 2:.1f}" height="{height:.1f}" rx="2" '
        f'fill="var(--s{series % COLOURS})"><title>{escape(name)}: {_words(e, scale)}</title></rect>'
    )
    low, high, centre = canvas.y(e.low * scale), canvas.y(e.high * scale), x + width / 2
    canvas.add(
        f'<path d="M{centre:.1f} {low:.1f}V{high:.1f}M{centre - 4:.1f} {high:.1f}h8M{centre - 4:.1f} {low:.1f}h8" '
        'class="whisker" fill="none" stroke-width="1.3"/>'
    )


def _rows(plot: BarPlot, narrow: bool) -> str:
    """One row a series, one dot a group, sorted by the first group: for hundreds of chains."""
    names = sorted(plot.series, key=lambda name: (math.isnan(plot.series[name][0].value), plot.series[name][0].value))
    longest = min(44, max(len(name) for name in names))
    pitch = 32 if narrow else 17  # a phone has no room beside the dots: the name stands above them
    canvas = _Canvas(
        _width(narrow), pitch * len(names) + 66, left=14 if narrow else 16 + 7 * longest, right=22, top=20, bottom=40
    )
    if len(plot.groups) > 1:
        canvas.make_room_for(list(plot.groups))
    values = [e.high * plot.scale for name in names for e in plot.series[name] if math.isfinite(e.high)]
    ticks = _ticks([0.0, *values], 4 if narrow else 5)
    span = ticks[-1] or 1.0

    def x(value: float) -> float:
        return canvas.left + canvas.inner_width * min(1.0, max(0.0, value / span))

    for tick in ticks:
        canvas.add(f'<path d="M{x(tick):.1f} {canvas.top}V{canvas.bottom}" class="grid"/>')
        canvas.text(x(tick), canvas.bottom + 16, f"{tick:g}", anchor="middle", soft=True)
    canvas.text(canvas.left + canvas.inner_width / 2, canvas.bottom + 34, plot.label, anchor="middle", soft=True)
    for row, name in enumerate(names):
        y = canvas.top + pitch * (row + 0.5) + (6 if narrow else 0)
        shown = name if len(name) <= 44 else name[:43] + "…"
        if narrow:
            canvas.text(canvas.left, y - 10, shown, soft=True)
        else:
            canvas.text(canvas.left - 8, y + 4, shown, anchor="end", soft=True)
        for g, e in enumerate(plot.series[name]):
            if math.isfinite(e.value):
                colour = f"var(--s{g % COLOURS})"
                canvas.add(
                    f'<path d="M{x(e.low * plot.scale):.1f} {y:.1f}H{x(e.high * plot.scale):.1f}" stroke="{colour}" '
                    f'stroke-width="2" opacity="0.55"/><circle cx="{x(e.value * plot.scale):.1f}" cy="{y:.1f}" r="4" '
                    f'fill="{colour}"><title>{escape(name)}, {escape(plot.groups[g])}: '
                    f"{_words(e, plot.scale)}</title></circle>"
                )
    if len(plot.groups) > 1:
        canvas.legend(list(plot.groups))
    return canvas.svg(plot.title)


def _width(narrow: bool) -> float:
    return 360.0 if narrow else 720.0


def _left(narrow: bool) -> float:
    return 60.0 if narrow else 64.0


class _Canvas:
    """A drawing area with margins, collecting SVG elements."""

    def __init__(self, width: float, height: float, *, left: float, right: float, top: float, bottom: float) -> None:
        self.width, self.height, self.left, self.top = width, height, left, top
        self.bottom = height - bottom
        self.inner_width = width - left - right
        self._low, self._high = 0.0, 1.0
        self._parts: list[str] = []

    def add(self, element: str) -> None:
        self._parts.append(element)

    def text(
        self, x: float, y: float, words: str, *, anchor: str = "start", soft: bool = False, slanted: bool = False
    ) -> None:
        style = ' class="soft"' if soft else ""
        if slanted:
            anchor, style = "end", f'{style} transform="rotate(-32 {x:.1f} {y:.1f})"'
        self.add(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{style}>{escape(words)}</text>')

    def y(self, value: float) -> float:
        return self.bottom - (self.bottom - self.top) * (value - self._low) / (self._high - self._low)

    def y_axis(self, values: Sequence[float], label: str) -> None:
        """Sets the vertical scale so that all values fit and draws its grid."""
        ticks = _ticks([v for v in values if math.isfinite(v)])
        self._low, self._high = ticks[0], ticks[-1]
        for tick in ticks:
            y = self.y(tick)
            self.add(f'<path d="M{self.left} {y:.1f}h{self.inner_width}" class="grid"/>')
            self.text(self.left - 8, y + 4, f"{tick:g}", anchor="end", soft=True)
        self.add(
            f'<text class="soft" text-anchor="middle" '
            f'transform="translate(16 {(self.top + self.bottom) / 2:.1f}) rotate(-90)">{escape(label)}</text>'
        )

    def make_room_for(self, names: Sequence[str]) -> None:
        """Moves the drawing down by what a legend of these names takes, and makes the picture taller by it."""
        rows = 1 + max(row for row, _ in self._legend_places(names))
        self.top += 20 * rows
        self.bottom += 20 * rows
        self.height += 20 * rows

    def _legend_places(self, names: Sequence[str]) -> list[tuple[int, float]]:
        """Row and left edge of each entry: as many a row as fit, none over another."""
        places, row, x = [], 0, self.left
        for name in names:
            wide = 16 + 7.6 * len(name) + 14
            if x > self.left and x + wide - 14 > self.width:
                row, x = row + 1, self.left
            places.append((row, x))
            x += wide
        return places

    def legend(self, names: Sequence[str]) -> None:
        for index, (name, (row, x)) in enumerate(zip(names, self._legend_places(names), strict=True)):
            y = 16 + 20 * row
            self.add(f'<rect x="{x:.1f}" y="{y - 9}" width="11" height="11" rx="2" fill="var(--s{index % COLOURS})"/>')
            self.text(x + 16, y + 1, name)

    def svg(self, title: str) -> str:
        body = "".join(self._parts)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width:g} {self.height:g}" role="img" '
            f'aria-label="{escape(title, quote=True)}">{body}</svg>'
        )


def _ticks(values: Sequence[float], count: int = 5) -> list[float]:
    """Round numbers that enclose the values, about ``count`` of them."""
    low, high = (min(values), max(values)) if values else (0.0, 1.0)
    if high <= low:
        low, high = min(low, 0.0), max(high, 0.0) or low + 1.0
    raw = (high - low) / count
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if m * power >= raw * 0.999)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(i * step, 12) for i in range(first, last + 1)]


def _words(e: Estimate, scale: float) -> str:
    return f"{e.value * scale:.4g} [{e.low * scale:.4g}, {e.high * scale:.4g}]"
