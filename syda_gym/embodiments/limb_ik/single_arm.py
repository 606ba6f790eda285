"""SingleArmIK: the limb inverse kinematics of one arm for one frame, in plain floats.

For a single frame numpy spends its time on calling, not on calculating: the batched solver takes over 10 ms for what
takes a tenth of a millisecond here. Live teleoperation maps one frame at a time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.coupled import coupled_range
from syda_gym.embodiments.kinematics.two_turns import TwoTurns, Vector, turned_back

__all__ = ["EXACT", "FLAT", "STEPS", "SingleArmIK"]

Swept = tuple[list[Vector], list[Vector], list[Vector]]
Couplings = Sequence[tuple[int, int, FloatArray, FloatArray, FloatArray]]

EXACT = 1e-7  # m, as in limb_ik
STEPS = 60
_TURN = 2.0 * math.pi
FLAT = 1e-16  # m^4/rad^2; with a squared slope below this no step gains anything


class SingleArmIK:
    """The same problem, candidates and refinement as ``LimbIK`` for an arm with a closed form.

    Args:
        chain: kinematics of the arm.
        axes: joint axes at the zero pose in the torso frame ``(n, 3)``.
        movers: the four joints that move elbow and wrist.
        lengths: upper arm and forearm [m].
        zero: unit directions of upper arm and forearm at the zero pose, the latter with the other joints at rest.
        rest: rest angles of the arm ``(n,)`` [rad].
        couplings: coupled limits among the arm's own joints: joint, governor, angles, lower, upper.
    """

    def __init__(
        self,
        chain: ArmChain,
        axes: FloatArray,
        movers: Sequence[int],
        lengths: FloatArray,
        zero: tuple[FloatArray, FloatArray],
        rest: FloatArray,
        couplings: Couplings,
    ) -> None:
        self.movers = tuple(movers)
        self.lengths = (float(lengths[0]), float(lengths[1]))
        self.rest: list[float] = rest.tolist()
        self.lower: list[float] = chain.lower.tolist()
        self.upper: list[float] = chain.upper.tolist()
        self.middle = [0.5 * (low + high) for low, high in zip(self.lower, self.upper, strict=True)]
        # Per mover: where a whole turn about mid-range starts, the limits, and the angle at rest.
        self._windows = [((self.middle[j] - math.pi, self.lower[j], self.upper[j]), self.rest[j]) for j in self.movers]
        self.axes: list[Vector] = [tuple(axis) for axis in axes.tolist()]
        self.couplings = [(j, by, at.tolist(), low.tolist(), high.tolist()) for j, by, at, low, high in couplings]
        self.carriers = chain.point_joints[:3]
        self._plan = _plan(chain, axes)
        self._first, self._second, third, fourth = (self.axes[joint] for joint in self.movers)
        self.upper_zero: Vector = tuple(zero[0].tolist())
        self.fore_zero: Vector = tuple(zero[1].tolist())
        self._to_elbow = TwoTurns(self._first, self._second, self.upper_zero)
        self._to_wrist = TwoTurns(third, fourth, self.fore_zero)
        self.exact = self._is_exact()

    def solve(self, upper: Vector, fore: Vector) -> list[float]:
        """Joint angles [rad] of the arm, within its limits.

        Args:
            upper: unit direction of the upper arm in the torso frame.
            fore: unit direction of the forearm.
        """
        if self.exact:
            solved = self.solved(upper, fore)
            if solved is not None:
                return solved
        goal_elbow = _scaled(upper, self.lengths[0])
        goal = (*goal_elbow, *_sum(goal_elbow, _scaled(fore, self.lengths[1])))
        best, least, miss = self.rest, math.inf, math.inf
        for candidate, _ in self._candidates(upper, fore):
            angles = self._clamped(candidate)
            error = math.sqrt(_squared(_residual(_sweep(self._plan, angles)[0], goal)))
            score = error + self._pull(angles)
            if score < least:
                best, least, miss = angles, score, error
        return best if miss <= EXACT else self._refine(best, goal)

    def solved(self, upper: Vector, fore: Vector) -> list[float] | None:
        """Of the closed-form solutions within the limits the one nearest to rest; most frames need nothing else.

        Args:
            upper: unit direction of the upper arm in the torso frame.
            fore: unit direction of the forearm.

        Returns:
            Joint angles [rad] of the arm, ``None`` if the limits allow no solution.
        """
        (w0, r0), (w1, r1), (w2, r2), (w3, r3) = self._windows
        real, elbows = self._to_elbow.solve(upper)
        best, least = None, math.inf
        for a0, a1 in elbows if real else ():
            b0, b1 = _wrapped(a0, w0), _wrapped(a1, w1)
            if b0 is None or b1 is None:
                continue
            real, wrists = self._to_wrist.solve(turned_back(self._first, self._second, b0, b1, fore))
            for a2, a3 in wrists if real else ():
                b2, b3 = _wrapped(a2, w2), _wrapped(a3, w3)
                if b2 is None or b3 is None:
                    continue
                # Among equally good solutions the nearest to rest, as the pull of the other candidates has it.
                pull = abs(b0 - r0) + abs(b1 - r1) + abs(b2 - r2) + abs(b3 - r3)
                if pull < least:
                    angles = self.rest.copy()
                    for joint, angle in zip(self.movers, (b0, b1, b2, b3), strict=True):
                        angles[joint] = angle
                    if self._within_couplings(angles):
                        best, least = angles, pull
        return best

    def _within_couplings(self, angles: list[float]) -> bool:
        """Whether angles within their own limits obey the coupled ones too."""
        for joint, by, at, low, high in self.couplings:
            least, most = coupled_range(angles[by], at, low, high)
            if not least <= angles[joint] <= most:
                return False
        return True

    def _is_exact(self) -> bool:
        """Whether the closed form leaves no error: the last two movers then turn the forearm about the elbow."""
        rng = np.random.default_rng(0)
        for directions in rng.normal(size=(8, 2, 3)):
            upper, fore = (tuple((d / np.linalg.norm(d)).tolist()) for d in directions)
            goal_elbow = _scaled(upper, self.lengths[0])
            goal = (*goal_elbow, *_sum(goal_elbow, _scaled(fore, self.lengths[1])))
            for angles, real in self._candidates(upper, fore):
                if real and _squared(_residual(_sweep(self._plan, angles)[0], goal)) > EXACT**2:
                    return False
        return True

    def _pull(self, angles: list[float]) -> float:
        """A tiny pull towards rest makes the choice among equally good solutions unique."""
        return 1e-6 * sum([abs(a - r) for a, r in zip(angles, self.rest, strict=True)])

    def _candidates(self, upper: Vector, fore: Vector) -> list[tuple[list[float], bool]]:
        """The four solutions without regard to limits, and whether each is one rather than the nearest to one."""
        found = []
        real_upper, elbows = self._to_elbow.solve(upper)
        for a0, a1 in elbows:
            real_fore, wrists = self._to_wrist.solve(turned_back(self._first, self._second, a0, a1, fore))
            for a2, a3 in wrists:
                angles = self.rest.copy()
                for joint, angle, ((lowest, _, _), _) in zip(self.movers, (a0, a1, a2, a3), self._windows, strict=True):
                    angles[joint] = lowest + (angle - lowest) % _TURN
                found.append((angles, real_upper and real_fore))
        return found

    def _limits(self, angles: list[float]) -> tuple[list[float], list[float]]:
        if not self.couplings:
            return self.lower, self.upper
        lower, upper = self.lower.copy(), self.upper.copy()
        for joint, by, at, low, high in self.couplings:
            a, b = coupled_range(angles[by], at, low, high)
            lower[joint], upper[joint] = max(lower[joint], a), min(upper[joint], b)
        return lower, upper

    def _clamped(self, angles: list[float]) -> list[float]:
        inside = [min(max(a, low), high) for a, low, high in zip(angles, self.lower, self.upper, strict=True)]
        if not self.couplings:
            return inside
        lower, upper = self._limits(inside)
        return [min(max(a, low), high) for a, low, high in zip(inside, lower, upper, strict=True)]

    def _columns(self, swept: Swept) -> list[tuple[float, ...]]:
        """Derivatives of elbow and wrist against the shoulder with respect to each mover, six numbers each."""
        points, origins, axes = swept
        columns: list[tuple[float, ...]] = []
        for joint in self.movers:
            speeds = [
                _cross(axes[joint], _difference(point, origins[joint])) if joint <= carrier else (0.0, 0.0, 0.0)
                for point, carrier in zip(points, self.carriers, strict=True)
            ]
            columns.append((*_difference(speeds[1], speeds[0]), *_difference(speeds[2], speeds[0])))
        return columns

    def _refine(self, angles: list[float], goal: tuple[float, ...]) -> list[float]:
        """Projected Levenberg-Marquardt on elbow and wrist [m], as in ``limb_ik`` but for one frame."""
        swept = _sweep(self._plan, angles)
        residual, columns = _residual(swept[0], goal), self._columns(swept)
        cost, damping = _squared(residual), 1e-4
        for _ in range(STEPS):
            lower, upper = self._limits(angles)
            free, gradient = [], []
            for index, joint in enumerate(self.movers):
                slope = _dot6(columns[index], residual)
                at_lower = angles[joint] <= lower[joint] + 1e-12 and slope > 0.0
                at_upper = angles[joint] >= upper[joint] - 1e-12 and slope < 0.0
                if not (at_lower or at_upper):
                    free.append(index)
                    gradient.append(slope)
            if sum([slope * slope for slope in gradient]) < FLAT:
                break
            step = _damped_step([columns[index] for index in free], gradient, damping)
            promised = -0.5 * sum([g * s for g, s in zip(gradient, step, strict=True)])
            trial = angles.copy()
            for index, move in zip(free, step, strict=True):
                trial[self.movers[index]] += move
            trial = self._clamped(trial)
            swept = _sweep(self._plan, trial)
            new_residual = _residual(swept[0], goal)
            new_cost = _squared(new_residual)
            gain = cost - new_cost
            if gain <= 1e-12 and damping > 10.0:
                break
            # Far from the goal Gauss-Newton overshoots; trust it more only where it delivers what it promises.
            damping = min(max(damping * (0.2 if gain > max(0.0, promised) else 5.0), 1e-7), 1e2)
            if gain > 0.0:
                angles, residual, cost = trial, new_residual, new_cost
                columns = self._columns(swept)
        return angles


class _Joint:
    """One step along the arm at the zero pose: where the joint sits, how it turns and which points it carries."""

    __slots__ = ("axis", "kind", "offset", "points", "sign")

    def __init__(self, offset: Vector, axis: Vector, points: list[tuple[int, Vector]]) -> None:
        self.offset = offset
        self.axis = axis
        self.points = points
        self.kind, self.sign = 3, 1.0
        for index in range(3):  # turns about a coordinate axis mix two columns only
            if abs(abs(axis[index]) - 1.0) < 1e-12:
                self.kind, self.sign = index, math.copysign(1.0, axis[index])


def _plan(chain: ArmChain, axes: FloatArray) -> tuple[list[tuple[int, Vector]], list[_Joint]]:
    """Product-of-exponentials form: points fixed to the torso, and the joints with everything in the torso frame."""
    rotation, position, origins = np.eye(3), np.zeros(3), []
    frames = []
    for fixed, offset in zip(chain.rotations, chain.offsets, strict=True):
        position = position + rotation @ offset
        rotation = rotation @ fixed
        origins.append(position)
        frames.append(rotation)
    still: list[tuple[int, Vector]] = []
    carried: list[list[tuple[int, Vector]]] = [[] for _ in origins]
    for index, carrier in enumerate(chain.point_joints[:3]):
        offset = chain.point_offsets[index]
        if carrier < 0:
            still.append((index, tuple(offset.tolist())))
        else:
            carried[carrier].append((index, tuple((frames[carrier] @ offset).tolist())))
    last = max((i for i, points in enumerate(carried) if points), default=-1)
    steps = [b - a for a, b in zip([np.zeros(3), *origins[:-1]], origins, strict=True)]
    return still, [_Joint(tuple(steps[i].tolist()), tuple(axes[i].tolist()), carried[i]) for i in range(last + 1)]


def _sweep(plan: tuple[list[tuple[int, Vector]], list[_Joint]], angles: list[float]) -> Swept:
    """Shoulder, elbow and wrist; origin and axis of every joint; all in the torso frame."""
    points: list[Vector] = [(0.0, 0.0, 0.0)] * 3
    origins: list[Vector] = []
    axes: list[Vector] = []
    for index, point in plan[0]:
        points[index] = point
    px = py = pz = 0.0
    ax, ay, az, bx, by, bz, cx, cy, cz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0  # columns of the rotation
    for joint, angle in zip(plan[1], angles, strict=False):
        x, y, z = joint.offset
        px += ax * x + bx * y + cx * z
        py += ay * x + by * y + cy * z
        pz += az * x + bz * y + cz * z
        origins.append((px, py, pz))
        c, s, kind = math.cos(angle), math.sin(angle) * joint.sign, joint.kind
        if kind == 0:
            axes.append((ax * joint.sign, ay * joint.sign, az * joint.sign))
            bx, cx = c * bx + s * cx, c * cx - s * bx
            by, cy = c * by + s * cy, c * cy - s * by
            bz, cz = c * bz + s * cz, c * cz - s * bz
        elif kind == 1:
            axes.append((bx * joint.sign, by * joint.sign, bz * joint.sign))
            cx, ax = c * cx + s * ax, c * ax - s * cx
            cy, ay = c * cy + s * ay, c * ay - s * cy
            cz, az = c * cz + s * az, c * az - s * cz
        elif kind == 2:
            axes.append((cx * joint.sign, cy * joint.sign, cz * joint.sign))
            ax, bx = c * ax + s * bx, c * bx - s * ax
            ay, by = c * ay + s * by, c * by - s * ay
            az, bz = c * az + s * bz, c * bz - s * az
        else:
            x, y, z = joint.axis
            axes.append((ax * x + bx * y + cx * z, ay * x + by * y + cy * z, az * x + bz * y + cz * z))
            rest = 1.0 - c
            m00, m10, m20 = c + x * x * rest, y * x * rest + z * s, z * x * rest - y * s
            m01, m11, m21 = x * y * rest - z * s, c + y * y * rest, z * y * rest + x * s
            m02, m12, m22 = x * z * rest + y * s, y * z * rest - x * s, c + z * z * rest
            ax, bx, cx = (
                ax * m00 + bx * m10 + cx * m20,
                ax * m01 + bx * m11 + cx * m21,
                ax * m02 + bx * m12 + cx * m22,
            )
            ay, by, cy = (
                ay * m00 + by * m10 + cy * m20,
                ay * m01 + by * m11 + cy * m21,
                ay * m02 + by * m12 + cy * m22,
            )
            az, bz, cz = (
                az * m00 + bz * m10 + cz * m20,
                az * m01 + bz * m11 + cz * m21,
                az * m02 + bz * m12 + cz * m22,
            )
        for index, (x, y, z) in joint.points:
            points[index] = (
                px + ax * x + bx * y + cx * z,
                py + ay * x + by * y + cy * z,
                pz + az * x + bz * y + cz * z,
            )
    return points, origins, axes


def _residual(points: list[Vector], goal: tuple[float, ...]) -> tuple[float, ...]:
    """Elbow and wrist against the shoulder, minus where they should be."""
    (sx, sy, sz), elbow, wrist = points
    return (
        elbow[0] - sx - goal[0],
        elbow[1] - sy - goal[1],
        elbow[2] - sz - goal[2],
        wrist[0] - sx - goal[3],
        wrist[1] - sy - goal[4],
        wrist[2] - sz - goal[5],
    )


def _damped_step(columns: list[tuple[float, ...]], gradient: list[float], damping: float) -> list[float]:
    """Solves (J^T J + damping I) step = -gradient by Cholesky's method; at most four unknowns."""
    count = len(columns)
    factor = [[0.0] * count for _ in range(count)]
    middle = [0.0] * count
    for i in range(count):
        row = factor[i]
        for j in range(i + 1):
            value = _dot6(columns[i], columns[j])
            other = factor[j]
            for k in range(j):
                value -= row[k] * other[k]
            row[j] = math.sqrt(value + damping) if i == j else value / other[j]
        value = -gradient[i]
        for k in range(i):
            value -= row[k] * middle[k]
        middle[i] = value / row[i]
    step = [0.0] * count
    for i in range(count - 1, -1, -1):
        value = middle[i]
        for k in range(i + 1, count):
            value -= factor[k][i] * step[k]
        step[i] = value / factor[i][i]
    return step


def _wrapped(angle: float, window: tuple[float, float, float]) -> float | None:
    """The angle by whole turns within the limits; ``None`` if there is no such."""
    lowest, lower, upper = window
    angle = lowest + (angle - lowest) % _TURN
    return angle if lower <= angle <= upper else None


def _dot6(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


def _squared(a: tuple[float, ...]) -> float:
    return _dot6(a, a)


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _sum(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _difference(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _scaled(a: Vector, factor: float) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor
