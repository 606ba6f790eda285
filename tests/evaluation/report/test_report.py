"""The report as a user meets it: one file, no network, numbers that sort, figures that move."""

from __future__ import annotations

import json
import re
import time

import numpy as np
import pytest
from PIL import Image

from syda_gym.errors import OptionError, StorageError
from syda_gym.evaluation.report import BarPlot, PlaybackChain, Report, Section, Table, track, write_report
from syda_gym.evaluation.report.model import Column
from syda_gym.evaluation.report.page import report_html
from syda_gym.evaluation.report.playback import pack_playback
from syda_gym.evaluation.report.plots import bar_svg, standalone
from syda_gym.evaluation.statistics import Estimate
from tests.evaluation.conftest import sample_playback


def test_the_page_needs_no_network_and_escapes_what_it_shows(sample_report):
    page = report_html(sample_report)
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)
    assert "url(http" not in page
    assert "@import" not in page
    assert "A &lt;report&gt; &amp; more" in page
    assert "</script><b>" not in page
    assert page.count("<script") == page.count("</script>")
    assert "{{" not in page


def test_plots_are_well_formed_and_stand_alone(sample_report, tmp_path):
    from xml.etree import ElementTree

    plot = sample_report.sections[1].blocks[2]
    tree = ElementTree.fromstring(standalone(bar_svg(plot)))
    bars = tree.findall(".//{http://www.w3.org/2000/svg}rect[@rx='2']")
    assert len(bars) == 4 + 2  # bars and legend
    heights = [float(bar.get("height")) for bar in bars[:4]]
    # Drawn in the order x.a y.a x.b y.b with values 1, 3, 2, 0.5 on one linear axis from zero.
    assert np.allclose(np.array(heights) / heights[0], [1.0, 3.0, 2.0, 0.5], rtol=0.02)


def test_many_bars_become_rows_sorted_by_value():
    series = {f"chain {i}": [Estimate(float(30 - i), 1.0, 40.0)] for i in range(30)}
    text = bar_svg(BarPlot("Many", "cm", ["E", "F"], {k: v * 2 for k, v in series.items()}))
    assert text.index(">chain 29<") < text.index(">chain 0<")


@pytest.mark.parametrize(("count", "legend"), [(8, True), (9, False)])
def test_more_series_than_colours_are_named_beside_their_dots(count, legend):
    series = {f"chain {i}": [Estimate.exactly(float(count - i))] for i in range(count)}
    text = bar_svg(BarPlot("Nine", "cm", ["E"], series))
    assert ("rx=" in text) == legend  # bars with a legend, or rows without
    assert (text.index(">chain 0<") < text.index(f">chain {count - 1}<")) == legend


def test_uneven_tables_plots_and_playbacks_are_refused(embedded):
    with pytest.raises(OptionError, match="2 columns"):
        Table("t", [Column("a"), Column("b")], [[1.0]])
    with pytest.raises(OptionError, match="1 values for 2 groups"):
        BarPlot("p", "cm", ["a", "b"], {"x": [Estimate.exactly(1.0)]})
    body = embedded.bodies["adult"]
    frames = embedded.takes[0].frames["adult"]
    with pytest.raises(OptionError, match="common number of frames"):
        PlaybackChain("c", [track(body, frames[:5]), track(body, frames[:6])], 30.0)


def test_tracks_stand_on_the_floor_and_keep_their_lengths(embedded):
    take = embedded.takes[0]
    human = track(embedded.bodies["adult"], take.frames["adult"])
    lowest = human.points[:, :, 2].min() - 0.03 * human.height
    assert abs(lowest) < 0.15
    robot = track(embedded.bodies["pepper"], take.frames["pepper"])
    moving = {shape.pose for shape in robot.shapes if shape.pose >= 0}
    assert moving <= set(range(robot.poses.shape[1]))
    assert len(moving) >= 8  # both arms
    # The distance between consecutive links of an arm does not change with the pose.
    gaps = np.linalg.norm(robot.poses[:, 1, :3] - robot.poses[:, 0, :3], axis=1)
    assert np.ptp(gaps) < 1e-6


def test_packed_tracks_are_shared_and_thinned_to_the_budget(embedded):
    playback = sample_playback(embedded, chains=6)
    whole = pack_playback(playback)
    used = {key for chain in whole["chains"] for key in chain["figures"]}
    assert len(whole["tracks"]) == len(used | {chain["reference"] for chain in whole["chains"]})
    assert len(whole["models"]) == 3
    assert whole["stride"] == 1
    thin = pack_playback(playback, budget=20_000)
    assert thin["stride"] > 1
    assert len(json.dumps(thin)) < len(json.dumps(whole))
    assert all(len(c["error"]) == t["frames"] for c in thin["chains"] for t in [thin["tracks"][c["figures"][0]]])


def test_an_unwritable_folder_is_named(sample_report, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    with pytest.raises(StorageError, match="file"):
        write_report(sample_report, blocked / "inside")


def test_a_full_disk_leaves_the_old_page(sample_report, tmp_path, monkeypatch):
    page = write_report(sample_report, tmp_path)
    before = page.read_bytes()

    def full(*_args, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_text", full)
    with pytest.raises(StorageError, match="No space left"):
        write_report(sample_report, tmp_path)
    assert page.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


# --- in a real browser ---------------------------------------------------------------------------------------------


def _open(browser, path, width=1200, height=900, theme="light"):
    browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    )
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600},
    )
    browser.get(path.as_uri())
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")


