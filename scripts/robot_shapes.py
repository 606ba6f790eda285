"""Shapes of the bundled robots: how they are described, and how Pepper and NAO look.

Spheres, cylinders and boxes only, which every URDF reader understands; no vendor mesh may be shipped.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

COLORS = {
    "white": (0.88, 0.88, 0.89, 1.0),
    "grey": (0.62, 0.64, 0.67, 1.0),
    "dark": (0.10, 0.10, 0.12, 1.0),
    "glass": (0.16, 0.20, 0.27, 1.0),
    "blue": (0.30, 0.66, 0.95, 1.0),
    "red": (0.82, 0.25, 0.16, 1.0),
}
Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Shape:
    """A sphere (radius), a cylinder (radius, length along z) or a box (size) placed in a link frame."""

    kind: str
    size: tuple[float, ...]
    xyz: Vector
    rpy: Vector = ZERO
    color: str = "white"

    def moved(self, shift: Sequence[float]) -> Shape:
        """The same shape, ``shift`` metres away."""
        return replace(self, xyz=add(self.xyz, shift))

    def mirrored(self) -> Shape:
        """The same shape on the other side of the plane y = 0."""
        (x, y, z), (roll, pitch, yaw) = self.xyz, self.rpy
        return replace(self, xyz=(x, -y, z), rpy=(-roll, pitch, -yaw))


def add(a: Sequence[float], b: Sequence[float]) -> Vector:
    """The sum of two vectors as a plain tuple."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def ball(color: str, center: Vector, radius: float) -> list[Shape]:
    """A sphere."""
    return [Shape("sphere", (radius,), center, color=color)]


def block(color: str, center: Vector, size: Vector, pitch: float = 0.0) -> list[Shape]:
    """A box, turned about y."""
    return [Shape("box", size, center, (0.0, pitch, 0.0), color)]


