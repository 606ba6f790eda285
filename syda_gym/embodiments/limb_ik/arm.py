"""Arm: one arm as the arrays that the solver's arithmetic works on."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError

__all__ = ["Arm", "Habits", "moving_joints", "of_robot"]

Indices = NDArray[np.int64]

_STILL = 1e-6  # m/rad; a joint that moves elbow and wrist by less moves neither
_STRONG = 0.3  # of a limb's direction per radian; a joint that does less does not point it
_SEEDS = 6


class Habits(NamedTuple):
    """How the solver follows frames in time order.

    Attributes:
        glue: cost of moving a joint by a radian within a thirtieth of a second, squared: what the limbs do not ask for
            stays as it was.
        stiff: the same for turning a nearly straight arm about its own length, over the fourth power of the sine of its
            flexion.
        firm: that cost at most.
        opening: time [s] after which a bent elbow is believed.
        calm: a miss below this makes nobody look for another branch.
        margin: by how much less another branch must miss.
        patience: by how much less in sum over time [s] at least; if the way there costs more, by as much as that.
    """

    glue: float = 2e-3
    stiff: float = 2e-3
    firm: float = 50.0
    opening: float = 0.1
    calm: float = 0.01
    margin: float = 0.03
    patience: float = 0.0075


class Arm(NamedTuple):
    """One arm; joints count from 0 within it.

    Attributes:
        steps: from each joint to the next at the zero pose, up to the joint that carries the wrist ``(k, 3)`` [m].
        axes: their axes at the zero pose ``(k, 3)``.
        carriers: joints that carry shoulder, elbow and wrist ``(3,)``; -1 is the torso.
        points: where those are from their joints at the zero pose ``(3, 3)`` [m].
        movers: joints that turn upper arm or forearm ``(m,)``.
        hinge: the joint that bends the elbow.
        twisting: 1 for those that turn the elbow's own axis about the upper arm, else 0 ``(m,)``.
        lower: lower limits ``(n,)`` [rad].
        upper: upper limits ``(n,)`` [rad].
        rest: the pose to prefer ``(n,)`` [rad].
        speed: speed limits ``(n,)`` [rad/s].
        governed: joints of the coupled limits ``(c,)``.
        governors: joints on which those depend ``(c,)``.
        rows: first row of each in the table, and one past the last ``(c + 1,)``.
        table: governor's angle, lower and upper limit ``(rows, 3)`` [rad].
        closed: the four joints of the closed form; empty if there is none.
        turns: two pairs of turns, as ``kernel`` says ``(2, 5, 3)``.
        seeds: poses from which a search starts beside the closed form's ``(s, n)`` [rad].
        habits: how it follows.
    """

    steps: FloatArray
    axes: FloatArray
    carriers: Indices
    points: FloatArray
    movers: Indices
    hinge: int
    twisting: FloatArray
    lower: FloatArray
    upper: FloatArray
    rest: FloatArray
    speed: FloatArray
    governed: Indices
    governors: Indices
    rows: Indices
    table: FloatArray
    closed: Indices
    turns: FloatArray
    seeds: FloatArray
    habits: Habits


def of_robot(robot: Robot, index: int, habits: Habits) -> Arm:
    """The arm of that index.

    Raises:
        EmbodimentError: its limits exclude every pose.
    """
    chain, part = robot.chains[index], robot.arm_slices[index]
    steps, axes, points = _zero_pose(chain)
    carriers = np.array(chain.point_joints[:3], dtype=np.int64)
    reach = int(carriers.max()) + 1
    rest = np.ascontiguousarray(robot.clamp(robot.rest)[0, part])
    governed, governors, rows, table = _couplings(robot, part)
    movers = np.array(moving_joints(chain), dtype=np.int64)
    closed, hinge = _closed_joints(chain, movers), _hinge(chain, movers)
    return Arm(
        steps=steps[:reach],
        axes=axes[:reach],
        carriers=carriers,
        points=points,
        movers=movers,
        hinge=hinge,
        twisting=(movers < hinge).astype(np.float64),
        lower=chain.lower.copy(),
        upper=chain.upper.copy(),
        rest=rest,
        speed=np.where(np.isfinite(robot.speed[part]) & (robot.speed[part] > 0.0), robot.speed[part], 1e6),
        governed=governed,
        governors=governors,
        rows=rows,
        table=table,
        closed=closed,
        turns=_turns(chain, rest, closed),
        seeds=_seeds(chain, rest, _SEEDS if not len(closed) else 2),
        habits=habits,
    )


def moving_joints(chain: ArmChain) -> list[int]:
    """The joints that move elbow or wrist against the shoulder; the others (a wrist) say nothing about the limbs."""
    jacobian = chain.jacobians(_probe(chain))[1]
    moving = np.abs(jacobian[:, 1:3] - jacobian[:, :1]).max(axis=(0, 1, 2)) > _STILL
    return [int(joint) for joint in np.flatnonzero(moving)]


def _probe(chain: ArmChain) -> FloatArray:
    return np.random.default_rng(0).uniform(chain.lower, chain.upper, (16, chain.n_joints))


def _zero_pose(chain: ArmChain) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Steps between joints, axes and the three points, all along the torso's axes at the zero pose."""
    rotation, steps, axes, frames = np.eye(3), [], [], []
    for fixed, offset, axis in zip(chain.rotations, chain.offsets, chain.axes, strict=True):
        steps.append(rotation @ offset)
        rotation = rotation @ fixed
        axes.append(rotation @ axis)
        frames.append(rotation)
    points = [
        frames[carrier] @ offset if carrier >= 0 else offset
        for carrier, offset in zip(chain.point_joints[:3], chain.point_offsets[:3], strict=True)
    ]
    return np.array(steps), np.array(axes), np.array(points)


