"""run: a source, the loop and a sink together in real time."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable

from syda_gym.teleoperation.driver import Driver
from syda_gym.teleoperation.ending import Ending
from syda_gym.teleoperation.incoming.anticipation import Anticipation
from syda_gym.teleoperation.incoming.inbox import Received
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.journal import Record
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import Sink
from syda_gym.teleoperation.tick import Decision, State

__all__ = ["run"]

_GRACE = 1.5  # periods to wait for the frame after a frame
_HOMEWARD = 90.0  # s; the longest way to rest at the end of a run; slow joints and detours take their time
_REPEATS = 5  # how often a stop is sent at the end, for a network that loses packets
_APART = 1e-3  # s; least time between two commands


def run(
    source: Source,
    loop: TeleoperationLoop,
    sink: Sink,
    *,
    journal: Record | None = None,
    statistics: LiveStatistics | None = None,
    on_decision: Callable[[Decision], None] | None = None,
    seconds: float | None = None,
    rest_at_end: bool = True,
) -> LiveStatistics:
    """Runs until the source ends, the time is over, or a signal (Ctrl-C, SIGTERM, SIGHUP); then eases to rest.

    A frame is acted on when it arrives. While none arrives the loop decides ``settings.rate`` times a second all the
    same, for the first time one and a half periods after a frame. The source and the sink must be started and open, the
    sink first, which may take a second; the source's clock is the loop's.

    Requests are obeyed on the way to rest too: an emergency stop there ends the run where the robot stands, as does a
    second signal. What fails beside the robot (journal, screen, one of several sinks) is dropped with a line among the
    loop's notices, and the run goes on.

    Args:
        source: where frames come from.
        loop: what decides.
        sink: where commands go.
        journal: where every decision is written, after its command was sent.
        statistics: to go on counting; new ones if not given.
        on_decision: called after each command, for the screen.
        seconds: when to end.
        rest_at_end: whether to ease to rest at the end; an emergency stop is left as it is.

    Returns:
        The statistics.

    Raises:
        TeleoperationError: the robot takes no commands any more.
    """
    stats = statistics or LiveStatistics()
    driver = Driver(source, loop, sink, journal, stats, on_decision)
    frames = Anticipation(source, driver.rehearse)
    with Ending() as ending:
        # What exists now stays; the collector need not look at it again in the middle of a frame.
        gc.collect()
        gc.freeze()
        try:
            _follow(driver, frames, ending, seconds)
        except KeyboardInterrupt:
            pass
        except BaseException:
            _leave_safely(driver, ending, rest_at_end)
            raise
        finally:
            gc.unfreeze()
        if rest_at_end and loop.state is not State.STOPPED and not driver.gone:
            try:
                _go_to_rest(driver, ending)
            except BaseException:
                driver.stop()
                raise
        driver.flush()
    driver.raise_if_gone()
    return stats


def _follow(driver: Driver, frames: Anticipation, ending: Ending, seconds: float | None) -> None:
    source = driver.source
    end = None if seconds is None else source.clock() + seconds
    patience = period = 1.0 / driver.loop.settings.rate
    while (end is None or source.clock() < end) and not driver.gone:
        received = driver.spaced(driver.take(frames, patience))
        driver.step(received)
        if ending.asked or source.inbox.closed:
            return
        # A stream of the loop's own rate must not find the loop just deciding that no frame came.
        patience = period if received.packet is None else _GRACE * period
        if received.packet is None and received.controls:
            time.sleep(_APART)  # requests in a flood must not make a flood of commands


def _go_to_rest(driver: Driver, ending: Ending) -> None:
    """Asks for rest and keeps deciding until the robot is there; frames are left unread, requests are not."""
    begun, signals = driver.source.clock(), ending.asked
    # The last command may just have left: one at once would be a step too short to go any way.
    controls = ("resume", "rest", *_homeward(_listen(driver, ending, signals, max(driver.early, 0.0))))
    while driver.source.clock() - begun < _HOMEWARD and not driver.gone:
        state = driver.step(Received(None, 0.0, controls)).state
        if state is State.RESTING:
            return
        if state is State.STOPPED:
            _repeat(driver)
            return
        controls = _homeward(_listen(driver, ending, signals, 1.0 / driver.loop.settings.rate))


def _homeward(heard: list[str]) -> tuple[str, ...]:
    """Requests on the way home: whoever resumes goes on home."""
    return tuple(c for control in heard for c in (("resume", "rest") if control == "resume" else (control,)))


def _listen(driver: Driver, ending: Ending, signals: int, seconds: float) -> list[str]:
    """Requests of the next moments, as soon as one comes."""
    end = time.monotonic() + seconds
    heard: list[str] = []
    while not heard:
        if ending.asked > signals:
            return ["stop"]
        driver.source.inbox.reopen()
        left = end - time.monotonic()
        if left <= 0.0:
            break
        received = driver.spaced(driver.take(driver.source, left)._replace(packet=None))
        heard += [control for control in received.controls if control != "calibrate"]
    return heard


def _repeat(driver: Driver) -> None:
    for _ in range(_REPEATS):
        time.sleep(1.0 / driver.loop.settings.rate)
        driver.step(Received(None, 0.0, ()))


def _leave_safely(driver: Driver, ending: Ending, rest_at_end: bool) -> None:
    """After a failure that nobody foresaw: to rest if that goes, else a stop; the caller raises the failure."""
    try:
        if rest_at_end and driver.loop.state is not State.STOPPED and not driver.gone:
            _go_to_rest(driver, ending)
        driver.flush()
    except BaseException:
        driver.stop()
