"""Robot: a URDF with one or two arms, its kinematics by pinocchio."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.description import ArmDescription, CoupledLimit, RobotDescription
from syda_gym.embodiments.embodiment import SIDES, Embodiment, Feature, FloatArray, Side
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.coupled import coupled_range
from syda_gym.embodiments.kinematics.urdf import UrdfTree, arm_chain, read_urdf
from syda_gym.errors import EmbodimentError
from syda_gym.files import fingerprint

__all__ = ["ArmDescription", "CoupledLimit", "Robot", "RobotDescription"]


class Robot(Embodiment):
    """A robot whose frames are the joint angles [rad] of its arms, left arm first.

    Args:
        description: what the URDF is and which parts of it are arms.

    Attributes:
        joint_names: the columns of a frame.
        lower: lower limits ``(n,)`` [rad].
        upper: upper limits ``(n,)`` [rad].
        speed: speed limits ``(n,)`` [rad/s].
        effort: effort limits ``(n,)`` [N m].
        chains: kinematics per arm, in the order of ``sides``.
        memo: what other files have worked out for this robot and keep as long as it lives, such as its ``LimbIK``.

    Raises:
        EmbodimentError: not a URDF, unknown joints or links, missing limits, arms of zero length.
    """

    def __init__(self, description: RobotDescription) -> None:
        self.description = description
        self.memo: dict[type, Any] = {}
        self.name = description.name
        self.height = description.height
        given = [arm.side for arm in description.arms]
        if not given or len(set(given)) != len(given) or not set(given) <= set(SIDES):
            raise EmbodimentError(f"robot {self.name!r}: describe one left and/or one right arm, got sides {given}")
        arms = sorted(description.arms, key=lambda arm: SIDES.index(arm.side))
        self.sides = tuple(arm.side for arm in arms)
        tree = read_urdf(description.urdf)
        for arm in arms:
            _refuse_followers(tree, arm)
        self.joint_names = tuple(joint for arm in arms for joint in arm.joints)
        limits = tree.limits(self.joint_names)
        self.lower, self.upper = limits.lower, limits.upper
        self.speed, self.effort = limits.speed, limits.effort
        self.features = tuple(Feature(name, "rad") for name in self.joint_names)
        self.chains: tuple[ArmChain, ...] = tuple(
            arm_chain(tree, description.torso, arm.side, arm.joints, arm.links, arm.point_offsets) for arm in arms
        )
        if description.axes is not None:
            turn = np.array(description.axes)
            self.chains = tuple(_in_body_axes(chain, turn) for chain in self.chains)
        starts = np.cumsum([0, *[chain.n_joints for chain in self.chains]])
        self.arm_slices = tuple(slice(int(a), int(b)) for a, b in zip(starts[:-1], starts[1:], strict=True))
        self._coupled = tuple(
            (self._column(c.joint), self._column(c.by), np.array(c.at), np.array(c.lower), np.array(c.upper))
            for c in description.coupled_limits
            if c.joint in self.joint_names and c.by in self.joint_names
        )
        self.rest = np.clip(
            np.array([description.rest.get(name, 0.0) for name in self.joint_names]), self.lower, self.upper
        )
        lengths = self.arm_lengths
        if not (lengths > 1e-4).all():
            raise EmbodimentError(
                f"robot {self.name!r}: upper arm and forearm must have a length, got {lengths.tolist()} m; "
                "check the links named shoulder, elbow and wrist"
            )

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Robot:
        """Builds a robot from the YAML description at ``path``.

        Raises:
            EmbodimentError: as the constructor; the message names the line that it is about.
        """
        description = RobotDescription.read(path)
        try:
            return cls(description)
        except EmbodimentError as error:
            line = _line_about(Path(path), str(error))
            if not line:
                raise
            raise EmbodimentError(f"{path}, line {line}: {error}") from error

    @property
    def kind(self) -> Literal["human", "robot"]:
        """``"robot"``."""
        return "robot"

    @property
    def urdf(self) -> Path:
        """The URDF file."""
        return self.description.urdf

    @cached_property
    def arm_lengths(self) -> FloatArray:
        """Distances shoulder-elbow and elbow-wrist at the zero pose [m], ``(arms, 2)``."""
        points = self.arm_points(np.zeros(len(self.joint_names)))[0]
        lengths: FloatArray = np.linalg.norm(np.diff(points, axis=1), axis=-1)
        return lengths

    def arm_points(self, frames: ArrayLike) -> FloatArray:
        """Shoulder, elbow and wrist of each arm, ``(N, arms, 3, 3)`` [m], torso frame."""
        q = self.check(frames)
        return np.stack(
            [chain.points(q[:, part])[:, :3] for chain, part in zip(self.chains, self.arm_slices, strict=True)],
            axis=1,
        )

    def limits_at(self, frames: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Joint limits that hold at each frame, coupled limits included.

        Args:
            frames: ``(N, n)`` [rad].

        Returns:
            Lower and upper limits, ``(N, n)`` each [rad].
        """
        q = np.atleast_2d(np.asarray(frames, dtype=np.float64))
        lower, upper = (
            np.repeat(self.lower[None], len(q), axis=0),
            np.repeat(self.upper[None], len(q), axis=0),
        )
        for joint, by, at, low, high in self._coupled:
            lower[:, joint] = np.maximum(lower[:, joint], np.interp(q[:, by], at, low))
            upper[:, joint] = np.minimum(upper[:, joint], np.interp(q[:, by], at, high))
        return lower, upper

    def clamp(self, frames: ArrayLike) -> FloatArray:
        """Nearest frames within the joint limits, coupled limits included (the governing joint is clamped first)."""
        if np.size(frames) == len(self.joint_names):
            return np.array([self.clamp_one(np.asarray(frames, dtype=np.float64).ravel().tolist())])
        q = np.clip(np.atleast_2d(np.asarray(frames, dtype=np.float64)), self.lower, self.upper)
        lower, upper = self.limits_at(q)
        return np.clip(q, lower, upper)

    def clamp_one(self, angles: list[float]) -> list[float]:
        """``clamp`` for one frame ``(n,)`` in plain floats, which live use does for every frame."""
        lower, upper, couplings = self._plain_limits
        # Comparisons instead of min and max: calls are most of the cost here.
        inside = [
            low if a < low else high if a > high else a for a, low, high in zip(angles, lower, upper, strict=True)
        ]
        if not couplings:
            return inside
        result = inside.copy()
        for joint, by, at, low_rows, high_rows in couplings:
            least, most = coupled_range(inside[by], at, low_rows, high_rows)
            result[joint] = min(max(result[joint], lower[joint], least), upper[joint], most)
        return result

    @cached_property
    def _plain_limits(
        self,
    ) -> tuple[list[float], list[float], list[tuple[int, int, list[float], list[float], list[float]]]]:
        couplings = [(j, by, at.tolist(), low.tolist(), high.tolist()) for j, by, at, low, high in self._coupled]
        return self.lower.tolist(), self.upper.tolist(), couplings

    def violations(self, frames: ArrayLike, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Which joint angles lie outside their limits by more than ``tolerance`` [rad], ``(N, n)``."""
        q = self.check(frames)
        lower, upper = self.limits_at(q)
        result: NDArray[np.bool_] = (q < lower - tolerance) | (q > upper + tolerance)
        return result

    def mirror(self, frames: ArrayLike) -> FloatArray:
        """Left-right mirror image of the pose: arms swapped, signs by the mirrored joint axes.

        Raises:
            EmbodimentError: the robot has not two arms with the same joints.
        """
        q = self.check(frames)
        return q[:, self._mirror_order] * self._mirror_signs

    @cached_property
    def _mirror_order(self) -> NDArray[np.intp]:
        if len(self.chains) != 2 or self.chains[0].n_joints != self.chains[1].n_joints:
            raise EmbodimentError(f"robot {self.name!r} has no left and right arm with equal joints to mirror")
        count = self.chains[0].n_joints
        order: NDArray[np.intp] = np.r_[count : 2 * count, 0:count].astype(np.intp)
        return order

    @cached_property
    def _mirror_signs(self) -> FloatArray:
        # A reflection across y = 0 turns a rotation about (x, y, z) into one about (-x, y, -z).
        left, right = (self._world_axes(chain) for chain in self.chains)
        same = np.sum(left * np.array([-1.0, 1.0, -1.0]) * right, axis=1)
        signs = np.where(same >= 0.0, 1.0, -1.0)
        return np.tile(signs, 2)

    @staticmethod
    def _world_axes(chain: ArmChain) -> FloatArray:
        rotation = np.eye(3)
        axes = []
        for fixed, axis in zip(chain.rotations, chain.axes, strict=True):
            rotation = rotation @ fixed
            axes.append(rotation @ axis)
        return np.array(axes)

    def _column(self, joint: str) -> int:
        return self.joint_names.index(joint)

    def spec(self) -> dict[str, Any]:
        """Name, joints and a fingerprint of the kinematics, by which a stored mapping knows its robot again."""
        numbers = b"".join(
            np.round(np.concatenate([c.rotations.ravel(), c.offsets.ravel(), c.axes.ravel()]), 9).tobytes()
            for c in self.chains
        )
        return {
            "kind": "robot",
            "name": self.name,
            "joints": list(self.joint_names),
            "kinematics": fingerprint(numbers, self.lower.tobytes(), self.upper.tobytes()),
        }


def _refuse_followers(tree: UrdfTree, arm: ArmDescription) -> None:
    """A joint that follows one of the arm's own would move elbow or wrist in ways that no chain of joints knows."""
    if not arm.joints or arm.joints[0] not in tree.joints or arm.wrist not in tree.links():
        return  # told by name where the chain is built
    for name in tree.path_to(tree.joints[arm.joints[0]].parent, arm.wrist) or ():
        mimic = None if tree.joints[name].type == "fixed" else tree.joints[name].mimic
        if mimic is not None and mimic.multiplier and mimic.joint in arm.joints and name not in arm.joints:
            raise EmbodimentError(
                f"{tree.path.name}: joint {name!r} of the {arm.side} arm follows {mimic.joint!r} (<mimic>), and "
                "arms are made of joints that move by themselves; make it fixed, or take its <mimic> away and name it "
                "in `joints`"
            )


def _line_about(path: Path, message: str) -> int:
    """Line of a description that holds a name which an error puts in quotes, 0 if none does."""
    lines = path.read_text(encoding="utf-8").splitlines()
    for name in re.findall(r"'([^']+)'", message):
        for number, line in enumerate(lines, start=1):
            if not line.lstrip().startswith("#") and re.search(rf"(^|[\s\[,]){re.escape(name)}($|[\s\],}}])", line):
                return number
    return 0


def _in_body_axes(chain: ArmChain, turn: FloatArray) -> ArmChain:
    """The same arm seen from a torso frame turned by ``turn``."""
    fixed = np.array([joint < 0 for joint in chain.point_joints])[:, None]
    return replace(
        chain,
        rotations=np.concatenate([(turn @ chain.rotations[0])[None], chain.rotations[1:]]),
        offsets=np.concatenate([(turn @ chain.offsets[0])[None], chain.offsets[1:]]),
        point_offsets=np.where(fixed, chain.point_offsets @ turn.T, chain.point_offsets),
    )


def select_sides(robot: Robot, sides: Sequence[Side]) -> RobotDescription:
    """A description of the same robot with only some of its arms (for one-armed studies)."""
    arms = tuple(arm for arm in robot.description.arms if arm.side in sides)
    return RobotDescription(
        name=f"{robot.name}-{'-'.join(sides)}",
        urdf=robot.description.urdf,
        torso=robot.description.torso,
        height=robot.description.height,
        arms=arms,
        coupled_limits=robot.description.coupled_limits,
        rest=robot.description.rest,
        disabled_collisions=robot.description.disabled_collisions,
        axes=robot.description.axes,
    )
