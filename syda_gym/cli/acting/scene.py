"""Scene: the options by which ``train``, ``tune``, ``evaluate`` and ``play`` describe their environment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syda_gym.cli import checks
from syda_gym.cli.groups.expanding import with_group
from syda_gym.cli.groups.reading import Reading
from syda_gym.cli.names import REFERENCES
from syda_gym.cli.options import (
    DisturbancesOption,
    HeldOutOption,
    MappingOption,
    MethodOption,
    MotionsOption,
    OperatorOption,
    PresetOption,
    RobotOption,
    RouteOption,
    ends_of,
    mapping_of,
    route_of,
)

if TYPE_CHECKING:
    from syda_gym.motions import Motions

__all__ = ["Scene", "with_scene"]


@dataclass(frozen=True)
class Scene(Reading):
    """The environment that a command acts in, as its user described it; the fields are options of the command.

    What is said of a recording is said of ``motions``.
    """

    motions: MotionsOption = "embedded"
    operator: OperatorOption = None
    robot: RobotOption = None
    route: RouteOption = "auto"
    method: MethodOption = None
    preset: PresetOption = None
    mapping: MappingOption = None
    disturbances: DisturbancesOption = "none"
    reference: Annotated[
        str,
        typer.Option(
            help="What errors are measured against: `mapped`, what the mapping makes of the undisturbed operator, "
            "which an agent can reach, or `paired`, the robot's recorded motion, which includes the mapping's error; "
            "`auto` is `paired` where there is such a motion.",
            callback=checks.one_of(REFERENCES, "reference"),
        ),
    ] = "mapped"
    preview: Annotated[
        int, typer.Option(help="Future base commands in the observation; live this is latency.", min=0, max=60)
    ] = 0
    history: Annotated[
        int, typer.Option(help="Past base commands and joint angles in the observation.", min=0, max=60)
    ] = 0
    held_out: HeldOutOption = None

    def options(self, *, training: bool = False) -> dict[str, Any]:
        """Environment options; held-out actions are kept out of fits and, if ``training``, out of the motions."""
        mapping, preset = mapping_of(self.method, self.preset, self.mapping)
        operator, robot = ends_of(self.operator, self.robot, self.route)
        motions = self.read(self.motions)
        options: dict[str, Any] = {
            "motions": motions,
            "operator": operator,
            "robot": robot,
            "route": route_of(self.route),
            "mapping": _stored(mapping),
            "preset": preset,
            "disturbances": None if self.disturbances == "none" else self.disturbances,
            "reference": self.reference,
            "preview": self.preview,
            "history": self.history,
        }
        if self.held_out:
            known = _actions(motions, self.held_out)
            options["held_out"] = tuple(self.held_out)
            options["actions"] = tuple(sorted(known - set(self.held_out)) if training else self.held_out)
        return options


def _stored(mapping: str) -> Any:
    """A stored mapping if one file is named; a method or a folder as it is."""
    if not Path(mapping).is_file():
        return mapping
    from syda_gym.mappings.storage import load_mapping

    return load_mapping(mapping)


def _actions(motions: str | Motions, names: Sequence[str]) -> set[str]:
    """All actions of the motions, if the named ones are among them."""
    from syda_gym.errors import nearest_name
    from syda_gym.motions.loading import load_motions

    loaded = load_motions(motions)
    known = {take.action for take in loaded.takes}
    for name in names:
        if name not in known:
            raise typer.BadParameter(
                f"{loaded.name} has no action {name!r}; {nearest_name(name, known)}", param_hint="'--held-out'"
            )
    return known


with_scene = with_group("scene", Scene)
"""Gives a command that takes ``scene`` the options of a ``Scene`` in its place."""
