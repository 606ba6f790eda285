"""A picture of what was found in a robot: shapes, proposed landmarks, joints used and left out, and a person."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import BONES, HumanSkeleton
from syda_gym.embodiments.kinematics.urdf import placements_at, read_urdf
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.reading.shapes import corners
from syda_gym.embodiments.robot import Robot
from syda_gym.files import atomic_path
from syda_gym.look import LEFT, RIGHT

__all__ = ["draw_robot"]

_COLOURS = {"left": LEFT, "right": RIGHT}
_VIEWS = (("front", 1, 2), ("from its right", 0, 2), ("from above", 1, 0))
_POINTS = ("shoulder", "elbow", "wrist")
_PERSON = "#dd8452"


def draw_robot(
    robot: Robot, path: str | os.PathLike[str], *, title: str = "", left_out: Sequence[str] | None = None
) -> Path:
    """Draws the robot at rest and with its arms forward, seen from three sides, a person beside it in the same pose.

    Grey areas: the links' shapes, as their convex outlines; grey lines: link origins joined to their parents'. Red and
    blue: left and right shoulder, elbow and wrist as this library measures them, with the joints that it moves as
    squares. Crosses: movable joints on the arms that it does not move. If the coloured arms do not lie on the robot's
    arms, edit the description.

    Args:
        robot: what to draw.
        path: PNG file to write.
        title: a line above it.
        left_out: joints to mark with crosses; by default every other movable joint below an arm's first one.

    Returns:
        ``path``.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sides = [1.0 if side == "left" else -1.0 for side in robot.sides]
    forward = np.array([[[[1.0, 0.3 * s, -0.4], [1.0, 0.0, 0.3]] for s in sides]])
    posed = LimbIK.of(robot).solve(forward)[0]
    poses = (("at rest", robot.rest, np.diff(robot.arm_points(robot.rest), axis=2)), ("arms forward", posed, forward))
    figure = Figure(figsize=(13.0, 9.0))
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(poses), len(_VIEWS))
    for row, (name, angles, wanted) in zip(grid, poses, strict=True):
        drawn = _Drawn(robot, angles, wanted, left_out)
        for axis, (view, across, up) in zip(row, _VIEWS, strict=True):
            drawn.draw(axis, across, up)
            axis.set_title(f"{name}, {view}", fontsize=10)
    lengths = "; ".join(
        f"{side} {1000 * upper:.0f} + {1000 * fore:.0f} mm"
        for side, (upper, fore) in zip(robot.sides, robot.arm_lengths, strict=True)
    )
    head = f"{robot.name}: torso {robot.description.torso!r}, upper arm + forearm {lengths}"
    # Fixed margins: a layout engine would draw everything twice.
    figure.subplots_adjust(left=0.035, right=0.99, bottom=0.03, top=0.90, wspace=0.1, hspace=0.12)
    figure.suptitle(f"{head}\n{title}" if title else head, fontsize=11)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=80, format="png")
    return Path(path)


