"""ServoWorld: the motor law in numpy, without contacts; hundreds of times faster than rigid-body physics."""

from __future__ import annotations

import json
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError
from syda_gym.files import asset
from syda_gym.simulation.backend import MotorConditions
from syda_gym.simulation.landmark_kinematics import LandmarkKinematics
from syda_gym.simulation.rates import Rates

__all__ = ["ServoConstants", "ServoWorld", "servo_constants"]

_DEFAULT_ACCELERATION = 100.0  # rad/s2, for robots that scripts/fit_servo.py was never run on


class ServoWorld:
    """``count`` robots whose joints follow the motor law of the Bullet backend.

    Per physics step of length ``dt``, for every joint::

        wish = clip(gain (target - q) / dt, -speed, +speed)
        v   += clip(wish - v, -acceleration dt, +acceleration dt)
        q   += v dt

    The accelerations that the motors can reach are fitted to Bullet by ``scripts/fit_servo.py``, with payload and
    friction taking away from them. Links have no extent: there are no contacts.

    Args:
        robot: the kind of robot.
        rates: control and physics rate.
        count: number of robots.

    Raises:
        OptionError: ``count`` is not positive.
    """

    def __init__(self, robot: Robot, rates: Rates, count: int = 1) -> None:
        if count < 1:
            raise OptionError(f"a world needs at least one robot, got {count}")
        self.robot = robot
        self.rates = rates
        self.count = count
        n = len(robot.joint_names)
        self._constants = servo_constants(robot.name, robot.joint_names)
        self._landmarks = LandmarkKinematics(robot)
        dt = rates.physics_dt
        self._full_speed = np.where(np.isfinite(robot.speed), robot.speed, 1e3)[:, None]
        self._gain = np.full((n, count), rates.motor_gain / dt)
        self._speed = np.repeat(self._full_speed, count, axis=1)
        self._kick = np.repeat(self._constants.kick(MotorConditions(), dt)[:, None], count, axis=1)
        self._conditions = [MotorConditions()] * count
        self._lower, self._upper = robot.lower[:, None], robot.upper[:, None]
        # Joint-major, so that one operation runs over a contiguous row per joint.
        self._q = np.repeat(robot.rest[:, None], count, axis=1)
        self._v = np.zeros((n, count))
        self.contacts: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        self.pose = np.zeros((count, 0))
        self.qd = np.zeros((count, 0))
        self._show()

    def reset(self, which: NDArray[np.intp], q: FloatArray) -> None:
        """Puts robots ``which`` ``(k,)`` at rest at joint angles ``q`` ``(k, n)`` [rad]."""
        self._q[:, which] = q.T
        self._v[:, which] = 0.0
        if len(which) == self.count:
            self._show()
            return
        n = len(self._q)
        self.pose[which, :n] = q
        self.pose[which, n:] = self._landmarks(self._q[:, which]).T
        self.qd[which] = 0.0

    def set_conditions(self, index: int, conditions: MotorConditions) -> None:
        """Changes motors and payload of one robot until they are changed again."""
        if conditions == self._conditions[index]:
            return
        self._conditions[index] = conditions
        dt = self.rates.physics_dt
        self._gain[:, index] = self.rates.motor_gain * conditions.gain / dt
        self._speed[:, index] = self._full_speed[:, 0] * conditions.speed
        self._kick[:, index] = self._constants.kick(conditions, dt)

    def let_go(self) -> None:
        """Copies the state arrays, so that a reset of some robots does not write into arrays that others hold."""
        self.pose, self.qd = self.pose.copy(), self.qd.copy()

    def set_constants(self, constants: ServoConstants, index: int) -> None:
        """Takes other constants than those that were fitted, for one robot."""
        self._kick[:, index] = constants.kick(self._conditions[index], self.rates.physics_dt)

    def advance(self, commands: FloatArray) -> None:
        """Lets every robot follow its command ``(B, n)`` [rad] for one control step."""
        target = np.ascontiguousarray(commands.T)
        q, v, dt = self._q, self._v, self.rates.physics_dt
        speed, slowest, kick, least = self._speed, -self._speed, self._kick, -self._kick
        wish = np.empty_like(q)
        for _ in range(self.rates.substeps):
            np.subtract(target, q, out=wish)
            wish *= self._gain
            np.minimum(wish, speed, out=wish)
            np.maximum(wish, slowest, out=wish)
            wish -= v
            np.minimum(wish, kick, out=wish)
            np.maximum(wish, least, out=wish)
            v += wish
            np.multiply(v, dt, out=wish)
            q += wish
        self._stop_at_limits()
        self._show()

    def advance_one(self, command: list[float]) -> list[float]:
        """``advance`` for a world of one robot: joint angles, landmark coordinates and joint speeds afterwards."""
        self.advance(np.array([command]))
        return self._row()

    def reset_one(self, q: list[float]) -> list[float]:
        """``reset`` for a world of one robot: joint angles, landmark coordinates and joint speeds afterwards."""
        self.reset(np.array([0]), np.array([q]))
        return self._row()

    def close(self) -> None:
        """Nothing to release."""

    def _row(self) -> list[float]:
        row: list[float] = self.pose[0].tolist() + self.qd[0].tolist()
        return row

    def _stop_at_limits(self) -> None:
        beyond = (self._q < self._lower) | (self._q > self._upper)
        if beyond.any():
            np.clip(self._q, self._lower, self._upper, out=self._q)
            self._v[beyond] = 0.0

    def _show(self) -> None:
        n = len(self._q)
        pose = np.empty((self.count, n + 3 * self._landmarks.n_landmarks))
        pose[:, :n] = self._q.T
        pose[:, n:] = self._landmarks(self._q).T
        self.pose, self.qd = pose, np.ascontiguousarray(self._v.T)


class ServoConstants:
    """How fast motors can change the speed of their joints.

    ``acceleration = free acceleration (1 - friction) / (1 + payload_factor * payload)``.

    Args:
        acceleration: of the free arm ``(n,)`` [rad/s2].
        payload: relative growth of the inertia that the motor sees, per kilogram in the hand ``(n,)`` [1/kg].
    """

    def __init__(self, acceleration: FloatArray, payload: FloatArray) -> None:
        self.acceleration = acceleration
        self.payload = payload

    def kick(self, conditions: MotorConditions, dt: float) -> FloatArray:
        """Largest change of speed in one physics step ``(n,)`` [rad/s]."""
        free = self.acceleration * (1.0 - conditions.friction)
        return np.asarray(free / (1.0 + self.payload * conditions.payload) * dt)


def servo_constants(robot: str, joints: tuple[str, ...]) -> ServoConstants:
    """The constants fitted for a robot, or cautious defaults for a robot that was never fitted."""
    table = _fitted().get(robot, {})
    rows = [table.get(joint, {}) for joint in joints]
    acceleration = np.array([float(row.get("acceleration", _DEFAULT_ACCELERATION)) for row in rows])
    payload = np.array([float(row.get("payload", 0.0)) for row in rows])
    return ServoConstants(acceleration, payload)


@lru_cache(maxsize=1)
def _fitted() -> dict[str, Any]:
    path = asset("robots", "servo.json")
    if not path.is_file():
        return {}
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return dict(content["robots"])