def _pointing(chain: ArmChain, poses: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axes ``(N, n, 3)`` and unit directions of upper arm and forearm ``(N, 3)`` each."""
    _, axes, _ = _zero_pose(chain)
    points = chain.points(poses)
    limbs = np.diff(points[:, :3], axis=1)
    limbs /= np.linalg.norm(limbs, axis=-1, keepdims=True)
    turned = np.empty((len(poses), chain.n_joints, 3))
    for row, pose in enumerate(poses):
        rotation = np.eye(3)
        for joint in range(chain.n_joints):
            turned[row, joint] = rotation @ axes[joint]
            rotation = rotation @ _matrix(axes[joint], float(pose[joint]))
    return turned, limbs[:, 0], limbs[:, 1]


def _effects(chain: ArmChain) -> FloatArray:
    """How strongly each joint turns upper arm and forearm, mean over poses ``(n, 2)`` [rad per rad]."""
    points, jacobian = chain.jacobians(_probe(chain))
    effects = []
    for limb in range(2):
        along = points[:, limb + 1] - points[:, limb]
        length = np.linalg.norm(along, axis=-1)[:, None]
        along = along / length
        moved = jacobian[:, limb + 1] - jacobian[:, limb]
        moved = moved - along[:, :, None] * np.einsum("nd,ndj->nj", along, moved)[:, None]
        effects.append((np.linalg.norm(moved, axis=1) / length).mean(axis=0))
    return np.array(effects).T


def _hinge(chain: ArmChain, movers: Indices) -> int:
    """The joint that bends the elbow: of those that move the forearm alone, the one most across the upper arm."""
    axes, upper, _ = _pointing(chain, _probe(chain))
    across = np.linalg.norm(np.cross(axes, upper[:, None]), axis=-1).mean(axis=0)
    effects = _effects(chain)
    own = [int(j) for j in movers if effects[j, 0] < _STRONG and effects[j, 1] > _STRONG]
    return max(own, key=lambda j: across[j]) if own else int(movers[-1])


def _closed_joints(chain: ArmChain, movers: Indices) -> Indices:
    """Two joints that point the upper arm and the next two that point the forearm, if there are such."""
    effects = _effects(chain)
    upper = [int(j) for j in movers if effects[j, 0] > _STRONG][-2:]
    fore = [int(j) for j in movers if upper and j > upper[-1] and effects[j, 1] > _STRONG][:2]
    return np.array(upper + fore if len(upper) == len(fore) == 2 else [], dtype=np.int64)


def _turns(chain: ArmChain, rest: FloatArray, closed: Indices) -> FloatArray:
    """What the closed form needs, about the pose with its joints at zero and the others at rest."""
    result = np.zeros((2, 5, 3))
    if not len(closed):
        return result
    pose = rest.copy()
    pose[closed] = 0.0
    axes, upper, fore = _pointing(chain, pose[None])
    for stage, start in enumerate((upper[0], fore[0])):
        first, second = axes[0, closed[2 * stage]], axes[0, closed[2 * stage + 1]]
        across = np.cross(first, second)
        across = across / np.linalg.norm(across)
        offset = np.arctan2(-start @ across, start @ np.cross(second, across))
        result[stage] = [first, second, np.cross(across, first), across, [first @ second, second @ start, offset]]
    return result


def _seeds(chain: ArmChain, rest: FloatArray, count: int) -> FloatArray:
    """Rest, mid-range, and poses spread over the range."""
    middle = 0.5 * (chain.lower + chain.upper)
    spread = np.random.default_rng(1).uniform(chain.lower, chain.upper, (max(count - 2, 0), chain.n_joints))
    return np.concatenate([rest[None], middle[None], spread])


def _couplings(robot: Robot, part: slice) -> tuple[Indices, Indices, Indices, FloatArray]:
    """Coupled limits between joints of one arm; those between arms are left to ``Robot.clamp``."""
    inside = range(part.start, part.stop)
    own = [row for row in robot._coupled if row[0] in inside and row[1] in inside]
    for joint, _, _, lower, upper in own:
        if (np.maximum(lower, robot.lower[joint]) > np.minimum(upper, robot.upper[joint])).any():
            raise EmbodimentError(
                f"robot {robot.name!r}: the coupled limit of {robot.joint_names[joint]!r} leaves no angle within its "
                f"own limits {robot.lower[joint]:.4f} to {robot.upper[joint]:.4f} rad; correct the description"
            )
    table: list[Any] = [np.stack([at, lower, upper], axis=1) for _, _, at, lower, upper in own]
    rows = np.cumsum([0, *[len(part) for part in table]])
    governed = np.array([row[0] - part.start for row in own], dtype=np.int64)
    governors = np.array([row[1] - part.start for row in own], dtype=np.int64)
    return governed, governors, rows.astype(np.int64), np.concatenate([np.zeros((0, 3)), *table])


def _matrix(axis: FloatArray, angle: float) -> FloatArray:
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: FloatArray = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return rotation
