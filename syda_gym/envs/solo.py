"""Solo: a fleet of one whose step runs on short arrays and plain numbers, without the fleet's axis of robots.

Every sum is taken in the same order as in ``Fleet``, so that both give the same bits; ``tests/envs/test_vector.py``
holds them together. It is there for speed alone: in one process a fleet of one took 1.36 times its processor time a
step in the servo model and 1.14 times in Bullet.
"""

from __future__ import annotations

from functools import reduce
from math import sqrt
from operator import add
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.fleet import Fleet
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.task.tracking import TERMS

__all__ = ["Solo"]

Step = tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]


class Solo(Fleet):
    """One robot; ``begin`` and ``play`` stand for ``reset``, ``step``, ``observe`` and ``info``.

    Args:
        options: of the environment.
    """

    def __init__(self, options: TeleopOptions) -> None:
        super().__init__(options, 1)
        self._safe = self._safe_lower.tolist(), self._safe_upper.tolist()
        self._low, self._high = self.layout.low, self.layout.high
        weights = self._weights
        self._plain = not (weights.limits or weights.contacts or weights.jitter)
        self._now, self._last, self._total = 0, 0, 0.0
        self._base_now = self._last_correction = np.zeros(self._n)
        self._last_trail: tuple[FloatArray, ...] = ()
        self._labels: dict[str, Any] = {}

    def begin(self, rng: np.random.Generator, wish: Any) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode, as ``Fleet.reset`` does it; returns observation and info."""
        n = self._n
        clip, k, route = self._draw(rng, wish)
        self.clip[0], self.route[0], self._start[0] = clip, route, k
        self._take_plan(0, k, self._scripts.write(0, clip, k, route, rng))
        self._scripts.turn_to(0)
        self._now, self._last, self._total = k, int(self._scripts.lengths[clip]), 0.0
        self._labels = self.names(0)
        base = self._scripts.base_row(k)[:n]
        self._start_q[0], self._past[0] = base, base
        state = np.array(self.world.reset_one(base.tolist()))
        still = np.zeros(3 * self._points)
        self._last_trail, self._last_correction = (state[n:-n].copy(), still, still), np.zeros(n)
        observation = self._look(state, np.zeros(n) if self._residual else (base - self._middle) / self._half)
        target = self._scripts.target_row(k)
        error = state[:-n] - target
        distances = _lengths(error[n:].tolist())
        info = self._tell(k, state, target, error, distances, [0.0] * len(TERMS), 0.0, 0, base, False)
        return observation, info

    def play(self, action: ArrayLike) -> Step:
        """One control step of the robot, as ``Fleet.step`` and ``Fleet.observe`` do it.

        Args:
            action: ``(n,)``.

        Returns:
            Observation, reward, terminated, truncated, info.

        Raises:
            OptionError: wrong shape, or an action that is not finite.
        """
        n, k, options = self._n, self._now, self.options
        values = self._clipped(action)
        correction, command, hits = self._command_of(values)
        if options.history:
            self._remember(self._base_now[None])
        if self._journal.size:
            self._journal[0, k] = command
        if self._changing and k >= self._change_at[0]:
            self._change_motors(np.array([k]))
        state = np.array(self.world.advance_one(command.tolist()))
        target = self._scripts.target_row(k)
        error = state[:-n] - target
        flat = error.tolist()
        distances = _lengths(flat[n:])
        mean, jitter = reduce(add, distances) / self._points, self._jolt(state[n:-n])
        change = (correction - self._last_correction).tolist()
        terms = self._weigh(
            reduce(add, [e * e for e in flat[:n]]), mean, reduce(add, [c * c for c in change]) / n, hits, jitter
        )
        self._last_correction = correction
        self._total = self._total + mean
        self._now = k + 1
        truncated = self._now >= self._last
        terminated = options.terminate_error is not None and mean > options.terminate_error
        success = (truncated or terminated) and self._end(terminated)
        observation = self._look(state, values)
        info = self._tell(k, state, target, error, distances, terms, jitter, hits, command, bool(success))
        return observation, reduce(add, terms), terminated, truncated, info

    @property
    def present_base(self) -> FloatArray:
        """Base command of the next step ``(n,)`` [rad]."""
        return self._base_now.copy()

    def pose(self, index: int) -> dict[str, Any]:
        """What a picture of the robot shows."""
        self._sync()
        return super().pose(index)

    def __getstate__(self) -> dict[str, Any]:
        self._sync()
        return super().__getstate__()

    def _clipped(self, action: ArrayLike) -> FloatArray:
        values = np.array(action, dtype=np.float64)
        if values.shape == (self._n,):
            for value in values.tolist():
                if not -1.0 <= value <= 1.0:
                    break
            else:
                return values
        return np.asarray(np.minimum(np.maximum(self._checked(values[None])[0], -1.0), 1.0))

    def _command_of(self, values: FloatArray) -> tuple[FloatArray, FloatArray, int]:
        """Correction, command within the joint limits, and how many joints had to be clipped."""
        scale, base = self.options.residual_scale, self._base_now
        if self._residual:
            correction, wanted = values, base + values * scale
        else:
            wanted = self._middle + values * self._half
            correction = (wanted - base) / scale
        for value, low, high in zip(wanted.tolist(), *self._safe, strict=True):
            if not low <= value <= high:
                clipped, counts = self._limited(wanted[None])
                return correction, clipped[0], int(counts[0])
        return correction, wanted, 0

    def _jolt(self, landmarks: FloatArray) -> float:
        """Mean third difference of the landmarks."""
        before = self._last_trail
        first = landmarks - before[0]
        second = first - before[1]
        self._last_trail = (landmarks.copy(), first, second)
        return reduce(add, _lengths((second - before[2]).tolist())) / self._points

    def _weigh(self, squared: float, mean: float, change: float, hits: int, jitter: float) -> list[float]:
        weights = self._weights
        # numpy's exp and math.exp may differ in the last bit.
        near = np.exp([squared * -weights.joint_sharpness, mean * -weights.landmark_sharpness]).tolist()
        terms = [weights.joints * near[0], weights.landmarks * near[1], -weights.correction_change * change]
        if self._plain:
            return [*terms, 0.0, 0.0, 0.0]
        contacts = int(self.world.contacts[0])
        return [*terms, *self._penalties(hits, contacts, jitter)]

    def _penalties(self, hits: int, contacts: int, jitter: float) -> list[float]:
        weights = self._weights
        return [-weights.limits * hits, -weights.contacts * contacts, -weights.jitter * jitter]

    def _look(self, state: FloatArray, values: FloatArray) -> NDArray[np.float32]:
        """The observation after a step; the next base command is looked up here."""
        n, k, scripts, blocks = self._n, self._now, self._scripts, self._blocks
        q, ahead = state[:n], scripts.base_row(k)
        self._base_now = ahead[:n]
        result = np.empty(self.layout.size, dtype=np.float32)
        result[blocks["operator"]] = scripts.operator_row(k)
        result[blocks["base_error"]] = (ahead.reshape(-1, n) - q).ravel() if self.options.preview else ahead - q
        result[blocks["q"]] = q
        result[blocks["qd"]] = state[-n:]
        result[blocks["previous_action"]] = values
        result[blocks["packet_age"].start] = scripts.age(k)
        if self.options.history:
            past = (self._past[0] - q).reshape(2, -1)
            result[blocks["base_history"]], result[blocks["q_history"]] = past[0], past[1]
        np.maximum(result, self._low, out=result)
        np.minimum(result, self._high, out=result)
        return result

    def _tell(
        self,
        k: int,
        state: FloatArray,
        target: FloatArray,
        error: FloatArray,
        distances: list[float],
        terms: list[float],
        jitter: float,
        hits: int,
        command: FloatArray,
        success: bool,
    ) -> dict[str, Any]:
        """The info of a step or a reset; it takes over the arrays."""
        n, points = self._n, (self._points, 3)
        return {
            "reward_terms": dict(zip(TERMS, terms, strict=True)),
            "joint_error": error[:n],
            "landmark_error": np.array(distances),
            "jitter": jitter,
            "limit_hits": hits,
            "contacts": int(self.world.contacts[0]) if self.options.self_collision else 0,
            "q": state[:n],
            "base": self._base_now.copy(),
            "command": command,
            "reference": target[:n],
            "landmarks": state[n:-n].reshape(points),
            "reference_landmarks": target[n:].reshape(points),
            "packet_age": self._scripts.age(k),
            "frame": k,
            **self._labels,
            "is_success": success,
        }

    def _end(self, terminated: bool) -> bool:
        frames = self._now - int(self._start[0])
        error = self._total / frames
        self._starts.learn(int(self.clip[0]), int(self._start[0]), frames, error)
        return not terminated and error <= self.repertoire.success_error

    def _sync(self) -> None:
        """Brings the fleet's arrays up to date, for pictures and pickles."""
        k = max(self._now - 1, int(self._start[0]))  # the frame that was compared last
        self._k[0] = self._now
        self._frame = np.array([k], dtype=np.intp)
        self._target = self._scripts.target_of_all(self._frame)
        self._error = self.world.pose - self._target
        points = self._error[:, self._n :].reshape(1, -1, 3)
        self._distances = np.zeros((1, 2 * self._points))
        self._distances[0, : self._points] = np.sqrt((points * points).sum(axis=2))[0]


def _lengths(flat: list[float]) -> list[float]:
    """Lengths of vectors that are listed coordinate by coordinate."""
    numbers = iter(flat)
    return [sqrt(x * x + y * y + z * z) for x, y, z in zip(numbers, numbers, numbers, strict=True)]