def _canvas(browser, name="canvas.view"):
    import io

    from selenium.webdriver.common.by import By

    data = browser.find_element(By.CSS_SELECTOR, name).screenshot_as_png
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=np.int16)


def _set(browser, selector, value, event):
    browser.execute_script(
        "const e = document.querySelector(arguments[0]); e.value = arguments[1];"
        "e.dispatchEvent(new Event(arguments[2], {bubbles: true}));",
        selector, value, event,
    )  # fmt: skip
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")


@pytest.fixture(scope="module")
def page(sample_report, tmp_path_factory):
    return write_report(sample_report, tmp_path_factory.mktemp("report"))


def test_it_loads_without_console_errors(browser, page):
    browser.get_log("browser")
    _open(browser, page)
    assert browser.get_log("browser") == []
    assert browser.title == "A <report> & more"


def test_the_slider_moves_the_figures(browser, page):
    _open(browser, page)
    first = _canvas(browser)
    _set(browser, ".time", "30", "input")
    second = _canvas(browser)
    assert (np.abs(first - second).max(axis=2) > 20).sum() > 300
    _set(browser, ".time", "0", "input")
    assert np.array_equal(first, _canvas(browser))


def test_the_selector_switches_the_chain(browser, page):
    _open(browser, page)
    names = "return [...document.querySelectorAll('.names span')].map(s => s.firstChild.textContent)"
    assert browser.execute_script(names) == ["adult", "pepper"]
    first = _canvas(browser)
    _set(browser, ".chain", "adult>kid>pepper", "change")
    assert browser.execute_script(names) == ["adult", "kid", "pepper"]
    assert (np.abs(first - _canvas(browser)).max(axis=2) > 20).sum() > 1000


def test_play_advances_time(browser, page):
    _open(browser, page)
    browser.execute_script("document.querySelector('.play').click()")
    deadline = time.monotonic() + 10.0  # a software renderer on a busy machine draws few frames a second
    while int(browser.execute_script("return document.querySelector('.time').value")) <= 3:
        assert time.monotonic() < deadline, "the slider did not move"
        time.sleep(0.05)


def test_a_click_on_a_heading_sorts_and_a_filter_hides(browser, page):
    _open(browser, page)
    column = "return [...document.querySelectorAll('tbody tr')].map(r => Number(r.cells[1].dataset.v))"
    unsorted = browser.execute_script(column)
    browser.execute_script("document.querySelectorAll('th button')[1].click()")
    assert browser.execute_script(column) == sorted(unsorted)
    browser.execute_script("document.querySelectorAll('th button')[1].click()")
    assert browser.execute_script(column) == sorted(unsorted, reverse=True)
    _set(browser, ".filter", "chain 13", "input")
    rows = "return [...document.querySelectorAll('tbody tr')].filter(row => !row.hidden).length"
    assert browser.execute_script(rows) == 1


@pytest.mark.parametrize(("width", "height"), [(390, 844), (1366, 768)])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_it_fits_phone_and_laptop_in_both_themes(browser, page, width, height, theme):
    _open(browser, page, width, height, theme)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    paper = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    brightness = np.mean([int(part) for part in re.findall(r"\d+", paper)[:3]])
    assert brightness < 60 if theme == "dark" else brightness > 200
    corner = _canvas(browser)[5, -5].mean()
    assert abs(corner - brightness) < 12


def test_the_theme_button_switches(browser, page):
    _open(browser, page)
    before = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    browser.execute_script("document.getElementById('theme').click()")
    assert browser.execute_script("return getComputedStyle(document.body).backgroundColor") != before


def test_without_webgl_the_figures_are_still_drawn(browser, page):
    hook = browser.execute_cdp_cmd(
        "Page.addScriptToEvaluateOnNewDocument",
        {"source": "const g = HTMLCanvasElement.prototype.getContext;"
                   "HTMLCanvasElement.prototype.getContext = function (k, o)"
                   " { return k === 'webgl' ? null : g.call(this, k, o); };"},
    )  # fmt: skip
    try:
        _open(browser, page)
        first = _canvas(browser)
        _set(browser, ".time", "30", "input")
        assert (np.abs(first - _canvas(browser)).max(axis=2) > 20).sum() > 200
        assert browser.get_log("browser") == []
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", {"identifier": hook["identifier"]})


def test_two_hundred_chains_stay_small_and_open_fast(browser, embedded, tmp_path):
    playback = sample_playback(embedded, chains=200, frames=60, own_tracks=True)
    rows = [[chain.name, Estimate(0.05, 0.04, 0.06), index] for index, chain in enumerate(playback.chains)]
    table = Table("All", [Column("Chain"), Column("E", "cm", 1, 100), Column("n")], rows)
    bars = BarPlot("Errors", "cm", ["all"], {row[0]: [row[1]] for row in rows}, 100.0)
    path = write_report(Report("Many", "", [], [Section("Play", [playback]), Section("All", [table, bars])]), tmp_path)
    assert path.stat().st_size < 25e6
    browser.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})  # other work may share the machine
    before = _processor_time(browser)
    _open(browser, path)
    assert 0.0 < _processor_time(browser) - before < 3.0
    assert browser.execute_script("return document.querySelectorAll('.chain option').length") == 200


def _processor_time(browser) -> float:
    metrics = browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return next(entry["value"] for entry in metrics if entry["name"] == "TaskDuration")
