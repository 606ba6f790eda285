"""The demo's baselines: what any mapping has to beat before it deserves a word."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MappingError
from syda_gym.evaluation.chains import Links, Route
from syda_gym.mappings.card import MappingCard, versions
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.clip import Motions

__all__ = ["BASELINES", "MeanPose", "baseline"]

BASELINES = ("unfitted", "ridge", "mean pose")
"""Limb directions taken over without any recording; ridge regression along the chosen chain; standing still."""


@dataclass(frozen=True, eq=False)
class MeanPose(Mapping):
    """Answers every frame with one pose of the target.

    Attributes:
        source: whose frames it takes.
        target: whose pose it gives.
        pose: ``(F,)``.
    """

    source: Embodiment
    target: Embodiment
    pose: FloatArray

    @property
    def card(self) -> MappingCard:
        """Says ``mean pose``."""
        given, wanted = ([f"{one.name} [{one.unit}]" for one in body.features] for body in (self.source, self.target))
        return MappingCard(
            "mean pose", "none", 0, self.source.spec(), self.target.spec(), given, wanted, versions=versions()
        )

    def raw(self, frames: FloatArray) -> FloatArray:
        """The pose, as often as there are frames."""
        return np.repeat(self.pose[None], len(frames), axis=0)

    def inverse(self) -> Mapping:
        """There is none."""
        raise MappingError("the mean pose forgets what it was given, so it has no inverse")

    def error_bound(self, frames: ArrayLike) -> FloatArray:
        """There is none."""
        raise MappingError("the mean pose knows no error bound")

    def difficulty(self, frames: ArrayLike) -> FloatArray:
        """Zero: it does not look at the frames."""
        return np.zeros(len(np.atleast_2d(np.asarray(frames))))

    def unfamiliar(self, frames: ArrayLike) -> NDArray[np.bool_]:
        """None: it does not look at the frames."""
        return np.zeros(len(np.atleast_2d(np.asarray(frames))), dtype=bool)


def baseline(name: str, motions: Motions, route: Route, ridge: Links, held_out: Sequence[str]) -> Mapping:
    """One baseline from the operator to the robot.

    Args:
        name: of ``BASELINES``.
        motions: for the mean pose: of the robot in the actions that are not held out, with whoever stands before it.
        route: the chosen chain.
        ridge: fits of ridge regression.
        held_out: actions that nothing may have seen.
    """
    source, target = motions.bodies[route[0]], motions.bodies[route[-1]]
    if name == "ridge":
        return ridge.chain(route, held_out)
    if name == "unfitted":
        from syda_gym.mappings.methods.unfitted import unfitted

        return unfitted(source, target)
    seen = ridge.pair(route[-2], route[-1]).without_actions(list(held_out))
    return MeanPose(source, target, seen.target.mean(axis=0))
