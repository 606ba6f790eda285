"""read_shapes: the visual and collision shapes of links, with the files of their meshes; and their corners."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.reading.meshes import find_mesh
from syda_gym.embodiments.reading.parts import Shape

__all__ = ["corners", "placement_of", "read_shapes"]

FloatArray = NDArray[np.float64]

_SIZES = {"box": (("size", 3),), "sphere": (("radius", 1),), "cylinder": (("radius", 1), ("length", 1)),
          "capsule": (("radius", 1), ("length", 1))}  # fmt: skip
_PLAIN_MESHES = (".stl", ".obj", ".dae", ".ply", ".off", ".glb")
_MOST_MESH_BYTES = 24 * 2**20  # a larger mesh would take seconds to read
_RING = 8
_DIRECTIONS = 128  # in which the farthest corners of a mesh are kept


def read_shapes(links: Mapping[str, Any], path: Path, root: Any) -> dict[str, tuple[Shape, ...]]:
    """Shapes by link; those whose numbers are none are left out.

    Args:
        links: link elements by name.
        path: the URDF, beside which meshes are looked for.
        root: the element ``<robot>``, whose materials the shapes name.
    """
    colors = {m.get("name"): _color(m) for m in root.findall("material") if _color(m) is not None}
    # Materials may be defined in any link and used in another.
    for element in root.iter("material"):
        if _color(element) is not None:
            colors.setdefault(element.get("name"), _color(element))
    return {
        name: tuple(
            shape
            for role in ("visual", "collision")
            for element in link.findall(role)
            if (shape := _shape(role, element, path, colors)) is not None
        )
        for name, link in links.items()
    }


def _shape(role: str, element: Any, path: Path, colors: Mapping[Any, Any]) -> Shape | None:
    geometry = element.find("geometry")
    inner = None if geometry is None else next((c for c in geometry if isinstance(c.tag, str)), None)
    placement = placement_of(element)
    if inner is None or placement is None:
        return None
    material = element.find("material")
    color = None if material is None else _color(material) or colors.get(material.get("name"))
    if inner.tag == "mesh":
        scale = _floats(inner.get("scale", "1 1 1"))
        scale = scale * 3 if len(scale) == 1 else scale
        address = inner.get("filename", "")
        if len(scale) != 3 or not address:
            return None
        return Shape(role, "mesh", tuple(scale), placement, find_mesh(address, path), color)
    if inner.tag not in _SIZES:
        return None
    size = [value for key, _ in _SIZES[inner.tag] for value in _floats(inner.get(key, ""))]
    wanted = sum(count for _, count in _SIZES[inner.tag])
    if len(size) != wanted or not all(value >= 0.0 for value in size) or max(size) <= 0.0:
        return None
    return Shape(role, str(inner.tag), tuple(size), placement, None, color)


def placement_of(element: Any) -> FloatArray | None:
    """Homogeneous transform ``(4, 4)`` of an element's ``<origin>``; ``None`` if its numbers are none."""
    origin = element.find("origin")
    place = np.eye(4)
    if origin is None:
        return place
    xyz, rpy = _floats(origin.get("xyz", "0 0 0")), _floats(origin.get("rpy", "0 0 0"))
    if len(xyz) != 3 or len(rpy) != 3:
        return None
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    place[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    place[:3, 3] = xyz
    return place


def corners(shape: Shape) -> FloatArray:
    """Points whose convex hull is about the shape's, ``(N, 3)`` [m] in the link's frame; none of a missing mesh."""
    if shape.kind == "mesh":
        if shape.mesh is None:
            return np.zeros((0, 3))
        points = _mesh_corners(shape.mesh) * np.array(shape.size)
    elif shape.kind == "box":
        signs = np.array(np.meshgrid((-1, 1), (-1, 1), (-1, 1))).reshape(3, -1).T
        points = 0.5 * signs * np.array(shape.size)
    elif shape.kind == "sphere":
        points = shape.size[0] * _sphere()
    else:
        radius, length = shape.size
        angles = np.linspace(0.0, 2.0 * np.pi, _RING, endpoint=False)
        ring = radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(_RING)], axis=1)
        end = 0.5 * length + (radius if shape.kind == "capsule" else 0.0)
        points = np.concatenate([ring + np.array([0.0, 0.0, end]), ring - np.array([0.0, 0.0, end])])
    moved: FloatArray = points @ shape.placement[:3, :3].T + shape.placement[:3, 3]
    return moved


@lru_cache(maxsize=512)
def _mesh_corners(path: Path) -> FloatArray:
    """Corners of a mesh's convex hull, or of its box where it has none."""
    if path.stat().st_size > _MOST_MESH_BYTES:
        return np.zeros((0, 3))
    try:
        points = _read_mesh(path)
    except Exception:  # each of the mesh formats has its own ways to be broken
        return np.zeros((0, 3))
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) > 2 * _DIRECTIONS:
        # The farthest points in many directions are the hull's corners but for details, in a hundredth of the time.
        ways = _sphere(_DIRECTIONS)
        points = points[np.unique(np.concatenate([np.argmax(points @ part.T, axis=0) for part in np.split(ways, 8)]))]
    return points


def _read_mesh(path: Path) -> FloatArray:
    content = path.read_bytes()
    if path.suffix.lower() == ".stl" and len(content) >= 84:
        count = int.from_bytes(content[80:84], "little")
        if len(content) == 84 + 50 * count:  # a binary one, read at once instead of by a library in seconds
            rows = np.frombuffer(content, dtype=np.uint8, offset=84).reshape(count, 50)[:, 12:48]
            found = np.ascontiguousarray(rows).view("<f4").reshape(-1, 3).astype(np.float64)
            return found
    if path.suffix.lower() not in _PLAIN_MESHES:  # archives unpack to anything
        raise ValueError(f"{path.suffix} is no mesh")
    import trimesh

    # From memory: a mesh that names further files, materials or pictures, gets none of them.
    loaded = trimesh.load(io.BytesIO(content), file_type=path.suffix[1:].lower(), force="mesh", process=False)
    return np.asarray(loaded.vertices, dtype=np.float64)


@lru_cache(maxsize=2)
def _sphere(count: int = 32) -> FloatArray:
    """Directions spread evenly, a Fibonacci lattice."""
    turns = np.arange(count) * np.pi * (3.0 - math.sqrt(5.0))
    z = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(turns), flat * np.sin(turns), z], axis=1)


def _floats(text: str) -> list[float]:
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        return []
    return values if all(math.isfinite(value) for value in values) else []


def _color(element: Any) -> tuple[float, float, float, float] | None:
    part = element.find("color")
    values = [] if part is None else _floats(part.get("rgba", ""))
    if len(values) != 4:
        return None
    return (values[0], values[1], values[2], values[3])
