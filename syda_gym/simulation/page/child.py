"""The page's process: takes poses as lines of JSON, shows them in browsers, and tells which button was pressed.

Started by ``process.PageProcess``. The first line that it reads is the plan with the address, the first that it writes
says that the page is there, or why not.
"""

from __future__ import annotations

import base64
import json
import os
import signal
import sys
import threading
from collections import deque
from io import BytesIO
from typing import Any, TextIO

import numpy as np

from syda_gym.errors import MissingExtraError, SydaError
from syda_gym.look import GROUND, LIGHT_AMBIENT, LIGHT_DIFFUSE, LIGHT_FROM, OPERATOR, SKY_BOTTOM, SKY_TOP
from syda_gym.simulation.page.drawing import PointsDrawing, RobotDrawing, drawing
from syda_gym.simulation.page.plan import PagePlan, PlotPlan
from syda_gym.simulation.page.serving import serve

__all__ = ["main"]

_PLOT_EVERY = 0.25  # s of what is shown; plots are sent whole


class _Page:
    """What stands on the page."""

    def __init__(self, plan: PagePlan, server: Any, tell: Any) -> None:
        self._server, self._tell = server, tell
        scene, gui = server.scene, server.gui
        scene.world_axes.visible = False
        _light(scene)
        gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=False, brand_color=(47, 111, 222))
        gui.set_panel_label(plan.title)
        self._bodies: dict[str, RobotDrawing | PointsDrawing] = {
            body.name: drawing(server, body) for body in plan.bodies
        }
        self.floor = floor = min(
            (body.lowest for body in self._bodies.values() if np.isfinite(body.lowest)), default=0.0
        )
        for body in self._bodies.values():
            body.stand_on(floor)
        scene.add_box(
            "/floor", dimensions=(40.0, 40.0, 0.02), position=(0.0, 0.0, floor - 0.012), color=_bytes(GROUND),
            cast_shadow=False,
        )  # fmt: skip
        self._text = gui.add_markdown("connecting …")
        for button in plan.buttons:
            handle = gui.add_button(button.label, color=button.colour, hint=button.hint or None)
            handle.on_click(lambda _, name=button.name: tell({"pressed": name}))
        self._choice = None
        if plan.choices is not None:
            label, names = plan.choices
            self._choice = gui.add_dropdown(label, names)
            self._choice.on_update(lambda event: tell({"chosen": event.target.value}))
        self._picture = gui.add_image(np.full((120, 160, 3), 235, np.uint8), label="camera") if plan.picture else None
        self._plots = [_Plot(server, plot) for plot in plan.plots]
        middle, height = plan.middle, plan.height

        camera = server.initial_camera
        # The bodies stand to the left of the picture, for the panel covers its right side.
        camera.position = (1.0 * height + 0.9, middle + 0.5, floor + 0.75 * height)
        camera.look_at = (0.0, middle + 0.5, floor + 0.5 * height)

    def show(self, message: dict[str, Any]) -> None:
        """Shows what a message holds."""
        with self._server.atomic():
            for name, body in self._bodies.items():
                values = message.get("poses", {}).get(name)
                if values is not None:
                    body.pose(values)
            text = message.get("text")
            if text is not None and text != self._text.content:
                self._text.content = text
        picture = message.get("picture")
        if picture is not None and self._picture is not None:
            self._picture.image = _decoded(picture)
        for plot, values in zip(self._plots, message.get("values", []), strict=False):
            plot.add(float(message["time"]), values)


def _decoded(picture: dict[str, Any]) -> Any:
    """The picture, with its lines and dots drawn: ``jpeg`` in base64, ``dots`` and ``lines`` in shares of its size."""
    from PIL import Image, ImageDraw

    image = Image.open(BytesIO(base64.b64decode(picture["jpeg"]))).convert("RGB")
    draw = ImageDraw.Draw(image)
    dots = [(x * image.width, y * image.height) for x, y in picture["dots"]]
    for a, b in picture["lines"]:
        draw.line([dots[a], dots[b]], fill=OPERATOR, width=3)
    for x, y in dots:
        draw.ellipse((x - 2, y - 2, x + 2, y + 2), fill="white")
    return np.asarray(image)


def _light(scene: Any) -> None:
    """The sky and the light of all pictures; viser's own environment would be another one."""
    shade = np.linspace(0.0, 1.0, 64)[:, None, None]
    sky = 255.0 * ((1.0 - shade) * np.array(SKY_TOP) + shade * np.array(SKY_BOTTOM))
    scene.set_background_image(np.broadcast_to(sky, (64, 8, 3)).astype(np.uint8))
    scene.configure_environment_map(None)
    scene.configure_default_lights(False)
    # three.js counts light in another unit than a fraction of the colour, and its materials swallow some.
    scene.add_light_ambient("/light/ambient", intensity=1.3 * np.pi * LIGHT_AMBIENT)
    scene.add_light_directional("/light/sun", intensity=1.3 * np.pi * LIGHT_DIFFUSE, position=LIGHT_FROM)


class _Plot:
    """Curves over the last seconds."""

    def __init__(self, server: Any, plan: PlotPlan) -> None:
        from viser import uplot

        self._seconds = plan.seconds
        self._rows: deque[tuple[float, list[float | None]]] = deque(maxlen=600)
        self._shown = -np.inf
        series = (
            uplot.Series(label="s"),
            *(uplot.Series(label=name, stroke=colour, width=2, points={"show": False}) for name, colour in plan.series),
        )
        empty = np.array([0.0])
        self._handle = server.gui.add_uplot(
            data=tuple(empty for _ in series), series=series, title=plan.title, aspect=2.4,
            scales={"x": uplot.Scale(time=False)}, legend=uplot.Legend(show=len(plan.series) > 1),
        )  # fmt: skip

    def add(self, time: float, values: list[float | None]) -> None:
        self._rows.append((time, values))
        while self._rows and time - self._rows[0][0] > self._seconds:
            self._rows.popleft()
        if time - self._shown < _PLOT_EVERY:
            return
        self._shown = time
        columns = list(zip(*(row for _, row in self._rows), strict=True))
        self._handle.data = (
            np.array([at - time for at, _ in self._rows]),
            *(np.array([np.nan if value is None else value for value in column], dtype=float) for column in columns),
        )


def main() -> None:
    """Serves until the input ends."""
    # Ctrl-C reaches every process of a terminal; this one ends when its input does, after the robot has come to rest.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What viser or a library prints must not mix with what this process tells.
    told = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - viser announces itself, with an address
    lock = threading.Lock()

    def tell(message: dict[str, Any]) -> None:
        with lock:
            _write(told, message)

    first = json.loads(sys.stdin.readline())
    try:
        plan = PagePlan.from_json(first["plan"])
        server, address = serve(first["host"], int(first["port"]), first["token"], plan.title)
        page = _Page(plan, server, tell)
    except (SydaError, MissingExtraError) as error:
        tell({"error": str(error)})
        return
    tell({"ready": address, "floor": page.floor})
    for line in sys.stdin:
        page.show(json.loads(line))
        tell({"shown": 1})
    server.stop()


def _write(told: TextIO, message: dict[str, Any]) -> None:
    try:
        told.write(json.dumps(message) + "\n")
        told.flush()
    except OSError:  # the other side is gone; the input will end too
        return


def _bytes(colour: tuple[float, float, float]) -> tuple[int, int, int]:
    red, green, blue = colour
    return round(255 * red), round(255 * green), round(255 * blue)


if __name__ == "__main__":
    main()
