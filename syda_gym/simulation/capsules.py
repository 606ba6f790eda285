"""CapsuleModel: how far a robot's arms are from its body and from each other, for many poses at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError
from syda_gym.simulation.capsule_shapes import read_shapes

__all__ = ["CapsuleModel", "Nearest"]

_SAMPLES = 4096
_FAR = 0.05  # m; a pair that stays farther apart than this in every sampled pose is not checked
_ALWAYS = 0.5  # a pair that overlaps in more than this share of poses overlaps by construction
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, eq=False)
class Nearest:
    """The nearest pair of shapes of each pose (or the nearest few, with one more axis behind the first).

    Attributes:
        distance: signed distance ``(N,)`` [m]; negative where the shapes overlap.
        gradient: its derivative by the joint angles ``(N, n)`` [m/rad].
        pair: index of the pair ``(N,)``.
    """

    distance: FloatArray
    gradient: FloatArray
    pair: NDArray[np.intp]


class CapsuleModel:
    """Signed distances between the collision shapes of a robot, in numpy.

    Arm shapes are capsules, body shapes capsules and boxes (see ``capsule_shapes``). Pairs that the description
    disables, that belong to one arm, that overlap by construction or that can never come near say nothing and are left
    out, as in the set-up assistants of motion planners. Segment against segment is closed form (Ericson, *Real-Time
    Collision Detection*, 2005, section 5.1.9); segment against box is the minimum of a convex function of one variable,
    by golden sections.

    Args:
        robot: whose shapes; joints that are no arm joints stay at rest.

    Attributes:
        pairs: names of the two links of each pair.

    Raises:
        EmbodimentError: the URDF has no collision shapes on its arms.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.shapes = read_shapes(robot)
        if not any(len(arm.radii) for arm in self.shapes.arms):
            raise EmbodimentError(f"robot {robot.name!r} has no collision shapes on its arms; add them to its URDF")
        self._index_shapes()
        self._choose_pairs()

    def distances(self, frames: ArrayLike) -> FloatArray:
        """Signed distance of every pair, ``(N, pairs)`` [m], for joint angles ``(N, n)`` [rad]."""
        starts, ends = self._ends(self.robot.check(frames))
        return np.concatenate([self._capsule_pairs(starts, ends)[0], self._box_pairs(starts, ends)[0]], axis=1)

    def clearance(self, frames: ArrayLike) -> FloatArray:
        """Least signed distance of each pose, ``(N,)`` [m]; negative where something overlaps."""
        return np.asarray(self.distances(frames).min(axis=1))

    def nearest(self, frames: ArrayLike) -> Nearest:
        """The nearest pair of each pose and how the joints change its distance."""
        found = self.nearest_pairs(frames, 1)
        return Nearest(found.distance[:, 0], found.gradient[:, 0], found.pair[:, 0])

    def nearest_pairs(self, frames: ArrayLike, count: int) -> Nearest:
        """The ``count`` nearest pairs of each pose, the nearest first; all arrays have one more axis ``(N, count)``.

        Args:
            frames: joint angles ``(N, n)`` [rad].
            count: pairs per pose, at most ``len(pairs)``.
        """
        q = self.robot.check(frames)
        starts, ends = self._ends(q)
        capsule, s, t, along = self._capsule_pairs(starts, ends)
        box, u, normal = self._box_pairs(starts, ends)
        distance = np.concatenate([capsule, box], axis=1)
        pair = np.argsort(distance, axis=1, kind="stable")[:, :count]
        rows = np.repeat(np.arange(len(q))[:, None], pair.shape[1], axis=1)
        jacobians = self._end_jacobians(q)
        gradient = np.zeros((*pair.shape, q.shape[1]))
        first = pair < capsule.shape[1]
        r, p = rows[first], pair[first]
        moved = self._mixed(jacobians, r, self._first[p], s[r, p]) - self._mixed(jacobians, r, self._second[p], t[r, p])
        gradient[first] = np.einsum("nk,nkj->nj", along[r, p], moved)
        r, p = rows[~first], pair[~first] - capsule.shape[1]
        gradient[~first] = np.einsum("nk,nkj->nj", normal[r, p], self._mixed(jacobians, r, self._with_box[p], u[r, p]))
        return Nearest(distance[rows, pair], gradient, pair)

    def _index_shapes(self) -> None:
        """All capsules in one list, those of the arms first, and all boxes in another."""
        arms, fixed = self.shapes.arms, self.shapes.capsules
        self._radii = np.concatenate([*(arm.radii for arm in arms), np.array([c.radius for c in fixed])])
        self._links = [link for arm in arms for link in arm.links] + [c.link for c in fixed]
        self._arm_of = np.array([i for i, arm in enumerate(arms) for _ in arm.radii] + [-1] * len(fixed), dtype=np.intp)
        self._fixed_starts = np.array([c.start for c in fixed]).reshape(-1, 3)
        self._fixed_ends = np.array([c.end for c in fixed]).reshape(-1, 3)
        self._moving = int((self._arm_of >= 0).sum())
        boxes = self.shapes.boxes
        self._box_rotation = np.array([b.rotation for b in boxes]).reshape(-1, 3, 3)
        self._box_centre = np.array([b.centre for b in boxes]).reshape(-1, 3)
        self._box_half = np.array([b.half for b in boxes]).reshape(-1, 3)
        self._box_links = [b.link for b in boxes]

    def _choose_pairs(self) -> None:
        disabled = {frozenset(pair) for pair in self.robot.description.disabled_collisions}
        count = len(self._radii)
        capsule = [
            (i, j)
            for i in range(self._moving)
            for j in range(i + 1, count)
            if self._arm_of[i] != self._arm_of[j] and frozenset((self._links[i], self._links[j])) not in disabled
        ]
        boxes = [
            (i, b)
            for i in range(self._moving)
            for b in range(len(self._box_links))
            if frozenset((self._links[i], self._box_links[b])) not in disabled
        ]
        self._take(np.array(capsule, dtype=np.intp).reshape(-1, 2), np.array(boxes, dtype=np.intp).reshape(-1, 2))
        rng = np.random.default_rng(0)
        poses = self.robot.clamp(rng.uniform(self.robot.lower, self.robot.upper, (_SAMPLES, len(self.robot.lower))))
        seen = np.concatenate([self.distances(chunk) for chunk in np.array_split(poses, 16)])
        keep = ((seen < 0.0).mean(axis=0) <= _ALWAYS) & (seen.min(axis=0) < _FAR)
        keep &= self.distances(self.robot.rest)[0] > 0.0
        keep_capsule, keep_box = keep[: len(self._first)], keep[len(self._first) :]
        self._take(
            np.stack([self._first, self._second], axis=1)[keep_capsule],
            np.stack([self._with_box, self._box], axis=1)[keep_box],
        )
        self.pairs = tuple(
            [(self._links[i], self._links[j]) for i, j in zip(self._first, self._second, strict=True)]
            + [(self._links[i], self._box_links[b]) for i, b in zip(self._with_box, self._box, strict=True)]
        )

    def _take(
        self,
        capsule: np.ndarray[tuple[int, int], np.dtype[np.intp]],
        box: np.ndarray[tuple[int, int], np.dtype[np.intp]],
    ) -> None:
        self._first, self._second = capsule[:, 0], capsule[:, 1]
        self._with_box, self._box = box[:, 0], box[:, 1]
        self._reach = self._radii[self._first] + self._radii[self._second]

    def _ends(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Starts and ends of all capsules, ``(N, P, 3)`` [m] each."""
        starts, ends = [], []
        for arm in self.shapes.arms:
            points = arm.chain.points(q[:, arm.part])
            starts.append(points[:, : len(arm.radii)])
            ends.append(points[:, len(arm.radii) :])
        shape = (len(q), *self._fixed_starts.shape)
        starts.append(np.broadcast_to(self._fixed_starts, shape))
        ends.append(np.broadcast_to(self._fixed_ends, shape))
        return np.concatenate(starts, axis=1), np.concatenate(ends, axis=1)

    def _end_jacobians(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of starts and ends by all joints, ``(N, P, 3, n)`` [m/rad] each; zero for what stands still."""
        starts = np.zeros((len(q), len(self._radii), 3, q.shape[1]))
        ends = np.zeros_like(starts)
        at = 0
        for arm in self.shapes.arms:
            count = len(arm.radii)
            jacobian = arm.chain.jacobians(q[:, arm.part])[1]
            starts[:, at : at + count, :, arm.part] = jacobian[:, :count]
            ends[:, at : at + count, :, arm.part] = jacobian[:, count:]
            at += count
        return starts, ends

    @staticmethod
    def _mixed(
        jacobians: tuple[FloatArray, FloatArray], rows: FloatArray, capsules: FloatArray, at: FloatArray
    ) -> FloatArray:
        starts, ends = jacobians
        weight = at[:, None, None]
        return np.asarray((1.0 - weight) * starts[rows, capsules] + weight * ends[rows, capsules])

    def _capsule_pairs(
        self, starts: FloatArray, ends: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Distances ``(N, pairs)``, places on both segments in [0, 1], and the unit vector from second to first."""
        p, q = starts[:, self._first], starts[:, self._second]
        d, e = ends[:, self._first] - p, ends[:, self._second] - q
        s, t = _closest(p, d, q, e)
        gap = p + s[..., None] * d - q - t[..., None] * e
        length = np.linalg.norm(gap, axis=-1)
        along = gap / np.maximum(length, 1e-12)[..., None]
        return length - self._reach, s, t, along

    def _box_pairs(self, starts: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distances ``(N, pairs)``, places on the segments, and outward normals in the torso frame."""
        rotation, centre, half = self._box_rotation[self._box], self._box_centre[self._box], self._box_half[self._box]
        start = np.einsum("pji,npj->npi", rotation, starts[:, self._with_box] - centre)
        along = np.einsum("pji,npj->npi", rotation, ends[:, self._with_box] - centre) - start
        t = _golden(lambda at: _box_distance(start + at[..., None] * along, half), start.shape[:2])
        point = start + t[..., None] * along
        normal = np.einsum("pij,npj->npi", rotation, _box_normal(point, half))
        return _box_distance(point, half) - self._radii[self._with_box], t, normal


def _closest(p: FloatArray, d: FloatArray, q: FloatArray, e: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places in [0, 1] of the nearest points of the segments ``p + s d`` and ``q + t e``."""
    r = p - q
    a, b, c = (np.einsum("...k,...k", x, y) for x, y in ((d, d), (d, e), (e, e)))
    f, g = np.einsum("...k,...k", d, r), np.einsum("...k,...k", e, r)
    safe_a, safe_c = np.maximum(a, 1e-18), np.maximum(c, 1e-18)
    denominator = a * c - b * b
    s = np.where(denominator > 1e-12 * safe_a * safe_c, (b * g - f * c) / np.maximum(denominator, 1e-30), 0.0)
    s = np.clip(s, 0.0, 1.0)
    t = np.clip((b * s + g) / safe_c, 0.0, 1.0)
    s = np.clip(np.where(a > 0.0, (b * t - f) / safe_a, 0.0), 0.0, 1.0)
    return s, t


def _box_distance(point: FloatArray, half: FloatArray) -> FloatArray:
    """Signed distance from points in a box's own frame to the box."""
    outside = np.abs(point) - half
    return np.asarray(np.linalg.norm(np.maximum(outside, 0.0), axis=-1) + np.minimum(outside.max(axis=-1), 0.0))


def _box_normal(point: FloatArray, half: FloatArray) -> FloatArray:
    """Gradient of ``_box_distance``."""
    outside = np.abs(point) - half
    away = np.maximum(outside, 0.0)
    length = np.linalg.norm(away, axis=-1, keepdims=True)
    nearest_face = np.eye(3)[np.argmax(outside, axis=-1)]
    return np.asarray(np.sign(point) * np.where(length > 1e-12, away / np.maximum(length, 1e-12), nearest_face))


def _golden(function: Callable[[FloatArray], FloatArray], shape: tuple[int, ...], steps: int = 16) -> FloatArray:
    """Minimum of convex functions on [0, 1], one per element of ``shape``."""
    low, high = np.zeros(shape), np.ones(shape)
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    f_left, f_right = function(left), function(right)
    for _ in range(steps):
        smaller = f_left < f_right
        high, low = np.where(smaller, right, high), np.where(smaller, low, left)
        fresh = np.where(smaller, high - _GOLDEN * (high - low), low + _GOLDEN * (high - low))
        value = function(fresh)
        left, right = np.where(smaller, fresh, right), np.where(smaller, left, fresh)
        f_left, f_right = np.where(smaller, value, f_right), np.where(smaller, f_left, value)
    return np.asarray((low + high) / 2.0)