class _Drawn:
    """One pose of robot and person, in body axes."""

    def __init__(self, robot: Robot, angles: FloatArray, wanted: FloatArray, left_out: Sequence[str] | None) -> None:
        self._robot = robot
        tree = read_urdf(robot.urdf)
        places = placements_at(
            tree, {**robot.description.rest, **dict(zip(robot.joint_names, angles.tolist(), strict=True))}
        )
        to_torso = np.linalg.inv(places[robot.description.torso])
        turn = np.eye(4)
        if robot.description.axes is not None:
            turn[:3, :3] = np.array(robot.description.axes)
        seen = {name: turn @ to_torso @ place for name, place in places.items()}
        self._outlines = []
        for link, shapes in tree.shapes.items():
            drawn = [s for s in shapes if s.role == "collision"] or list(shapes)
            parts = [corners(shape) @ seen[link][:3, :3].T + seen[link][:3, 3] for shape in drawn if link in seen]
            self._outlines += [part for part in parts if len(part) >= 3]
        self._bones = [
            np.array([seen[joint.parent][:3, 3], seen[joint.child][:3, 3]])
            for joint in tree.joints.values()
            if joint.parent in seen and joint.child in seen
        ]
        self._points = robot.arm_points(angles)[0]
        self._used = {name: seen[tree.joints[name].child][:3, 3] for name in robot.joint_names}
        if left_out is None:
            left_out = [
                name
                for name, joint in tree.joints.items()
                if joint.type != "fixed"
                and name not in robot.joint_names
                and any(tree.path_to(tree.joints[a.joints[0]].child, joint.child) for a in robot.description.arms)
            ]
        self._left_out = np.array([seen[tree.joints[name].child][:3, 3] for name in left_out]).reshape(-1, 3)
        cloud = np.concatenate([*self._outlines, *self._bones])
        self._person = _person(robot, wanted, cloud)

    def draw(self, axis: Any, across: int, up: int) -> None:
        from scipy.spatial import ConvexHull, QhullError

        for outline in self._outlines:
            flat = outline[:, [across, up]]
            try:
                edge = flat[ConvexHull(flat).vertices]
            except QhullError:  # seen edge-on
                edge = flat
            axis.fill(edge[:, 0], edge[:, 1], facecolor="0.75", edgecolor="0.5", alpha=0.35, lw=0.5, zorder=1)
        for bone in self._bones:
            axis.plot(bone[:, across], bone[:, up], color="0.55", lw=0.8, marker=".", ms=2, zorder=2)
        if across == 1 or up != 0:
            for bone in self._person:
                axis.plot(
                    bone[:, across], bone[:, up], color=_PERSON, lw=2.0, alpha=0.8, solid_capstyle="round", zorder=1
                )
        self._draw_arms(axis, across, up)
        axis.plot(0.0, 0.0, marker="+", ms=9, color="k", zorder=5)
        if up == 0:
            axis.invert_xaxis()  # seen from above, its left is on the left; from the front, on the right
        axis.set_aspect("equal", adjustable="datalim")
        axis.tick_params(labelsize=7)
        axis.grid(alpha=0.25)

    def _draw_arms(self, axis: Any, across: int, up: int) -> None:
        robot = self._robot
        for arm, side in enumerate(robot.sides):
            line = self._points[arm]
            axis.plot(line[:, across], line[:, up], color=_COLOURS[side], lw=2.5, marker="o", ms=7, zorder=4)
            used = np.array([self._used[name] for name in robot.joint_names[robot.arm_slices[arm]]])
            axis.plot(used[:, across], used[:, up], "s", color="w", mec=_COLOURS[side], ms=4, zorder=4.5)
            # From the side one arm hides the other; one set of labels is enough.
            for point, label in zip(line, _POINTS if across == 1 or arm == len(robot.sides) - 1 else (), strict=False):
                axis.annotate(
                    f"{side[0].upper()} {label}", (point[across], point[up]), textcoords="offset points", xytext=(5, 4),
                    fontsize=7, color=_COLOURS[side], zorder=5,
                )  # fmt: skip
        if len(self._left_out):
            axis.plot(self._left_out[:, across], self._left_out[:, up], "x", color="k", ms=5, mew=1.2, zorder=4)


def _person(robot: Robot, wanted: FloatArray, cloud: FloatArray) -> list[FloatArray]:
    """Bones of an adult beside the robot whose limbs point as wanted, in the robot's size and on its floor."""
    adult = catalog.get("adult")
    if not isinstance(adult, HumanSkeleton):
        return []
    points = adult.arm_points(adult.standing())[0].copy()
    for arm, side in enumerate(adult.sides):
        if side in robot.sides:
            limbs = wanted[0, robot.sides.index(side)]
            limbs = limbs / np.linalg.norm(limbs, axis=-1, keepdims=True) * adult.arm_lengths[arm][:, None]
            points[arm, 1] = points[arm, 0] + limbs[0]
            points[arm, 2] = points[arm, 1] + limbs[1]
    joints = {name: place[0] for name, place in adult.complete(adult.frames_from_points(points[None])[0]).items()}
    body = np.array(list(joints.values()))
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    size = float(high[2] - low[2]) / max(float(np.ptp(body[:, 2])), 1e-6)
    middle = 0.5 * (joints["LShoulder"] + joints["RShoulder"])
    away = float(high[1]) + 0.75 * size - size * float(middle[1])
    shift = np.array([-size * float(middle[0]), away, float(low[2]) - size * float(body[:, 2].min())])
    return [np.array([size * joints[a] + shift, size * joints[b] + shift]) for a, b in BONES if {a, b} <= set(joints)]
