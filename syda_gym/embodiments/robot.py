"""Robot: a URDF with two arms, read by yourdfpy, its kinematics by pinocchio."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import SIDES, Embodiment, Feature, FloatArray, Side
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.coupled import coupled_range
from syda_gym.embodiments.kinematics.urdf import arm_chain, read_urdf
from syda_gym.errors import EmbodimentError, nearest_name
from syda_gym.files import fingerprint, read_yaml, shortened

__all__ = ["ArmDescription", "CoupledLimit", "Robot", "RobotDescription"]


@dataclass(frozen=True)
class ArmDescription:
    """Which links and joints of a URDF make one arm.

    Attributes:
        side: ``"left"`` or ``"right"``.
        joints: revolute joints from shoulder to wrist, in order.
        shoulder: link whose origin is the shoulder point.
        elbow: link whose origin is the elbow point.
        wrist: link whose origin is the wrist point.
        tip: link whose origin ends the arm (for the workspace).
    """

    side: Side
    joints: tuple[str, ...]
    shoulder: str
    elbow: str
    wrist: str
    tip: str


@dataclass(frozen=True)
class CoupledLimit:
    """Limits of ``joint`` that depend on the angle of ``by``, linear between the rows ``at`` [rad]."""

    joint: str
    by: str
    at: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]


@dataclass(frozen=True)
class RobotDescription:
    """The small hand-editable YAML beside a URDF: everything that the URDF alone does not say.

    Attributes:
        name: name in the catalog.
        urdf: the URDF file.
        torso: link in whose frame landmarks are expressed.
        height: stature [m].
        arms: one or two.
        coupled_limits: limits that depend on another joint.
        rest: joint name to angle [rad] of the pose to start from; 0 where absent.
        disabled_collisions: pairs of links whose contact does not count.
        axes: rows of the rotation from the torso link's frame to body axes (x forward, y left, z up); ``None`` if the
            link has body axes already, as most do.
    """

    name: str
    urdf: Path
    torso: str
    height: float
    arms: tuple[ArmDescription, ...]
    coupled_limits: tuple[CoupledLimit, ...] = ()
    rest: Mapping[str, float] = field(default_factory=dict)
    disabled_collisions: tuple[tuple[str, str], ...] = ()
    axes: tuple[tuple[float, float, float], ...] | None = None

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> RobotDescription:
        """Reads a description from YAML.

        Raises:
            EmbodimentError: missing file, unknown or missing keys; the message names them.
        """
        file = Path(path)
        if not file.is_file():
            raise EmbodimentError(f"no robot description {file}; write one with `syda-gym robot add URDF`")
        data = read_yaml(file, "a robot description (YAML)", EmbodimentError)
        needed = {"name", "urdf", "torso", "height", "arms"}
        allowed = needed | {"coupled_limits", "rest", "disabled_collisions", "axes"}
        if not isinstance(data, dict) or not needed <= set(data):
            raise EmbodimentError(f"{file}: expected the keys {sorted(needed)}, got {shortened(data)}")
        for key in set(data) - allowed:
            raise EmbodimentError(f"{file}: unknown key {shortened(key)}; {nearest_name(shortened(key, 40), allowed)}")
        try:
            return cls(
                name=str(data["name"]),
                urdf=(file.parent / str(data["urdf"])).resolve(),
                torso=str(data["torso"]),
                height=float(data["height"]),
                arms=tuple(_arm(a) for a in data["arms"]),
                coupled_limits=tuple(_coupled_limit(c) for c in data.get("coupled_limits") or ()),
                rest={str(k): float(v) for k, v in (data.get("rest") or {}).items()},
                disabled_collisions=tuple((str(a), str(b)) for a, b in data.get("disabled_collisions") or ()),
                axes=_rotation_rows(data["axes"]) if data.get("axes") else None,
            )
        except (TypeError, KeyError, ValueError, AttributeError, OverflowError) as error:
            raise EmbodimentError(
                f"{file}: a wrong value or key: {str(error)[:400]}; see docs for the format"
            ) from error


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
        self.joint_names = tuple(joint for arm in arms for joint in arm.joints)
        limits = tree.limits(self.joint_names)
        self.lower, self.upper = limits.lower, limits.upper
        self.speed, self.effort = limits.speed, limits.effort
        self.features = tuple(Feature(name, "rad") for name in self.joint_names)
        self.chains: tuple[ArmChain, ...] = tuple(
            arm_chain(tree, description.torso, arm.side, arm.joints, (arm.shoulder, arm.elbow, arm.wrist, arm.tip))
            for arm in arms
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
        """Builds a robot from the YAML description at ``path``."""
        return cls(RobotDescription.read(path))

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


def _arm(entry: Any) -> ArmDescription:
    arm = ArmDescription(**{**entry, "joints": tuple(entry["joints"])})
    for name in (*arm.joints, arm.side, arm.shoulder, arm.elbow, arm.wrist, arm.tip):
        if not isinstance(name, str):
            raise ValueError(f"arms are described by names of joints and links, got {name!r}")
    return arm


def _coupled_limit(entry: Any) -> CoupledLimit:
    at, lower, upper = (tuple(float(value) for value in entry[key]) for key in ("at", "lower", "upper"))
    if not 0 < len(at) == len(lower) == len(upper):
        raise ValueError(f"at, lower and upper of a coupled limit need equally many numbers, got {entry}")
    return CoupledLimit(str(entry["joint"]), str(entry["by"]), at, lower, upper)


def _rotation_rows(value: Any) -> tuple[tuple[float, float, float], ...]:
    rows = np.asarray(value, dtype=np.float64)
    if rows.shape != (3, 3) or not np.allclose(rows @ rows.T, np.eye(3), atol=1e-6) or np.linalg.det(rows) < 0.0:
        raise ValueError(f"axes must be the three rows of a rotation, got {value}")
    return tuple((float(x), float(y), float(z)) for x, y, z in rows)


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
