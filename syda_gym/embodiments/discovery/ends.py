"""arm_end: where an arm ends that a file names no end of: at a tool, at the end of its last link's shape, or mass."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.discovery.lines import Line
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.urdf import UrdfTree
from syda_gym.embodiments.reading.shapes import corners

__all__ = ["ArmEnd", "arm_end"]

_TIP = re.compile(r"tool|tcp|tip|ee($|_)|eef|endpoint|end_effector|gripper|palm|hand|grasp|flange", re.I)
_SENSOR = re.compile(
    r"cam|imu|force|sensor|optical|marker|light|accelero|range|itb|virtual|collision|shape|skin|(^|_)ft($|_)", re.I
)
_FINGER = re.compile(r"finger|thumb", re.I)
_NEAR = 0.025  # m; a link that ends nearer to the last joint than this says nothing about where the arm ends


_MOST = 0.8  # of the way from the root; what a last joint moves is not longer than that


@dataclass(frozen=True, eq=False)
class ArmEnd:
    """Where an arm ends.

    Attributes:
        link: that carries the end.
        offset: in the link's frame ``(3,)`` [m].
        place: at the zero pose, in the root's frame ``(3,)`` [m].
        source: ``link``, ``shape``, ``mass``, or ``none`` where nothing reaches beyond the last joint.
    """

    link: str
    offset: FloatArray
    place: FloatArray
    source: str


def arm_end(tree: UrdfTree, placements: dict[str, FloatArray], last: str, axis: Line) -> ArmEnd:
    """The end of the arm whose last joint moves the link ``last`` about ``axis``.

    A link fixed behind it that is called a tool, palm or hand, or the farthest that is fixed there; else the far end of
    the shapes behind the last joint; else twice the way to their centre of mass.
    """
    origin = axis.nearest(placements[last][:3, 3])
    rigid = [link for link in sorted(tree.links()) if _rigidly_behind(tree, last, link)]
    fixed = [link for link in rigid if link != last and not _SENSOR.search(link)]
    named = [link for link in fixed if _TIP.search(link) and not _FINGER.search(link)]
    distances = {link: float(np.linalg.norm(placements[link][:3, 3] - origin)) for link in named or fixed}
    best = max(distances, key=lambda link: distances[link], default=last)
    # Frames that turn about the last axis and stay there are no end; those along it are (a hand behind a wrist's roll).
    if distances.get(best, 0.0) > _NEAR:
        return ArmEnd(best, np.zeros(3), placements[best][:3, 3], "link")
    fallback = best if distances.get(best, 0.0) > 1e-6 else last
    most = _MOST * _chain_length(tree, placements, last)
    for source, place in (("shape", _by_shape(tree, placements, last, origin)),
                          ("mass", _by_mass(tree, placements, last, origin))):  # fmt: skip
        # A mesh in other units or about another origin reaches out of the robot.
        if place is not None and float(np.linalg.norm(place - origin)) < most:
            offset = placements[last][:3, :3].T @ (place - placements[last][:3, 3])
            return ArmEnd(last, offset, place, source)
    return ArmEnd(fallback, np.zeros(3), placements[fallback][:3, 3], "none")


def _chain_length(tree: UrdfTree, placements: dict[str, FloatArray], last: str) -> float:
    """Way along the link origins from the root to ``last`` [m]."""
    length, link = 0.0, last
    while link in tree.parent_joint:
        parent = tree.joints[tree.parent_joint[link]].parent
        length += float(np.linalg.norm(placements[link][:3, 3] - placements[parent][:3, 3]))
        link = parent
    return length


def _by_shape(tree: UrdfTree, placements: dict[str, FloatArray], last: str, origin: FloatArray) -> FloatArray | None:
    """The far end of what hangs behind the last joint, fingers at rest included, along its middle."""
    hanging = [link for link in tree.links() if tree.path_to(last, link) is not None]
    parts = [
        corners(shape) @ placements[link][:3, :3].T + placements[link][:3, 3]
        for link in hanging
        for shape in tree.shapes.get(link, ())
    ]
    points = np.concatenate(parts) if parts else np.zeros((0, 3))
    if not len(points):
        return None
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0)) - origin
    length = float(np.linalg.norm(middle))
    if length < _NEAR / 2:
        return None
    way = middle / length
    far = float(((points - origin) @ way).max())
    place: FloatArray = origin + far * way
    return place if far > _NEAR else None


def _by_mass(tree: UrdfTree, placements: dict[str, FloatArray], last: str, origin: FloatArray) -> FloatArray | None:
    """Twice as far as the centre of mass of what hangs behind the last joint."""
    joint = tree.model.joints[tree.model.getJointId(tree.model_joints[tree.parent_joint[last]])]
    inertia = tree.model.inertias[joint.id]
    if inertia.mass <= 1e-6:
        return None
    # Pinocchio's joint frame is the frame of the link that it moves.
    centre = placements[last][:3, 3] + placements[last][:3, :3] @ np.array(inertia.lever)
    way = centre - origin
    place: FloatArray = origin + 2.0 * way
    return place if float(np.linalg.norm(way)) > _NEAR else None


def _rigidly_behind(tree: UrdfTree, last: str, link: str) -> bool:
    path = tree.path_to(last, link)
    return path is not None and all(tree.joints[name].type == "fixed" for name in path)
