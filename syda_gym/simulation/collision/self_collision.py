"""SelfCollision: would the robot touch itself? The URDF's collision shapes, by closed forms or pinocchio and coal."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.urdf import UrdfTree, configuration, read_urdf
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError
from syda_gym.simulation.collision.clearance import Clearance
from syda_gym.simulation.collision.contact.shapes import of_model

__all__ = ["RESERVE", "SelfCollision"]

RESERVE = 1e-3
"""Further distance [m] that is kept where a way is foreseen rather than known, such as that of braking."""

_SAMPLES = 256
_STEP = 0.1  # rad; how far apart the tested poses of a way may be
_FEW = 24  # pairs; looking at more of them one by one takes as long as looking at all
_LARGE = 500  # vertices of a mesh
_CLOSE = 0.25  # m; a bound above it will do for a distance
_ALWAYS = 0.5  # pairs that touch in more than this share of random poses overlap by construction


class SelfCollision:
    """Checks command steps against the robot's own body.

    The joints that are not arm joints are locked at rest. Pairs of shapes that are neighbours in the kinematic tree,
    that the description disables, that already touch at rest or that touch in most random poses say nothing about a
    pose and are left out, as in the set-up assistants of motion planners.

    Spheres, capsules, and these against boxes and cylinders have closed forms, which are computed in compiled loops
    over all pairs at once. The other pairs (two boxes, meshes) are excluded by balls about them, or else asked of coal.

    Args:
        robot: whose shapes.
        margin: distance [m] below which two links count as touching.
        samples: random poses in which pairs that overlap by construction are told from others.

    Attributes:
        available: false when the URDF has no collision shape that could be read; then nothing is checked, and
            ``why`` says so.
        why: empty, or the reason for not checking.
        pairs: number of pairs of shapes that are checked.
        ignored: names of links whose shapes overlap by construction or touch at rest, left out for that.

    Raises:
        OptionError: ``margin`` is negative.
    """

    def __init__(self, robot: Robot, margin: float = 0.005, *, samples: int = _SAMPLES) -> None:
        if margin < 0.0:
            raise OptionError(f"self-collision margin must not be negative, got {margin} m")
        self.robot = robot
        self.margin = margin
        self.why = ""
        self.pairs = 0
        self.ignored: tuple[tuple[str, str], ...] = ()
        import pinocchio

        self._pin: Any = pinocchio
        try:
            self._model, self._shapes = _arm_model(robot)
        except (ValueError, RuntimeError) as error:  # meshes that are missing or broken
            self.why = f"self-collision is not checked: {str(error).splitlines()[0]}"
        else:
            self._index, self._turns, self._columns, joints = _indices(self._model, robot)
            self._configuration = np.zeros(self._model.nq)
            self._choose_pairs(samples)
            self._clearance = Clearance(joints, self._model, self._shapes, margin + RESERVE)
            self._arrays = of_model(self._model, self._shapes, joints)
            self._every = np.arange(len(self._shapes.collisionPairs))
            self.pairs = len(self._shapes.collisionPairs)
            if self._arrays is not None:  # compiled now rather than on the way
                self.near(robot.rest, 0.0)
                self._touch(robot.rest[None], [])
                self._distances(robot.rest)
            if not self.pairs:
                self.why = f"self-collision is not checked: {robot.urdf.name} has no collision shapes on two links"

    @property
    def available(self) -> bool:
        """Whether anything is checked."""
        return not self.why

    def touches(self, angles: FloatArray) -> bool:
        """Whether any pair of links is nearer than the margin at ``angles`` ``(n,)`` [rad]."""
        if not self.available:
            return False
        return self._touch(angles[None], self._clearance.suspects(angles))

    def measure(self, angles: FloatArray) -> None:
        """Measures all distances at ``angles`` ``(n,)`` [rad], where that helps: checks near there become cheap."""
        if self.available and self._clearance.wants(angles):
            self._clearance.note(angles, self._distances(angles))

    def ignores_far_links(self) -> bool:
        """Whether a pair was left out because it touches at rest although the links are no near relatives.

        Then the rest pose is a bad one rather than the shapes too coarse: an arm that rests on the body, say.
        """
        if not self.available:
            return False
        joints = {self._model.frames[s.parentFrame].name: s.parentJoint for s in self._shapes.geometryObjects}
        return any(self._steps(joints[a], joints[b]) > 3 for a, b in self.ignored)

    def _steps(self, first: int, second: int) -> int:
        """Number of joints between two joints of the tree."""
        parents = self._model.parents
        above: dict[int, int] = {}
        count = 0
        while True:
            above[first] = count
            if first == 0:
                break
            first, count = parents[first], count + 1
        count = 0
        while second not in above:
            second, count = parents[second], count + 1
        return above[second] + count

    def free_path(self, start: FloatArray, end: FloatArray) -> bool:
        """Whether the straight way from ``start`` (known to be free) to ``end`` is free, tested every 0.1 rad."""
        return not self.available or self._is_free(start, end, self._clearance.suspects(start, end))

    def suspects(self, *poses: FloatArray) -> list[int] | None:
        """Pairs that may touch somewhere in the box of joint angles that ``poses`` span; ``None`` if all may."""
        return self._clearance.suspects(*poses) if self.available else []

    def free(self, poses: ArrayLike, suspects: list[int] | None, reserve: bool = False) -> bool:
        """Whether none of the suspected pairs touches at any pose ``(poses, n)`` [rad]; the last one is tried first.

        Args:
            poses: to look at.
            suspects: indices of pairs; all if ``None``.
            reserve: asks for ``RESERVE`` more than the margin.
        """
        return suspects == [] or not self._touch(np.asarray(poses), suspects, reserve)

    def overlaps(self, angles: FloatArray) -> dict[int, float]:
        """Pairs nearer than the margin at ``angles`` ``(n,)`` [rad], and how near [m]."""
        if not self.available:
            return {}
        everything = self._model, self._data, self._shapes, self._shape_data, self._full(angles)
        self._pin.updateGeometryPlacements(*everything)
        found = {}
        for pair in self._clearance.suspects(angles) or range(self.pairs):
            distance = float(self._pin.computeDistance(self._shapes, self._shape_data, pair).min_distance)
            if distance < self.margin:
                found[pair] = distance
        return found

    def near(self, angles: FloatArray, within: float) -> tuple[FloatArray, FloatArray]:
        """Distances of near pairs and how they change with the joint angles.

        Args:
            angles: ``(n,)`` [rad].
            within: pairs further apart are left out [m].

        Returns:
            Distances ``(pairs,)`` [m], negative where shapes overlap, and gradients ``(pairs, n)`` [m/rad].
        """
        pairs = self._clearance.within(angles, within)
        if self._arrays is None:
            return self._near(angles, pairs, within)
        distances, gradients = np.zeros(len(pairs)), np.zeros((len(pairs), len(angles)))
        asked, states = np.array(pairs, dtype=np.int64), np.zeros(len(pairs), dtype=np.int64)
        _call("near", self._arrays, np.ascontiguousarray(angles), asked, within, distances, gradients, states)
        for index in np.flatnonzero(states == 2):
            distance, gradient = self._near(angles, [pairs[index]], within)
            states[index] = len(distance)
            if len(distance):
                distances[index], gradients[index] = distance[0], gradient[0]
        found = states == 1
        return distances[found], gradients[found]

    def _near(self, angles: FloatArray, pairs: list[int], within: float) -> tuple[FloatArray, FloatArray]:
        """As ``near``, of the given pairs, by pinocchio and coal."""
        pin, model, data = self._pin, self._model, self._data
        pin.computeJointJacobians(model, data, self._full(angles))
        pin.updateGeometryPlacements(model, data, self._shapes, self._shape_data)
        look, shapes, shape_data = pin.computeDistance, self._shapes, self._shape_data
        distances, normals, kept, first, second = [], [], [], [], []
        for pair in pairs:
            result = look(shapes, shape_data, pair)
            distance = result.min_distance
            if distance < within:
                distances.append(distance)
                normals.append(result.normal)  # from the first shape to the second
                first.append(result.getNearestPoint1())
                second.append(result.getNearestPoint2())
                kept.append(pair)
        gradients = np.zeros((len(kept), len(angles)))
        if not kept:
            return np.zeros(0), gradients
        away = np.array(normals)
        for points, side, sign in ((np.array(first), 0, -1.0), (np.array(second), 1, 1.0)):
            joints = self._carriers[kept, side]
            for joint in set(joints.tolist()) - {0}:
                rows = joints == joint
                jacobian = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)[:, self._columns]
                lever = _cross(points[rows] - data.oMi[joint].translation, away[rows])
                gradients[rows] += sign * (away[rows] @ jacobian[:3] + lever @ jacobian[3:])
        usable = np.isfinite(gradients).all(axis=1)
        return np.array(distances)[usable], gradients[usable]

    def _distances(self, angles: FloatArray) -> FloatArray:
        """Distances of all pairs [m], or what they are at least where that is far."""
        everything = self._model, self._data, self._shapes, self._shape_data
        if self._arrays is None:
            self._pin.computeDistances(*everything, self._full(angles))
            return np.array([result.min_distance for result in self._shape_data.distanceResults])
        distances, opened = np.empty(self.pairs), np.empty(self.pairs, dtype=np.bool_)
        _call("measure", self._arrays, np.ascontiguousarray(angles), distances, opened)
        left = np.flatnonzero(opened & (distances < _CLOSE)).tolist()
        if left:
            self._pin.updateGeometryPlacements(*everything, self._full(angles))
        for pair in left:
            distances[pair] = self._pin.computeDistance(self._shapes, self._shape_data, pair).min_distance
        return distances

    def _is_free(self, start: FloatArray, end: FloatArray, suspects: list[int] | None) -> bool:
        """As ``free_path``, looking at the suspected pairs only, at all if there is no telling."""
        if suspects == []:
            return True
        count = max(math.ceil(float(np.abs(end - start).max()) / _STEP), 1)
        return not self._touch(start + (end - start) * (np.arange(1, count + 1)[:, None] / count), suspects)

    def _touch(self, poses: FloatArray, suspects: list[int] | None, reserve: bool = False) -> bool:
        """Whether any of the suspected pairs (all if ``None``) touches at any of the poses ``(K, n)``."""
        if self._arrays is None:
            return any(self._touches(pose, suspects, reserve) for pose in poses[::-1])
        pairs = self._every if suspects is None else np.array(suspects, dtype=np.int64)
        opened, poses = (
            np.zeros((len(poses), len(pairs)), dtype=np.bool_),
            np.ascontiguousarray(poses, dtype=np.float64),
        )
        margin = self.margin + RESERVE if reserve else self.margin
        if _call("touching", self._arrays, poses, pairs, margin, opened):
            return True
        if not opened.any():
            return False
        return any(
            self._touches(pose, pairs[left].tolist(), reserve)
            for pose, left in zip(poses[::-1], opened[::-1], strict=True)
            if left.any()
        )

    def _touches(self, angles: FloatArray, suspects: list[int] | None, reserve: bool) -> bool:
        """The same at one pose, by pinocchio and coal."""
        shape_data = self._reserved if reserve else self._shape_data
        everything = self._model, self._data, self._shapes, shape_data, self._full(angles)
        if suspects is None or len(suspects) > _FEW:
            return bool(self._pin.computeCollisions(*everything, True))
        self._pin.updateGeometryPlacements(*everything)
        look = self._pin.computeCollision
        return any(look(self._shapes, shape_data, pair) for pair in suspects)

    def _full(self, angles: FloatArray) -> FloatArray:
        self._configuration[self._index] = angles
        for joint, at in self._turns:  # a continuous joint is a cosine and a sine in pinocchio
            self._configuration[at] = math.cos(angles[joint])
            self._configuration[at + 1] = math.sin(angles[joint])
        return self._configuration

    def _hits(self, angles: FloatArray) -> list[bool]:
        self._pin.computeCollisions(self._model, self._data, self._shapes, self._shape_data, self._full(angles), False)
        return [result.isCollision() for result in self._shape_data.collisionResults]

    def _choose_pairs(self, samples: int) -> None:
        shapes = self._shapes
        shapes.addAllCollisionPairs()
        disabled = {frozenset(pair) for pair in self.robot.description.disabled_collisions}
        names = [self._model.frames[shape.parentFrame].name for shape in shapes.geometryObjects]
        joints = [shape.parentJoint for shape in shapes.geometryObjects]
        parents = self._model.parents
        within_reach = self._within_reach()
        self._keep(
            [
                within_reach(pair.first, pair.second)
                and frozenset((names[pair.first], names[pair.second])) not in disabled
                and parents[joints[pair.first]] != joints[pair.second]
                and parents[joints[pair.second]] != joints[pair.first]
                for pair in shapes.collisionPairs
            ]
        )
        rng = np.random.default_rng(0)
        poses = self.robot.clamp(rng.uniform(self.robot.lower, self.robot.upper, (samples, len(self.robot.lower))))
        frequency = np.mean([self._hits(pose) for pose in poses], axis=0)
        # Pairs within the margin at rest would never let the robot start.
        left_out = (frequency > _ALWAYS) | np.array(self._hits(self.robot.rest), dtype=bool)
        self.ignored = tuple(
            sorted(
                {
                    (names[pair.first], names[pair.second])
                    for pair, out in zip(shapes.collisionPairs, left_out, strict=True)
                    if out
                }
            )
        )
        self._keep(list(~left_out))
        # The check ends at the first hit; pairs that touch often come first.
        self._keep([True] * int((~left_out).sum()), np.argsort(-frequency[~left_out], kind="stable").tolist())

    def _within_reach(self) -> Callable[[int, int], bool]:
        """Tells which pairs can meet at all: each shape stays in a ball about the first joint of its arm.

        The ball's radius is the length of the arm's links up to the shape plus the shape's own size, whatever the joint
        angles, so that nothing is lost by leaving out pairs whose balls are apart.
        """
        model, zero = self._model, np.zeros(3)
        lengths, roots = [0.0], [0]
        for joint in range(1, model.njoints):
            parent = model.parents[joint]
            roots.append(joint if parent == 0 else roots[parent])
            step = float(np.linalg.norm(model.jointPlacements[joint].translation))
            lengths.append(0.0 if parent == 0 else lengths[parent] + step)
        balls = []
        for shape in self._shapes.geometryObjects:
            shape.geometry.computeLocalAABB()
            middle = shape.placement.act(np.array(shape.geometry.aabb_center))
            radius = float(shape.geometry.aabb_radius)
            if shape.parentJoint == 0:
                balls.append((middle, radius))
            else:
                root = model.jointPlacements[roots[shape.parentJoint]].act(zero)
                balls.append((root, lengths[shape.parentJoint] + float(np.linalg.norm(middle)) + radius))

        def meet(first: int, second: int) -> bool:
            (a, r), (b, s) = balls[first], balls[second]
            return bool(np.linalg.norm(a - b) <= r + s + self.margin)

        return meet

    def _keep(self, chosen: list[bool], order: list[int] | None = None) -> None:
        """Keeps only the chosen pairs of shapes, perhaps in another order, and renews what depends on them."""
        # Indices first: the list's elements are references into a vector that changes under removal.
        pairs = [(pair.first, pair.second) for pair in self._shapes.collisionPairs]
        self._shapes.removeAllCollisionPairs()
        for index in range(len(pairs)) if order is None else order:
            if chosen[index]:
                self._shapes.addCollisionPair(self._pin.CollisionPair(*pairs[index]))
        carriers = [shape.parentJoint for shape in self._shapes.geometryObjects]
        kept = [(carriers[pair.first], carriers[pair.second]) for pair in self._shapes.collisionPairs]
        self._carriers = np.array(kept, dtype=np.int64).reshape(-1, 2)  # the joints that carry the shapes of each pair
        self._data = self._pin.Data(self._model)
        self._shape_data = self._pin.GeometryData(self._shapes)
        self._reserved = self._pin.GeometryData(self._shapes)
        for shape_data, margin in ((self._shape_data, self.margin), (self._reserved, self.margin + RESERVE)):
            for request in shape_data.collisionRequests:
                request.security_margin = margin
            with warnings.catch_warnings():  # the attribute is going to be renamed, and its successor does nothing yet
                warnings.simplefilter("ignore", DeprecationWarning)
                for request in (*shape_data.collisionRequests, *shape_data.distanceRequests):
                    # A search that begins where the last one ended has last bits that depend on what was asked before.
                    request.enable_cached_gjk_guess = False


def _arm_model(robot: Robot) -> tuple[Any, Any]:
    """Pinocchio's model and collision shapes with every joint but the arms' locked at rest."""
    import pinocchio

    tree = read_urdf(robot.urdf)
    shapes = _whole_shapes(tree)
    still = {name: angle for name, angle in robot.description.rest.items() if name not in robot.joint_names}
    kept_names = {"universe", *(tree.model_joints[name] for name in robot.joint_names)}
    locked = [tree.model.getJointId(name) for name in tree.model.names if name not in kept_names]
    reduced, kept = pinocchio.buildReducedModel(tree.model, shapes, locked, configuration(tree, still))
    return reduced, kept


@lru_cache(maxsize=4)
def _whole_shapes(tree: UrdfTree) -> Any:
    """Collision shapes of a file, meshes as convex hulls; kept, because hulls take seconds and are asked for often."""
    import pinocchio

    shapes = pinocchio.buildGeomFromUrdfString(tree.model, tree.xml, pinocchio.GeometryType.COLLISION)
    _join_capsules(shapes)
    for shape in shapes.geometryObjects:
        _convex(shape)
    return shapes


def _join_capsules(shapes: Any) -> None:
    """Makes one capsule of a cylinder and the two spheres at its ends, which is how URDF writes a capsule."""
    import coal

    # Plain copies first: the list's elements are references into a vector that changes under removal.
    balls = {
        shape.name: (shape.parentFrame, float(shape.geometry.radius), np.array(shape.placement.translation))
        for shape in shapes.geometryObjects
        if isinstance(shape.geometry, coal.Sphere)
    }
    needless: set[str] = set()
    for shape in shapes.geometryObjects:
        if not isinstance(shape.geometry, coal.Cylinder):
            continue
        radius, half = float(shape.geometry.radius), float(shape.geometry.halfLength)
        ends = [shape.placement.act(np.array([0.0, 0.0, sign * half])) for sign in (1.0, -1.0)]
        caps = [
            name
            for end in ends
            for name, (frame, size, centre) in balls.items()
            if frame == shape.parentFrame and abs(size - radius) < 1e-6 and np.linalg.norm(centre - end) < 1e-6
        ]
        if len(caps) >= 2:
            shape.geometry = coal.Capsule(radius, 2.0 * half)
            needless.update(caps)
    for name in needless:
        shapes.removeGeometryObject(name)


def _convex(shape: Any) -> None:
    """Replaces a mesh by its convex hull, which is faster to check and never smaller."""
    if hasattr(shape.geometry, "buildConvexHull"):
        try:
            small = _hull(shape.geometry)
            if small is not None:
                shape.geometry = small
                return
            shape.geometry.buildConvexHull(True, "Qt")
        except RuntimeError:  # a mesh that has no volume stays as it is
            return
        if shape.geometry.convex is not None:
            shape.geometry = shape.geometry.convex


def _hull(mesh: Any) -> Any:
    """The convex hull of a large mesh, from its corners alone, which is faster; ``None`` if that cannot be had."""
    import coal
    from scipy.spatial import ConvexHull, QhullError

    points = np.array(mesh.vertices(), dtype=np.float64).reshape(-1, 3)
    if len(points) < _LARGE:
        return None
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:
        return None
    vertices = coal.StdVec_Vec3s()
    for corner in corners:
        vertices.append(corner)
    return coal.ConvexBase.convexHull(vertices, True, "Qt")


def _indices(model: Any, robot: Robot) -> tuple[list[int], list[tuple[int, int]], list[int], dict[int, int]]:
    """Where angles go in pinocchio's configuration, continuous joints, columns of Jacobians, and joints to angles."""
    index, turns, columns, joints = [], [], [], {}
    names = read_urdf(robot.urdf).model_joints
    for column, name in enumerate(robot.joint_names):
        joint = model.joints[model.getJointId(names[name])]
        joints[int(joint.id)] = column
        index.append(joint.idx_q)
        columns.append(joint.idx_v)
        if joint.nq == 2:
            turns.append((column, joint.idx_q))
    return index, turns, columns, joints


def _call(name: str, *arguments: Any) -> Any:
    """Calls a compiled function; numba is imported where shapes are looked at, not before."""
    call, looking = _arithmetic()
    return call(getattr(looking, name), *arguments)


@lru_cache(maxsize=1)
def _arithmetic() -> tuple[Any, Any]:
    from syda_gym.embodiments.limb_ik.compiling import first_call
    from syda_gym.simulation.collision.contact import looking

    return first_call, looking


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of rows ``(N, 3)``; numpy's own takes several times as long."""
    result = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
    return result
