"""ParallelFleet: a fleet in several processes that gives the bits of a fleet in one."""

from __future__ import annotations

import pickle
import weakref
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.fleet import EpisodeWish, Fleet, Generator
from syda_gym.envs.parallel.child import Answer, Beginning, Share, Task, serve
from syda_gym.envs.parallel.tables import Column, state_of, table, width_of
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.task.tracking import TERMS
from syda_gym.errors import OptionError, SydaError
from syda_gym.processes import Worker, end_workers, start_worker

__all__ = ["ParallelFleet"]

_NOT_TOLD = ("observation", "reward", "terminated", "truncated", "watched")


class ParallelFleet(Fleet):
    """``count`` robots in ``workers`` processes, each with a share of them and a world of its own.

    This process draws clips, start frames and routes, and learns where policies fail; the others simulate. What is
    asked is kept until somebody looks, so that a step with its restarts is one message to each process.

    Args:
        options: of the environment; they are sent to the processes.
        count: number of robots, B.
        max_steps: as for ``Fleet``.
        workers: number of processes, at most ``count``.

    Raises:
        OptionError: options that cannot be sent to another process.
        SydaError: a process failed.
    """

    def __init__(self, options: TeleopOptions, count: int, max_steps: int | None, workers: int) -> None:
        # One robot here, of the cheapest kind: what it knows of clips, limits and shapes holds for all of them.
        super().__init__(replace(options, physics="servo", self_collision=False, whole_body=False), 1, max_steps)
        super().reset([0], [np.random.default_rng(0)], [EpisodeWish()])  # tables are made when they are first read
        observation, info = super().observe(), super().info()
        columns = {name: Column.like(array) for name, array in state_of(self, info).items()}
        self._columns = {"observation": Column.like(observation), **columns}
        self.options, self.count = options, count
        self.clip, self.route = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=np.intp)
        self._told: dict[str, NDArray[Any]] = {}
        self._stepping, self._skip = False, np.zeros(count, dtype=bool)
        self._begun: dict[int, tuple[Generator, Beginning]] = {}
        edges = np.linspace(0, count, workers + 1).round().astype(int).tolist()
        self._shares = list(zip(edges[:-1], edges[1:], strict=True))
        self._start_workers(options, max_steps)

    def reset(
        self,
        which: Sequence[int],
        rngs: Sequence[Generator],
        wishes: Sequence[EpisodeWish],
        *,
        handed_out: bool = True,
    ) -> None:
        """Begins new episodes; see ``Fleet.reset``."""
        if self.options.start == "failures" and self._stepping:
            self._flush(show=False)  # what the step taught counts for the next start
        self.clip, self.route = self.clip.copy(), self.route.copy()
        for index, rng, wish in zip(which, rngs, wishes, strict=True):
            state = dict(rng.bit_generator.state)
            clip, frame, route = self._draw(rng, wish)
            self.clip[index], self.route[index] = clip, route
            share = next(share for share in self._shares if index < share[1])
            bodies = self.repertoire.routes[route].bodies
            self._begun[index] = rng, Beginning(index - share[0], state, clip, frame, bodies)
        self._told = {}

    def step(self, actions: ArrayLike, skip: NDArray[np.bool_] | None = None) -> None:
        """One control step of every robot; see ``Fleet.step``."""
        if self._stepping or self._begun:
            self._flush(show=False)
        self._actions[:] = self._checked(actions)
        self._stepping = True
        self._skip = np.zeros(self.count, dtype=bool) if skip is None else skip.copy()
        self._told = {}

    def observe(self, which: NDArray[np.intp] | None = None) -> NDArray[np.float32]:
        """Observations ``(B, size)``, or those of some robots."""
        self._look()
        found: NDArray[np.float32] = self._told["observation"]
        return found if which is None else found[which]

    @property
    def done(self) -> NDArray[np.bool_]:
        """Robots whose episode has ended, ``(B,)``."""
        self._look()
        return super().done

    @property
    def base(self) -> FloatArray:
        """Base commands of the next step, ``(B, n)`` [rad]."""
        self._look()
        return np.asarray(self._told["base"])

    def info(self) -> dict[str, Any]:
        """Arrays over the robots; none of them is written to later."""
        self._look()
        told = {name: value for name, value in self._told.items() if name not in _NOT_TOLD}
        terms = {name: told.pop(f"reward_terms.{name}") for name in TERMS}
        success = told.pop("is_success")
        return {
            "reward_terms": terms,
            **told,
            "motion": self.clip,
            "motion_action": self.clip,
            "route": self.route,
            "transferability": self.route,
            "is_success": success,
        }

    def pose(self, index: int) -> dict[str, FloatArray]:
        """What a picture of one robot shows."""
        self._look()
        told = self._told
        names = {"q": "q", "reference": "reference", "operator": "watched", "errors": "landmark_error"}
        return {name: told[key][index] for name, key in names.items()}

    def close(self) -> None:
        """Ends the processes."""
        self._finalizer()
        super().close()

    def __getstate__(self) -> dict[str, Any]:
        raise SydaError(
            "an environment with workers cannot be pickled or copied, since its robots live in other processes; make "
            "it with workers=1"
        )

    def _start_workers(self, options: TeleopOptions, max_steps: int | None) -> None:
        import multiprocessing

        try:
            pickle.dumps(options)
        except Exception as error:  # whatever a stranger's mapping does when it is pickled
            raise OptionError(f"workers: the options cannot be sent to another process: {error}") from error
        context = multiprocessing.get_context("spawn")
        self._memory = context.RawArray("b", width_of(self._columns, self.count))
        actions = context.RawArray("d", self.count * self._n)
        self._actions: FloatArray = np.frombuffer(actions, dtype=np.float64).reshape(self.count, self._n)
        self._workers: list[Worker] = []
        self._finalizer = weakref.finalize(self, end_workers, self._workers)
        try:
            for _ in self._shares:
                self._workers.append(start_worker(serve, self._memory, actions))
            for worker, rows in zip(self._workers, self._shares, strict=True):
                self._send(worker, Share(options, rows, self.count, max_steps, self._columns))
            for worker in self._workers:
                self._answer(worker)
        except BaseException:
            self._finalizer()
            raise

    def _look(self) -> None:
        if not self._told:
            self._flush(show=True)

    def _flush(self, *, show: bool) -> None:
        """Sends what was asked for since the last time, and takes what came of it."""
        began, self._begun = self._begun, {}
        try:
            parts = []
            for worker, (first, last) in zip(self._workers, self._shares, strict=True):
                mine = [began[index] for index in range(first, last) if index in began]
                task = Task(self._stepping, self._skip[first:last], tuple(one for _, one in mine), show)
                self._send(worker, task)
                parts.append([rng for rng, _ in mine])
            answers = [self._answer(worker) for worker in self._workers]
        except BaseException:  # also Ctrl-C: answers would be taken for those to the next question
            self._finalizer()
            raise
        self._stepping = False
        for rngs, answer in zip(parts, answers, strict=True):
            for rng, state in zip(rngs, answer.states, strict=True):
                rng.bit_generator.state = state
        for answer in answers:  # in the order of the robots, as one process would learn it
            for ending in answer.ended:
                self._starts.learn(*ending[1:])
        if show:
            self._told = table(self._columns, self.count, bytearray(self._memory))
            self.reward, self.terminated = self._told["reward"], self._told["terminated"]
            self.truncated = self._told["truncated"]

    def _send(self, worker: Worker, message: Share | Task) -> None:
        if worker.pipe.closed:
            raise SydaError("the workers of this environment have ended; make a new environment")
        try:
            worker.pipe.send(message)
        except (BrokenPipeError, ConnectionError) as error:
            raise SydaError(f"{worker.lost()}; make a new environment") from error

    def _answer(self, worker: Worker) -> Answer:
        try:
            answer: Answer = worker.pipe.recv()
        except (EOFError, OSError) as error:
            raise SydaError(
                f"{worker.lost()}; make a new environment. A script that uses workers must do its work under "
                'if __name__ == "__main__":'
            ) from error
        if isinstance(answer.failure, SydaError):
            raise answer.failure
        if answer.failure:
            raise SydaError(f"a worker of the environment failed:\n{answer.failure}")
        return answer
