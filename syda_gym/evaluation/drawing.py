"""Pictures of bodies side by side, drawn in numpy: the same solids and light as in the report's playback.

The camera is orthographic, so that bodies keep their relative sizes. Each solid is intersected with the rays of the
pixels in its bounding box, and a depth buffer keeps the nearest.
"""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError, nearest_name
from syda_gym.evaluation.report.figures import Shape, Track
from syda_gym.files import atomic_path
from syda_gym.look import GROUNDS, LIGHT_FROM

__all__ = ["draw", "png_bytes", "write_png"]

Image = NDArray[np.uint8]

_SPACING = 1.35  # m between bodies
_SUN = np.array(LIGHT_FROM) / np.linalg.norm(LIGHT_FROM)


def draw(
    tracks: Sequence[Track],
    frame: int,
    *,
    labels: Sequence[str] = (),
    title: str = "",
    size: tuple[int, int] = (960, 540),
    turn: float = 0.35,
    finer: int = 2,
    ground: str = "day",
    letters: int | None = None,
) -> Image:
    """Draws bodies side by side at one frame.

    Args:
        tracks: bodies, left to right.
        frame: index into them; a shorter track shows its last frame.
        labels: text below each body; its name if there are none.
        title: text at the top.
        size: width and height [pixels], even numbers.
        turn: how far the camera stands to the side [rad].
        finer: pixels are drawn this much finer and averaged; 1 is four times as fast and has jagged edges.
        ground: one of ``look.GROUNDS``: ``day`` for light pages, ``night`` for dark ones, ``dusk`` for both.
        letters: height of words [pixels]; by default a 32nd of the picture's, at least 12. A label may have lines.

    Returns:
        ``(height, width, 3)`` uint8.

    Raises:
        OptionError: no body, a size that is not positive and even, or an unknown ground.
    """
    if not tracks or min(size) < 16 or size[0] % 2 or size[1] % 2:
        raise OptionError(f"draw needs at least one body and an even size, got {len(tracks)} bodies and {size}")
    if ground not in GROUNDS:
        raise OptionError(f"unknown ground {ground!r}; {nearest_name(ground, GROUNDS)}")
    stage = GROUNDS[ground]
    width, height = size[0] * finer, size[1] * finer
    tall = max(track.height for track in tracks) + 0.35
    span = _SPACING * len(tracks) + 0.4
    scale = min(height / (tall + 0.25), width / span)  # pixels a metre
    camera = _camera(turn, 0.16)
    colour = _ground(width, height, stage.sky_top, stage.floor)
    depth = np.full((height, width), -np.inf)
    for index, track in enumerate(tracks):
        shift = np.array([0.0, (index - (len(tracks) - 1) / 2) * _SPACING, 0.0])
        _shadow(colour, track, shift, scale, camera)
        for shape, rotation, centre, size_ in _solids(track, min(frame, len(track) - 1)):
            _paint(colour, depth, shape, camera @ rotation, camera @ (centre + shift), size_, scale, camera)
    fine = (255.0 * np.clip(colour, 0.0, 1.0)).reshape(size[1], finer, size[0], finer, 3).mean(axis=(1, 3))
    image: Image = np.rint(fine).astype(np.uint8)
    places = [
        _pixel(camera @ np.array([0.3, (i - (len(tracks) - 1) / 2) * _SPACING, 0.0]), width, height, scale)
        for i in range(len(tracks))
    ]
    places = [(x / finer, y / finer) for x, y in places]
    return _write_words(image, places, labels or [track.name for track in tracks], title, stage.ink, letters)


def write_png(image: Image, path: str | os.PathLike[str]) -> Path:
    """Writes a picture atomically.

    Raises:
        StorageError: the folder cannot be written.
    """
    from PIL import Image as Pillow

    with atomic_path(path) as temporary:
        Pillow.fromarray(image).save(temporary, format="PNG", optimize=True)
    return Path(path)


def png_bytes(image: Image) -> bytes:
    """The picture as the bytes of a PNG file."""
    from PIL import Image as Pillow

    buffer = io.BytesIO()
    Pillow.fromarray(image).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def _camera(yaw: float, pitch: float) -> FloatArray:
    """Rotation from body axes (x to the viewer, y right, z up) to right, up, towards the viewer."""
    toward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    right = np.cross([0.0, 0.0, 1.0], toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])


