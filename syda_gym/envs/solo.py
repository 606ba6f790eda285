"""Solo: a fleet of one whose step runs on plain numbers, because arrays of ten are slower than lists of ten.

Every sum is taken in the same order as in ``Fleet``, so that both give the same bits.
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
from syda_gym.envs.options import TeleopOptions
from syda_gym.envs.tracking import TERMS

__all__ = ["Solo"]

Step = tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]


class Solo(Fleet):
    """One robot; ``reset`` and everything else is the fleet's.

    Args:
        options: of the environment.
    """

    def __init__(self, options: TeleopOptions) -> None:
        super().__init__(options, 1)
        self._safe = list(zip(self._safe_lower.tolist(), self._safe_upper.tolist(), strict=True))
        self._middles, self._halves = self._middle.tolist(), self._half.tolist()
        self._low, self._high = self.layout.low, self.layout.high
        self._corners = range(0, 3 * self._points, 3)
        weights = self._weights
        self._sharpness = np.array([-weights.joint_sharpness, -weights.landmark_sharpness])
        self._plain = not (weights.limits or weights.contacts or weights.jitter)
        self._now, self._last, self._total = 0, 0, 0.0
        self._base_values: list[float] = []
        self._last_correction: list[float] = []
        self._trail_values: tuple[list[float], ...] = ()
        self._labels: dict[str, Any] = {}
        self._read()

    def begin(self, rng: np.random.Generator, wish: Any) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode; returns observation and info."""
        self.reset([0], [rng], [wish], handed_out=False)
        observation = self.observe()[0]
        self._read()
        return observation, self._first_info()

    def play(self, action: ArrayLike) -> Step:
        """One control step of the robot, as ``Fleet.step`` and ``Fleet.observe`` do it.

        Args:
            action: ``(n,)``.

        Returns:
            Observation, reward, terminated, truncated, info.

        Raises:
            OptionError: wrong shape, or an action that is not finite.
        """
        n, k, base, options = self._n, self._now, self._base_values, self.options
        values = [-1.0 if v < -1.0 else 1.0 if v > 1.0 else v for v in self._values(action)]
        scale = options.residual_scale
        if self._residual:
            correction, command = values, [b + v * scale for b, v in zip(base, values, strict=True)]
        else:
            command = [m + v * h for m, v, h in zip(self._middles, values, self._halves, strict=True)]
            correction = [(c - b) / scale for b, c in zip(base, command, strict=True)]
        hits = 0
        for value, (low, high) in zip(command, self._safe, strict=True):
            if value < low or value > high:
                clipped, counts = self._limited(np.array([command]))
                command, hits = clipped[0].tolist(), int(counts[0])
                break
        if options.history:
            self._remember(np.array([base]))
        change = [a - b for a, b in zip(correction, self._last_correction, strict=True)]
        if self._journal.size:
            self._journal[0, k] = command
        row = self.world.advance_one(command)
        target = self._scripts.target_row(k)
        error = [p - t for p, t in zip(row, target, strict=False)]
        distances = self._lengths(error[n:])
        landmarks = row[n:-n]
        first = [a - b for a, b in zip(landmarks, self._trail_values[0], strict=True)]
        second = [a - b for a, b in zip(first, self._trail_values[1], strict=True)]
        third = [a - b for a, b in zip(second, self._trail_values[2], strict=True)]
        self._trail_values = (landmarks, first, second)
        mean = reduce(add, distances) / self._points
        jitter = reduce(add, self._lengths(third)) / self._points
        terms = self._weigh(
            reduce(add, [e * e for e in error[:n]]), mean, reduce(add, [c * c for c in change]) / n, hits, jitter
        )
        reward = reduce(add, terms)
        self._last_correction = correction
        self._total = self._total + mean
        self._now = k + 1
        truncated = self._now >= self._last
        terminated = options.terminate_error is not None and mean > options.terminate_error
        success = (truncated or terminated) and self._end(terminated)
        observation = self._look(row, values)
        info = self._describe(k, row, target, error, distances, terms, jitter, hits, command, bool(success))
        return observation, reward, terminated, truncated, info

    @property
    def present_base(self) -> FloatArray:
        """Base command of the next step ``(n,)`` [rad]."""
        return np.array(self._base_values)

    def pose(self, index: int) -> dict[str, Any]:
        """What a picture of the robot shows."""
        self._sync()
        return super().pose(index)

    def __getstate__(self) -> dict[str, Any]:
        self._sync()
        return super().__getstate__()

    def _values(self, action: ArrayLike) -> list[float]:
        array = np.asarray(action, dtype=np.float64)
        if array.shape == (self._n,):
            values: list[float] = array.tolist()
            total = reduce(add, values)
            if total - total == 0.0:
                return values
        checked: list[float] = self._checked(array[None])[0].tolist()
        return checked

    def _lengths(self, flat: list[float]) -> list[float]:
        return [sqrt(flat[i] * flat[i] + flat[i + 1] * flat[i + 1] + flat[i + 2] * flat[i + 2]) for i in self._corners]

    def _weigh(self, squared: float, mean: float, change: float, hits: int, jitter: float) -> list[float]:
        weights = self._weights
        # numpy's exp and math.exp may differ in the last bit.
        near = np.exp(np.array([squared, mean]) * self._sharpness).tolist()
        terms = [weights.joints * near[0], weights.landmarks * near[1], -weights.correction_change * change]
        if self._plain:
            return [*terms, 0.0, 0.0, 0.0]
        contacts = int(self.world.contacts[0])
        return [*terms, *self._penalties(hits, contacts, jitter)]

    def _penalties(self, hits: int, contacts: int, jitter: float) -> list[float]:
        weights = self._weights
        return [-weights.limits * hits, -weights.contacts * contacts, -weights.jitter * jitter]

    def _look(self, row: list[float], values: list[float]) -> NDArray[np.float32]:
        """The observation after a step; the next base command is looked up here."""
        n, k, scripts = self._n, self._now, self._scripts
        q = row[:n]
        ahead = scripts.base_row(k)
        self._base_values = base = ahead[:n]
        errors = [b - p for b, p in zip(base, q, strict=True)]
        for start in range(n, len(ahead), n):
            errors += [b - p for b, p in zip(ahead[start : start + n], q, strict=True)]
        parts = [*scripts.operator_row(k), *errors, *q, *row[-n:], *values, scripts.age(k)]
        if self.options.history:
            parts += (self._past[0] - np.array(q)).ravel().tolist()
        result = np.array(parts, dtype=np.float32)
        np.maximum(result, self._low, out=result)
        np.minimum(result, self._high, out=result)
        return result

    def _describe(
        self,
        k: int,
        row: list[float],
        target: list[float],
        error: list[float],
        distances: list[float],
        terms: list[float],
        jitter: float,
        hits: int,
        command: list[float],
        success: bool,
    ) -> dict[str, Any]:
        n, points, size = self._n, self._points, len(target)
        # One array, cut into views: making an array costs more than its numbers.
        numbers = np.array([*row, *target, *error[:n], *command, *self._base_values, *distances])
        cuts = numbers[size + n :]
        return {
            "reward_terms": dict(zip(TERMS, terms, strict=True)),
            "joint_error": cuts[size : size + n],
            "landmark_error": cuts[size + 3 * n :],
            "jitter": jitter,
            "limit_hits": hits,
            "contacts": int(self.world.contacts[0]) if self.options.self_collision else 0,
            "q": numbers[:n],
            "base": cuts[size + 2 * n : size + 3 * n],
            "command": cuts[size + n : size + 2 * n],
            "reference": cuts[:n],
            "landmarks": numbers[n:size].reshape(points, 3),
            "reference_landmarks": cuts[n:size].reshape(points, 3),
            "packet_age": self._scripts.age(k),
            "frame": k,
            **self._labels,
            "is_success": success,
        }

    def _first_info(self) -> dict[str, Any]:
        info = self.info()
        result: dict[str, Any] = {}
        for key, value in info.items():
            if key in self._labels:
                result[key] = self._labels[key]
            elif isinstance(value, dict):
                result[key] = {name: column.item(0) for name, column in value.items()}
            else:
                result[key] = value.item(0) if value.ndim == 1 else value[0].copy()
        return result

    def _end(self, terminated: bool) -> bool:
        frames = self._now - int(self._start[0])
        error = self._total / frames
        self._starts.learn(int(self.clip[0]), int(self._start[0]), frames, error)
        return not terminated and error <= self.options.success_error

    def _read(self) -> None:
        """Takes over from the fleet's arrays, as a reset leaves them."""
        self._now, self._last = int(self._k[0]), int(self._length[0])
        self._base_values = self._base[0].tolist()
        self._last_correction = self._correction[0].tolist()
        self._trail_values = tuple(array[0].tolist() for array in self._trail)
        self._total = float(self._error_sum[0])
        self._scripts.turn_to(0)
        self._labels = self.names(0)

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
