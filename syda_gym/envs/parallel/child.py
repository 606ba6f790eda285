"""The life of a process that simulates a share of a fleet: steps and resets come in, tables are written."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from syda_gym.envs.fleet import Ending, EpisodeWish, Fleet
from syda_gym.envs.parallel.tables import Column, state_of, table
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.errors import SydaError
from syda_gym.processes import begin_worker

__all__ = ["Answer", "Beginning", "Share", "Task", "serve"]


@dataclass(frozen=True)
class Share:
    """What a process is told when it starts.

    Attributes:
        options: of the environment.
        rows: first robot of its share, and one past the last.
        count: robots of all processes.
        max_steps: after which episodes are cut off.
        columns: of the table that all processes write.
    """

    options: TeleopOptions
    rows: tuple[int, int]
    count: int
    max_steps: int | None
    columns: Mapping[str, Column]


@dataclass(frozen=True)
class Beginning:
    """An episode to begin.

    Attributes:
        index: of the robot, within the share.
        state: of its random numbers before anything is drawn.
        clip: index of the clip.
        frame: first frame.
        route: names of the bodies.
    """

    index: int
    state: dict[str, Any]
    clip: int
    frame: int
    route: tuple[str, ...]


@dataclass(frozen=True)
class Task:
    """What comes next.

    Attributes:
        step: whether to step, with the actions that are in the table.
        skip: robots of the share whose step does not count.
        begin: episodes to begin after that.
        show: whether to write the table.
    """

    step: bool
    skip: np.ndarray[Any, np.dtype[np.bool_]] | None
    begin: tuple[Beginning, ...]
    show: bool


@dataclass(frozen=True)
class Answer:
    """What came of a task.

    Attributes:
        states: of the random numbers after the beginnings.
        ended: episodes that ended.
        failure: the exception, if it is one of ours; else its trace.
    """

    states: tuple[dict[str, Any], ...] = ()
    ended: tuple[Ending, ...] = ()
    failure: SydaError | str | None = None


def serve(pipe: Any, memory: Any, actions: Any) -> None:
    """Runs until the pipe is closed.

    Args:
        pipe: brings a ``Share``, then ``Task`` after ``Task``; takes an ``Answer`` to each of them.
        memory: shared bytes of the table.
        actions: shared bytes of all actions, float64.
    """
    begin_worker()
    try:
        share = pipe.recv()
        work = None
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the caller has said it all
                work = _Work(share, memory, actions)
            pipe.send(Answer())
        except Exception as error:
            pipe.send(_failed(error))
        while work is not None:
            try:
                answer = work.do(pipe.recv())
            except (EOFError, ConnectionError):
                raise
            except Exception as error:
                answer = _failed(error)
            pipe.send(answer)
    except (EOFError, BrokenPipeError, ConnectionError):
        return


class _Work:
    """A share of the fleet."""

    def __init__(self, share: Share, memory: Any, actions: Any) -> None:
        first, last = share.rows
        self._fleet = Fleet(share.options, last - first, share.max_steps)
        self._rows = {name: rows[first:last] for name, rows in table(share.columns, share.count, memory).items()}
        self._actions = np.frombuffer(actions, dtype=np.float64).reshape(share.count, -1)[first:last]

    def do(self, task: Task) -> Answer:
        fleet, ended = self._fleet, []
        if task.step:
            fleet.step(self._actions, task.skip)
            ended = fleet.ended
        rngs = [_generator(one.state) for one in task.begin]
        if task.begin:
            known = fleet.repertoire
            wishes = [EpisodeWish(one.clip, one.frame, known.route_index(one.route)) for one in task.begin]
            fleet.reset([one.index for one in task.begin], rngs, wishes, handed_out=False)
        if task.show:
            self._rows["observation"][:] = fleet.observe()
            for name, values in state_of(fleet, fleet.info()).items():
                self._rows[name][:] = values
        return Answer(tuple(dict(rng.bit_generator.state) for rng in rngs), tuple(ended))


def _generator(state: Any) -> np.random.Generator:
    bits = np.random.PCG64()
    bits.state = state
    return np.random.Generator(bits)


def _failed(error: BaseException) -> Answer:
    return Answer(failure=error if isinstance(error, SydaError) else "".join(traceback.format_exception(error)))
