"""What is on the screen while a robot is teleoperated, and the keys that steer the loop."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

from syda_gym.teleoperation.incoming.inbox import Inbox
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import State

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["KEYS", "keyboard", "status_table"]

KEYS = {"p": "pause", "g": "resume", " ": "stop", "r": "release", "c": "calibrate", "h": "rest"}
"""Keys and what they ask for; ``q`` ends the run."""

_COLOURS = {
    State.CALIBRATING: "cyan",
    State.FOLLOWING: "green",
    State.HOLDING: "yellow",
    State.EASING: "yellow",
    State.RESTING: "blue",
    State.PAUSED: "magenta",
    State.STOPPED: "bold red",
}


def status_table(loop: TeleoperationLoop, source: Source, stats: LiveStatistics) -> Table:
    """State, rate, latency percentiles, dropped packets, error bound and the most frequent reasons."""
    from rich.table import Table

    table = Table(title=f"{' > '.join(loop.mapping.route)}", show_header=False, min_width=64)
    table.add_row("state", f"[{_COLOURS[loop.state]}]{loop.state.value}[/]")
    if loop.calibration is None and loop.calibration_message:
        table.add_row("calibration", loop.calibration_message)
    table.add_row("commands", f"{stats.commands}, {stats.rate:.1f} per second")
    latency = [1e3 * stats.percentile(share) for share in (50, 99, 100)]
    table.add_row("latency", f"median {latency[0]:.2f} ms, 99 % {latency[1]:.2f} ms, worst {latency[2]:.2f} ms")
    dropped = source.inbox.dropped
    what = ", ".join(f"{reason} {count}" for reason, count in dropped.most_common(5))
    table.add_row("dropped", f"{sum(dropped.values())} of {stats.frames + sum(dropped.values())}  {what}")
    table.add_row("error bound", f"{stats.bound:.3f} m" if stats.bound == stats.bound else "unknown")
    table.add_row("reasons", ", ".join(f"{reason} {count}" for reason, count in stats.reasons.most_common(4)) or "none")
    for notice in loop.notices:
        table.add_row("note", notice)
    table.add_row("keys", "p pause  g go  SPACE emergency stop  r release  c calibrate  h home  q quit")
    return table


@contextlib.contextmanager
def keyboard(inbox: Inbox) -> Iterator[bool]:
    """Turns keys into requests while the block runs, if the standard input is a terminal.

    Args:
        inbox: where the requests go.

    Yields:
        Whether keys are read.
    """
    try:
        import termios
        import tty
    except ImportError:  # no POSIX
        yield False
        return
    if sys.stdin is None or sys.stdin.closed or not sys.stdin.isatty():
        yield False
        return
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    ending = threading.Event()
    tty.setcbreak(descriptor)
    thread = threading.Thread(target=_read_keys, args=(descriptor, inbox, ending), name="keyboard", daemon=True)
    thread.start()
    try:
        yield True
    finally:
        ending.set()
        thread.join(timeout=1.0)
        with contextlib.suppress(termios.error, OSError):  # a terminal that was closed
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _read_keys(descriptor: int, inbox: Inbox, ending: threading.Event) -> None:
    while not ending.is_set():
        ready, _, _ = select.select([descriptor], [], [], 0.1)
        if not ready:
            continue
        # Unbuffered: sys.stdin would swallow keys typed together, and one of them may be the emergency stop.
        try:
            typed = os.read(descriptor, 64)
        except OSError:  # the terminal hung up
            return
        if not typed:
            return
        for key in typed.decode("utf-8", "replace"):
            if key == "q":
                inbox.close()  # and go on reading: the way home can be stopped too
            elif key in KEYS:
                inbox.request(KEYS[key])
