"""A mapping that needs no fit, and a person who can stand and wave."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.mappings.card import MappingCard
from syda_gym.mappings.mapping import Mapping


class LimbMapping(Mapping):
    """Points the robot's limbs as the operator's; bound and familiarity are what a test wants them to be."""

    def __init__(self, source: Embodiment, target: Robot) -> None:
        self.source = source
        self.target = target
        self.bound = 0.05
        self.strange = False
        self.broken: Exception | None = None
        self.fixed: FloatArray | None = None
        self._solver = LimbIK(target)

    @property
    def card(self) -> MappingCard:
        return MappingCard(
            method="limbs",
            preset="test",
            seed=0,
            source=self.source.spec(),
            target=self.target.spec(),
            source_features=[feature.name for feature in self.source.features],
            target_features=[feature.name for feature in self.target.features],
            data="none",
            rows=0,
            actions=[],
            options={},
            versions={},
        )

    def raw(self, frames: FloatArray) -> FloatArray:
        if self.broken is not None:
            raise self.broken
        if self.fixed is not None:
            return np.repeat(self.fixed[None], len(frames), axis=0)
        return self._solver.solve(np.diff(self.source.arm_points(frames), axis=2))

    def inverse(self) -> Mapping:
        raise AssertionError("not needed live")

    def error_bound(self, frames: ArrayLike) -> FloatArray:
        return np.full(len(np.atleast_2d(frames)), self.bound)

    def difficulty(self, frames: ArrayLike) -> FloatArray:
        return np.zeros(len(np.atleast_2d(frames)))

    def unfamiliar(self, frames: ArrayLike) -> NDArray[np.bool_]:
        return np.full(len(np.atleast_2d(frames)), self.strange)


@pytest.fixture(scope="session")
def adult() -> HumanSkeleton:
    body = catalog.get("adult")
    assert isinstance(body, HumanSkeleton)
    return body


@pytest.fixture(scope="session")
def pepper() -> Robot:
    robot = catalog.get("pepper")
    assert isinstance(robot, Robot)
    return robot


@pytest.fixture
def mapping(adult: HumanSkeleton, pepper: Robot) -> LimbMapping:
    return LimbMapping(adult, pepper)


@pytest.fixture(scope="session")
def wave(adult: HumanSkeleton) -> Callable[[float], FloatArray]:
    """The adult's frame at a time [s]: both arms swing up and down in front, elbows bending."""

    def frame(time: float) -> FloatArray:
        points = np.zeros((1, 2, 3, 3))
        raised = 0.9 * (1.0 - np.cos(2.0 * time))
        bent = 0.5 * (1.0 - np.cos(3.1 * time))
        for arm, side in enumerate((1.0, -1.0)):
            shoulder = np.array([0.0, 0.5 * adult.shoulders * side, -0.2])
            upper = np.array([np.sin(raised), 0.15 * side, -np.cos(raised)])
            fore = np.array([np.sin(raised + bent), 0.1 * side, -np.cos(raised + bent)])
            elbow = shoulder + adult.upper_arm * upper / np.linalg.norm(upper)
            points[0, arm] = shoulder, elbow, elbow + adult.forearm * fore / np.linalg.norm(fore)
        return adult.frames_from_points(points)[0]

    return frame
