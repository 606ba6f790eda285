"""Coders: how a body's frames become the numbers that a model sees, and back."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError, StorageError, nearest_name

__all__ = ["CODERS", "Coder", "PositionCoder", "QuaternionCoder", "paper_coder", "restore_coder"]

Arrays = dict[str, FloatArray]


CODERS: dict[str, type[Coder]] = {}
"""Kind to class, of every coder whose file has been imported."""


def restore_coder(entry: dict[str, Any], body: Embodiment, arrays: Arrays) -> Coder:
    """Rebuilds a coder from its stored kind, settings and arrays.

    Raises:
        StorageError: an unknown kind.
    """
    kind = str(entry["kind"])
    if kind not in CODERS:
        raise StorageError(f"unknown coder {kind!r}; {nearest_name(kind, CODERS)}")
    return CODERS[kind](body, entry["settings"], arrays)


class Coder(ABC):
    """Turns frames into codes ``(N, K, D)`` and codes into frames.

    K is 1 for a code of the whole body, or the number of arms for a code that arms share.

    Args:
        body: whose frames.
    """

    kind: ClassVar[str]

    def __init_subclass__(cls, **options: Any) -> None:
        """Enters the coder into ``CODERS``, so that what is stored under its kind can be rebuilt."""
        super().__init_subclass__(**options)
        CODERS[cls.kind] = cls

    def __init__(self, body: Embodiment, settings: dict[str, Any] | None = None, arrays: Arrays | None = None) -> None:
        self.body = body

    @property
    @abstractmethod
    def width(self) -> int:
        """D, the numbers per code."""

    @abstractmethod
    def encode(self, frames: FloatArray) -> FloatArray:
        """Codes ``(N, K, D)`` of frames ``(N, F)``."""

    @abstractmethod
    def decode(self, codes: FloatArray) -> FloatArray:
        """Frames ``(N, F)`` of codes ``(N, K, D)``."""

    def begin(self) -> Any:
        """What ``follow`` remembers before the first frame of a clip; ``None`` for a coder that remembers nothing."""
        return None

    def follow(self, codes: FloatArray, memory: Any, dt: float | None, limited: bool) -> tuple[FloatArray, Any]:
        """Frames ``(N, F)`` of codes ``(N, K, D)`` in time order, ``dt`` seconds apart, and the memory after them.

        A coder that remembers nothing decodes each for itself. ``memory`` is a value that no call changes, and
        ``limited`` says whether joint speeds hold.
        """
        return self.decode(codes), memory

    def arrays(self) -> Arrays:
        """Fitted numbers, for storage."""
        return {}

    def settings(self) -> dict[str, Any]:
        """JSON-able settings, for storage."""
        return {}


class PositionCoder(Coder):
    """The paper's code of a human: the raw landmark positions [m]."""

    kind = "positions"

    def __init__(self, body: Embodiment, settings: dict[str, Any] | None = None, arrays: Arrays | None = None) -> None:
        super().__init__(body)

    @property
    def width(self) -> int:
        """The number of features."""
        return self.body.n_features

    def encode(self, frames: FloatArray) -> FloatArray:
        """The frames themselves as ``(N, 1, F)``."""
        return frames[:, None]

    def decode(self, codes: FloatArray) -> FloatArray:
        """The codes themselves as ``(N, F)``."""
        return codes[:, 0]


class QuaternionCoder(Coder):
    """The paper's code of a robot: the unit quaternion (scalar last) of every arm joint's local rotation.

    The local rotation is the joint's fixed placement followed by its turn. For Pepper these are Ry(ShoulderPitch),
    Rz(ShoulderRoll), Ry(-0.157) Rx(ElbowYaw), Rz(ElbowRoll), Rx(WristYaw): the 40 numbers of the paper's recordings.

    Raises:
        MappingError: the body is no robot.
    """

    kind = "quaternions"

    def __init__(self, body: Embodiment, settings: dict[str, Any] | None = None, arrays: Arrays | None = None) -> None:
        super().__init__(body)
        if not isinstance(body, Robot):
            raise MappingError(f"joint quaternions need a robot, {body.name!r} is a {body.kind}")
        self.robot = body
        self._fixed = np.concatenate([_fixed_quaternions(chain) for chain in body.chains])
        self._axes = np.concatenate([chain.axes for chain in body.chains])

    @property
    def width(self) -> int:
        """Four per joint."""
        return 4 * self.body.n_features

    def encode(self, frames: FloatArray) -> FloatArray:
        """Quaternions ``(N, 1, 4 n)`` of joint angles ``(N, n)``."""
        half = 0.5 * frames[..., None]
        turn = np.concatenate([np.sin(half) * self._axes, np.cos(half)], axis=-1)
        return _multiply(self._fixed, turn).reshape(len(frames), 1, -1)

    def decode(self, codes: FloatArray) -> FloatArray:
        """Joint angles ``(N, n)``: the turn about the joint's axis that is nearest to each quaternion."""
        quaternions = codes.reshape(len(codes), -1, 4)
        conjugate = self._fixed * np.array([-1.0, -1.0, -1.0, 1.0])
        turn = _multiply(conjugate, quaternions)
        angle = 2.0 * np.arctan2(np.sum(turn[..., :3] * self._axes, axis=-1), turn[..., 3])
        wrapped: FloatArray = (angle + np.pi) % (2.0 * np.pi) - np.pi
        return wrapped


def paper_coder(body: Embodiment) -> Coder:
    """The paper's code of a body: positions for a human, quaternions for a robot."""
    return PositionCoder(body) if isinstance(body, HumanSkeleton) else QuaternionCoder(body)


def _fixed_quaternions(chain: ArmChain) -> FloatArray:
    from scipy.spatial.transform import Rotation

    quaternions: FloatArray = Rotation.from_matrix(chain.rotations).as_quat()
    return np.where(quaternions[:, 3:] < 0.0, -quaternions, quaternions)


def _multiply(p: FloatArray, q: FloatArray) -> FloatArray:
    """Hamilton product of scalar-last quaternions, broadcast over leading axes."""
    px, py, pz, pw = np.moveaxis(p, -1, 0)
    qx, qy, qz, qw = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
            pw * qw - px * qx - py * qy - pz * qz,
        ],
        axis=-1,
    )
