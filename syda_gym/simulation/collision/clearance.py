"""Clearance: how far a robot's shapes were apart, and which of them a movement since then can have brought together."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["Clearance"]

_UNKNOWN = 1e9  # m/rad; a joint that does not turn brings every pair under suspicion
_SLACK = 1e-4  # m; beyond the accuracy of measured distances


class Clearance:
    """Tells which pairs of shapes need a look at a pose, from their distances at another pose.

    No point of a shape moves further than the sum over the joints that move it of the angle turned times the point's
    greatest possible distance from the joint. Pairs that were further apart than that, and the margin, are still free.

    Args:
        columns: from pinocchio's joints to the angles of a pose.
        model: pinocchio's model of the robot.
        shapes: its collision shapes and their pairs.
        margin: distance [m] below which a pair counts as touching.
    """

    def __init__(self, columns: dict[int, int], model: Any, shapes: Any, margin: float) -> None:
        self._margin = margin
        self._weights = _weights(columns, model, shapes)
        self._pose: FloatArray | None = None
        self._room = np.zeros(len(self._weights))
        self._stale = True

    def wants(self, pose: FloatArray) -> bool:
        """Whether a measurement at ``pose`` ``(n,)`` [rad] would clear suspicions."""
        return self._stale and (self._pose is None or bool((self._pose != pose).any()))

    def note(self, pose: FloatArray, distances: FloatArray) -> None:
        """Distances [m] of all pairs were measured at ``pose`` ``(n,)`` [rad]."""
        self._pose = np.ascontiguousarray(pose)
        self._room = distances - (self._margin + _SLACK)
        self._stale = False

    def suspects(self, *poses: FloatArray) -> list[int] | None:
        """Indices of the pairs that may touch somewhere in the box of joint angles that ``poses`` ``(n,)`` [rad] span.

        ``None`` before the first measurement.
        """
        if self._pose is None:
            return None
        call, looking = _arithmetic()
        found: list[int] = call(looking.suspects, self._weights, self._room, self._pose, np.array(poses)).tolist()
        self._stale = self._stale or bool(found)
        return found

    def within(self, pose: FloatArray, distance: float) -> list[int]:
        """Indices of the pairs that may be nearer than ``distance`` [m] at ``pose`` ``(n,)`` [rad].

        All of them before the first measurement.
        """
        if self._pose is None:
            return list(range(len(self._weights)))
        nearest = self._room + (self._margin + _SLACK) - self._weights @ np.abs(pose - self._pose)
        found: list[int] = (nearest < distance).nonzero()[0].tolist()
        return found


@lru_cache(maxsize=1)
def _arithmetic() -> tuple[Any, Any]:
    """The compiled part; numba is imported where shapes are looked at, not before."""
    from syda_gym.embodiments.limb_ik.compiling import first_call
    from syda_gym.simulation.collision.contact import looking

    return first_call, looking


def _weights(columns: dict[int, int], model: Any, shapes: Any) -> FloatArray:
    """How far a pair can come nearer for each joint's turn ``(pairs, n)`` [m/rad]."""
    reaches = []
    for shape in shapes.geometryObjects:
        shape.geometry.computeLocalAABB()
        middle = shape.placement.act(np.array(shape.geometry.aabb_center))
        length = float(np.linalg.norm(middle)) + float(shape.geometry.aabb_radius)
        reach, joint = np.zeros(len(columns)), shape.parentJoint
        while joint != 0:
            if joint in columns:
                turns = model.joints[joint].shortname().startswith("JointModelR")
                reach[columns[joint]] = length if turns else _UNKNOWN
            length += float(np.linalg.norm(model.jointPlacements[joint].translation))
            joint = model.parents[joint]
        reaches.append(reach)
    rows = []
    for pair in shapes.collisionPairs:
        first, second = reaches[pair.first], reaches[pair.second]
        # A joint that carries both turns them together.
        rows.append(np.where((first > 0.0) & (second > 0.0), 0.0, first + second))
    return np.array(rows).reshape(-1, len(columns))
