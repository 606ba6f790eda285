"""HowToRead: what a person says about recordings, carried as one value to whatever loads them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields

from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

__all__ = ["AS_IT_STANDS", "HowToRead"]


@dataclass(frozen=True)
class HowToRead:
    """What a person says about recordings; everything may be left out, and is then found by looking into the file.

    Attributes:
        fps: frames per second.
        joints: joint to its name, its number or its three columns in the file.
        unit: unit of length, or metres per unit.
        up: axis that points up.
        person: which of several people, from 1.
        layout: a YAML file that describes a format of one's own.

    All are those of ``load_motions``, which checks them.
    """

    fps: float | None = None
    joints: Mapping[str, object] | None = None
    unit: str | float | None = None
    up: str | None = None
    person: int | None = None
    layout: str | os.PathLike[str] | None = None

    @property
    def said(self) -> tuple[str, ...]:
        """Names of what is said."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name) is not None)

    def load(self, spec: str | os.PathLike[str] | Motions) -> Motions:
        """Loads motions as was said.

        Args:
            spec: as ``load_motions`` takes it.

        Raises:
            MotionError: the recording is missing or malformed.
            OptionError: an unknown joint, unit or axis, or something is said about motions that say it themselves.
        """
        return load_motions(
            spec, self.fps, joints=self.joints, unit=self.unit, up=self.up, person=self.person, layout=self.layout
        )


AS_IT_STANDS = HowToRead()
"""Nothing is said: everything is found by looking into the file."""
