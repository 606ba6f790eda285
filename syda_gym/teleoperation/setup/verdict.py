"""judge_robot: how far a robot's limbs can point as a person's do, and the likely reason if they cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.motions.loading import load_motions

__all__ = ["DOUBTFUL", "GOOD", "Verdict", "judge_robot"]

GOOD = 5.0
"""Degrees; below, a robot points its limbs as a person does."""

DOUBTFUL = 15.0
"""Degrees; above, something is likely wrong with what was found."""

_POSES = 200
_SHORT = 0.4  # an upper arm below this share of the forearm, or the other way round, is unlikely in any arm
_OFTEN = 0.25  # a joint that stands at a limit in more than this share of poses is named
_NEEDED = 4  # joints: two point the upper arm, two the forearm


@dataclass(frozen=True)
class Verdict:
    """What a robot's arms are good for.

    Attributes:
        error: mean angle between the limbs of a person's poses and the robot's [rad].
        upper: the same for upper arms alone [rad].
        fore: the same for forearms alone [rad].
        word: ``good``, ``fair`` or ``doubtful``.
        reason: the likely reason, empty where it is good.
    """

    error: float
    upper: float
    fore: float
    word: str
    reason: str


def judge_robot(robot: Robot) -> Verdict:
    """Points the limbs as in poses of the embedded adult, spread over all its actions.

    Args:
        robot: any robot; the poses of the sides that it has are taken.
    """
    wanted = _poses(robot)
    reached = LimbIK.of(robot).solve(wanted)
    angles = _angles(np.diff(robot.arm_points(reached), axis=2), wanted)
    upper, fore = (float(angles[:, :, limb].mean()) for limb in (0, 1))
    error = 0.5 * (upper + fore)
    degrees = np.degrees(error)
    word = "good" if degrees < GOOD else "doubtful" if degrees > DOUBTFUL else "fair"
    return Verdict(error, upper, fore, word, "" if word == "good" else _reason(robot, reached, upper, fore))


def _poses(robot: Robot) -> FloatArray:
    """Limb directions of a person, ``(N, arms, 2, 3)``."""
    adult = catalog.get("adult")
    motions = load_motions("embedded")
    frames = np.concatenate([take.frames["adult"] for take in motions.takes if "adult" in take.frames])
    chosen = frames[np.linspace(0, len(frames) - 1, _POSES).astype(int)]
    points = adult.arm_points(chosen)[:, [adult.sides.index(side) for side in robot.sides]]
    return np.asarray(np.diff(points, axis=2))


def _reason(robot: Robot, reached: FloatArray, upper: float, fore: float) -> str:
    for arm, lengths in zip(robot.description.arms, robot.arm_lengths, strict=True):
        if lengths[0] < _SHORT * lengths[1]:
            return (
                f"the upper arm is short ({1000 * lengths[0]:.0f} mm): the elbow lies at the shoulder's {arm.elbow!r}; "
                "name a link beyond the wrist with --left or --right"
            )
        if lengths[1] < _SHORT * lengths[0]:
            return (
                f"the forearm is short ({1000 * lengths[1]:.0f} mm): the elbow lies at the wrist's {arm.elbow!r}; name "
                "a link nearer to the elbow with --left or --right"
            )
    for chain, arm in zip(robot.chains, robot.description.arms, strict=True):
        q = np.random.default_rng(0).uniform(chain.lower, chain.upper, (16, chain.n_joints))
        jacobian = chain.jacobians(q)[1]
        moving = np.abs(jacobian[:, 1:3] - jacobian[:, :1]).max(axis=(0, 1, 2)) > 1e-3 * _length(robot)
        count = int(moving.sum())
        if count < _NEEDED:
            return (
                f"{count} joints move elbow and wrist of the {arm.side} arm, and pointing two limbs anywhere takes "
                f"{_NEEDED}; the robot cannot do better"
            )
    lower, upper_limits = robot.limits_at(reached)
    at = ((reached - lower < 1e-3) | (upper_limits - reached < 1e-3)).mean(axis=0)
    worst = int(np.argmax(at))
    which = "upper arms" if upper > fore else "forearms"
    if at[worst] > _OFTEN:
        return (
            f"mostly the {which}: joint {robot.joint_names[worst]!r} is at a limit in {100 * at[worst]:.0f} % of the "
            f"poses ({robot.lower[worst]:.2f} to {robot.upper[worst]:.2f} rad)"
        )
    return f"mostly the {which}; look whether the coloured arms of the picture lie on the robot's"


def _length(robot: Robot) -> float:
    """Mean length of the limbs [m]."""
    return float(robot.arm_lengths.mean())


def _angles(reached: FloatArray, wanted: FloatArray) -> FloatArray:
    cosine = np.sum(_unit(reached) * _unit(wanted), axis=-1)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))
