"""A picture of what was found in a robot: its links as lines, the proposed landmarks as labelled dots."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.urdf import read_urdf
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.files import atomic_path
from syda_gym.look import LEFT, RIGHT

__all__ = ["draw_robot"]

_COLOURS = {"left": LEFT, "right": RIGHT}
_VIEWS = (("front", 1, 2), ("from its right", 0, 2), ("from above", 1, 0))
_POINTS = ("shoulder", "elbow", "wrist")


def draw_robot(robot: Robot, path: str | os.PathLike[str]) -> Path:
    """Draws the robot at rest and with its arms forward, seen from three sides.

    Grey: every link's origin joined to its parent's. Red and blue: left and right shoulder, elbow and wrist as this
    library measures them. If the coloured arms do not lie on the robot's arms, edit the description.

    Args:
        robot: what to draw.
        path: PNG file to write.

    Returns:
        ``path``.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sides = [1.0 if side == "left" else -1.0 for side in robot.sides]
    forward = LimbIK(robot).solve(np.array([[[[1.0, 0.3 * s, -0.4], [1.0, 0.0, 0.3]] for s in sides]]))[0]
    poses = (("at rest", robot.rest), ("arms forward", forward))
    figure = Figure(figsize=(13.0, 9.0), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(poses), len(_VIEWS))
    for row, (title, angles) in zip(grid, poses, strict=True):
        bones, points = _bones(robot, angles), robot.arm_points(angles)[0]
        for axis, (view, across, up) in zip(row, _VIEWS, strict=True):
            _draw(axis, robot, bones, points, across, up)
            axis.set_title(f"{title}, {view}", fontsize=10)
    lengths = "; ".join(
        f"{side} {1000 * upper:.0f} + {1000 * fore:.0f} mm"
        for side, (upper, fore) in zip(robot.sides, robot.arm_lengths, strict=True)
    )
    figure.suptitle(f"{robot.name}: torso {robot.description.torso!r}, upper arm + forearm {lengths}")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=80, format="png")
    return Path(path)


def _draw(axis: Any, robot: Robot, bones: list[FloatArray], points: FloatArray, across: int, up: int) -> None:
    for bone in bones:
        axis.plot(bone[:, across], bone[:, up], color="0.7", lw=1.2, marker=".", ms=2, zorder=1)
    for arm, side in enumerate(robot.sides):
        line = points[arm]
        axis.plot(line[:, across], line[:, up], color=_COLOURS[side], lw=2.5, marker="o", ms=6, zorder=2)
        # From the side one arm hides the other; one set of labels is enough.
        for point, label in zip(line, _POINTS if across == 1 or arm == len(robot.sides) - 1 else (), strict=False):
            axis.annotate(
                f"{side[0].upper()} {label}", (point[across], point[up]), textcoords="offset points", xytext=(5, 4),
                fontsize=7, color=_COLOURS[side], zorder=3,
            )  # fmt: skip
    axis.plot(0.0, 0.0, marker="+", ms=9, color="k", zorder=3)
    if up == 0:
        axis.invert_xaxis()  # seen from above, its left is on the left; from the front, on the right
    axis.set_aspect("equal", adjustable="datalim")
    axis.tick_params(labelsize=7)
    axis.grid(alpha=0.25)


def _bones(robot: Robot, angles: FloatArray) -> list[FloatArray]:
    """Line from each link's origin to its parent's, ``(2, 3)`` [m] each, body axes about the torso."""
    import pinocchio

    tree = read_urdf(robot.urdf)
    model = tree.model
    configuration = pinocchio.neutral(model)
    wanted = {**robot.description.rest, **dict(zip(robot.joint_names, angles.tolist(), strict=True))}
    for name, angle in wanted.items():
        if model.existJointName(name):
            joint = model.joints[model.getJointId(name)]
            configuration[joint.idx_q : joint.idx_q + joint.nq] = (
                [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            )
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, configuration)
    places = {
        frame.name: np.array(data.oMf[index].homogeneous)
        for index, frame in enumerate(model.frames)
        if frame.type == pinocchio.FrameType.BODY
    }
    to_torso = np.linalg.inv(places[robot.description.torso])
    turn = np.eye(3) if robot.description.axes is None else np.array(robot.description.axes)
    origin = {name: turn @ (to_torso @ place)[:3, 3] for name, place in places.items()}
    return [
        np.array([origin[joint.parent], origin[joint.child]])
        for joint in tree.joints.values()
        if joint.parent in origin and joint.child in origin
    ]
