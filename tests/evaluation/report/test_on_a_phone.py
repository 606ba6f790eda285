"""A page as crowded as the demo's, on a phone and on a laptop: nothing is cut, overlaps or scrolls sideways."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

from syda_gym.evaluation.drawing import draw, png_bytes
from syda_gym.evaluation.report import (
    BarPlot,
    Column,
    CurvePlot,
    Picture,
    Report,
    RouteEdge,
    RouteGraph,
    Section,
    Table,
    track,
    write_report,
)
from syda_gym.evaluation.statistics import Estimate
from tests.evaluation.report.test_report import _open

JOINTS = [
    f"{side} {joint}" for side in "LR" for joint in ("sh. pitch", "sh. roll", "elb. yaw", "elb. roll", "wrist yaw")
]
CHAINS = ["tall>adult>pepper", "tall>pepper", "unfitted", "ridge (tall>adult>pepper)"]
AGENTS = ["base", "lead", "kalman", "predictor", "residual"]
COLUMNS = ["T", "Landmark error", "Mapping alone", "Joint error", "Success", "Jitter", "Bound", "Bound holds",
           "Elbows", "Wrists", "Self-collision", "Reward"]  # fmt: skip
EDGES = [("tall", "adult"), ("adult", "pepper"), ("tall", "frail"), ("frail", "pepper"), ("tall", "left_only"),
         ("left_only", "pepper"), ("tall", "slow_nao"), ("slow_nao", "pepper")]  # fmt: skip


def _about(value: float) -> Estimate:
    return Estimate(value, 0.9 * value, 1.2 * value, 9)


def _bars(title: str, groups: list[str], series: list[str]) -> BarPlot:
    return BarPlot(
        title, "error [degrees]", groups,
        {name: [_about(1.0 + (3 * g + 5 * s) % 7) for g in range(len(groups))] for s, name in enumerate(series)},
    )  # fmt: skip


@pytest.fixture(scope="module")
def page(embedded, tmp_path_factory):
    take = embedded.takes[5]
    tracks = [track(embedded.bodies[name], take.frames[name]) for name in ("adult", "kid", "pepper")]
    names = ["adult", "kid", "simulated"]
    narrow = png_bytes(draw(tracks, 30, labels=names, size=(700, 560), letters=25, finer=1))
    table = Table(
        "Every chain as episodes",
        [Column("Chain"), *(Column(name, "cm", 1) for name in COLUMNS)],
        [[chain, *(_about(10.0 + i) for i in range(len(COLUMNS)))] for chain in CHAINS],
        strong=(0,),
    )
    blocks = [
        table,
        _bars("Joints", JOINTS, CHAINS),
        _bars("Agents", ["from the recorded motion", "from what the mapping asked for"], AGENTS),
        _bars("Bodies", ["adult (chosen)", "frail", "slow_nao", "left_only"], ["predicted", "measured"]),
        CurvePlot("Curve", "thousand steps", "J", [0, 40.96, 81.92, 120.832],
                  {"residual": [_about(12.1), _about(12.2), _about(11.9), _about(12.4)]}),
        RouteGraph("Graph", {"tall": "human", "adult": "human", "frail": "human", "left_only": "human",
                             "pepper": "robot", "slow_nao": "robot"},
                   [RouteEdge(a, b, 0.4 + 0.07 * i) for i, (a, b) in enumerate(EDGES)], ("tall", "adult", "pepper")),
        Picture("Side by side", narrow, variants={"narrow": narrow, "dark": narrow, "narrow-dark": narrow}),
        Picture("Film", b"not looked at", "video/mp4", variants={"poster": narrow}),
    ]  # fmt: skip
    return write_report(Report("Crowded", "", [], [Section("All", blocks)]), tmp_path_factory.mktemp("crowded"))


def _boxes(browser, what: str) -> list[list[list]]:
    """Of every drawing that is shown: the boxes of its words, ``[words, left, top, right, bottom]``."""
    return browser.execute_script(
        """const box = (e) => { const r = e.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; };
        const words = (svg) => [...svg.querySelectorAll("text")].map((text) => [text.textContent, ...box(text)]);
        return [...document.querySelectorAll(arguments[0])].filter((svg) => svg.getClientRects().length)
          .map((svg) => [["", ...box(svg)], ...words(svg)]);""",
        what,
    )


@pytest.mark.parametrize("width", [390, 1440])
def test_nothing_scrolls_sideways(browser, page, width):
    _open(browser, page, width, 900)
    wide = browser.execute_script(
        "return [...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth + 1)"
        ".map(e => e.parentElement.querySelector('figcaption').textContent)"
    )
    assert wide == []
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("width", [390, 1440])
def test_no_word_of_a_drawing_is_cut(browser, page, width):
    _open(browser, page, width, 900)
    drawings = _boxes(browser, "figure svg")
    assert len(drawings) >= 5
    for whole, *words in drawings:
        for text, left, top, right, bottom in words:
            assert left >= whole[1] - 1, text
            assert right <= whole[3] + 1, text
            assert top >= whole[2] - 1, text
            assert bottom <= whole[4] + 1, text


def test_words_on_a_phone_do_not_lie_on_one_another(browser, page):
    """Slanted words have boxes that overlap though they do not, so that none may be slanted here."""
    _open(browser, page, 390, 844)
    for _, *words in _boxes(browser, "figure svg:not(.graph)"):
        for (one, *a), (other, *b) in itertools.combinations(words, 2):
            across = min(a[2], b[2]) - max(a[0], b[0])
            along = min(a[3], b[3]) - max(a[1], b[1])
            assert across < 2 or along < 4, f"{one!r} lies on {other!r}"


def test_a_label_of_the_graph_is_above_every_node(page):
    drawing = re.findall(r'<svg[^>]*class="graph".*?</svg>', page.read_text(), re.DOTALL)
    assert len(drawing) == 2
    for svg in drawing:
        assert svg.rindex("<circle") < svg.index('class="edge-label"')
        nodes = [tuple(map(float, found)) for found in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', svg)]
        labels = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" text-anchor="middle" class="edge-label"', svg)
        assert len(labels) == len(EDGES)
        for x, y in ((float(x), float(y)) for x, y in labels):
            assert min(np.hypot(x - a, y - 4 - b) for a, b in nodes) > 34 + 5  # a node's radius, and some air


def test_rows_of_a_table_are_cards_on_a_phone(browser, page):
    _open(browser, page, 390, 844)
    before = browser.execute_script("return getComputedStyle(document.querySelectorAll('td')[2], '::before').content")
    assert before == '"Landmark error [cm]"'
    _open(browser, page, 1440, 900)
    assert browser.execute_script("return getComputedStyle(document.querySelectorAll('td')[2]).display") == "table-cell"


def test_a_film_shows_something_before_it_plays(page):
    assert re.search(r'<video [^>]*poster="data:image/png;base64,', page.read_text())
