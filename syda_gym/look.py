"""Look: the colours, the ground and the light that every picture shares, be it a plot, a render, a film or a page."""

from __future__ import annotations

from typing import Any, NamedTuple

__all__ = [
    "COMMAND",
    "GROUND",
    "GROUNDS",
    "LEFT",
    "LIGHT_AMBIENT",
    "LIGHT_DIFFUSE",
    "LIGHT_FROM",
    "LIGHT_SPECULAR",
    "NIGHT_GROUND",
    "NIGHT_SKY",
    "OPERATOR",
    "PERSON",
    "REFERENCE",
    "RIGHT",
    "ROBOT",
    "ROBOT_SHELL",
    "SKY_BOTTOM",
    "SKY_TOP",
    "Ground",
    "hex_of",
    "plot_theme",
    "rgb",
    "rgba",
]

Colour = tuple[float, float, float]

OPERATOR = "#d9762b"
"""Whoever leads: plots, paths, the shirt of the figure."""
ROBOT = "#2f6fde"
"""The robot as it is: plots and paths; in renders it wears its own colours."""
REFERENCE = "#8257c9"
"""Where the robot should be: plots, and the ghost in renders."""
COMMAND = "#2a9d6f"
"""What was commanded, where it is told from both."""
LEFT, RIGHT = "#c44e52", "#4c72b0"
"""A body's left and right arm, where arms are told apart."""

GROUND: Colour = (0.80, 0.82, 0.85)
SKY_TOP: Colour = (0.97, 0.98, 1.0)
SKY_BOTTOM: Colour = (0.86, 0.89, 0.94)
NIGHT_SKY: Colour = (0.098, 0.125, 0.165)
NIGHT_GROUND: Colour = (0.16, 0.20, 0.25)
"""The same on dark pages."""


class Ground(NamedTuple):
    """What bodies stand on and before, and the colour of words on it."""

    sky_top: Colour
    sky_bottom: Colour
    floor: Colour
    ink: Colour


GROUNDS = {
    "day": Ground(SKY_TOP, SKY_BOTTOM, GROUND, (0.16, 0.19, 0.24)),
    "night": Ground(NIGHT_SKY, NIGHT_SKY, NIGHT_GROUND, (0.88, 0.91, 0.94)),
    "dusk": Ground((0.31, 0.36, 0.44), (0.42, 0.47, 0.55), (0.37, 0.41, 0.48), (0.97, 0.98, 1.0)),
}
"""Grounds by name: for light pages, for dark ones, and one for films and pictures that stand on both."""
LIGHT_FROM = (1.5, 0.9, 2.2)
"""Where the light stands: before the scene, to its left, above."""
LIGHT_AMBIENT, LIGHT_DIFFUSE, LIGHT_SPECULAR = 0.62, 0.40, 0.06
ROBOT_SHELL: Colour = (0.85, 0.85, 0.87)
"""Parts of a robot whose URDF names no colour."""

PERSON: dict[str, Colour] = {
    "skin": (0.91, 0.73, 0.60),
    "shirt": (0.85, 0.46, 0.17),  # OPERATOR
    "strip": (0.98, 0.93, 0.86),
    "trousers": (0.27, 0.31, 0.40),
    "shoes": (0.16, 0.18, 0.22),
    "hair": (0.24, 0.17, 0.13),
    "eyes": (0.10, 0.11, 0.14),
}
"""What the figure of a person wears."""


def plot_theme(ground: str = "day") -> dict[Any, Any]:
    """Matplotlib's settings for plots.

    Args:
        ground: ``"day"`` is white, ``"night"`` the report's dark card, ``"dusk"`` has no ground at all and letters that
            can be read on white and on black.

    Returns:
        A dictionary as ``matplotlib.rc_context`` takes it.
    """
    if ground == "day":
        return {"figure.facecolor": "white"}
    # Ink, softer lines, ground, grid and the panes of boxes in space; dark ones as in the report's style sheet.
    ink, soft, card, grid, pane = {
        "night": ("#e6ebf2", "#9aa7b8", "#19202a", "#3a4656", (0.14, 0.18, 0.23, 0.6)),
        "dusk": ("#76808d", "#76808d", "none", "#8a94a1", (0.5, 0.55, 0.6, 0.10)),
    }[ground]
    names = ("text.color", "axes.labelcolor", "axes.titlecolor", "xtick.color", "ytick.color")
    panes = {f"axes3d.{axis}axis.panecolor": pane for axis in "xyz"}
    return {
        **dict.fromkeys(names, ink), **panes, "axes.edgecolor": soft, "figure.facecolor": card, "axes.facecolor": card,
        "savefig.facecolor": card, "legend.facecolor": card, "legend.edgecolor": soft, "grid.color": grid,
    }  # fmt: skip


def rgb(colour: str) -> Colour:
    """Red, green and blue in 0..1 of ``#rrggbb``."""
    red, green, blue = (int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5))
    return red, green, blue


def rgba(colour: str, opacity: float = 1.0) -> tuple[float, float, float, float]:
    """The same with an opacity behind."""
    return (*rgb(colour), opacity)


def hex_of(colour: Colour) -> str:
    """``#rrggbb`` of red, green and blue in 0..1."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in colour)
