"""Positions: how a robot would imitate whose elbows and wrists are led to where a person's are, scaled to its arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.routes.dry_run.plan import FPS

__all__ = ["TOP_SPEED", "Pace", "by_positions", "led_by_positions"]

TOP_SPEED = 20.0
"""[rad/s] at most, where a URDF gives none."""

_UPPER_SHARE = 0.506  # of a person's arm: positions are led in a person's proportions
_START_STEPS = 80
_DAMPING = 1e-2
_ELBOW = 0.4  # weight of the elbow's position beside the wrist's
_PULL = 10.0**-2.1  # towards the robot's rest, per radian


@dataclass(frozen=True)
class Pace:
    """How a robot hurries.

    Attributes:
        gain: share of a step that is taken.
        speed: share of the joints' top speed.
        steps: steps a frame.
    """

    gain: float = 1.0
    speed: float = 1.0
    steps: int = 3


def by_positions(robot: Robot, index: int, wanted: FloatArray) -> FloatArray:
    """What an arm does whose elbow and wrist are led to a person's positions: a retargeter, see ``imitation``.

    Args:
        robot: whose arm.
        index: of the arm.
        wanted: ``(K, T, 2, 3)`` unit directions of upper arm and forearm, body axes, at ``FPS``.

    Returns:
        ``(K, T, 2, 3)`` directions reached.
    """
    angles = led_by_positions(robot, index, wanted, np.sqrt([_ELBOW, 1.0]), _PULL, Pace())
    clips, frames = angles.shape[:2]
    limbs = np.diff(robot.chains[index].points(angles.reshape(clips * frames, -1))[:, :3], axis=1)
    unit = limbs / np.maximum(np.linalg.norm(limbs, axis=-1, keepdims=True), 1e-9)
    return np.asarray(unit).reshape(wanted.shape)


def led_by_positions(
    robot: Robot, index: int, wanted: FloatArray, weights: Sequence[float] | FloatArray, pull: float, pace: Pace
) -> FloatArray:
    """Angles ``(K, T, n)`` [rad] of one arm, within joint limits and joint speeds: damped least squares, warm-started.

    Args:
        robot: whose arm.
        index: of the arm.
        wanted: ``(K, T, 2, 3)`` unit directions of upper arm and forearm.
        weights: of the elbow and of the wrist.
        pull: towards rest.
        pace: how it hurries.
    """
    upper = _UPPER_SHARE * wanted[:, :, 0]
    goal = np.stack([upper, upper + (1.0 - _UPPER_SHARE) * wanted[:, :, 1]], axis=2)
    weights = np.asarray(weights)
    chain, part = robot.chains[index], robot.arm_slices[index]
    length, rest = float(robot.arm_lengths[index].sum()), robot.rest[part]
    most = pace.speed * np.minimum(robot.speed[part], TOP_SPEED) / FPS / pace.steps
    clips, count = goal.shape[:2]

    def step(q: FloatArray, wanted: FloatArray) -> FloatArray:
        points, jacobians = chain.jacobians(q)
        gap = (wanted - (points[:, 1:3] - points[:, :1]) / length) * weights[:, None]
        slope = (jacobians[:, 1:3] - jacobians[:, :1]) / length * weights[:, None, None]
        flat, gap = slope.reshape(clips, 6, -1), gap.reshape(clips, 6)
        normal = np.einsum("kij,kil->kjl", flat, flat) + (pull + _DAMPING) * np.eye(chain.n_joints)
        right = np.einsum("kij,ki->kj", flat, gap) - pull * (q - rest)
        return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0])

    q = np.repeat(rest[None], clips, axis=0)
    for _ in range(_START_STEPS):
        q = np.clip(q + np.clip(step(q, goal[:, 0]), -0.3, 0.3), chain.lower, chain.upper)
    found = np.empty((clips, count, chain.n_joints))
    for frame in range(count):
        for _ in range(pace.steps if frame else 0):
            q = np.clip(q + np.clip(pace.gain * step(q, goal[:, frame]), -most, most), chain.lower, chain.upper)
        found[:, frame] = q
    return found
