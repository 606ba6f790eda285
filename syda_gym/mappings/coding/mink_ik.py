"""MinkArmCoder: limb directions decoded by mink, a differential inverse kinematics library, as a baseline."""

from __future__ import annotations

from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import EmbodimentError, MissingExtraError
from syda_gym.mappings.coding.arm_coders import RobotArmCoder
from syda_gym.mappings.coding.coders import Arrays

__all__ = ["MinkArmCoder"]

_STEPS = 20
_CONVERGED = 1e-4  # m


class MinkArmCoder(RobotArmCoder):
    """Like ``RobotArmCoder``, but elbow and wrist are pulled to their goals by mink, warm-started frame by frame.

    Every frame takes up to 20 steps of a quadratic programme with the joint limits as constraints; it stops when the
    steps no longer move the landmarks by 0.1 mm.

    Raises:
        MissingExtraError: mink or its solver is not installed.
        EmbodimentError: MuJoCo cannot read the robot's URDF.
    """

    kind = "mink_arms"

    def __init__(self, body: Embodiment, settings: dict[str, Any], arrays: Arrays) -> None:
        super().__init__(body, settings, arrays)
        try:
            import daqp  # noqa: F401
            import mink
            import mujoco
        except ImportError as error:
            raise MissingExtraError("the mink inverse kinematics baseline", "ik") from error
        self._mink = mink
        if self.robot.urdf.suffix.lower() != ".urdf" or any(arm.offsets for arm in self.robot.description.arms):
            raise EmbodimentError(
                f"mink looks for shoulder, elbow and wrist at the origins of links of a URDF, and those of "
                f"{self.robot.name!r} lie elsewhere; use method='geometric'"
            )
        try:
            self._model = mujoco.MjModel.from_xml_path(str(self.robot.urdf))
        except ValueError as error:
            raise EmbodimentError(f"MuJoCo cannot read {self.robot.urdf}: {error}") from error
        self._columns = np.array([self._model.joint(name).qposadr[0] for name in self.robot.joint_names], dtype=np.intp)
        moving = {int(self._model.joint(name).dofadr[0]) for name in self.robot.joint_names}
        frozen = [dof for dof in range(self._model.nv) if dof not in moving]
        self._constraints = [mink.DofFreezingTask(self._model, frozen)] if frozen else []
        self._limits = [mink.ConfigurationLimit(self._model)]

    def begin(self) -> Any:
        """Nothing: mink remembers frames within one call of ``decode`` only."""
        return None

    def follow(self, codes: FloatArray, memory: Any, dt: float | None, limited: bool) -> tuple[FloatArray, Any]:
        """``decode``, which is warm-started from frame to frame anyhow."""
        return self.decode(codes), None

    def decode(self, codes: FloatArray) -> FloatArray:
        """Joint angles ``(N, n)``."""
        goals = self._goals(codes)
        configuration = self._mink.Configuration(self._model)
        start = configuration.q.copy()
        start[self._columns] = self.rest
        low, high = self._model.jnt_range.T
        # Joints that are held must lie within their limits, or the programme has no solution.
        start = np.where(self._model.jnt_limited.astype(bool), np.clip(start, low + 1e-6, high - 1e-6), start)
        configuration.update(start)
        goals = self._to_world(configuration, goals)
        frames = np.stack([self._solve(configuration, goal) for goal in goals])
        frames[:, self.extra_columns] = codes[..., 6:] * self.extra_signs
        return frames

    def _goals(self, codes: FloatArray) -> FloatArray:
        """Elbows and wrists ``(N, arms, 2, 3)`` [m] in the torso frame; shoulders do not move."""
        shoulders = self.robot.arm_points(self.rest)[0, self._arms, 0]
        lengths = self.robot.arm_lengths[self._arms]
        limbs = codes[..., :6].reshape(*codes.shape[:2], 2, 3) * self._signs[:, None]
        limbs = limbs / np.maximum(np.linalg.norm(limbs, axis=-1, keepdims=True), 1e-9)
        elbows = shoulders + lengths[:, :1] * limbs[:, :, 0]
        return np.stack([elbows, elbows + lengths[:, 1:] * limbs[:, :, 1]], axis=2)

    def _to_world(self, configuration: Any, goals: FloatArray) -> FloatArray:
        """Goals from the torso frame to MuJoCo's, which may lack the torso's link: by the arms' points at rest."""
        inside = self.robot.arm_points(self.rest)[0].reshape(-1, 3)
        outside = np.array(
            [
                configuration.data.body(link).xpos
                for arm in self.robot.description.arms
                for link in (arm.shoulder, arm.elbow, arm.wrist)
            ]
        )
        u, _, vt = np.linalg.svd((outside - outside.mean(axis=0)).T @ (inside - inside.mean(axis=0)))
        rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
        result: FloatArray = (goals - inside.mean(axis=0)) @ rotation.T + outside.mean(axis=0)
        return result

    def _solve(self, configuration: Any, goals: FloatArray) -> FloatArray:
        mink = self._mink
        tasks = []
        for arm, points in zip(self._arms, goals, strict=True):
            description = self.robot.description.arms[arm]
            for link, point in zip((description.elbow, description.wrist), points, strict=True):
                task = mink.FrameTask(link, "body", position_cost=1.0, orientation_cost=0.0, lm_damping=1e-3)
                task.set_target(mink.SE3.from_translation(point))
                tasks.append(task)
        for _ in range(_STEPS):
            try:
                velocity = mink.solve_ik(
                    configuration, tasks, 1.0, "daqp", 1e-4, limits=self._limits, constraints=self._constraints
                )
            except mink.NoSolutionFound:
                break  # the solver gives up at a corner of the limits; the last iterate stands
            configuration.integrate_inplace(velocity, 1.0)
            if np.abs(velocity).max() * float(self.robot.arm_lengths.max()) < _CONVERGED:
                break
        result: FloatArray = configuration.q[self._columns].copy()
        return result
