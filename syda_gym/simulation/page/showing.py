"""show: motions of bodies, played on a page until somebody closes it; with choice, pause and single steps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.simulation.page.plan import BodyPlan, Button, PagePlan, PlotPlan
from syda_gym.simulation.page.process import PageProcess

__all__ = ["Player", "Shown", "show"]


@dataclass(frozen=True, eq=False)
class Shown:
    """One motion to be chosen on the page.

    Attributes:
        name: what is chosen.
        fps: frames per second.
        poses: body of the page to its poses ``(N, ...)``: joint angles, frames or points.
        values: plots' values, a row a frame; empty for none.
        words: what is said beside it.
    """

    name: str
    fps: float
    poses: Mapping[str, FloatArray]
    values: Sequence[Sequence[Sequence[float]]] = field(default_factory=tuple)
    words: str = ""

    def __len__(self) -> int:
        return min(len(rows) for rows in self.poses.values())


class Player:
    """Keeps the time of what is played; asked by the page's thread, steered by its buttons.

    Args:
        shown: what can be chosen; the first is played first.
        clock: seconds.

    Raises:
        OptionError: nothing to show.
    """

    BUTTONS = (
        Button("pause", "Pause / go on"),
        Button("back", "One frame back"),
        Button("ahead", "One frame ahead"),
    )

    def __init__(self, shown: Sequence[Shown], clock: Callable[[], float] = time.monotonic) -> None:
        if not shown:
            raise OptionError("nothing to show; name at least one motion")
        self._shown = {each.name: each for each in shown}
        self._clock = clock
        self._lock = threading.Lock()
        self._now = shown[0]
        self._begun = clock()
        self._paused: float | None = None

    def choose(self, name: str) -> None:
        """Plays another motion from its beginning."""
        with self._lock:
            if name in self._shown:
                self._now, self._begun = self._shown[name], self._clock()
                self._paused = None if self._paused is None else 0.0

    def press(self, name: str) -> None:
        """A button of ``BUTTONS`` was pressed."""
        with self._lock:
            at = self._at()
            if name == "pause":
                if self._paused is None:
                    self._paused = at
                else:
                    self._begun, self._paused = self._clock() - self._paused, None
            elif name in ("back", "ahead"):
                step = (1.0 if name == "ahead" else -1.0) / self._now.fps
                self._paused = (at + step) % (len(self._now) / self._now.fps)

    def look(self) -> dict[str, Any]:
        """The page's message of this moment."""
        with self._lock:
            now, at = self._now, self._at()
            paused = self._paused is not None
        index = min(len(now) - 1, int(at * now.fps + 1e-6))
        words = f"### {now.name}\n\n{at:.1f} of {len(now) / now.fps:.1f} s{', paused' if paused else ''}"
        message: dict[str, Any] = {
            "poses": {name: rows[index].round(4).tolist() for name, rows in now.poses.items()},
            "text": words + (f"\n\n{now.words}" if now.words else ""),
            "time": self._clock(),
        }
        if len(now.values):
            message["values"] = now.values[index]
        return message

    def _at(self) -> float:
        return (
            self._paused
            if self._paused is not None
            else (self._clock() - self._begun) % (len(self._now) / self._now.fps)
        )


def show(
    title: str,
    bodies: Sequence[BodyPlan],
    shown: Sequence[Shown],
    *,
    plots: Sequence[PlotPlan] = (),
    host: str = "127.0.0.1",
    port: int = 0,
    height: float = 1.7,
    middle: float = 0.0,
    tell: Callable[[str], None] = print,
    seconds: float | None = None,
) -> None:
    """Plays motions on a page until Ctrl-C.

    Args:
        title: of the page.
        bodies: see ``plan.body_plan``.
        shown: what can be chosen.
        plots: for the values of ``shown``.
        host: address to listen on, loopback or what the caller's token protects.
        port: 0 for any that is free.
        height: of the tallest body [m].
        middle: of what stands there, to the left [m].
        tell: is told the address.
        seconds: when to end; ``None`` for only by Ctrl-C.

    Raises:
        TeleoperationError: the page cannot be shown.
        OptionError: nothing to show.
    """
    player = Player(shown)
    plan = PagePlan(
        title, tuple(bodies), Player.BUTTONS, tuple(plots), height=height, middle=middle,
        choices=("motion", tuple(each.name for each in shown)) if len(shown) > 1 else None,
    )  # fmt: skip
    page = PageProcess(plan, player.look, on_press=player.press, on_choice=player.choose, host=host, port=port)
    with page:
        tell(page.address)
        end = None if seconds is None else time.monotonic() + seconds
        try:
            while page.alive and (end is None or time.monotonic() < end):
                time.sleep(0.1)
        except KeyboardInterrupt:
            return
