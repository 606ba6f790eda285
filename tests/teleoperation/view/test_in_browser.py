"""The cockpit in a real browser: the robot is seen to move, buttons reach the loop, nothing is asked of the network."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from PIL import Image

from syda_gym.embodiments import catalog
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.motions import load_motions
from syda_gym.teleoperation import LoopSettings, ReplaySource, State, TeleoperationLoop, run
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.outgoing.bullet import BulletSink
from syda_gym.teleoperation.tick import Decision
from syda_gym.teleoperation.view.cockpit import Cockpit

pytest.importorskip("viser", reason="SKIPPED LOUDLY: the extra 'view' is not installed")

HISTORY: list[Any] = []
"""Requests and states of the running loop, in order."""

_PATIENCE = 180.0  # s; a browser that draws in software on a busy machine is slow


def wait_until(true: Callable[[], Any], what: str) -> Any:
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        found = true()
        if found:
            return found
        time.sleep(0.2)
    raise AssertionError(f"waited in vain for {what}")


def picture(browser: Any) -> np.ndarray:
    """What is seen; the browser may be too busy to answer at once."""
    from selenium.common.exceptions import WebDriverException

    for _ in range(6):
        try:
            data = browser.get_screenshot_as_png()
        except WebDriverException:
            continue
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=np.int16)
    raise AssertionError("the browser gives no picture")


def press(browser: Any, label: str) -> None:
    browser.execute_script(
        "[...document.querySelectorAll('button')].find(b => b.textContent.trim() === arguments[0]).click()", label
    )


def words(browser: Any) -> str:
    return str(browser.execute_script("return document.body.innerText"))


@pytest.fixture(scope="module")
def running() -> Iterator[tuple[TeleoperationLoop, Cockpit]]:
    """Pepper follows a waving adult until the test ends; what the loop did and was asked for stands in ``HISTORY``."""
    adult, pepper = catalog.get("adult"), catalog.get("pepper")
    clips = [clip for clip in load_motions("embedded").clips("adult") if clip.action == "wave_both"][:1]
    loop = TeleoperationLoop(unfitted(adult, pepper), LoopSettings(calibration=0.0))
    source, sink, stats = ReplaySource(clips, repeat=True), BulletSink(pepper), LiveStatistics()
    request = source.inbox.request

    def noted(control: str) -> None:
        HISTORY.append(control)
        request(control)

    with sink, Cockpit(loop, source, sink, stats) as cockpit, source:
        source.inbox.request = noted  # type: ignore[method-assign]

        def decided(decision: Decision) -> None:
            HISTORY.append(decision.state)
            cockpit.update(decision)

        thread = threading.Thread(
            target=run, args=(source, loop, sink),
            kwargs={"statistics": stats, "on_decision": decided, "rest_at_end": False}, daemon=True,
        )  # fmt: skip
        thread.start()
        yield loop, cockpit
        source.inbox.close()
        thread.join(timeout=10.0)


def test_the_robot_is_seen_to_move_and_the_buttons_reach_the_loop(
    browser: Any, running: tuple[TeleoperationLoop, Cockpit]
) -> None:
    loop, cockpit = running
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 760, "height": 520, "deviceScaleFactor": 1, "mobile": False}
    )
    browser.get(cockpit.address)
    try:
        wait_until(lambda: "following" in words(browser), "the page to say what the loop does")
        assert cockpit.address.split("token=")[1] not in browser.current_url, "the secret left the address line"
        first = picture(browser)
        wait_until(lambda: (np.abs(picture(browser) - first).max(axis=2) > 25).sum() > 150, "the robot to move")

        press(browser, "EMERGENCY STOP")
        wait_until(lambda: loop.state is State.STOPPED, "the stop to reach the loop")
        asked = HISTORY.index("stop")
        assert State.STOPPED in HISTORY[asked : asked + 3], "obeyed within a tick; one may have been on its way"
        wait_until(lambda: "EMERGENCY STOP: press Release" in words(browser), "the page to say so")
        held = loop.command
        press(browser, "Go on")
        time.sleep(1.0)
        assert loop.state is State.STOPPED, "nothing but the release ends a stop"
        np.testing.assert_array_equal(loop.command, held)
        press(browser, "Release the stop")
        wait_until(lambda: loop.state is State.PAUSED, "the release to reach the loop")
        press(browser, "Go on")
        wait_until(lambda: loop.state is State.FOLLOWING, "the robot to follow again")
        press(browser, "Rest")
        wait_until(lambda: loop.state in (State.EASING, State.RESTING), "the robot to ease to rest")

        asked = browser.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
        page = cockpit.address.split("/?")[0]
        assert not [name for name in asked if not name.startswith((page, "blob:", "data:"))]
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.get("about:blank")


def test_a_closed_tab_does_not_disturb_the_loop(browser: Any, running: tuple[TeleoperationLoop, Cockpit]) -> None:
    """The page of the test before was left; commands go on."""
    _, cockpit = running
    before = cockpit._stats.commands
    time.sleep(1.0)
    assert cockpit._stats.commands > before
