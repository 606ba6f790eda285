"""ResidualVecEnv: what Stable-Baselines3 trains a residual policy on: recorded streams, servo model, shadows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from syda_gym.agents.agent import Agent, limited
from syda_gym.agents.classical.projection import capsule_model
from syda_gym.agents.interface import Reading
from syda_gym.agents.learned.views import Views
from syda_gym.agents.residual.costs import CostWeights
from syda_gym.agents.streams.streams import Past, Streams, play_streams, read_rows
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.simulation.making import make_world
from syda_gym.simulation.rates import Rates

__all__ = ["ResidualVecEnv"]

_DEEPEST = 4.0  # margins of overlap beyond which a contact costs no more


class ResidualVecEnv(VecEnv):  # type: ignore[misc]
    """``B`` robots replay streams under a base agent plus a correction.

    The reward is the cost that the correction saves, in the same step, against a shadow: a robot in the same world that
    follows the base agent alone. So its mean says at once whether the policy helps. What shadows do follows from the
    streams, and is played once before. An episode that begins in its middle begins where the shadow is. Actions are
    corrections in [-1, 1], low-passed and scaled as ``ResidualPolicy`` does it; observations are the features of
    ``ResidualPolicy``, normalised. An episode ends with its clip, which is truncation.

    Where the policy looks at each arm (``views.Views``), every robot is two environments, its left arm and, after all
    robots, its right arm in the mirror; each is paid for what it costs itself.

    Args:
        base: the agent below.
        streams: what is replayed.
        rates: control and physics rate.
        count: number of robots.
        each_arm: two views of a robot, one an arm, or one of the whole.
        scale: largest correction [rad].
        smoothing: share of the old correction.
        weights: of the cost.
        mean: of the features; zeros until ``normalise``.
        std: of the features; ones until ``normalise``.
    """

    def __init__(
        self,
        base: Agent,
        streams: Streams,
        rates: Rates,
        *,
        count: int,
        scale: float,
        smoothing: float,
        weights: CostWeights,
        each_arm: bool = False,
        mean: FloatArray | None = None,
        std: FloatArray | None = None,
    ) -> None:
        self.interface = base.interface
        self.views = Views(self.interface, each_arm)
        self.robots = count
        features, n = self.views.size, self.interface.n
        self.render_mode = None
        super().__init__(
            count * self.views.count,
            gymnasium.spaces.Box(-10.0, 10.0, (features,), dtype=np.float32),
            gymnasium.spaces.Box(-1.0, 1.0, (self.views.outputs,), dtype=np.float32),
        )
        self.base = base
        self.streams, self.rates = streams, rates
        self.scale, self.smoothing, self.weights = scale, smoothing, weights
        self.mean = np.zeros(features) if mean is None else mean
        self.std = np.ones(features) if std is None else std
        self.world = make_world(self.interface.robot, rates, count=count, physics="servo")
        self._capsules = capsule_model(self.interface.robot) if weights.contact else None
        robot, shape = self.interface.robot, streams.reference.shape
        self._targets = robot.landmarks(streams.reference.reshape(-1, n)).reshape(*shape[:2], -1, 3)
        self._changing = streams.changing
        self._actions = np.zeros((self.num_envs, self.views.outputs))
        self.raw_features = np.zeros((self.num_envs, features))
        self._episode: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        self._step: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        self._correction: FloatArray = np.zeros((count, n))
        self._below: FloatArray = np.zeros((count, n))
        self._trail: FloatArray = np.zeros((4, count, self._targets.shape[2], 3))
        self._past = Past(self.interface, count)
        self._shadow_q = play_streams(base, streams, rates)
        self._shadow_cost = self._cost_of_shadows()
        self.rng = np.random.default_rng(0)

        self._begin_all()

    def seed_all(self, seed: int | Sequence[int]) -> None:
        """Sets the random numbers that choose episodes; takes effect at the next ``reset``."""
        self.rng = np.random.default_rng(seed)

    def reset(self) -> NDArray[np.float32]:
        """Begins all episodes anew, each at a random step so that they do not end together."""
        self._begin_all()
        steps = (self.rng.random(self.robots) * (self.streams.lengths[self._episode] - 10)).astype(np.intp)
        self._start(np.arange(self.robots), steps)
        return self._observe()

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Takes the actions ``(num_envs, outputs)`` of the next step."""
        self._actions = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """One control step."""
        n = self.interface.n
        actions = self.views.join(self._actions)
        self._correction = self.smoothing * self._correction + (1.0 - self.smoothing) * actions
        below = self._below
        q = self.world.pose[:, :n]
        self._past.add(self.streams.base[self._episode, self._step], q)
        for row in np.flatnonzero(self._changing[self._episode, self._step]).tolist():
            self.world.set_conditions(row, self.streams.motors[self._episode[row]].at(int(self._step[row])))
        self.world.advance(limited(self.interface, below + self.scale * self._correction, below, q))
        reward = (self._shadow_cost[self._episode, self._step] - self._cost()) / self.weights.scale
        self._step = self._step + 1
        done = self._step >= self.streams.lengths[self._episode]
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            self._finish(done, infos)
        return self._observe(), reward.T.ravel().astype(np.float32), np.tile(done, self.views.count), infos

    def close(self) -> None:
        """Releases the world."""
        self.world.close()

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No robot is wrapped."""
        return [False] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The same attribute for every robot."""
        return [getattr(self, attr_name)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Sets an attribute that all robots share."""
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Calls a method that all robots share."""
        return [getattr(self, method_name)(*args, **kwargs)] * self.num_envs

    def _begin_all(self) -> None:
        """All robots at the start of some episode, all agents without history."""
        count, n = self.robots, self.interface.n
        self.base.reset(count)
        self._episode = np.asarray(self.rng.integers(len(self.streams), size=count))
        self._step = np.zeros(count, dtype=np.intp)
        self._correction = np.zeros((count, n))

    def _start(self, rows: NDArray[np.intp], steps: NDArray[np.intp]) -> None:
        """Puts robots ``rows`` at rest where the base alone is before a step of their episodes."""
        self._step[rows] = steps
        self._correction[rows] = 0.0
        episodes = self._episode[rows]
        base = self.streams.base[episodes, steps]
        start = np.where(steps[:, None] > 0, self._shadow_q[episodes, np.maximum(steps - 1, 0)], base)
        if self.streams.motors:
            for row in rows.tolist():
                self.world.set_conditions(row, self.streams.motors[self._episode[row]].at(int(self._step[row])))
        self.world.reset(rows, start)
        self._past.begin(rows, base)
        self._trail[:, rows] = self._landmarks()[rows]

    def _finish(self, done: NDArray[np.bool_], infos: list[dict[str, Any]]) -> None:
        """Ends episodes: what was seen last goes to ``infos``, and the next ones begin."""
        rows = np.flatnonzero(done)
        learner = self._reading()
        # The base agent must not be asked twice in one step, so that the raw base command stands in for its answer.
        last = self._normalised(self.views.see(learner.base, self._correction, learner))
        for row in (rows[None] + self.robots * np.arange(self.views.count)[:, None]).ravel().tolist():
            infos[row] = {"terminal_observation": last[row], "TimeLimit.truncated": True}
        self._episode[rows] = self.rng.integers(len(self.streams), size=len(rows))
        self._start(rows, np.zeros(len(rows), dtype=np.intp))
        self.base.restart(done)

    def _observe(self) -> NDArray[np.float32]:
        """Asks the base for its commands and returns the features."""
        learner = self._reading()
        self._below = self.base.act_on(learner)
        self.raw_features = self.views.see(self._below, self._correction, learner)
        return self._normalised(self.raw_features)

    def _normalised(self, features: FloatArray) -> NDArray[np.float32]:
        return np.clip((features - self.mean) / self.std, -10.0, 10.0).astype(np.float32)

    def _reading(self) -> Reading:
        """What the robots read."""
        q, qd = self.world.pose[:, : self.interface.n], self.world.qd
        return read_rows(self.interface, self.streams, self._episode, self._step, q, qd, self._past.rows)

    def _landmarks(self) -> FloatArray:
        n = self.interface.n
        return np.asarray(self.world.pose[:, n:].reshape(self.robots, -1, 3))

    def _cost(self) -> FloatArray:
        """Cost of the step just made, of each view, ``(B, views)``."""
        points, q = self._landmarks(), self.world.pose[:, : self.interface.n]
        self._trail = np.concatenate([self._trail[1:], points[None]])
        at = (self._episode, self._step)
        return self._weighed(points, self._targets[at], _third(self._trail)[0], q, self.streams.reference[at])

    def _cost_of_shadows(self) -> FloatArray:
        """Cost of every step of every episode under the base alone, of each view, ``(E, T, views)``."""
        q, robot = self._shadow_q, self.interface.robot
        start = robot.landmarks(self.streams.base[:, 0])[:, None]
        points = robot.landmarks(q.reshape(-1, q.shape[-1])).reshape(*q.shape[:2], -1, 3)
        trail = np.concatenate([start, start, start, points], axis=1).swapaxes(0, 1)
        flat = [array.reshape(-1, *array.shape[2:]) for array in (points, self._targets, _third(trail).swapaxes(0, 1))]
        joints = [array.reshape(-1, q.shape[-1]) for array in (q, self.streams.reference)]
        return self._weighed(*flat, *joints).reshape(*q.shape[:2], -1)

    def _weighed(
        self, points: FloatArray, targets: FloatArray, third: FloatArray, q: FloatArray, reference: FloatArray
    ) -> FloatArray:
        """Costs ``(N, views)`` of steps that led to ``points`` ``(N, P, 3)`` and ``q`` ``(N, n)``.

        That of one arm is what its own landmarks and joints cost; the mean of both is what the robot costs.
        """
        weights = self.weights
        shape = (len(q), self.views.count, -1)
        landmark = _lengths(points - targets).reshape(shape).mean(axis=-1)
        joint = np.abs(q - reference).reshape(shape).mean(axis=-1)
        jitter = _lengths(third).reshape(shape).mean(axis=-1)
        cost = 1e3 * (landmark + weights.joints * joint + weights.jitter * jitter)
        if self._capsules is not None:
            depth = 1.0 - self._capsules.clearance(q) / weights.margin
            cost = cost + weights.contact * np.clip(depth, 0.0, _DEEPEST)[:, None]
        return np.asarray(cost)


def _lengths(vectors: FloatArray) -> FloatArray:
    """Lengths along the last axis."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vectors, vectors)))


def _third(trail: FloatArray) -> FloatArray:
    """Third differences along the first axis."""
    return np.asarray(trail[3:] - 3.0 * trail[2:-1] + 3.0 * trail[1:-2] - trail[:-3])