def _pixel(point: FloatArray, width: int, height: int, scale: float) -> tuple[float, float]:
    return width / 2 + scale * float(point[0]), height * 0.87 - scale * float(point[1])


def _ground(width: int, height: int, sky: Sequence[float], floor: Sequence[float]) -> FloatArray:
    colour = np.broadcast_to(np.array(sky), (height, width, 3)).copy()
    horizon = int(height * 0.70)
    fade = np.linspace(0.0, 1.0, height - horizon)[:, None, None]
    colour[horizon:] = np.array(sky) + np.minimum(1.0, 2.5 * fade) * (np.array(floor) - np.array(sky))
    return colour


def _shadow(colour: FloatArray, track: Track, shift: FloatArray, scale: float, camera: FloatArray) -> None:
    height, width = colour.shape[:2]
    x0, y0 = _pixel(camera @ shift, width, height, scale)
    radius = 0.19 * track.height * scale
    rows, columns = np.ogrid[:height, :width]
    distance = ((columns - x0) / radius) ** 2 + ((rows - y0) / (0.30 * radius)) ** 2
    colour *= (1.0 - 0.28 * np.exp(-1.6 * distance))[:, :, None]


def _solids(track: Track, frame: int) -> list[tuple[Shape, FloatArray, FloatArray, tuple[float, ...]]]:
    """Every solid with its rotation, centre and size; a bone becomes a cylinder and two spheres."""
    from scipy.spatial.transform import Rotation

    result: list[tuple[Shape, FloatArray, FloatArray, tuple[float, ...]]] = []
    eye = np.eye(3)
    for shape in track.shapes:
        if shape.kind == "bone":
            start, end = (track.points[frame, p] for p in shape.points)
            radius, length = shape.size[0], float(np.linalg.norm(end - start))
            ball = Shape("sphere", (radius,), shape.colour)
            result += [(ball, eye, start, (radius,)), (ball, eye, end, (radius,))]
            if length > 1e-6:
                rod = Shape("cylinder", (radius, length), shape.colour)
                result.append((rod, _towards((end - start) / length), (start + end) / 2, (radius, length)))
            continue
        rotation, position = Rotation.from_quat(shape.rotation).as_matrix(), np.array(shape.position)
        if shape.pose >= 0:
            pose = track.poses[frame, shape.pose]
            carrier = Rotation.from_quat(pose[3:]).as_matrix()
            rotation, position = carrier @ rotation, carrier @ position + pose[:3]
        result.append((shape, rotation, position, shape.size))
    return result


