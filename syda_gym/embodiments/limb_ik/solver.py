"""LimbIK: joint angles that point a robot's upper arms and forearms in given directions, within joint limits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.two_turns import Vector
from syda_gym.embodiments.limb_ik.single_arm import SingleArmIK
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError

__all__ = ["LimbIK"]

_EXACT = 1e-7  # m; a closed-form solution nearer than this needs no refinement
_STEPS = 60
_FEW = 30  # below so many rows, steps in plain floats are faster than in numpy


class LimbIK:
    """Inverse kinematics on limb directions.

    Two joints point the upper arm and the next two point the forearm. Each is the second Paden-Kahan subproblem
    (Murray, Li, Sastry, *A Mathematical Introduction to Robotic Manipulation*, 1994, section 3.2), solved in closed
    form. Where the limits forbid the solution, or an arm's elbow is also moved by a third joint, projected
    Levenberg-Marquardt steps bring elbow and wrist as near as the limits allow, in metres. Further joints (wrist) stay
    at rest.

    Args:
        robot: whose arms.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._arms = tuple(_ArmIK(robot, index, chain) for index, chain in enumerate(robot.chains))
        single = [arm.single for arm in self._arms if arm.single is not None]
        self._single = tuple(single) if len(single) == len(self._arms) else ()

    @classmethod
    def of(cls, robot: Robot) -> LimbIK:
        """The solver of a robot, made once and kept as long as the robot."""
        if cls not in robot.memo:
            robot.memo[cls] = cls(robot)
        solver: LimbIK = robot.memo[cls]
        return solver

    @property
    def single_arms(self) -> tuple[SingleArmIK, ...]:
        """The solvers of single frames, one per arm; empty if an arm has no closed form."""
        return self._single

    def solve(self, directions: ArrayLike) -> FloatArray:
        """Joint angles whose limb directions are nearest to the wanted ones.

        Args:
            directions: ``(N, arms, 2, 3)``: upper arm and forearm of each arm in the torso frame; any positive length.

        Returns:
            Frames ``(N, n)`` [rad] within all limits, coupled ones included.

        Raises:
            EmbodimentError: wrong shape, not finite, or a direction of zero length.
        """
        wanted = np.asarray(directions, dtype=np.float64)
        if wanted.ndim != 4 or wanted.shape[1:] != (len(self._arms), 2, 3):
            raise EmbodimentError(
                f"directions for {self.robot.name!r}: expected (N, {len(self._arms)}, 2, 3), got {wanted.shape}"
            )
        norms = np.linalg.norm(wanted, axis=-1, keepdims=True)
        if not np.isfinite(wanted).all() or (norms < 1e-9).any():
            raise EmbodimentError(f"directions for {self.robot.name!r} must be finite and longer than zero")
        unit = wanted / norms
        if len(unit) == 1 and self._single:
            return np.array([self.solve_frame([(tuple(a), tuple(b)) for a, b in unit[0].tolist()])])
        frames = np.repeat(self.robot.rest[None], len(unit), axis=0)
        for index, arm in enumerate(self._arms):
            frames = arm.solve(frames, unit[:, index])
        return frames

    def solve_frame(self, directions: Sequence[tuple[Vector, Vector]]) -> list[float]:
        """The same for one frame, without numpy's overhead where the arms allow it.

        Args:
            directions: arms, limbs, xyz: unit vectors as nested sequences of floats.

        Returns:
            The angles of one frame [rad].
        """
        if not self._single:
            whole: list[float] = self.solve(np.array([directions]))[0].tolist()
            return whole
        angles: list[float] = []
        for single, (upper, fore) in zip(self._single, directions, strict=True):
            angles += single.solve(upper, fore)
        return angles


