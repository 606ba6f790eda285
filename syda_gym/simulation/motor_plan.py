"""MotorPlan: motors and payload of one robot over an episode, those that it begins with and every change."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from syda_gym.errors import OptionError
from syda_gym.simulation.backend import MotorConditions

__all__ = ["NEVER", "MotorPlan", "changing_steps"]

NEVER = np.iinfo(np.int64).max
"""The step of a change that does not come."""


@dataclass(frozen=True)
class MotorPlan:
    """Conditions hold from their step on until the next ones.

    Attributes:
        conditions: one after the other.
        steps: control step of the episode, counted from its first one, from which each of them holds; the first is 0.

    Raises:
        OptionError: as many steps as conditions are needed, the first 0, each later than the one before.
    """

    conditions: tuple[MotorConditions, ...] = (MotorConditions(),)
    steps: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        rising = all(first < second for first, second in zip(self.steps[:-1], self.steps[1:], strict=True))
        if not self.steps or len(self.steps) != len(self.conditions) or self.steps[0] != 0 or not rising:
            raise OptionError(
                f"a plan needs one step for each of its {len(self.conditions)} conditions, rising from 0, "
                f"got {self.steps}"
            )

    @property
    def first(self) -> MotorConditions:
        """Those that the episode begins with."""
        return self.conditions[0]

    @property
    def changes(self) -> bool:
        """Whether anything changes within the episode."""
        return len(self.steps) > 1

    def at(self, step: int) -> MotorConditions:
        """The conditions that hold in a step of the episode."""
        return self.conditions[max(bisect_right(self.steps, step) - 1, 0)]

    def next_change(self, step: int) -> int:
        """The first step after ``step`` in which something changes, or ``NEVER``."""
        place = bisect_right(self.steps, step)
        return self.steps[place] if place < len(self.steps) else NEVER

    def gains(self, steps: int) -> NDArray[np.float64]:
        """Factor on the motors' gain in each of the first ``steps`` control steps, ``(steps,)``."""
        held = np.searchsorted(np.array(self.steps), np.arange(steps), side="right") - 1
        return np.array([conditions.gain for conditions in self.conditions])[held]


def changing_steps(plans: Sequence[MotorPlan], steps: int) -> NDArray[np.bool_]:
    """In which of the first ``steps`` steps each of some robots is changed, ``(robots, steps)``; the start is none."""
    marks = np.zeros((len(plans), steps), dtype=bool)
    for row, plan in enumerate(plans):
        marks[row, [step for step in plan.steps[1:] if step < steps]] = True
    return marks
