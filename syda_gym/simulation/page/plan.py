"""What stands on a page and what is sent to it: plain values that travel as JSON between two processes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError

__all__ = ["BodyPlan", "Button", "PagePlan", "PlotPlan", "body_plan"]


@dataclass(frozen=True)
class BodyPlan:
    """A body on the page.

    Attributes:
        name: under which its poses are sent.
        kind: ``"robot"`` (poses are joint angles), ``"human"`` (poses are frames) or ``"points"`` (poses are points).
        place: of a robot's torso frame; between a human's feet, above the floor; added to points [m].
        colour: one for all parts (red, green, blue, opacity in 0..1), or ``None`` for their own.
        urdf: of a robot.
        torso: the robot's link that stands at ``place``.
        joints: the robot's joints in the order of its poses.
        rest: angle of every joint that its description gives [rad].
        human: a human's ``spec()``.
        bones: of points: start, end, radius [m], colour.
    """

    name: str
    kind: str
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: tuple[float, float, float, float] | None = None
    urdf: str = ""
    torso: str = ""
    joints: tuple[str, ...] = ()
    rest: dict[str, float] = field(default_factory=dict)
    human: dict[str, Any] = field(default_factory=dict)
    bones: tuple[tuple[int, int, float, tuple[float, float, float]], ...] = ()


@dataclass(frozen=True)
class Button:
    """A button.

    Attributes:
        name: what is reported when it is pressed.
        label: what it says.
        colour: red, green, blue in 0..255, or ``None`` for the page's own.
        hint: shown when the pointer rests on it.
    """

    name: str
    label: str
    colour: tuple[int, int, int] | None = None
    hint: str = ""


@dataclass(frozen=True)
class PlotPlan:
    """A plot over the last seconds.

    Attributes:
        title: above it, with the unit.
        series: name of each curve and its colour.
        seconds: how much of the past it shows.
    """

    title: str
    series: tuple[tuple[str, str], ...]
    seconds: float = 20.0


@dataclass(frozen=True)
class PagePlan:
    """Everything that stands on a page.

    Attributes:
        title: of the page.
        bodies: that move.
        buttons: in order.
        plots: in order.
        picture: whether there is room for a picture.
        choices: label and what can be chosen, or ``None``.
        height: of the tallest body [m], for the camera.
        middle: of what stands there, to the left [m].
    """

    title: str
    bodies: tuple[BodyPlan, ...] = ()
    buttons: tuple[Button, ...] = ()
    plots: tuple[PlotPlan, ...] = ()
    picture: bool = False
    choices: tuple[str, tuple[str, ...]] | None = None
    height: float = 1.7
    middle: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """All values by name."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> PagePlan:
        """Rebuilds a plan."""
        choices = values["choices"]
        return cls(
            title=values["title"],
            bodies=tuple(
                BodyPlan(
                    **{
                        **body, "joints": tuple(body["joints"]), "place": tuple(body["place"]),
                        "colour": None if body["colour"] is None else tuple(body["colour"]),
                        "bones": tuple((a, b, r, tuple(c)) for a, b, r, c in body["bones"]),
                    }
                )
                for body in values["bodies"]
            ),
            buttons=tuple(Button(**button) for button in values["buttons"]),
            plots=tuple(
                PlotPlan(plot["title"], tuple((a, b) for a, b in plot["series"]), plot["seconds"])
                for plot in values["plots"]
            ),
            picture=values["picture"],
            choices=None if choices is None else (choices[0], tuple(choices[1])),
            height=values["height"],
            middle=values["middle"],
        )  # fmt: skip


def body_plan(
    body: Embodiment,
    name: str,
    *,
    place: Sequence[float] = (0.0, 0.0, 0.0),
    colour: tuple[float, float, float, float] | None = None,
    appearance: str | os.PathLike[str] | None = None,
) -> BodyPlan:
    """What the page must know of a body.

    Args:
        body: a human or a robot.
        name: under which its poses will be sent.
        place: see ``BodyPlan``.
        colour: see ``BodyPlan``.
        appearance: another URDF of the robot with the same joint names, for example the vendor's with meshes.

    Raises:
        EmbodimentError: the body is neither a human nor a robot.
    """
    at = (float(place[0]), float(place[1]), float(place[2]))
    if isinstance(body, Robot):
        return BodyPlan(
            name, "robot", at, colour, os.path.abspath(os.fspath(appearance or body.urdf)), body.description.torso,
            tuple(body.joint_names), {key: float(value) for key, value in body.description.rest.items()},
        )  # fmt: skip
    if isinstance(body, HumanSkeleton):
        return BodyPlan(name, "human", at, colour, human=body.spec())
    raise EmbodimentError(f"{body.name!r} is neither a human nor a robot; the page cannot draw it")
