"""check_agreement: whether PyBullet's landmarks are where the kinematics has them, before anything is measured."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError

__all__ = ["MOST_DISAGREEMENT", "check_agreement", "disagreement"]

MOST_DISAGREEMENT = 1e-3
"""m; what is farther apart is no rounding but another robot."""

_POSES = 3
_agreed: set[tuple[str, str]] = set()


class _Posed(Protocol):
    """What takes joint angles and tells joint angles, landmark coordinates and joint speeds."""

    def reset(self, angles: list[float]) -> None:
        """At rest at joint angles."""

    def read(self) -> list[float]:
        """Joint angles, landmark coordinates, joint speeds."""


def check_agreement(robot: Robot, puppet: _Posed) -> None:
    """Compares at rest and in a few other poses, once per robot and process.

    Raises:
        EmbodimentError: a landmark differs by more than ``MOST_DISAGREEMENT``; the message names it.
    """
    key = (str(robot.urdf), str(robot.spec()["kinematics"]))
    if key in _agreed:
        return
    apart = disagreement(robot, puppet)
    worst = int(np.argmax(apart))
    if not apart[worst] <= MOST_DISAGREEMENT:
        raise EmbodimentError(
            f"{robot.urdf.name}: in PyBullet the {robot.landmark_names[worst]} lies {1000 * apart[worst]:.1f} mm "
            f"from where the kinematics has it; expected at most {1000 * MOST_DISAGREEMENT:.0f} mm. Please report this "
            "robot; physics='servo' works without PyBullet"
        )
    _agreed.add(key)


def disagreement(robot: Robot, puppet: _Posed) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Largest distance of each landmark between PyBullet and the kinematics over a few poses, ``(2 * arms,)`` [m]."""
    rng = np.random.default_rng(0)
    poses = robot.clamp(rng.uniform(robot.lower, robot.upper, (_POSES, robot.n_features)))
    found = []
    for q in [robot.rest, *poses]:
        puppet.reset(q.tolist())
        row = np.array(puppet.read())
        seen = row[robot.n_features : -robot.n_features].reshape(-1, 3)
        found.append(np.linalg.norm(seen - robot.landmarks(q)[0], axis=1))
    return np.asarray(np.max(found, axis=0), dtype=np.float64)
