"""The report: plain data in (``model``), one self-contained HTML page out (``page.write_report``)."""

from syda_gym.evaluation.report.figures import Track, track
from syda_gym.evaluation.report.model import (
    BarPlot,
    Column,
    CurvePlot,
    Headline,
    Picture,
    Playback,
    PlaybackChain,
    Report,
    RouteEdge,
    RouteGraph,
    Section,
    Table,
    Text,
)
from syda_gym.evaluation.report.page import write_report

__all__ = [
    "BarPlot",
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
    "Track",
    "track",
    "write_report",
]
