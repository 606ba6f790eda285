"""choose_mapping: from what a user names (bodies, method, route, data) to the mapping that drives the robot."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import TeleoperationError
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions
from syda_gym.routes.piloting.pilot import AUTO, Pilot

__all__ = ["choose_mapping"]


def choose_mapping(
    operator: str | Embodiment,
    robot: str | os.PathLike[str] | Embodiment,
    *,
    mapping: str | os.PathLike[str] = AUTO,
    preset: str | None = None,
    route: str | Sequence[str] = "auto",
    motions: str | os.PathLike[str] | Motions | None = None,
    seed: int = 0,
) -> tuple[Mapping, tuple[str, ...]]:
    """The mapping from a person to a robot.

    By default what this user recorded of the pair (``syda-gym record``, ``syda-gym fit``), along the best route if
    there are several; where nothing was recorded, the unfitted mapping. Synthetic motions serve only if they are named.

    Args:
        operator: who leads.
        robot: who follows: a name, or the path of a description.
        mapping: ``auto``; a method such as ``syda``; ``geometric``, which needs no recordings; a stored mapping, or a
            folder of them.
        preset: of the method.
        route: ``auto`` or the names of the bodies.
        motions: what is fitted on; ``None`` for what this user recorded.
        seed: of fits.

    Returns:
        The mapping, and what a person should know about the choice, a line each.

    Raises:
        SydaError: names, routes or files that do not exist; each says what would.
    """
    if Path(mapping).suffix in (".json", ".safetensors"):
        from syda_gym.mappings.storage import load_mapping

        return load_mapping(mapping), ()
    leader, follower = catalog.resolve(operator), catalog.resolve(robot)
    if not isinstance(follower, Robot):
        raise TeleoperationError(f"{follower.name!r} is a {follower.kind}; live commands need a robot such as 'pepper'")
    data = None if motions is None else load_motions(motions)
    pilot = Pilot(data, leader, follower, mapping=mapping, preset=preset, seed=seed)
    return pilot.mapping(pilot.plan(route)[0].bodies), pilot.notices
