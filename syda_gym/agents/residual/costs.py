"""CostWeights: what one step of a residual policy costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from syda_gym.agents.figures import JOINT_WEIGHT, Figures
from syda_gym.errors import OptionError, nearest_name

__all__ = ["CostWeights"]


@dataclass(frozen=True)
class CostWeights:
    """Cost of one step: ``landmark mm + joints * joint mrad + jitter * third difference mm + contact``.

    Attributes:
        joints: weight of the joint error; that of the objective ``J`` by default.
        jitter: weight of the landmarks' third difference.
        contact: cost of touching; it rises linearly over the last ``margin`` of clearance, and on while shapes overlap.
        margin: clearance below which ``contact`` begins to be paid [m].
        scale: the reward is ``(cost of the shadow - cost) / scale``.

    Raises:
        OptionError: a negative weight, or a margin or scale that is not positive.
    """

    joints: float = JOINT_WEIGHT
    jitter: float = 1.0
    contact: float = 0.0
    margin: float = 0.01
    scale: float = 10.0

    def __post_init__(self) -> None:
        if min(self.joints, self.jitter, self.contact) < 0.0 or min(self.margin, self.scale) <= 0.0:
            raise OptionError(f"cost weights must not be negative, margin and scale positive, got {self}")

    def of_figures(self, figures: Figures) -> float:
        """The mean cost of a step of episodes with these figures: by it the policies of a training are ranked."""
        return (
            figures.landmark_mm
            + self.joints * figures.joint_mrad
            + self.jitter * figures.jitter
            + self.contact * figures.contact_steps
        )

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> CostWeights:
        """From plain data.

        Raises:
            OptionError: an unknown name.
        """
        known = [f.name for f in fields(cls)]
        for name in values:
            if name not in known:
                raise OptionError(f"unknown cost weight {name!r}; {nearest_name(str(name), known)}")
        return cls(**values)
