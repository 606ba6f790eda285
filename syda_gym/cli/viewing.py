"""``--view`` of commands that show what is over already: an episode, a recording, a robot that was found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from syda_gym.cli.shared import console

if TYPE_CHECKING:
    from syda_gym.agents.work import PlayedEpisode
    from syda_gym.embodiments.robot import Robot
    from syda_gym.motions import Motions
    from syda_gym.simulation.page.plan import BodyPlan, PlotPlan
    from syda_gym.simulation.page.showing import Shown

__all__ = ["view_episode", "view_motions", "view_robot"]


def view_episode(played: PlayedEpisode, title: str, address: str, appearance: Path | None) -> None:
    """An episode over and over: operator, robot, the reference as a ghost, and the landmark error."""
    import numpy as np

    from syda_gym.look import REFERENCE, ROBOT, rgba
    from syda_gym.simulation.page.plan import PlotPlan, body_plan
    from syda_gym.simulation.page.showing import Shown
    from syda_gym.simulation.pictures.stage import OPERATOR_AT

    robot, operator = played.robot, played.operator
    errors = 1000.0 * np.linalg.norm(robot.landmarks(played.q) - robot.landmarks(played.reference), axis=-1)
    bodies = [
        body_plan(robot, "robot", appearance=appearance),
        body_plan(robot, "ghost", colour=rgba(REFERENCE, 0.4), appearance=appearance),
        body_plan(operator, "operator", place=(0.0, OPERATOR_AT, 0.0)),
    ]
    poses = {"robot": played.q, "ghost": played.reference, "operator": played.frames}
    values = [[[float(row.mean()), float(row.max())]] for row in errors]
    plot = PlotPlan("landmark error [mm]", (("mean", ROBOT), ("largest", REFERENCE)))
    height = max(float(getattr(body, "height", 1.0)) for body in (robot, operator))
    _show(title, bodies, [Shown(title, played.fps, poses, values)], address, [plot], height, 0.5 * OPERATOR_AT)


def view_motions(motions: Motions, address: str) -> None:
    """A recording, take by take, its bodies side by side."""
    from syda_gym.simulation.page.plan import body_plan
    from syda_gym.simulation.page.showing import Shown

    names = list(motions.bodies)
    apart = 1.1
    bodies = [
        body_plan(body, f"body{index}", place=(0.0, apart * index, 0.0))
        for index, body in enumerate(motions.bodies.values())
    ]
    shown, seen = [], set()
    for take in motions.takes:
        name = take.recording + ("~mirror" if take.mirrored else "")
        if name in seen:
            continue
        seen.add(name)
        poses = {f"body{names.index(body)}": frames for body, frames in take.frames.items()}
        shown.append(Shown(name, take.fps, poses, words=f"{take.action}: {', '.join(take.frames)}"))
    height = max(float(getattr(body, "height", 1.0)) for body in motions.bodies.values())
    _show(motions.name, bodies, shown, address, [], height, 0.5 * apart * (len(names) - 1))


def view_robot(robot: Robot, address: str, appearance: Path | None) -> None:
    """A robot that swings its arms, and coloured lines from shoulder to elbow to wrist that must lie on its arms."""
    import numpy as np

    from syda_gym.embodiments.limb_ik.solver import LimbIK
    from syda_gym.look import LEFT, RIGHT, rgb
    from syda_gym.simulation.page.plan import BodyPlan, body_plan
    from syda_gym.simulation.page.showing import Shown

    sides = [1.0 if side == "left" else -1.0 for side in robot.sides]
    solver = LimbIK(robot)
    ways = (
        [[[1.0, 0.3 * s, -0.4], [1.0, 0.0, 0.3]] for s in sides],
        [[[0.1, s, 0.0], [0.1, s, 0.2]] for s in sides],
        [[[0.3, 0.4 * s, 0.8], [0.2, 0.0, 1.0]] for s in sides],
    )
    corners = [robot.rest, *(solver.solve(np.array([[way]]).reshape(1, len(sides), 2, 3))[0] for way in ways)]
    corners.append(robot.rest)
    steps = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 45))
    angles = np.concatenate([a + steps[:, None] * (b - a) for a, b in zip(corners[:-1], corners[1:], strict=True)])
    angles = robot.clamp(angles)
    points = robot.arm_points(angles).reshape(len(angles), -1, 3)
    colours = {"left": rgb(LEFT), "right": rgb(RIGHT)}
    radius = 0.03 * robot.reach
    lines = tuple(
        (3 * arm + joint, 3 * arm + joint + step, radius * (1.0 if step else 1.7), colours[side])
        for arm, side in enumerate(robot.sides)
        for joint, step in ((0, 0), (0, 1), (1, 0), (1, 1), (2, 0))
    )
    bodies = [
        body_plan(robot, "robot", colour=(0.75, 0.77, 0.80, 0.55), appearance=appearance),
        BodyPlan("arms", "points", bones=lines),
    ]
    words = "Red is its left arm, blue its right: they must lie on the robot's arms"
    shown = [Shown(robot.name, 30.0, {"robot": angles, "arms": points}, words=words)]
    _show(robot.name, bodies, shown, address, [], robot.height, 0.0)


def _show(
    title: str,
    bodies: Sequence[BodyPlan],
    shown: Sequence[Shown],
    address: str,
    plots: Sequence[PlotPlan],
    height: float,
    middle: float,
) -> None:
    from syda_gym.simulation.page.showing import show
    from syda_gym.teleoperation.addresses import host_and_port
    from syda_gym.teleoperation.incoming.network import require_token

    host, port = host_and_port(address, 8099)
    require_token(host, None)

    def tell(where: str) -> None:
        console().print(f"view: {where}\nCtrl-C ends it", markup=False, highlight=False, soft_wrap=True)

    show(title, bodies, shown, plots=plots, host=host, port=port, height=height, middle=middle, tell=tell)
