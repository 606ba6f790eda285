"""Fleet: B robots that each replay a clip; the common core of the single and the vectorised environment.

Everything is computed for all robots at once, and no operation mixes robots, so that a robot's trajectory does not
depend on how many others there are, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.task.observation import ObservationLayout, teleop_layout
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.task.repertoire import Repertoire
from syda_gym.envs.task.scripts import Scripts
from syda_gym.envs.task.starts import StartSampler
from syda_gym.envs.task.tracking import TERMS, in_order, reward_terms
from syda_gym.errors import OptionError
from syda_gym.simulation.backend import MotorConditions
from syda_gym.simulation.making import make_world

__all__ = ["Ending", "EpisodeWish", "Fleet"]

Generator = np.random.Generator

_HANDED_OUT = (
    "clip", "route", "_frame", "_k", "_base", "_command", "_error", "_target", "_distances", "_jitter", "_hits",
    "_success", "_terms", "reward", "terminated", "truncated", "_action", "_correction",
)  # fmt: skip


@dataclass(frozen=True)
class EpisodeWish:
    """What a caller of ``reset`` asks for; ``None`` leaves it to chance.

    Attributes:
        clip: index of the clip.
        frame: first frame.
        route: index of the route.
    """

    clip: int | None = None
    frame: int | None = None
    route: int | None = None


class Ending(NamedTuple):
    """An episode that ended: robot, clip, first frame, number of frames, mean landmark error [m]."""

    robot: int
    clip: int
    start: int
    frames: int
    error: float


class Fleet:
    """``count`` robots.

    Args:
        options: of the environment.
        count: number of robots, B.
        max_steps: after so many steps an episode is cut off; ``None`` plays clips to their end.

    Attributes:
        layout: of the observation.
        reward: ``(B,)`` of the last step.
        terminated: ``(B,)``.
        truncated: ``(B,)``.
        ended: episodes that ended in the last step.
    """

    def __init__(self, options: TeleopOptions, count: int, max_steps: int | None = None) -> None:
        self.options = options
        self.count = count
        self._max_steps = max_steps
        self.rates = options.rates
        self.repertoire = Repertoire(options)
        self.robot = self.repertoire.robot
        self._residual = options.action_mode == "residual"
        self.layout: ObservationLayout = teleop_layout(
            self.repertoire.operator,
            self.robot,
            preview=options.preview,
            history=options.history,
        )
        self._blocks = dict(self.layout)
        self._weights = options.weights
        self._n = n = len(self.robot.joint_names)
        self._scripts = Scripts(self.repertoire, options, count)
        self._starts = StartSampler(self.repertoire.clips, options.start)
        self._lower, self._upper = self.robot.lower, self.robot.upper
        self._middle, self._half = 0.5 * (self._lower + self._upper), 0.5 * (self._upper - self._lower)
        # A command inside these bounds is inside the coupled limits whatever the other joints do.
        samples = np.random.default_rng(0).uniform(self._lower, self._upper, (512, n))
        low, high = self.robot.limits_at(samples)
        self._safe_lower, self._safe_upper = low.max(axis=0), high.min(axis=0)
        points = 2 * len(self.robot.sides)
        self._points = points
        self.world = self._new_world()
        # Commands of the present episodes: what a pickled Bullet world is led back by.
        frames = self.repertoire.longest + 2 if options.physics == "bullet" else 0
        self._journal = np.zeros((count, frames, n))
        self._robots = np.arange(count)
        self._start_q = np.repeat(self.robot.rest[None], count, axis=0)
        self._conditions = [MotorConditions()] * count
        zeros = np.zeros((count, n))
        self._k = np.zeros(count, dtype=np.intp)
        self._length = np.zeros(count, dtype=np.intp)
        self.clip = np.zeros(count, dtype=np.intp)
        self.route = np.zeros(count, dtype=np.intp)
        self._start = np.zeros(count, dtype=np.intp)
        self._base, self._command, self._correction, self._action = (zeros.copy() for _ in range(4))
        self._past = np.zeros((count, 2, options.history, n))
        self._trail = [np.zeros((count, 3 * points)) for _ in range(3)]
        self._error_sum = np.zeros(count)
        self.ended: list[Ending] = []
        self.reward, self._terms = np.zeros(count), np.zeros((len(TERMS), count))
        self.terminated, self.truncated = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        self._success = np.zeros(count, dtype=bool)
        self._hits = np.zeros(count, dtype=np.int64)
        self._target = np.zeros((count, n + 3 * points))
        self._error, self._distances = self._target.copy(), np.zeros((count, 2 * points))
        self._jitter = np.zeros(count)
        self._frame = self._k.copy()

    @property
    def done(self) -> NDArray[np.bool_]:
        """Robots whose episode has ended, ``(B,)``."""
        result: NDArray[np.bool_] = self.terminated | self.truncated
        return result

    @property
    def base(self) -> FloatArray:
        """Base commands of the next step, ``(B, n)`` [rad]."""
        return self._base

    def reset(
        self,
        which: Sequence[int],
        rngs: Sequence[Generator],
        wishes: Sequence[EpisodeWish],
        *,
        handed_out: bool = True,
    ) -> None:
        """Begins new episodes.

        Args:
            which: indices of the robots ``(k,)``.
            rngs: random numbers of each of them.
            wishes: what is asked of each of them.
            handed_out: whether a caller may hold arrays of the present state, which then must not change.
        """
        index_rows = np.asarray(which, dtype=np.intp)
        rows: Any = slice(None) if len(which) == self.count else index_rows
        if handed_out:
            self._let_go()
        for index, rng, wish in zip(which, rngs, wishes, strict=True):
            clip, frame, route = self._draw(rng, wish)
            self.clip[index], self._k[index], self.route[index] = clip, frame, route
            conditions = self._scripts.write(index, clip, frame, route, rng)
            if conditions is not None:
                self._conditions[index] = conditions
                self.world.set_conditions(index, conditions)
        self._start[rows] = self._frame[rows] = k = self._k[rows]
        length = self._scripts.lengths[self.clip[rows]]
        self._length[rows] = length if self._max_steps is None else np.minimum(length, k + self._max_steps)
        base = self._scripts.base(rows, k)[:, : self._n]
        self.world.reset(index_rows, base)
        self._start_q[rows] = base
        self._base[rows] = self._command[rows] = base
        self._correction[rows] = 0.0
        self._action[rows] = 0.0 if self._residual else (base - self._middle) / self._half
        self._past[rows] = base[:, None, None]
        pose = self.world.pose[rows]
        self._trail[0][rows], self._trail[1][rows], self._trail[2][rows] = pose[:, self._n :], 0.0, 0.0
        self._error_sum[rows] = 0.0
        self.reward[rows], self._terms[:, rows] = 0.0, 0.0
        self.terminated[rows] = self.truncated[rows] = self._success[rows] = False
        self._hits[rows] = 0
        self._jitter[rows] = 0.0
        target = self._scripts.target(rows, k)
        error = pose - target
        self._target[rows], self._error[rows] = target, error
        points = error[:, self._n :].reshape(len(which), -1, 3)
        self._distances[rows, : self._points] = np.sqrt(in_order(points * points))
        self._distances[rows, self._points :] = 0.0

    def step(self, actions: ArrayLike, skip: NDArray[np.bool_] | None = None) -> None:
        """One control step of every robot.

        Args:
            actions: ``(B, n)``.
            skip: ``(B,)`` robots whose episode has ended before; what happens to them now does not count.

        Raises:
            OptionError: wrong shape, or an action that is not finite.
        """
        n, points, k, options = self._n, self._points, self._k, self.options
        self.ended = []
        action = np.minimum(np.maximum(self._checked(actions), -1.0), 1.0)
        base = self._base
        if self._residual:
            correction, wanted = action, base + action * options.residual_scale
        else:
            wanted = self._middle + action * self._half
            correction = (wanted - base) / options.residual_scale
        command, self._hits = self._limited(wanted)
        change = correction - self._correction
        if options.history:
            self._remember(base)
        if self._journal.size:
            self._journal[self._robots, k] = command
        self.world.advance(command)
        pose = self.world.pose
        self._frame = k
        self._target = target = self._scripts.target_of_all(k)
        self._error = error = pose - target
        landmarks = pose[:, n:]
        trail = self._trail
        first = landmarks - trail[0]
        second = first - trail[1]
        squares = np.empty((self.count, 2 * points, 3))
        squares[:, :points] = error[:, n:].reshape(self.count, points, 3)
        squares[:, points:] = (second - trail[2]).reshape(self.count, points, 3)
        self._trail = [landmarks, first, second]
        squares *= squares
        self._distances = distances = np.sqrt(in_order(squares))
        joints = error[:, :n]
        mean, jitter = in_order(distances[:, :points]) / points, in_order(distances[:, points:]) / points
        self._jitter = jitter
        self._terms = terms = reward_terms(
            self._weights,
            squared_joint_error=in_order(joints * joints),
            landmark_error=mean,
            correction_change=in_order(change * change) / n,
            limit_hits=self._hits,
            contacts=self.world.contacts,
            jitter=jitter,
        )
        self.reward = in_order(terms.T)
        self._action, self._correction, self._command = action, correction, command
        self._error_sum = self._error_sum + mean
        self._k = k = k + 1
        self.truncated = k >= self._length
        if options.terminate_error is not None:
            self.terminated = mean > options.terminate_error
        if self.truncated.any() or self.terminated.any():
            self._finish(self.done if skip is None else self.done & ~skip)

    def observe(self, which: NDArray[np.intp] | None = None) -> NDArray[np.float32]:
        """Observations ``(B, size)``, or those of some robots; base commands of the next step are looked up here."""
        n, k, blocks = self._n, self._k, self._blocks
        rows = self._scripts.base_of_all(k)
        q = self.world.pose[:, :n]
        result = np.empty((self.count, self.layout.size), dtype=np.float32)
        self._base = rows[:, :n]
        result[:, blocks["operator"]] = self._scripts.operator_of_all(k)
        if self.options.preview:
            error = rows.reshape(self.count, -1, n) - q[:, None]
            result[:, blocks["base_error"]] = error.reshape(self.count, -1)
        else:
            result[:, blocks["base_error"]] = rows - q
        result[:, blocks["q"]] = q
        result[:, blocks["qd"]] = self.world.qd
        result[:, blocks["previous_action"]] = self._action
        result[:, blocks["packet_age"].start] = self._scripts.age_of_all(k)
        if self.options.history:
            past = (self._past - q[:, None, None]).reshape(self.count, 2, -1)
            result[:, blocks["base_history"]] = past[:, 0]
            result[:, blocks["q_history"]] = past[:, 1]
        np.maximum(result, self.layout.low, out=result)
        np.minimum(result, self.layout.high, out=result)
        return result if which is None else result[which]

    def info(self) -> dict[str, Any]:
        """Arrays over the robots; none of them is written to later."""
        n, points = self._n, self._points
        pose = self.world.pose
        shape = (self.count, points, 3)
        return {
            "reward_terms": dict(zip(TERMS, self._terms, strict=True)),
            "joint_error": self._error[:, :n],
            "landmark_error": self._distances[:, :points],
            "jitter": self._jitter,
            "limit_hits": self._hits,
            "contacts": self.world.contacts,
            "q": pose[:, :n],
            "base": self._base,
            "command": self._command,
            "reference": self._target[:, :n],
            "landmarks": pose[:, n:].reshape(shape),
            "reference_landmarks": self._target[:, n:].reshape(shape),
            "packet_age": self._scripts.age_of_all(self._frame),
            "frame": self._frame,
            "motion": self.clip,
            "motion_action": self.clip,
            "route": self.route,
            "transferability": self.route,
            "is_success": self._success,
        }

    def names(self, index: int) -> dict[str, Any]:
        """The entries of ``info`` that are looked up by clip and route: texts and the transferability."""
        clip = self.repertoire.clips[self.clip[index]]
        route = self.repertoire.routes[self.route[index]]
        return {
            "motion": clip.name,
            "motion_action": clip.action,
            "route": route.name,
            "transferability": route.transferability,
        }

    def pose(self, index: int) -> dict[str, FloatArray]:
        """What a picture of one robot shows: ``q``, ``reference``, ``operator`` and ``errors``."""
        n = self._n
        return {
            "q": self.world.pose[index, :n],
            "reference": self._target[index, :n],
            "operator": self.watched()[index],
            "errors": self._distances[index, : self._points],
        }

    def watched(self) -> FloatArray:
        """Operator frames of the newest packets when the robots were compared last, ``(B, F)``."""
        return self._scripts.operator_of_all(self._frame)

    def close(self) -> None:
        """Releases the world."""
        self.world.close()

    def __getstate__(self) -> dict[str, Any]:
        state = self.__dict__.copy()
        if self.options.physics == "bullet":
            del state["world"]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self.options.physics == "bullet":
            self.world = self._new_world()
            self._replay()

    def _replay(self) -> None:
        """Leads a fresh world to where the pickled one was: every robot repeats its commands since its reset."""
        steps = self._k - self._start
        for index in range(self.count):
            self.world.set_conditions(index, self._conditions[index])
        self.world.reset(np.arange(self.count), self._start_q)
        longest = int(steps.max())
        for time in range(longest):
            late = np.flatnonzero(longest - steps == time)
            if len(late) and time:
                self.world.reset(late, self._start_q[late])
            past = np.minimum(self._start + np.maximum(time - (longest - steps), 0), self._journal.shape[1] - 1)
            self.world.advance(self._journal[self._robots, past])
        fresh = np.flatnonzero(steps == 0)
        if len(fresh) and longest:
            self.world.reset(fresh, self._start_q[fresh])

    def _new_world(self) -> Any:
        options = self.options
        return make_world(
            self.robot,
            self.rates,
            count=self.count,
            physics=options.physics,
            self_collision=bool(options.self_collision),
            whole_body=bool(options.whole_body),
        )

    def _draw(self, rng: Generator, wish: EpisodeWish) -> tuple[int, int, int]:
        shares = rng.random(3).tolist()
        clip, frame = self._starts.draw(shares[0], shares[1], wish.clip)
        if wish.frame is not None:
            length = self.repertoire.clips[clip].length
            if not 0 <= wish.frame < length:
                raise OptionError(
                    f"frame must lie between 0 and {length - 1} for {self.repertoire.clips[clip].name!r}, "
                    f"got {wish.frame}"
                )
            frame = wish.frame
        route = self.repertoire.clip_routes[clip]
        if wish.route is not None:
            route = wish.route
        elif self.options.route == "sample":
            route = self._scripts.draw_route(shares[2])
        return clip, frame, route

    def _checked(self, actions: ArrayLike) -> FloatArray:
        array = np.asarray(actions, dtype=np.float64)
        if array.shape != (self.count, self._n):
            raise OptionError(
                f"expected actions of shape {(self.count, self._n)}, one number per joint "
                f"({', '.join(self.robot.joint_names)}), got {array.shape}"
            )
        if not np.isfinite(array).all():
            row, column = np.argwhere(~np.isfinite(array))[0]
            raise OptionError(
                f"action of robot {row} for {self.robot.joint_names[column]} is {array[row, column]}; actions must be "
                "finite (check the policy for overflow)"
            )
        return array

    def _limited(self, wanted: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
        """Commands within the joint limits, and how many joints had to be clipped."""
        outside = (wanted < self._safe_lower) | (wanted > self._safe_upper)
        if not outside.any():
            return wanted, np.zeros(self.count, dtype=np.int64)
        rows = np.flatnonzero(outside.any(axis=1))
        command, hits = wanted.copy(), np.zeros(self.count, dtype=np.int64)
        command[rows] = self.robot.clamp(wanted[rows])
        hits[rows] = (np.abs(command[rows] - wanted[rows]) > 1e-9).sum(axis=1)
        return command, hits

    def _let_go(self) -> None:
        """Copies what ``info`` may have handed out, before a reset writes into it."""
        for name in _HANDED_OUT:
            setattr(self, name, getattr(self, name).copy())
        self._trail = [array.copy() for array in self._trail]
        self.world.let_go()

    def _remember(self, base: FloatArray) -> None:
        self._past[:, :, 1:] = self._past[:, :, :-1].copy()
        self._past[:, 0, 0] = base
        self._past[:, 1, 0] = self.world.pose[:, : self._n]

    def _finish(self, ended: NDArray[np.bool_]) -> None:
        for index in np.flatnonzero(ended).tolist():
            frames = int(self._k[index] - self._start[index])
            error = float(self._error_sum[index]) / frames
            lived = not bool(self.terminated[index])
            self._success = self._success.copy()
            self._success[index] = lived and error <= self.repertoire.success_error
            ending = Ending(index, int(self.clip[index]), int(self._start[index]), frames, error)
            self.ended.append(ending)
            self._starts.learn(*ending[1:])