def _towards(direction: FloatArray) -> FloatArray:
    """A rotation whose z axis is ``direction``."""
    side = np.cross(direction, [1.0, 0.0, 0.0] if abs(direction[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(direction, side), direction], axis=1)


def _paint(
    colour: FloatArray,
    depth: FloatArray,
    shape: Shape,
    rotation: FloatArray,
    centre: FloatArray,
    size: tuple[float, ...],
    scale: float,
    camera: FloatArray,
) -> None:
    """Draws one solid; rotation and centre are in camera axes."""
    height, width = depth.shape
    half = _half_sides(shape.kind, size)
    reach = np.abs(rotation) @ half if shape.kind != "sphere" else half
    x0, y0 = _pixel(centre, width, height, scale)
    left, right = max(0, int(x0 - scale * reach[0])), min(width, int(x0 + scale * reach[0]) + 2)
    top, bottom = max(0, int(y0 - scale * reach[1])), min(height, int(y0 + scale * reach[1]) + 2)
    if left >= right or top >= bottom:
        return
    x = (np.arange(left, right)[None, :] + 0.5 - x0) / scale
    y = -(np.arange(top, bottom)[:, None] + 0.5 - y0) / scale
    x, y = np.broadcast_arrays(x, y)
    z, normal = _INTERSECT[shape.kind](x, y, rotation, size)
    with np.errstate(invalid="ignore"):
        nearer = z + centre[2] > depth[top:bottom, left:right]
    if not nearer.any():
        return
    sun, up = camera @ _SUN, camera[:, 2]
    light = 0.52 + 0.14 * (normal @ up) + 0.42 * np.maximum(normal @ sun, 0.0)
    shine = sun + np.array([0.0, 0.0, 1.0])
    glint = 0.16 * np.maximum(normal @ (shine / np.linalg.norm(shine)), 0.0) ** 28
    lit = np.array(shape.colour) * light[:, :, None] + glint[:, :, None]
    colour[top:bottom, left:right][nearer] = lit[nearer]
    depth[top:bottom, left:right][nearer] = (z + centre[2])[nearer]


def _half_sides(kind: str, size: tuple[float, ...]) -> FloatArray:
    """Half sides of the box around a solid, in its own axes."""
    if kind == "sphere":
        return np.full(3, size[0])
    return np.array([size[0], size[0], size[1] / 2]) if kind == "cylinder" else np.array(size) / 2


def _hit_sphere(
    x: FloatArray, y: FloatArray, rotation: FloatArray, size: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    with np.errstate(invalid="ignore"):
        z = np.sqrt(size[0] ** 2 - x**2 - y**2)
    return z, np.stack([x, y, z], axis=-1) / size[0]


def _hit_cylinder(
    x: FloatArray, y: FloatArray, rotation: FloatArray, size: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Rays along -z against the mantle and the caps, in the cylinder's own frame."""
    radius, half = size[0], size[1] / 2
    origin = np.stack([x, y, np.zeros_like(x)], axis=-1) @ rotation  # rotation.T applied to rows
    ray = rotation[2]  # the viewer's direction in the solid's frame
    with np.errstate(invalid="ignore", divide="ignore"):
        a = ray[0] ** 2 + ray[1] ** 2
        b = origin[..., 0] * ray[0] + origin[..., 1] * ray[1]
        c = origin[..., 0] ** 2 + origin[..., 1] ** 2 - radius**2
        side = (-b + np.sqrt(b**2 - a * c)) / a
        at = origin[..., 2] + side * ray[2]
        side = np.where(np.abs(at) <= half, side, np.nan)
        cap = (np.sign(ray[2]) * half - origin[..., 2]) / ray[2]
        flat = (origin[..., 0] + cap * ray[0]) ** 2 + (origin[..., 1] + cap * ray[1]) ** 2
        cap = np.where(flat <= radius**2, cap, np.nan)
    z = np.fmax(side, cap)
    on_cap = cap >= np.where(np.isnan(side), -np.inf, side)
    point = origin + z[..., None] * ray
    normal = np.where(
        on_cap[..., None],
        np.array([0.0, 0.0, np.sign(ray[2])]),
        np.stack([point[..., 0], point[..., 1], np.zeros_like(z)], axis=-1) / radius,
    )
    return z, normal @ rotation.T


def _hit_box(
    x: FloatArray, y: FloatArray, rotation: FloatArray, size: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Rays along -z against the three slabs of a box."""
    half = np.array(size) / 2
    origin = np.stack([x, y, np.zeros_like(x)], axis=-1) @ rotation
    ray = np.where(np.abs(rotation[2]) < 1e-9, 1e-9, rotation[2])
    far = (np.sign(ray) * half - origin) / ray  # where the ray leaves each slab on the viewer's side
    near = (-np.sign(ray) * half - origin) / ray
    z = far.min(axis=-1)
    axis = far.argmin(axis=-1)
    z = np.where(near.max(axis=-1) <= z, z, np.nan)
    normal = np.sign(ray) * (np.arange(3) == axis[..., None])
    return z, normal @ rotation.T


_INTERSECT = {"sphere": _hit_sphere, "cylinder": _hit_cylinder, "box": _hit_box}


def _write_words(
    image: Image,
    places: list[tuple[float, float]],
    labels: Sequence[str],
    title: str,
    colour: Sequence[float],
    letters: int | None,
) -> Image:
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    picture = Pillow.fromarray(image)
    pen = ImageDraw.Draw(picture)
    ink = tuple(round(255 * part) for part in colour)
    font = ImageFont.load_default(size=letters or max(12, image.shape[0] // 32))
    for (x, y), label in zip(places, labels, strict=True):
        pen.text((x, y + image.shape[0] // 60), label, fill=ink, font=font, anchor="ma", align="center")
    if title:
        pen.text((image.shape[1] // 60, image.shape[0] // 40), title, fill=ink, font=font)
    return np.asarray(picture)
