"""What a report says, as plain data: the demo, the benchmark and the paper's tables all fill these in.

Nothing here knows HTML. ``page.write_report`` turns a ``Report`` into one file that needs no network.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from syda_gym.errors import OptionError
from syda_gym.evaluation.report.figures import Track
from syda_gym.evaluation.statistics import Estimate

__all__ = [
    "BarPlot",
    "Block",
    "Cell",
    "Column",
    "CurvePlot",
    "Headline",
    "Picture",
    "Playback",
    "PlaybackChain",
    "Report",
    "RouteEdge",
    "RouteGraph",
    "Section",
    "Table",
    "Text",
]

Cell = str | int | float | bool | Estimate | None
"""What a table cell may hold; an ``Estimate`` shows its interval and sorts by its value."""


@dataclass(frozen=True)
class Headline:
    """One large number at the top.

    Attributes:
        label: what it is.
        value: the number as text, with its unit.
        note: one short line below: interval, conditions, what to compare with.
        tone: colour: ``"good"``, ``"plain"`` or ``"warn"``.
    """

    label: str
    value: str
    note: str = ""
    tone: Literal["good", "plain", "warn"] = "plain"


@dataclass(frozen=True)
class Column:
    """A table column.

    Attributes:
        title: heading.
        unit: shown behind the heading.
        digits: decimals of numbers.
        scale: numbers are multiplied by this before they are shown, for example 100 for metres shown as cm.
        tip: explanation shown when the pointer rests on the heading.
    """

    title: str
    unit: str = ""
    digits: int = 3
    scale: float = 1.0
    tip: str = ""


@dataclass(frozen=True)
class Table:
    """A sortable table.

    Attributes:
        title: caption.
        columns: headings.
        rows: one cell a column.
        note: text below.
        strong: indices of rows to emphasise, for example the chosen route.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    note: str = ""
    strong: Sequence[int] = ()

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise OptionError(
                    f"table {self.title!r}: a row has {len(row)} cells for {len(self.columns)} columns: {list(row)}"
                )


@dataclass(frozen=True)
class BarPlot:
    """Groups of bars with intervals, for example one group a joint and one bar a chain.

    Attributes:
        title: caption.
        label: what the axis measures, with its unit.
        groups: names along the axis.
        series: name of each colour to one estimate a group.
        scale: values are multiplied by this before they are drawn.
        note: text below.
    """

    title: str
    label: str
    groups: Sequence[str]
    series: Mapping[str, Sequence[Estimate]]
    scale: float = 1.0
    note: str = ""

    def __post_init__(self) -> None:
        for name, values in self.series.items():
            if len(values) != len(self.groups):
                raise OptionError(
                    f"plot {self.title!r}: series {name!r} has {len(values)} values for {len(self.groups)} groups"
                )


@dataclass(frozen=True)
class CurvePlot:
    """Curves with bands, for example error against the number of recordings.

    Attributes:
        title: caption.
        x_label: horizontal axis with its unit.
        y_label: vertical axis with its unit.
        x: values along the horizontal axis.
        series: name to one estimate a value of ``x``.
        scale: estimates are multiplied by this before they are drawn.
        note: text below.
    """

    title: str
    x_label: str
    y_label: str
    x: Sequence[float]
    series: Mapping[str, Sequence[Estimate]]
    scale: float = 1.0
    note: str = ""

    def __post_init__(self) -> None:
        for name, values in self.series.items():
            if len(values) != len(self.x):
                raise OptionError(
                    f"plot {self.title!r}: series {name!r} has {len(values)} values for {len(self.x)} positions"
                )


@dataclass(frozen=True)
class RouteEdge:
    """A fitted pair as an edge of the graph: where from, where to, its transferability, its error [m] if known."""

    source: str
    target: str
    transferability: float
    error: float | None = None


@dataclass(frozen=True)
class RouteGraph:
    """The graph of fitted pairs.

    Attributes:
        title: caption.
        bodies: name to ``"human"`` or ``"robot"``.
        edges: fitted pairs.
        chosen: the bodies of the chosen route, drawn strong.
        note: text below.
    """

    title: str
    bodies: Mapping[str, str]
    edges: Sequence[RouteEdge]
    chosen: Sequence[str] = ()
    note: str = ""


@dataclass(frozen=True)
class Picture:
    """A picture that is embedded in the page.

    Attributes:
        title: caption.
        data: the bytes of the file.
        kind: media type such as ``image/png`` or ``video/mp4``.
        note: text below.
        variants: the same picture for other pages, of the same kind: ``"dark"``, ``"narrow"`` (a phone) and
            ``"narrow-dark"``. A film has one, ``"poster"``: the PNG that is shown before it plays.
    """

    title: str
    data: bytes
    kind: str = "image/png"
    note: str = ""
    variants: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class PlaybackChain:
    """One entry of the playback's selector: figures side by side over time.

    Attributes:
        name: the chain, shown in the first selector.
        figures: operator first, robot last, intermediates between; all with the same number of frames.
        fps: frames per second.
        error: ``(N,)`` mean landmark error of each frame [m]; empty if unknown.
        reference: the recorded robot motion, drawn as a ghost over the last figure.
        bound: error bound [m] to draw in the strip.
        clip: the motion, shown in the second selector.
    """

    name: str
    figures: Sequence[Track]
    fps: float
    error: Sequence[float] = ()
    reference: Track | None = None
    bound: float | None = None
    clip: str = ""

    def __post_init__(self) -> None:
        tracks = [*self.figures, *([self.reference] if self.reference else [])]
        lengths = {len(figure) for figure in tracks} | ({len(self.error)} if len(self.error) else set())
        if len(lengths) != 1 or 0 in lengths:
            raise OptionError(
                f"playback {self.name!r}: figures and errors need one common number of frames, got {sorted(lengths)}"
            )


@dataclass(frozen=True)
class Playback:
    """The interactive 3D playback."""

    title: str
    chains: Sequence[PlaybackChain]
    note: str = ""


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str


Block = Table | BarPlot | CurvePlot | RouteGraph | Picture | Playback | Text


@dataclass(frozen=True)
class Section:
    """A heading with its content, in order."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Report:
    """A whole page.

    Attributes:
        title: heading and window title.
        subtitle: one line below.
        headlines: the numbers that matter.
        sections: everything else, in order.
        provenance: what made it: command, versions, data fingerprint, seeds. Shown at the end.
    """

    title: str
    subtitle: str
    headlines: Sequence[Headline]
    sections: Sequence[Section]
    provenance: Mapping[str, str] = field(default_factory=dict)