def rod(color: str, start: Sequence[float], end: Sequence[float], radius: float, caps: int = 0) -> list[Shape]:
    """A cylinder between two points, rounded by a sphere at the end (``caps=1``) or at both (``caps=2``)."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    pitch = math.atan2(math.hypot(along[0], along[1]), along[2])
    yaw = math.atan2(along[1], along[0])
    center = add(0.5 * np.asarray(start), 0.5 * np.asarray(end))
    spheres = [Shape("sphere", (radius,), add(point, ZERO), color=color) for point in (end, start)[:caps]]
    return [Shape("cylinder", (radius, length), center, (0.0, pitch, yaw), color), *spheres]


def lathe(color: str, profile: Sequence[Vector], slices: int) -> list[Shape]:
    """A turned body: stacked discs through rows of (x of the centre, z, radius), from top to bottom."""
    x, z, radius = np.transpose(profile)
    shapes = []
    for top, bottom in itertools.pairwise(np.linspace(z[0], z[-1], slices + 1)):
        # np.interp wants an ascending abscissa, z descends.
        at = -(top + bottom) / 2
        center, r = float(np.interp(at, -z, x)), float(np.interp(at, -z, radius))
        shapes += rod(color, (center, 0.0, bottom), (center, 0.0, top), r)
    return shapes


def tapered(color: str, top: Vector, bottom: Vector, radius: float, caps: int = 2) -> list[Shape]:
    """Three rods that lean towards each other: a flat body, wider above than below."""
    shapes = []
    for side in (-1.0, 0.0, 1.0):
        ends = [(x, side * y, z) for x, y, z in (top, bottom)]
        shapes += rod(color, *ends, radius, caps)
    return shapes


def disc(color: str, center: Vector, toward: Vector, start: float, end: float, radius: float) -> list[Shape]:
    """A disc on a round surface: from ``start`` to ``end`` metres from its centre, ``toward`` a point."""
    way = np.subtract(toward, center)
    way = way / np.linalg.norm(way)
    return rod(color, np.asarray(center) + start * way, np.asarray(center) + end * way, radius)


def pill(color: str, center: Vector, half_width: float, radius: float) -> list[Shape]:
    """A capsule that lies along y: shoulders, belly, hips."""
    x, y, z = center
    return rod(color, (x, y - half_width, z), (x, y + half_width, z), radius, caps=2)


def from_table(row: Mapping[str, Any]) -> list[Shape]:
    """The shapes of one row of the tables; a capsule, which most URDF readers do not know, becomes three."""
    color = row["color"]
    if row["shape"] == "capsule":
        return rod(color, row["p0"], row["p1"], row["radius"], caps=2)
    size = {"sphere": ("radius",), "cylinder": ("radius", "length")}.get(row["shape"])
    dimensions = tuple(row[key] for key in size) if size else tuple(row["size"])
    return [Shape(row["shape"], dimensions, add(row["center"], ZERO), add(row.get("rpy", ZERO), ZERO), color)]


def right_of(link: str) -> str:
    """The right-hand name of a left-hand link."""
    return "R" + link[1:] if link[0] == "L" else "r" + link[1:]


def with_right_side(shapes: dict[str, list[Shape]]) -> dict[str, list[Shape]]:
    """Adds the mirrored right arm and leg to shapes that hold the left ones."""
    left = [link for link in shapes if link.startswith("L") or link.startswith("l_")]
    return shapes | {right_of(link): [shape.mirrored() for shape in shapes[link]] for link in left}


def fingers(knuckles: Vector, size: Vector, curl: float) -> list[Shape]:
    """Four half-open fingers as one plate with round tips, for a picture's time goes with the number of its shapes.

    Args:
        knuckles: the middle of the row of knuckles.
        size: length, width and thickness.
        curl: how far they point down [rad].
    """
    length, width, thickness = size
    along = (math.cos(curl), 0.0, -math.sin(curl))
    middle, tip = (add(knuckles, tuple(share * length * value for value in along)) for share in (0.5, 1.0))
    plate = block("grey", middle, (length, width, thickness), curl)
    ends = [add(tip, (0.0, side * width / 2, 0.0)) for side in (-1.0, 1.0)]
    return plate + rod("grey", *ends, thickness / 2)


def both_sides(shapes: list[Shape]) -> list[Shape]:
    """The shapes and their mirror images."""
    return shapes + [shape.mirrored() for shape in shapes]


# What the robots look like: link frames of the vendor, metres.


def round_eye(skull: Vector, skull_radius: float, eye: Vector, radius: float) -> list[Shape]:
    """A dark eye with a ring of light, set into a round head."""
    rings = [("dark", 1.0), ("blue", 0.76), ("dark", 0.60)]
    shapes = []
    for depth, (color, share) in enumerate(rings, start=1):
        shapes += disc(color, skull, eye, 0.85 * skull_radius, skull_radius + 0.0015 * depth, share * radius)
    glint = add(eye, (0.0, -0.15 * radius, 0.25 * radius))
    return shapes + disc("white", skull, glint, 0.85 * skull_radius, skull_radius + 0.006, 0.13 * radius)


def fender(wheel: Vector) -> list[Shape]:
    """A wheel of Pepper and the dome over it."""
    x, y, _ = wheel
    return rod("white", (x, y, -0.300), (x, y, -0.238), 0.074, caps=1) + ball("dark", wheel, 0.070)


def pepper_looks() -> dict[str, list[Shape]]:
    """Pepper's shells, finer than the shapes that collide."""
    tilt = -0.523599
    skull, skull_radius = (-0.002, 0.0, 0.118), 0.0995
    eye = round_eye(skull, skull_radius, (0.083, 0.041, 0.117), 0.027)
    ear = rod("grey", (0.0, 0.085, 0.122), (0.0, 0.102, 0.122), 0.036)
    ear += rod("white", (0.0, 0.085, 0.122), (0.0, 0.106, 0.122), 0.026)
    skirt = [
        (-0.004, -0.020, 0.082),
        (-0.015, -0.070, 0.086),
        (-0.032, -0.112, 0.100),
        (-0.040, -0.145, 0.128),
        (-0.040, -0.175, 0.164),
    ]
    skirt += [(-0.036, -0.200, 0.196), (-0.034, -0.218, 0.210), (-0.034, -0.300, 0.216)]
    wheels = [(0.09, 0.155, -0.264), (0.09, -0.155, -0.264), (-0.17, 0.0, -0.264)]
    return with_right_side(
        {
            "torso": pill("white", (-0.041, 0, 0.080), 0.056, 0.086)
            + tapered("white", (-0.031, 0.050, 0.058), (-0.004, 0.004, -0.050), 0.075)
            + rod("white", (-0.038, 0, 0.150), (-0.038, 0, 0.172), 0.044)
            + rod("grey", (0, 0, -0.112), (0, 0, -0.138), 0.056)
            + block("white", (0.060, 0, 0.050), (0.075, 0.085, 0.085), tilt)
            + block("grey", (0.0960, 0, 0.0551), (0.017, 0.246, 0.191), tilt)
            + block("dark", (0.1030, 0, 0.0591), (0.006, 0.238, 0.183), tilt)
            + block("glass", (0.1062, 0, 0.0609), (0.003, 0.212, 0.146), tilt),
            "Neck": rod("grey", (0, 0, -0.027), (0, 0, 0.035), 0.033),
            "Head": ball("white", skull, skull_radius)
            + pill("white", (0.020, 0, 0.088), 0.014, 0.072)
            + both_sides(eye + ear)
            + disc("dark", (0.020, 0, 0.088), (0.10, 0, 0.0600), 0.06, 0.0735, 0.0085)
            + disc("dark", skull, (0.086, 0, 0.163), 0.09, 0.1005, 0.0065),
            "LShoulder": ball("white", ZERO, 0.045) + rod("grey", (0, -0.04, 0), (0, -0.02, 0), 0.043),
            # Ends that lie inside the next shape need no caps.
            "LBicep": rod("white", (0.008, 0.009, 0), (0.138, 0.017, 0), 0.0395, caps=1),
            "LElbow": ball("grey", ZERO, 0.0325),
            "LForeArm": rod("white", (0.010, 0.001, 0), (0.092, 0, 0), 0.0345),
            "l_wrist": rod("white", (-0.062, -0.001, 0), (0.020, -0.002, 0), 0.0325)
            + ball("white", (0.036, -0.001, 0.001), 0.0345)
            + fingers((0.058, 0.0, 0.004), (0.060, 0.066, 0.017), 0.85)
            + rod("grey", (0.046, -0.034, -0.016), (0.066, -0.031, -0.045), 0.009, caps=1),
            "Hip": rod("grey", (0, 0, 0.035), (0, 0, -0.03), 0.050),
            "Pelvis": tapered("white", (0.007, 0.046, -0.008), (0.012, 0.034, -0.185), 0.074)
            + pill("white", (0.007, 0, -0.205), 0.030, 0.064)
            + pill("grey", (0, 0, -0.258), 0.036, 0.046),
            "Tibia": lathe("white", skirt, 22) + [shape for wheel in wheels for shape in fender(wheel)],
        }
    )


