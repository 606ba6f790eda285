"""Look: the colours, the ground and the light that every picture shares, be it a plot, a render, a film or a page."""

from __future__ import annotations

__all__ = [
    "COMMAND",
    "GROUND",
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
    "hex_of",
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
