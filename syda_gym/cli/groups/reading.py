"""Reading: the options by which every command that takes a person's file lets that person say what it holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import typer

from syda_gym.cli.groups.expanding import with_group
from syda_gym.cli.options import FpsOption, JointsOption, LayoutOption, PersonOption, UnitOption, UpOption

if TYPE_CHECKING:
    from syda_gym.motions import Motions
    from syda_gym.motions.how_to_read import HowToRead

__all__ = ["Reading", "with_reading"]


@dataclass(frozen=True)
class Reading:
    """What the user says about a recording; the fields are options of the command."""

    fps: FpsOption = None
    joints: JointsOption = None
    unit: UnitOption = None
    up: UpOption = None
    person: PersonOption = None
    layout: LayoutOption = None

    def how(self) -> HowToRead:
        """The same as the library takes it.

        Raises:
            BadParameter: a joint without a place.
        """
        from syda_gym.motions.how_to_read import HowToRead

        pairs = [text.partition("=") for text in self.joints or ()]
        for name, sign, place in pairs:
            if not sign or not name or not place:
                raise typer.BadParameter(
                    f"expected JOINT=PLACE such as LShoulder=LeftArm, got {name}{sign}{place}", param_hint="'--joints'"
                )
        joints = {name: place for name, _, place in pairs} or None
        return HowToRead(self.fps, joints, self.unit, self.up, self.person, self.layout)

    def read(self, spec: str) -> str | Motions:
        """Motions read as was said, or ``spec`` as it is where nothing is said: whoever needs it will load it."""
        how = self.how()
        return how.load(spec) if how.said else spec


with_reading = with_group("reading", Reading)
"""Gives a command that takes ``reading`` the options of a ``Reading`` in its place."""
