"""Cockpit: the live page of a run, with buttons that end in the same inbox as keys and packets."""

from __future__ import annotations

import base64
import math
import os
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.errors import SydaError
from syda_gym.look import OPERATOR, REFERENCE, ROBOT, rgba
from syda_gym.motions.film.landmarks import BONES_SEEN
from syda_gym.simulation.page.plan import BodyPlan, Button, PagePlan, PlotPlan, body_plan
from syda_gym.simulation.page.process import PageProcess
from syda_gym.simulation.pictures.stage import OPERATOR_AT
from syda_gym.teleoperation.incoming.camera import PictureSource
from syda_gym.teleoperation.incoming.network import require_token
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import Sink
from syda_gym.teleoperation.tick import Decision
from syda_gym.teleoperation.view.words import status_text
from syda_gym.teleoperation.view.writing import Recorder

__all__ = ["BUTTONS", "Cockpit"]

BUTTONS = (
    Button("stop", "EMERGENCY STOP", (196, 32, 32), "The robot stands still at once; only Release ends it"),
    Button("release", "Release the stop", None, "After an emergency stop: paused, and Go on follows again"),
    Button("pause", "Pause", None, "The robot holds its pose"),
    Button("resume", "Go on", None, "Follow again, gently"),
    Button("calibrate", "Calibrate", None, "Stand still with hanging arms for two seconds"),
    Button("rest", "Rest", None, "The robot eases to its resting pose"),
    Button("record", "Record / end recording", None, "Keep what operator and robot do in a motion file"),
)
"""What can be asked for; all but ``record`` are requests of the loop."""

_WHY_FOR = 1.0  # s for which a reason stays on the page
_PICTURE_EVERY = 0.1  # s
_PICTURE_WIDTH = 320


