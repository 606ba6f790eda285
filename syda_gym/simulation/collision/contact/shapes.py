"""Shapes: a robot's joints, collision shapes and their pairs, as the arrays from which distances are computed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["BOX", "CYLINDER", "OTHER", "ROUND", "Shapes", "of_model"]

ROUND, BOX, CYLINDER, OTHER = 0, 1, 2, -1
"""Kinds of shapes: spheres and capsules; boxes; cylinders; all others, of which only a ball about them is known."""

Indices = NDArray[np.int64]


class Shapes(NamedTuple):
    """Few arrays, because each one that a compiled function takes costs half a microsecond a call.

    Joints count from 0, which is the torso and does not move.

    Attributes:
        links: the joint before each, and which angle is its own ``(J, 2)``.
        places: rotation from its parent at angle zero (three rows), where it is in its parent's axes [m], and its axis
            in its own axes ``(J, 5, 3)``.
        above: whether a joint moves another one, or is it ``(J, J)``.
        kinds: the joint that carries each shape, and its kind ``(S, 2)``.
        solids: middle, and from a capsule's middle to the end of its axis (zero for all others), axes of boxes and
            cylinders (those along z; three rows), all in the axes of the joint; last half the sides of a box, or
            radius, 0, and half the length of a cylinder ``(S, 6, 3)`` [m].
        radii: of spheres and capsules, of all others of the ball about the middle that holds them; and of that ball of
            every shape ``(S, 2)`` [m].
        pairs: the two shapes of each pair ``(P, 2)``.
    """

    links: Indices
    places: FloatArray
    above: NDArray[np.bool_]
    kinds: Indices
    solids: FloatArray
    radii: FloatArray
    pairs: Indices


def of_model(model: Any, shapes: Any, columns: dict[int, int]) -> Shapes | None:
    """The arrays of pinocchio's model and shapes; ``None`` where a joint does anything but turn about one axis.

    Args:
        model: with the arm joints alone.
        shapes: its collision shapes and pairs.
        columns: from pinocchio's joints to the angles of a pose.
    """
    axes, count = _axes(model), model.njoints
    if axes is None or len(columns) != count - 1:
        return None
    above = np.eye(count, dtype=np.bool_)
    for joint in range(1, count):
        above[:, joint] |= above[:, model.parents[joint]]
    rows = [_shape(shape) for shape in shapes.geometryObjects]
    return Shapes(
        links=np.array([(model.parents[joint], columns.get(joint, 0)) for joint in range(count)], dtype=np.int64),
        places=np.array(
            [
                [*np.array(place.rotation), np.array(place.translation), axis]
                for place, axis in zip(model.jointPlacements, axes, strict=True)
            ]
        ),
        above=above,
        kinds=np.array(
            [(shape.parentJoint, row[0]) for shape, row in zip(shapes.geometryObjects, rows, strict=True)],
            dtype=np.int64,
        ).reshape(-1, 2),
        solids=np.array([row[1] for row in rows], dtype=np.float64).reshape(-1, 6, 3),
        radii=np.array([(row[2], row[2] + np.linalg.norm(row[1][1])) for row in rows]).reshape(-1, 2),
        pairs=np.array([(pair.first, pair.second) for pair in shapes.collisionPairs], dtype=np.int64).reshape(-1, 2),
    )


def _axes(model: Any) -> FloatArray | None:
    """Each joint's axis in its own axes ``(J, 3)``; ``None`` if one of them is no plain turn."""
    import pinocchio

    axes = np.zeros((model.njoints, 3))
    data = pinocchio.Data(model)
    pinocchio.computeJointJacobians(model, data, pinocchio.neutral(model))
    for joint in range(1, model.njoints):
        part = model.joints[joint]
        if part.nv != 1:
            return None
        motion = pinocchio.getJointJacobian(model, data, joint, pinocchio.LOCAL)[:, part.idx_v]
        if np.abs(motion[:3]).max() > 1e-12 or abs(np.linalg.norm(motion[3:]) - 1.0) > 1e-9:
            return None
        axes[joint] = motion[3:]
    return axes


def _shape(shape: Any) -> tuple[int, list[FloatArray], float]:
    """Kind, row of ``solids`` and radius of one shape."""
    import coal

    geometry, none, upright = shape.geometry, np.zeros(3), list(np.eye(3))
    turn, middle = np.array(shape.placement.rotation), np.array(shape.placement.translation)
    if isinstance(geometry, coal.Sphere):
        return ROUND, [middle, none, *upright, none], float(geometry.radius)
    if isinstance(geometry, coal.Capsule):
        half = turn[:, 2] * float(geometry.halfLength)
        return ROUND, [middle, half, *upright, none], float(geometry.radius)
    if isinstance(geometry, coal.Box):
        size = np.array(geometry.halfSide, dtype=np.float64)
        return BOX, [middle, none, *turn, size], float(np.linalg.norm(size))
    if isinstance(geometry, coal.Cylinder):
        size = np.array([float(geometry.radius), 0.0, float(geometry.halfLength)])
        return CYLINDER, [middle, none, *turn, size], float(np.linalg.norm(size))
    geometry.computeLocalAABB()
    middle = shape.placement.act(np.array(geometry.aabb_center))
    return OTHER, [middle, none, *upright, none], float(geometry.aabb_radius)
