"""What every reader makes of a file: joint positions as they stand in it, with their times and what was noticed."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.motions.readers.times import Stamps

__all__ = ["MotionWarning", "Recording", "say"]


class MotionWarning(UserWarning):
    """A recording was understood, but not as it stands: other units, long gaps, left and right look swapped."""


@dataclass
class Recording:
    """Joint positions of one person as they stand in a file.

    Attributes:
        path: the file.
        format: name of the format.
        joints: canonical joint to ``(N, 3)`` in the file's units and axes; NaN where a joint was not tracked.
        fps: frames per second, where the file says so.
        stamps: times as they stand in the file, in whatever unit.
        lines: ``(N,)`` line of the file for each frame, for messages.
        up: the axis that points up if trunk and head are not there to tell, for example ``(0, 1, 0)``.
        unit: metres per unit of the file, where the file says so.
        names: the joint names of the file, for messages.
        notes: what the reader already found out.
        doubts: what is said aloud as well.
        image: whether positions may be places in a picture, which have to be refused.
        left_handed: whether the file's axes are left-handed (somebody said so): they are mirrored.
    """

    path: Path
    format: str
    joints: Mapping[str, FloatArray]
    fps: float | None = None
    stamps: Stamps | None = None
    lines: NDArray[np.int64] | None = None
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    unit: float | None = None
    names: Sequence[str] = ()
    notes: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    image: bool = False
    left_handed: bool = False

    def where(self, frame: int) -> str:
        """How a message calls a frame: by line if the format has lines."""
        return f"line {self.lines[frame]}" if self.lines is not None else f"frame {frame}"

    def doubt(self, text: str) -> None:
        """Notes something and says it aloud."""
        self.notes.append(text)
        say(f"{self.path}: {text}")


def say(text: str) -> None:
    """Warns the one who called the library."""
    warnings.warn(text, MotionWarning, stacklevel=5)
