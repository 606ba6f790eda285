"""The arms of any body as comparable serial chains: body axes, left arms mirrored, one form for equal kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray, Side
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.parametric import ARM_ANGLES, FULL_RANGE
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError

__all__ = ["PAPER_AXES", "canonical_arms", "canonical_chain", "human_arm", "zero_pose_chain"]

PAPER_AXES: FloatArray = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Takes the paper's arm frame (x right, y forward, z up) to body axes (x forward, y left, z up)."""

_MIRROR: FloatArray = np.diag([1.0, -1.0, 1.0])


def canonical_arms(body: Embodiment) -> dict[Side, ArmChain]:
    """The arms of a body, every one as a right arm in body axes.

    A human's arm is the four-angle model of the paper (shoulder Rx Ry Rz, elbow Rx) with this human's lengths and
    joint limits; a robot's arm is its own chain of the URDF, tip included.

    Args:
        body: a human or a robot.

    Returns:
        Side to chain, left before right.

    Raises:
        EmbodimentError: neither a human nor a robot, or an arm without length.
    """
    if isinstance(body, HumanSkeleton):
        arm = human_arm(body.upper_arm, body.forearm, body.joint_limits, base=PAPER_AXES)
        return {side: zero_pose_chain(arm) for side in body.sides}
    if isinstance(body, Robot):
        return {chain.side: canonical_chain(chain) for chain in body.chains}
    raise EmbodimentError(
        f"{body.name!r} is a {type(body).__name__}; transferability knows HumanSkeleton and Robot. "
        "Describe its arms by one of these"
    )


def human_arm(
    upper_arm: float,
    forearm: float,
    joint_limits: Mapping[str, tuple[float, float]] | None = None,
    base: FloatArray | None = None,
) -> ArmChain:
    """The paper's right human arm: p = Rx(t1) Ry(t2) Rz(t3) [(0, 0, -l1) + Rx(t4) (0, l2, 0)].

    Args:
        upper_arm: l1 [m].
        forearm: l2 [m].
        joint_limits: ranges of t1 to t4 [rad]; those of a healthy adult where absent.
        base: rotation ``(3, 3)`` of the paper's frame (x right, y forward, z up) in the wanted axes.
    """
    limits = {**FULL_RANGE, **(joint_limits or {})}
    lower, upper = np.array([limits[angle] for angle in ARM_ANGLES]).T
    if not (lower < upper).all():
        raise EmbodimentError(f"joint limits of a human arm must rise from lower to upper [rad], got {limits}")
    eye = np.eye(3)
    hand = np.array([0.0, forearm, 0.0])
    return ArmChain(
        side="right",
        joints=ARM_ANGLES,
        rotations=np.array([eye if base is None else base, eye, eye, eye]),
        offsets=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -upper_arm]]),
        axes=eye[[0, 1, 2, 0]],
        lower=lower,
        upper=upper,
        point_joints=(2, 3, 3, 3),
        point_offsets=np.array([np.zeros(3), np.zeros(3), hand, hand]),
    )


def canonical_chain(chain: ArmChain) -> ArmChain:
    """The same arm as a right arm (left ones reflected across y = 0), in the zero-pose form."""
    if chain.side == "left":
        # A reflection S turns a rotation about a into one about -S a by the same angle.
        chain = replace(
            chain,
            side="right",
            rotations=_MIRROR @ chain.rotations @ _MIRROR,
            offsets=chain.offsets @ _MIRROR,
            axes=-chain.axes @ _MIRROR,
            point_offsets=chain.point_offsets @ _MIRROR,
        )
    return zero_pose_chain(chain)


def zero_pose_chain(chain: ArmChain) -> ArmChain:
    """Rewrites an arm with all joint frames parallel to the torso at the zero pose and axes pointing the positive way.

    Two arms with equal kinematics but other conventions (local frames, signs of angles, where on its axis the first
    joint has its origin) become equal, so that they share one workspace. The shoulder, from which workspaces are
    measured, is the point on the first joint's axis that is nearest to the second joint.
    """
    rotation = np.eye(3)
    rotations, offsets, axes = [], [], []
    for fixed, offset, axis in zip(chain.rotations, chain.offsets, chain.axes, strict=True):
        offsets.append(rotation @ offset)
        rotation = rotation @ fixed
        rotations.append(rotation)
        axes.append(rotation @ axis)
    directions = np.array(axes)
    largest = directions[np.arange(len(axes)), np.argmax(np.abs(directions).round(6), axis=1)]
    flip = largest < 0.0
    frames = [np.eye(3), *rotations]
    points = [frames[joint + 1] @ point for joint, point in zip(chain.point_joints, chain.point_offsets, strict=True)]
    slide = directions[0] * (directions[0] @ offsets[1]) if len(offsets) > 1 else np.zeros(3)
    offsets[:2] = [offsets[0] + slide, *(offset - slide for offset in offsets[1:2])]
    points = [point - slide * (joint == 0) for joint, point in zip(chain.point_joints, points, strict=True)]
    return replace(
        chain,
        rotations=np.repeat(np.eye(3)[None], chain.n_joints, axis=0),
        offsets=np.array(offsets),
        axes=np.where(flip[:, None], -directions, directions),
        lower=np.where(flip, -chain.upper, chain.lower),
        upper=np.where(flip, -chain.lower, chain.upper),
        point_offsets=np.array(points),
    )