class Cockpit:
    """The page of a live run.

    The loop's thread only leaves its decision behind (``update``); everything else happens in the page's thread and
    process.

    Args:
        loop: that decides.
        source: where frames come from; requests go into its inbox.
        sink: where commands go; one that knows the robot's joint angles is asked for them.
        statistics: of the run.
        host: address to listen on; anything but loopback needs a token.
        port: 0 for any that is free.
        token: that opens the page; a new one if not given.
        appearance: another URDF of the robot to show.
        folder: where recordings are written.
        clock: of the run.

    Attributes:
        address: to open in a browser.

    Raises:
        OptionError: an address beyond this machine without a token.
    """

    def __init__(
        self,
        loop: TeleoperationLoop,
        source: Source,
        sink: Sink,
        statistics: LiveStatistics,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        appearance: str | os.PathLike[str] | None = None,
        folder: str | os.PathLike[str] = ".",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        require_token(host, token)
        self._loop, self._source, self._sink, self._stats = loop, source, sink, statistics
        self._clock = clock
        self._decision: Decision | None = None
        self._why: dict[str, float] = {}
        self._angles: Callable[[], FloatArray | None] | None = sink.angles
        self._picture_number, self._next_picture = -1, -math.inf
        self._frames: deque[tuple[float, int]] = deque(maxlen=32)
        self.recorder = Recorder(loop, Path(folder))
        self._page = PageProcess(
            _plan(loop, source, appearance),
            self.look,
            on_press=self.press,
            host=host,
            port=port,
            token=token,
            rate=15.0,
        )

    @property
    def address(self) -> str:
        """Where the page is, with the token that opens it."""
        return self._page.address

    def open(self) -> None:
        """Starts the page.

        Raises:
            TeleoperationError: it cannot be shown.
        """
        self._page.open()

    def close(self) -> None:
        """Ends the page, and finishes a recording; harmless when repeated."""
        self._page.close()
        if self.recorder.running:
            self.recorder.finish()

    def __enter__(self) -> Cockpit:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def update(self, decision: Decision) -> None:
        """Leaves a decision behind for the page; called by the loop's thread after each command."""
        self._decision = decision
        for reason in decision.reasons:
            self._why[reason] = decision.now
        if self.recorder.running:
            self.recorder.add(decision)

    def press(self, name: str) -> None:
        """Somebody pressed a button."""
        if name == "record":
            self.recorder.toggle()
        elif name in {button.name for button in BUTTONS}:
            self._source.inbox.request(name)

    def look(self) -> dict[str, Any] | None:
        """What the page should show now; ``None`` before the first decision."""
        decision = self._decision
        if decision is None:
            return None
        now = self._clock()
        poses: dict[str, Any] = {"robot": self._robot_angles(decision), "ghost": self._loop.target.round(4).tolist()}
        frame = self._loop.frame
        operator = self._loop.mapping.source
        if frame is not None:
            poses["operator"] = frame.round(4).tolist()
        elif isinstance(operator, HumanSkeleton):
            poses["operator"] = operator.standing().round(4).tolist()
        message: dict[str, Any] = {"poses": poses, "time": now, "values": self._values(now, decision)}
        reasons = [reason for reason, when in list(self._why.items()) if now - when < _WHY_FOR]
        message["text"] = status_text(self._loop, self._source, self._stats, decision, reasons, self.recorder.message)
        picture = self._picture(now)
        if picture is not None:
            message["picture"] = picture
        return message

    def _robot_angles(self, decision: Decision) -> list[float]:
        angles: FloatArray | None = None
        if self._angles is not None:
            try:
                angles = self._angles()  # ``None`` of a sink that cannot tell
            except SydaError:  # the simulation has just been closed
                self._angles = None
        angles = decision.command if angles is None else angles
        rounded: list[float] = angles.round(4).tolist()
        return rounded

    def _values(self, now: float, decision: Decision) -> list[list[float | None]]:
        self._frames.append((now, self._stats.frames))
        (begun, before), (_, after) = self._frames[0], self._frames[-1]
        frames = (after - before) / (now - begun) if now > begun else 0.0
        latency = 1e3 * self._stats.newest_latency
        whole = None
        if isinstance(self._source, PictureSource):
            whole = _number(self._source.parts()["picture_to_frame_p50_ms"] + latency)
        return [
            [_number(self._stats.bound)],
            [_number(self._stats.rate), _number(frames)],
            [_number(latency)] + ([whole] if isinstance(self._source, PictureSource) else []),
        ]

    def _picture(self, now: float) -> dict[str, Any] | None:
        look = self._source.look if isinstance(self._source, PictureSource) else None
        if look is None or look.number == self._picture_number or now < self._next_picture:
            return None
        import cv2  # is there, for it took the picture; it leaves the interpreter to the loop while it works

        self._picture_number, self._next_picture = look.number, now + _PICTURE_EVERY
        height, width = look.picture.shape[:2]
        small = cv2.resize(look.picture, (_PICTURE_WIDTH, max(1, round(height * _PICTURE_WIDTH / width))))
        good, data = cv2.imencode(".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 80])
        if not good:
            return None
        dots = [] if look.pose is None else np.clip(look.pose.image, -1.0, 2.0).round(4).tolist()
        return {
            "jpeg": base64.b64encode(data.tobytes()).decode("ascii"),
            "dots": dots,
            "lines": [] if look.pose is None else [list(pair) for pair in BONES_SEEN],
        }


def _plan(loop: TeleoperationLoop, source: Source, appearance: str | os.PathLike[str] | None) -> PagePlan:
    robot, operator = loop.robot, loop.mapping.source
    bodies: list[BodyPlan] = [
        body_plan(robot, "robot", appearance=appearance),
        body_plan(robot, "ghost", colour=rgba(REFERENCE, 0.4), appearance=appearance),
        body_plan(operator, "operator", place=(0.0, OPERATOR_AT, 0.0)),
    ]
    camera = isinstance(source, PictureSource)
    latency = (("arrival to command", ROBOT), *((("picture to command", OPERATOR),) if camera else ()))
    plots = (
        PlotPlan("error bound [m]", (("bound", REFERENCE),)),
        PlotPlan("a second", (("commands", ROBOT), ("frames", OPERATOR))),
        PlotPlan("latency [ms]", latency),
    )
    heights = [float(getattr(body, "height", 1.0)) for body in (robot, operator)]
    return PagePlan(
        f"{' > '.join(loop.mapping.route)}", tuple(bodies), BUTTONS, plots, picture=camera, height=max(heights),
        middle=0.5 * OPERATOR_AT,
    )  # fmt: skip


def _number(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
