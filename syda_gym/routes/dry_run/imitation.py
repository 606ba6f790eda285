"""Imitation: how one body alone would follow planned limb directions, within its joint limits and joint speeds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError
from syda_gym.motions.synthetic.range_of_motion import within_range
from syda_gym.routes.dry_run.plan import FPS, Plan

__all__ = ["SIDES", "Retargeter", "follow", "imitate", "track"]

SIDES = ("left", "right")

Retargeter = Callable[[Robot, int, FloatArray], FloatArray]
"""A robot, the index of one of its arms and wanted directions ``(K, T, 2, 3)`` of K clips at ``FPS``; gives the
directions ``(K, T, 2, 3)`` that the arm reaches. By default a robot does what ``follow`` says; whoever records in
another way passes the way in which they record, because the imitation has to be that of the recordings."""

_PULL = 1e-3  # towards the middle of the joint range, where an arm has joints to spare
_DAMPING = 3e-3
_STEPS = 4  # Gauss-Newton steps a frame; warm-started, so that more change nothing
_START_STEPS = 40
_TOP_SPEED = 20.0  # rad/s; where a URDF gives none


def imitate(body: Embodiment, plan: Plan, retargeter: Retargeter | None = None) -> list[dict[str, FloatArray]]:
    """The best imitation of every clip of a plan.

    A human imitates exactly, within the range of motion if one is known. A robot imitates by ``retargeter``, or by the
    library's own solver, which leads all its arms together.

    Args:
        body: who imitates.
        plan: what.
        retargeter: of robots, arm by arm; ``follow`` by default.

    Returns:
        Per clip, side to unit limb directions ``(T, 2, 3)``, for the arms that the body has.

    Raises:
        EmbodimentError: a body that is neither human nor robot, or a retargeter that gives something else than asked.
    """
    longest = max(len(clip) for clip in plan.clips)
    wanted = np.stack(
        [np.concatenate([clip, np.repeat(clip[-1:], longest - len(clip), axis=0)]) for clip in plan.clips]
    )
    own = follow(body, wanted) if isinstance(body, Robot) and retargeter is None else None
    arms = {
        side: _arm(body, index, side, wanted, retargeter) if own is None else own[:, :, index]
        for index, side in enumerate(body.sides)
    }
    return [{side: arm[k, : len(clip)] for side, arm in arms.items()} for k, clip in enumerate(plan.clips)]


def _arm(body: Embodiment, index: int, side: str, wanted: FloatArray, retargeter: Retargeter | None) -> FloatArray:
    arm = wanted[:, :, SIDES.index(side)]
    if isinstance(body, Robot) and retargeter is not None:
        found = np.asarray(retargeter(body, index, arm), dtype=np.float64)
        if found.shape != arm.shape or not np.isfinite(found).all():
            raise EmbodimentError(
                f"the retargeter for {body.name!r} gave {found.shape} for directions {arm.shape}; expected the same "
                "shape and finite numbers"
            )
        return found
    if not isinstance(body, HumanSkeleton):
        raise EmbodimentError(f"{body.name!r} is a {body.kind}; only humans and robots imitate")
    if not body.joint_limits:
        return arm
    flat = within_range(arm.reshape(-1, 2, 3), body.joint_limits, body.sides[index])
    return flat.reshape(arm.shape)


def follow(robot: Robot, wanted: FloatArray) -> FloatArray:
    """What the robot does when the library itself leads it: ``LimbIK`` frame after frame, within joint speeds.

    Args:
        robot: whose arms.
        wanted: ``(K, T, 2, 2, 3)`` unit directions of K clips at ``FPS``: left and right arm, upper arm and forearm.

    Returns:
        ``(K, T, arms, 2, 3)`` directions reached, for the arms that the robot has.
    """
    solver, sides = LimbIK.of(robot), [SIDES.index(side) for side in robot.sides]
    angles, _ = solver.follow(wanted[:, :, sides], solver.begin(len(wanted)), 1.0 / FPS)
    clips, frames = wanted.shape[:2]
    reached = np.empty((clips, frames, len(sides), 2, 3))
    for index, (chain, part) in enumerate(zip(robot.chains, robot.arm_slices, strict=True)):
        points = chain.points(angles[:, :, part].reshape(clips * frames, -1))
        reached[:, :, index] = _limbs(points).reshape(clips, frames, 2, 3)
    return reached


def track(robot: Robot, index: int, wanted: FloatArray) -> FloatArray:
    """Warm-started damped Gauss-Newton on limb directions, all clips side by side: plain NumPy, nothing is compiled.

    Each frame starts from the one before and moves no joint faster than its motor can, so that a slow robot lags. It
    was the default before ``follow``, which comes nearer to the wanted directions.

    Args:
        robot: whose arm.
        index: of the arm.
        wanted: ``(K, T, 2, 3)`` unit directions of upper arm and forearm, body axes, at ``FPS``.

    Returns:
        ``(K, T, 2, 3)`` directions reached.
    """
    arm = _Arm(robot, index)
    clips, frames = wanted.shape[:2]
    goal = wanted.reshape(clips, frames, 6)
    angles = np.empty((clips, frames, arm.n))
    q = arm.start(goal[:, 0])
    most = np.minimum(robot.speed[robot.arm_slices[index]], _TOP_SPEED) / FPS
    for frame in range(frames):
        low, high = arm.lower, arm.upper
        if frame:
            low, high = np.maximum(low, q - most), np.minimum(high, q + most)
        for _ in range(_STEPS):
            q = arm.step(q, goal[:, frame], low, high)
        angles[:, frame] = q
    return _limbs(arm.chain.points(angles.reshape(-1, arm.n))).reshape(wanted.shape)


def _limbs(points: FloatArray) -> FloatArray:
    """Unit directions ``(N, 2, 3)`` of upper arm and forearm."""
    limbs = np.diff(points[:, :3], axis=1)
    unit: FloatArray = limbs / np.maximum(np.linalg.norm(limbs, axis=-1, keepdims=True), 1e-9)
    return unit


class _Arm:
    """One arm's limb directions and their derivatives."""

    def __init__(self, robot: Robot, index: int) -> None:
        self.chain = robot.chains[index]
        self.n = self.chain.n_joints
        self.lower, self.upper = self.chain.lower, self.chain.upper
        self.middle = 0.5 * (self.lower + self.upper)
        self.rest = robot.rest[robot.arm_slices[index]]
        self._lengths = robot.arm_lengths[index]

    def start(self, goal: FloatArray) -> FloatArray:
        """The best of four starts for the first frames ``(K, 6)``; ``(K, n)``."""
        span = self.upper - self.lower
        tried = []
        for pose in (self.rest, self.middle, self.lower + 0.25 * span, self.lower + 0.75 * span):
            q = np.repeat(pose[None], len(goal), axis=0)
            for _ in range(_START_STEPS):
                q = self.step(q, goal, self.lower, self.upper)
            tried.append((((self._linear(q)[0] - goal) ** 2).sum(axis=1), q))
        best = np.argmin([cost for cost, _ in tried], axis=0)
        chosen: FloatArray = np.stack([q for _, q in tried])[best, np.arange(len(goal))]
        return chosen

    def step(self, q: FloatArray, goal: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        """One damped step towards ``goal`` ``(K, 6)``, cut to the bounds."""
        reached, jacobian = self._linear(q)
        normal = np.einsum("kij,kil->kjl", jacobian, jacobian) + (_PULL + _DAMPING) * np.eye(self.n)
        slope = np.einsum("kij,ki->kj", jacobian, reached - goal) + _PULL * (q - self.middle)
        move = np.linalg.solve(normal, slope[..., None])[..., 0]
        cut: FloatArray = np.clip(q - np.clip(move, -0.4, 0.4), low, high)
        return cut

    def _linear(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        upper, fore = self._lengths
        points, jacobian = self.chain.jacobians(q)
        reached = np.concatenate([(points[:, 1] - points[:, 0]) / upper, (points[:, 2] - points[:, 1]) / fore], axis=1)
        slopes = [(jacobian[:, 1] - jacobian[:, 0]) / upper, (jacobian[:, 2] - jacobian[:, 1]) / fore]
        return reached, np.concatenate(slopes, axis=1)
