"""The command ``export-episodes``: what agents do, as data sets of others; registered by ``cli``."""

from __future__ import annotations

from typing import Annotated

import typer

from syda_gym.cli import checks
from syda_gym.cli.names import CAMERAS, DATA_SETS, ticked
from syda_gym.cli.options import (
    AgentOption,
    DisturbancesOption,
    MethodOption,
    MotionsOption,
    OperatorOption,
    PresetOption,
    RobotOption,
    SeedOption,
    ends_of,
    mapping_of,
    route_of,
)
from syda_gym.cli.shared import bar, interruptible, say_written, typed_command

__all__ = ["export_episodes"]


def export_episodes(
    name: Annotated[
        str,
        typer.Argument(
            help="Name of the Minari data set, for example `syda/adult-pepper-v0`; or the LeRobot one's new folder."
        ),
    ],
    kind: Annotated[
        str,
        typer.Option(
            "--format",
            help="`minari` (offline reinforcement learning) or `lerobot` (LeRobotDataset v3.0, with films).",
            callback=checks.one_of(DATA_SETS, "format"),
        ),
    ] = "minari",
    motions: MotionsOption = "embedded",
    operator: OperatorOption = None,
    robot: RobotOption = None,
    route: Annotated[
        str,
        typer.Option(
            "--route",
            help="Bodies such as `adult,kid,pepper`, or in quotes `'adult>kid>pepper'`, since a shell takes a bare `>` "
            "for itself; by default straight from operator to robot.",
            metavar="A,B,C",
            callback=checks.route,
        ),
    ] = "",
    method: MethodOption = None,
    preset: PresetOption = None,
    agent: AgentOption = "base",
    disturbances: DisturbancesOption = "none",
    cameras: Annotated[
        list[str] | None,
        typer.Option(
            "--camera",
            help=f"Films of a LeRobot data set, repeatable: {ticked(CAMERAS)}, or `none`. Default: `front`.",
            callback=checks.several((*CAMERAS, "none"), "camera"),
        ),
    ] = None,
    episodes: Annotated[int, typer.Option("--episodes", help="How many episodes; 0 for one a clip.", min=0)] = 0,
    seed: SeedOption = 0,
) -> None:
    """Write episodes as a Minari or a LeRobot data set (extra `data`); by default without a chain."""
    from syda_gym.evaluation.data_sets.scene import Scene

    bodies = route_of(route) or ends_of(operator, robot)
    first, last = ends_of(operator, robot, route)
    if bodies == "auto":
        raise typer.BadParameter("a data set has one chain; name its bodies", param_hint="'--route'")
    if (first, last) != (bodies[0], bodies[-1]):
        raise typer.BadParameter(f"{route} does not lead from {first} to {last}", param_hint="'--route'")
    if cameras and kind != "lerobot":
        raise typer.BadParameter("films belong to --format lerobot", param_hint="'--camera'")
    named, chosen = mapping_of(method, preset, None)
    scene = Scene(
        motions=motions,
        route=">".join(bodies),
        method=f"{named}:{chosen}" if chosen else named,
        agent=agent,
        disturbance=disturbances,
        seed=seed,
        command=typed_command(),
    )
    with interruptible("no data set was written; run the command again"):
        if kind == "lerobot":
            from syda_gym.evaluation.data_sets.lerobot_export import export_lerobot

            chosen_cameras = [camera for camera in cameras or ["front"] if camera != "none"]
            with bar("Playing and filming") as tell:
                stored = export_lerobot(name, scene, episodes=episodes, cameras=chosen_cameras, progress=tell)
        else:
            from syda_gym.evaluation.data_sets.minari_export import export_minari

            stored = export_minari(name, scene, episodes=episodes)
    say_written(f"{stored.episodes} episodes, {stored.steps} steps", stored.path)
