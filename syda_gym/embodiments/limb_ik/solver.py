"""LimbIK: joint angles that point a robot's limbs in given directions, for single frames and for sequences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.limb_ik.arm import Habits, of_robot
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError

__all__ = ["LimbIK", "LimbState"]

_SHORTEST = 1e-9


@dataclass(frozen=True, eq=False)
class LimbState:
    """What a sequence remembers from its last frame; a value that no call changes.

    Attributes:
        numbers: ``(B, S)``, a row per sequence: per arm the pose and the pose of the branch [rad], how long another
            branch has been better [s], whether the arm is on its way there, and how bent the elbow has been.
        fresh: ``(B,)``, sequences that have not begun.
    """

    numbers: FloatArray
    fresh: np.ndarray[Any, np.dtype[np.bool_]]

    def __len__(self) -> int:
        return len(self.numbers)


class LimbIK:
    """Inverse kinematics on limb directions, within joint limits, coupled ones included.

    ``solve`` takes frames that have nothing to do with each other. Of the poses with the least angle to the wanted
    directions it gives the one nearest to rest. Where an arm has a closed form (two joints that point the upper arm and
    two that point the forearm; each the second Paden-Kahan subproblem of Murray, Li, Sastry, *A Mathematical
    Introduction to Robotic Manipulation*, 1994, section 3.2), that is the start and mostly the end; else projected
    Levenberg-Marquardt steps over all joints that move elbow or wrist lead from the nearest starts to the least angle.

    ``follow`` takes frames in time order. Of equally good poses it gives the one nearest to the frame before, and if
    asked keeps to the joint speeds. The less an elbow is bent, the less its yaw is worth: it holds still while the arm
    is straight and turns as the arm bends. Another branch is taken only when it has been better for a while.

    Both are the same arithmetic, compiled by numba on first use, for one frame and for many, so that a batch equals its
    frames bit for bit. Further joints (a wrist) stay at rest.

    Args:
        robot: whose arms.
        habits: how frames in time order are followed, if not as usual.

    Raises:
        EmbodimentError: the robot's limits exclude every pose.
    """

    def __init__(self, robot: Robot, habits: Habits | None = None) -> None:
        self.robot = robot
        self.arms = tuple(of_robot(robot, index, habits or Habits()) for index in range(len(robot.chains)))
        inside = [range(part.start, part.stop) for part in robot.arm_slices]
        self._across = any(not any(row[0] in arm and row[1] in arm for arm in inside) for row in robot._coupled)

    @classmethod
    def of(cls, robot: Robot) -> LimbIK:
        """The solver of a robot, made once and kept as long as the robot."""
        if cls not in robot.memo:
            robot.memo[cls] = cls(robot)
        solver: LimbIK = robot.memo[cls]
        return solver

    @property
    def state_size(self) -> int:
        """Numbers that a sequence remembers."""
        return sum(2 * len(arm.lower) + 3 for arm in self.arms)

    def solve(self, directions: ArrayLike) -> FloatArray:
        """Joint angles whose limb directions are nearest to the wanted ones, each frame for itself.

        Args:
            directions: ``(N, arms, 2, 3)``: upper arm and forearm of each arm in the torso frame; any positive length.

        Returns:
            Frames ``(N, n)`` [rad] within all limits, coupled ones included.

        Raises:
            EmbodimentError: wrong shape, not finite, or a direction of zero length.
        """
        unit = self._unit(directions, 4)
        frames = np.empty((len(unit), self.robot.n_features))
        for index, (arm, part) in enumerate(zip(self.arms, self.robot.arm_slices, strict=True)):
            angles = np.empty((len(unit), len(arm.lower)))
            _call("solve", arm, np.ascontiguousarray(unit[:, index]).reshape(-1, 6), angles)
            frames[:, part] = angles
        return self.robot.clamp(frames) if self._across else frames

    def begin(self, count: int = 1) -> LimbState:
        """The state of ``count`` sequences before their first frames."""
        return LimbState(np.zeros((count, self.state_size)), np.ones(count, dtype=np.bool_))

    def follow(
        self, directions: ArrayLike, state: LimbState, dt: ArrayLike | None = None, *, limited: bool = True
    ) -> tuple[FloatArray, LimbState]:
        """Joint angles for the next frames of one or more sequences.

        Args:
            directions: ``(B, T, arms, 2, 3)``: the next ``T`` frames of each of ``B`` sequences.
            state: of as many sequences; from ``begin`` or the call before.
            dt: time from the frame before to each frame [s]: one number, or ``(B, T)``. Without it joint speeds do not
                hold, and frames count as a thirtieth of a second apart.
            limited: whether joint speeds hold.

        Returns:
            Frames ``(B, T, n)`` [rad] within all limits, and the state after them. Frames of one sequence do not
            depend on the other sequences, nor on how many frames come in one call.

        Raises:
            EmbodimentError: wrong shapes, values that are not finite, a direction of zero length, or a time step that
                is not positive.
        """
        unit = self._unit(directions, 5)
        count, length = unit.shape[:2]
        if len(state) != count or state.numbers.shape[1] != self.state_size:
            raise EmbodimentError(
                f"the state is of {len(state)} sequences with {state.numbers.shape[1]} numbers each; "
                f"{self.robot.name!r} needs {self.state_size} for each of {count} sequences"
            )
        steps = np.empty((count, length))
        steps[...] = _kernel().FRAME if dt is None else dt
        if steps.size and not (float(steps.min()) > 0.0 and float(steps.max()) < math.inf):
            raise EmbodimentError("the time between frames must be positive and finite")
        numbers, frames = state.numbers.copy(), np.empty((count, length, self.robot.n_features))
        first = 0
        for index, (arm, part) in enumerate(zip(self.arms, self.robot.arm_slices, strict=True)):
            last = first + 2 * len(arm.lower) + 3
            own, angles = np.ascontiguousarray(numbers[:, first:last]), np.empty((count, length, len(arm.lower)))
            wanted = np.ascontiguousarray(unit[:, :, index]).reshape(count, length, 6)
            _call("follow", arm, wanted, steps, limited and dt is not None, state.fresh, own, angles)
            numbers[:, first:last], frames[:, :, part], first = own, angles, last
        if self._across:
            frames = self.robot.clamp(frames.reshape(-1, frames.shape[2])).reshape(frames.shape)
        return frames, LimbState(numbers, state.fresh & (length == 0))

    def sequence(self, directions: ArrayLike, fps: float | None = None) -> FloatArray:
        """Joint angles of one clip ``(T, arms, 2, 3)`` in time order, within joint speeds if ``fps`` is given.

        Returns:
            ``(T, n)`` [rad].
        """
        wanted = np.asarray(directions, dtype=np.float64)
        dt = None if fps is None else 1.0 / fps
        return np.asarray(self.follow(wanted[None], self.begin(), dt)[0][0])

    def _unit(self, directions: ArrayLike, dimensions: int) -> FloatArray:
        wanted = np.asarray(directions, dtype=np.float64)
        if wanted.ndim != dimensions or wanted.shape[-3:] != (len(self.arms), 2, 3):
            lead = "N" if dimensions == 4 else "B, T"
            raise EmbodimentError(
                f"directions for {self.robot.name!r}: expected ({lead}, {len(self.arms)}, 2, 3), got {wanted.shape}"
            )
        unit = np.empty(wanted.shape)
        if not _call("unit", np.ascontiguousarray(wanted).reshape(-1, 3), _SHORTEST, unit.reshape(-1, 3)):
            raise EmbodimentError(f"directions for {self.robot.name!r} must be finite and longer than zero")
        return unit


@lru_cache(maxsize=1)
def _kernel() -> Any:
    """The compiled part; numba is imported where arms are solved, not before."""
    from syda_gym.embodiments.limb_ik import kernel

    return kernel


@lru_cache(maxsize=1)
def _first_call() -> Any:
    from syda_gym.embodiments.limb_ik.compiling import first_call

    return first_call


def _call(name: str, *arguments: Any) -> Any:
    return _first_call()(getattr(_kernel(), name), *arguments)