def nao_looks() -> dict[str, list[Shape]]:
    """NAO's shells, finer than the shapes that collide."""
    skull, skull_radius = (-0.002, 0.0, 0.055), 0.063
    eye = round_eye(skull, skull_radius, (0.050, 0.027, 0.058), 0.0150)
    ear = rod("grey", (0, 0.050, 0.055), (0, 0.068, 0.055), 0.025)
    ear += rod("white", (0, 0.050, 0.055), (0, 0.0705, 0.055), 0.016)
    return with_right_side(
        {
            "torso": tapered("white", (0.0, 0.044, 0.065), (0.0, 0.012, -0.022), 0.048)
            + block("grey", (0, 0, -0.070), (0.076, 0.096, 0.045))
            + disc("grey", (0.002, 0, 0.047), (0.1, 0, 0.047), 0.04, 0.0560, 0.014)
            + disc("blue", (0.002, 0, 0.047), (0.1, 0, 0.047), 0.04, 0.0575, 0.009)
            + both_sides(rod("red", (0.0, 0.058, 0.096), (0.0, 0.080, 0.088), 0.022, caps=2)),
            "Neck": rod("grey", (0, 0, -0.035), (0, 0, 0.010), 0.022),
            "Head": ball("white", skull, skull_radius)
            + pill("white", (0.008, 0, 0.038), 0.016, 0.046)
            + both_sides(eye + ear)
            + rod("red", (-0.022, 0, 0.110), (0.014, 0, 0.111), 0.010, caps=2)
            + disc("dark", skull, (0.052, 0, 0.086), 0.05, 0.0640, 0.0055)
            + disc("dark", (0.008, 0, 0.038), (0.052, 0, 0.026), 0.04, 0.0470, 0.0055),
            "LShoulder": ball("grey", ZERO, 0.030),
            "LBicep": ball("white", (0.004, 0.006, 0), 0.033)
            + rod("white", (0.015, 0.006, 0), (0.078, 0.013, 0), 0.028, caps=2),
            "LElbow": ball("grey", ZERO, 0.025),
            "LForeArm": rod("white", (0.02, 0.001, 0), (0.045, 0, 0), 0.026, caps=2),
            "l_wrist": rod("white", (0.0, 0, 0), (0.030, 0, 0), 0.025, caps=2)
            + pill("white", (0.055, 0, 0), 0.010, 0.020)
            + fingers((0.066, 0.0, 0.001), (0.036, 0.040, 0.014), 0.79)
            + rod("grey", (0.048, -0.024, -0.006), (0.068, -0.026, -0.026), 0.007, caps=1),
            "LPelvis": ball("grey", ZERO, 0.030),
            "LHip": ball("grey", ZERO, 0.034),
            "LThigh": rod("white", (0.004, 0.002, -0.018), (0.006, 0.002, -0.078), 0.038, caps=2),
            "LTibia": ball("grey", ZERO, 0.033)
            + rod("white", (0.004, 0.002, -0.030), (0.004, 0.002, -0.080), 0.034, caps=2),
            "LAnklePitch": ball("grey", ZERO, 0.026),
            "l_ankle": block("white", (0.028, 0.003, -0.033), (0.160, 0.088, 0.0242))
            + block("white", (0.020, 0.003, -0.017), (0.110, 0.070, 0.010))
            + pill("white", (0.010, 0.003, -0.012), 0.016, 0.024),
        }
    )
