"""The family: the ids that people compare on, each with its options, its limit and its threshold.

All play the motions of the package, adult to robot. Two numbers are measured by ``scripts/build_leaderboard.py
--calibrate`` on the training actions, by one rule for all:

- ``success_error``, above which an episode is no success: the median over episodes of the mean landmark error of the
  base, so that who corrects nothing succeeds half of the time;
- ``reward_threshold`` in the spec: the mean return of the best of base, lead and tuned Kalman filter, so that whoever
  reaches it does at least what a formula does.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["FAMILY", "MAX_STEPS", "Member", "register_family", "warn_if_cut"]

MAX_STEPS = 10_000
"""``max_episode_steps`` of every id: longer motions of your own need -1, which is none."""


@dataclass(frozen=True)
class Member:
    """One id.

    Attributes:
        id: for ``gymnasium.make``.
        about: what it asks, in a few words.
        reward_threshold: of the spec.
        options: of the environment.
    """

    id: str
    about: str
    reward_threshold: float
    options: Mapping[str, Any] = field(default_factory=dict)


FAMILY: tuple[Member, ...] = (
    Member("SydaTeleop-v0", "the recorded motion, nothing disturbed", 89.5),
    Member(
        "SydaTeleopNoise-v0",
        "noisy, jumping and lost landmarks",
        118.7,
        {"reference": "mapped", "disturbances": "teleop:noise:train", "success_error": 0.012},
    ),
    Member(
        "SydaTeleopLatency-v0",
        "a late, uneven link that loses packets",
        99.2,
        {"reference": "mapped", "disturbances": "teleop:latency:train", "success_error": 0.033},
    ),
    Member(
        "SydaTeleopFull-v0",
        "noise, latency, weak motors and payload",
        93.8,
        {"reference": "mapped", "disturbances": "teleop:full:train", "success_error": 0.035},
    ),
    Member(
        "SydaTeleopContacts-v0",
        "arms that touch the body; each contact costs 0.1 a step",
        127.7,
        {"reference": "mapped", "self_collision": True, "reward": {"contacts": 0.1}, "success_error": 0.008},
    ),
    Member(
        "SydaTeleopNao-v0",
        "another robot, nothing disturbed",
        131.7,
        {"robot": "nao", "reference": "mapped", "success_error": 0.003},
    ),
)
"""All of them, ``SydaTeleop-v0`` first."""


def warn_if_cut(longest: int) -> None:
    """Says that a registered id cuts off motions of one's own; the motions of the package have 170 frames at most.

    Args:
        longest: frames of the longest clip.
    """
    if longest > MAX_STEPS:
        warnings.warn(
            f"the longest clip has {longest} frames and registered ids end episodes after {MAX_STEPS}; make the "
            "environment with max_episode_steps=-1",
            UserWarning,
            stacklevel=3,
        )


def register_family() -> None:
    """Registers every id that Gymnasium does not know yet; the package may be reloaded."""
    import gymnasium

    for member in FAMILY:
        if member.id not in gymnasium.registry:
            gymnasium.register(
                id=member.id,
                entry_point="syda_gym.envs.teleop:SydaTeleopEnv",
                vector_entry_point="syda_gym.envs.vector:SydaTeleopVectorEnv",
                reward_threshold=member.reward_threshold,
                max_episode_steps=MAX_STEPS,
                kwargs=dict(member.options),
            )