class _ArmIK:
    """The same for one arm; works on whole frames because coupled limits may look at other joints."""

    def __init__(self, robot: Robot, index: int, chain: ArmChain) -> None:
        self.robot = robot
        self.chain = chain
        self.part = robot.arm_slices[index]
        self.lengths = robot.arm_lengths[index]
        self.axes = _zero_axes(chain)
        zero = chain.points(np.zeros((1, chain.n_joints)))[0]
        self.upper_zero = _unit(zero[1] - zero[0])
        self.fore_zero = _unit(zero[2] - zero[1])
        self.movers = self._movers()
        self.closed_form = len(self.movers) >= 4 and self._two_move_the_elbow()
        self.single = self._single() if self.closed_form else None

    def _single(self) -> SingleArmIK | None:
        """The solver for one frame, ``None`` if a limit of this arm depends on a joint of another one."""
        inside = range(self.part.start, self.part.stop)
        own = [row for row in self.robot._coupled if row[0] in inside]
        if any(by not in inside for _, by, *_ in own):
            return None
        base = _rotations(self.axes, self.robot.rest[self.part], self.movers)
        shift = self.part.start
        couplings = [(joint - shift, by - shift, at, low, high) for joint, by, at, low, high in own]
        zero = (self.upper_zero, self.fore_zero @ base.T)
        rest = self.robot.rest[self.part]
        return SingleArmIK(self.chain, self.axes, self.movers, self.lengths, zero, rest, couplings)

    def _movers(self) -> list[int]:
        """Joints that move elbow or wrist against the shoulder, at most the first four; the rest keep their angle."""
        jacobian = self._relative_jacobian(self._probe())[1]
        moving = np.abs(jacobian).max(axis=(0, 1)) > 1e-6
        return [int(joint) for joint in np.flatnonzero(moving)][:4]

    def _two_move_the_elbow(self) -> bool:
        elbow = np.abs(self._relative_jacobian(self._probe())[1][:, :3]).max(axis=(0, 1))
        first, second, *rest = (elbow[joint] for joint in self.movers)
        return bool(min(first, second) > 0.2 * self.lengths[0] and max(rest) < 0.3 * self.lengths[0])

    def _probe(self) -> FloatArray:
        return np.random.default_rng(0).uniform(self.chain.lower, self.chain.upper, (16, self.chain.n_joints))

    def solve(self, frames: FloatArray, unit: FloatArray) -> FloatArray:
        """Writes this arm's angles into ``frames`` for directions ``(N, 2, 3)``."""
        if self.single is None or not self.single.exact:
            return self._search(frames, unit)
        # Row by row in plain floats: most rows are solved at once, and numpy would work on all candidates of all rows.
        wanted = [(tuple(upper), tuple(fore)) for upper, fore in unit.tolist()]
        found = [self.single.solved(*limbs) for limbs in wanted]
        missing = [row for row, angles in enumerate(found) if angles is None]
        result = frames.copy()
        if len(missing) <= _FEW:
            for row in missing:
                found[row] = self.single.solve(*wanted[row])
        else:
            result[missing] = self._search(frames[missing], unit[missing])
        solved = [row for row, angles in enumerate(found) if angles is not None]
        if solved:
            result[solved, self.part] = np.array([found[row] for row in solved])
        return result

    def _search(self, frames: FloatArray, unit: FloatArray) -> FloatArray:
        """The best of the candidates within the limits, moved nearer where it misses."""
        upper = unit[:, 0] * self.lengths[0]
        goal = np.concatenate([upper, upper + unit[:, 1] * self.lengths[1]], axis=1)
        best, error = frames, np.full(len(frames), np.inf)
        for start in self._starts(frames, unit):
            start = self.robot.clamp(start)
            found = np.linalg.norm(self._relative_points(start) - goal, axis=1)
            # A tiny pull towards rest makes the choice among equally good solutions unique.
            score = found + 1e-6 * np.abs(start - self.robot.rest).sum(axis=1)
            better = score < error
            best = np.where(better[:, None], start, best)
            error = np.where(better, score, error)
        error = np.linalg.norm(self._relative_points(best) - goal, axis=1)
        poor = error > _EXACT
        if poor.any():
            best = best.copy()
            best[poor] = self._refine(best[poor], goal[poor])
        return best

    def _starts(self, frames: FloatArray, unit: FloatArray) -> list[FloatArray]:
        """Closed-form candidates, or rest and mid-range where the arm has no closed form."""
        if not self.closed_form:
            middle = frames.copy()
            middle[:, self.part] = 0.5 * (self.chain.lower + self.chain.upper)
            return [frames, middle]
        starts = []
        w0, w1, w2, w3 = (self.axes[joint] for joint in self.movers)
        base = _rotations(self.axes, self.robot.rest[self.part], self.movers)
        for first, second in product((1.0, -1.0), repeat=2):
            a0, a1 = _subproblem_two(w0, w1, self.upper_zero, unit[:, 0], first)
            turned = _turn_back(w1, a1, _turn_back(w0, a0, unit[:, 1]))
            a2, a3 = _subproblem_two(w2, w3, self.fore_zero @ base.T, turned, second)
            start = frames.copy()
            for joint, angle in zip(self.movers, (a0, a1, a2, a3), strict=True):
                column = self.part.start + joint
                start[:, column] = _into_range(angle, self.chain.lower[joint], self.chain.upper[joint])
            starts.append(start)
        return starts

    def _refine(self, frames: FloatArray, goal: FloatArray) -> FloatArray:
        """Projected Levenberg-Marquardt on elbow and wrist [m] over the joints that move them."""
        columns = np.array([self.part.start + joint for joint in self.movers])
        damping = np.full(len(frames), 1e-4)
        points, jacobian = self._relative_jacobian(frames[:, self.part])
        residual = points - goal
        cost = np.sum(residual**2, axis=1)
        for _ in range(_STEPS):
            local = jacobian[:, :, self.movers]
            gradient = np.einsum("nij,ni->nj", local, residual)
            lower, upper = (limit[:, columns] for limit in self.robot.limits_at(frames))
            angles = frames[:, columns]
            stuck = ((angles <= lower + 1e-12) & (gradient > 0)) | ((angles >= upper - 1e-12) & (gradient < 0))
            local = np.where(stuck[:, None, :], 0.0, local)
            normal = np.einsum("nij,nik->njk", local, local) + damping[:, None, None] * np.eye(len(columns))
            gradient = np.where(stuck, 0.0, gradient)
            step = np.linalg.solve(normal, -gradient[:, :, None])[:, :, 0]
            trial = frames.copy()
            trial[:, columns] += step
            trial = self.robot.clamp(trial)
            new_points, new_jacobian = self._relative_jacobian(trial[:, self.part])
            new_residual = new_points - goal
            new_cost = np.sum(new_residual**2, axis=1)
            better = new_cost < cost
            if not (cost - new_cost > 1e-12).any() and (damping > 10.0).all():
                break
            frames = np.where(better[:, None], trial, frames)
            jacobian = np.where(better[:, None, None], new_jacobian, jacobian)
            residual = np.where(better[:, None], new_residual, residual)
            # Far from the goal Gauss-Newton overshoots; trust it more only where it delivers what it promises.
            delivered = cost - new_cost > -0.5 * np.sum(gradient * step, axis=1)
            damping = np.clip(np.where(better & delivered, damping * 0.2, damping * 5.0), 1e-7, 1e2)
            cost = np.where(better, new_cost, cost)
        return frames

    def _relative_points(self, frames: FloatArray) -> FloatArray:
        """Elbow and wrist from the shoulder, ``(N, 6)`` [m]."""
        points = self.chain.points(frames[:, self.part])
        return (points[:, 1:3] - points[:, :1]).reshape(len(points), 6)

    def _relative_jacobian(self, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
        points, jacobian = self.chain.jacobians(angles)
        relative = (points[:, 1:3] - points[:, :1]).reshape(len(points), 6)
        return relative, (jacobian[:, 1:3] - jacobian[:, :1]).reshape(len(points), 6, self.chain.n_joints)


def _zero_axes(chain: ArmChain) -> FloatArray:
    """Joint axes in the torso frame at the zero pose, ``(n, 3)``."""
    rotation, axes = np.eye(3), []
    for fixed, axis in zip(chain.rotations, chain.axes, strict=True):
        rotation = rotation @ fixed
        axes.append(rotation @ axis)
    return np.array(axes)


def _rotations(axes: FloatArray, rest: FloatArray, movers: list[int]) -> FloatArray:
    """Turn of the forearm by joints that are neither movers nor behind them (identity for ordinary arms)."""
    rotation = np.eye(3)
    for joint in range(movers[-1]):
        if joint not in movers:
            rotation = rotation @ _matrix(axes[joint], float(rest[joint]))
    return rotation


def _matrix(axis: FloatArray, angle: float) -> FloatArray:
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: FloatArray = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return rotation


def _subproblem_two(
    first: FloatArray, second: FloatArray, start: FloatArray, goal: FloatArray, sign: float
) -> tuple[FloatArray, FloatArray]:
    """Angles with R(first, a) R(second, b) start = goal, nearest where there is no solution."""
    c = float(first @ second)
    across = np.cross(first, second)
    span = float(across @ across)
    along_second = float(second @ start)
    along_first = goal @ first
    alpha = (along_first - c * along_second) / span
    beta = (along_second - c * along_first) / span
    rest = (1.0 - alpha**2 - beta**2 - 2.0 * alpha * beta * c) / span
    gamma = sign * np.sqrt(np.clip(rest, 0.0, None))
    middle = alpha[:, None] * first + beta[:, None] * second + gamma[:, None] * across
    return _subproblem_one(first, middle, goal), _subproblem_one(second, start[None], middle)


def _subproblem_one(axis: FloatArray, start: FloatArray, goal: FloatArray) -> FloatArray:
    """Angle about ``axis`` that turns ``start`` towards ``goal``."""
    a = start - (start @ axis)[:, None] * axis
    b = goal - (goal @ axis)[:, None] * axis
    angle: FloatArray = np.arctan2(np.cross(a, b) @ axis, np.sum(a * b, axis=1))
    return angle


def _turn_back(axis: FloatArray, angle: FloatArray, vectors: FloatArray) -> FloatArray:
    """Rotates each vector about ``axis`` by minus its angle."""
    c, s = np.cos(angle)[:, None], -np.sin(angle)[:, None]
    return vectors * c + np.cross(axis, vectors) * s + (vectors @ axis)[:, None] * axis * (1.0 - c)


def _into_range(angle: FloatArray, lower: float, upper: float) -> FloatArray:
    """Adds whole turns so that the angle falls into, or nearest to, its range."""
    middle = 0.5 * (lower + upper)
    nearest: FloatArray = middle + (angle - middle + np.pi) % (2.0 * np.pi) - np.pi
    return nearest


def _unit(vector: FloatArray) -> FloatArray:
    unit: FloatArray = vector / np.linalg.norm(vector)
    return unit
