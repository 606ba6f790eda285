from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import HumanSkeleton, catalog
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.motions.clip import PairedMotions

BENT = 0.35


def _directions(rng: np.random.Generator, actions: int, frames: int) -> np.ndarray:
    """Smooth limb directions (actions, frames, 2, 2, 3): arms move from hanging to a random reach."""
    time = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, frames))
    start = np.array([[0.1, 0.1, -1.0], [0.4, 0.05, -0.9]])
    result = np.zeros((actions, frames, 2, 2, 3))
    for action in range(actions):
        for arm in range(2):
            goal = rng.normal(size=(2, 3)) + np.array([1.0, 0.5, 0.0])
            path = start + time[:, None, None] * (goal - start)
            path[:, :, 1] = np.abs(path[:, :, 1]) + 0.1
            result[action, :, arm] = path * np.array([1.0, 1.0 if arm == 0 else -1.0, 1.0])
    return result / np.linalg.norm(result, axis=-1, keepdims=True)


def human_frames(body: HumanSkeleton, directions: np.ndarray) -> np.ndarray:
    points = body.arm_points(np.repeat(body.standing()[None], len(directions), axis=0))
    points[:, :, 1] = points[:, :, 0] + body.upper_arm * directions[:, :, 0]
    points[:, :, 2] = points[:, :, 1] + body.forearm * directions[:, :, 1]
    return body.frames_from_points(points)


def make_pair(source: str, target: str, actions: int = 5, frames: int = 24, seed: int = 0) -> PairedMotions:
    """Both bodies perform the same reaches; the source with a posture bias and noise."""
    rng = np.random.default_rng(seed)
    directions = _directions(rng, actions, frames).reshape(-1, 2, 2, 3)

    def frames_of(name: str) -> np.ndarray:
        body = catalog.get(name)
        if isinstance(body, Robot):
            return LimbIK(body).solve(directions)
        assert isinstance(body, HumanSkeleton)
        clean = human_frames(body, directions)
        return clean + rng.normal(scale=0.004, size=clean.shape)

    names = [f"reach{index}" for index in range(actions)]
    return PairedMotions(
        catalog.get(source),
        catalog.get(target),
        frames_of(source),
        frames_of(target),
        actions=np.repeat(names, frames),
        recordings=np.repeat([f"take{index}" for index in range(actions)], frames),
        times=np.tile(np.arange(frames), actions),
        fps=10.0,
    )


@pytest.fixture(scope="session")
def adult_pepper() -> PairedMotions:
    return make_pair("adult", "pepper")


@pytest.fixture(scope="session")
def kid_pepper() -> PairedMotions:
    return make_pair("kid", "pepper", seed=1)


@pytest.fixture(scope="session")
def adult_kid() -> PairedMotions:
    return make_pair("adult", "kid", seed=2)
