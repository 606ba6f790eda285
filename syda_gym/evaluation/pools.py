"""Pools: where long work is computed - processes of this machine, or actors of a Ray cluster.

One pool serves every study. Work is a *job*, anything that can be pickled; what a worker does with it is said by an
*opener*, a function at the top of a module that is called once in every worker and returns a function of job and
progress. Every pool computes in fresh processes with one thread each, one worker included, so that results do not
depend on which pool it was. Three promises hold for all of them:

- a worker that dies, whatever killed it, is a failure of the job that it had; the next job gets a new worker;
- Ctrl-C reaches the caller alone, who closes the pool: workers are ended, not asked to finish;
- nobody outlives the caller, not even one that is killed.
"""

from __future__ import annotations

import os
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from syda_gym.errors import MissingExtraError, OptionError
from syda_gym.processes import ONE_THREAD, Worker, begin_worker, end_workers, start_worker

__all__ = ["Done", "InlinePool", "Opener", "Pool", "Schedule", "Tell", "Work", "make_pool", "run_jobs"]

Tell = Callable[[float], None]
"""Told the finished fraction of one job."""

Work = Callable[[Any, Tell], Any]
"""Computes one job."""

Opener = Callable[..., Work]
"""Makes the work of one worker; called there once."""

_TELL_SECONDS = 0.2  # between two messages about the progress of one job


@dataclass(frozen=True)
class Done:
    """What came of a job.

    Attributes:
        worker: who had it.
        result: what the work returned.
        failure: a trace, or why the worker was lost; empty if all went well.
    """

    worker: int
    result: Any = None
    failure: str = ""


class Pool(ABC):
    """A number of workers, each of which computes one job at a time.

    Attributes:
        size: number of workers.
    """

    size: int

    @abstractmethod
    def submit(self, worker: int, job: Any) -> None:
        """Gives a job to a worker that has none."""

    @abstractmethod
    def wait(self, told: Callable[[int, float], None]) -> Done:
        """Waits until one of the workers is done.

        Args:
            told: is told a worker and the finished fraction of its job meanwhile, where the pool can.
        """

    @abstractmethod
    def close(self) -> None:
        """Releases the workers at once; work in progress is dropped."""


def make_pool(workers: str | int, opener: Opener, *arguments: Any) -> Pool:
    """Opens a pool.

    Args:
        workers: a number of processes, ``ray`` for a Ray cluster on this machine (or the one that ``RAY_ADDRESS``
            names), or ``ray:ADDRESS`` for a running cluster; ``ray`` takes as many workers as it has processors.
        opener: called in every worker.
        *arguments: of the opener, for example a data set; sent to every worker once.

    Raises:
        OptionError: none of these.
        MissingExtraError: Ray is asked for and not installed.
    """
    text = str(workers).strip()
    if text == "ray" or text.startswith("ray:"):
        return RayPool(text[4:] or None, opener, arguments)
    if not text.isdigit() or not 1 <= int(text) <= 1024:
        raise OptionError(f"workers must be a number from 1 to 1024, 'ray' or 'ray:ADDRESS', got {workers!r}")
    return ProcessPool(int(text), opener, arguments)


def run_jobs(
    pool: Pool,
    jobs: Sequence[Any],
    *,
    batch: Callable[[Any], Hashable] | None = None,
    inside: Callable[[dict[int, tuple[Any, float]]], None] | None = None,
) -> Iterator[tuple[Any, Done]]:
    """Computes jobs and yields each with what came of it, in the order in which they end.

    Args:
        pool: closed when the iteration ends, however it ends.
        jobs: in the order in which they are handed out.
        batch: jobs that share something costly, by this key, go to one worker as long as there are other batches.
        inside: told what every worker is at: its job and the finished fraction.
    """
    schedule = Schedule(jobs, pool.size, batch or (lambda job: 0))
    running: dict[int, tuple[Any, float]] = {}

    def told(worker: int, fraction: float) -> None:
        if worker in running:
            running[worker] = (running[worker][0], fraction)
        if inside is not None:
            inside(running)

    def hand_out(worker: int) -> None:
        job = schedule.next(worker)
        if job is not None:
            pool.submit(worker, job)
            running[worker] = (job, 0.0)
            told(worker, 0.0)

    try:
        for worker in range(pool.size):
            hand_out(worker)
        while running:
            done = pool.wait(told)
            job, _ = running.pop(done.worker)
            hand_out(done.worker)
            yield job, done
    finally:
        pool.close()


class Schedule:
    """Hands out jobs so that those of one batch go to one worker as long as there are other batches."""

    def __init__(self, jobs: Sequence[Any], workers: int, batch: Callable[[Any], Hashable]) -> None:
        self._batches: dict[Hashable, list[Any]] = {}
        for job in jobs:
            self._batches.setdefault(batch(job), []).append(job)
        self._mine: list[Hashable] = [None] * workers

    def next(self, worker: int) -> Any:
        """The next job for a worker, ``None`` if all are handed out."""
        mine = self._mine[worker]
        if mine is None or mine not in self._batches:
            left = [batch for batch in self._batches if batch not in self._mine]
            # Nobody's batch first; otherwise help with the longest one.
            self._mine[worker] = mine = (
                left[0] if left else max(self._batches, key=lambda batch: len(self._batches[batch]), default=None)
            )
            if mine is None:
                return None
        jobs = self._batches[mine]
        job = jobs.pop(0)
        if not jobs:
            del self._batches[mine]
        return job


class InlinePool(Pool):
    """Computes in this process, one job at a time: for scripts that watch one clock, and for tests."""

    size = 1

    def __init__(self, opener: Opener, *arguments: Any) -> None:
        self._work = opener(*arguments)
        self._job: Any = None
        self.computed = 0

    def submit(self, worker: int, job: Any) -> None:
        """Keeps the job until somebody waits for it."""
        self._job = job
        self.computed += 1

    def wait(self, told: Callable[[int, float], None]) -> Done:
        """Computes now."""
        try:
            return Done(0, self._work(self._job, lambda fraction: told(0, fraction)))
        except Exception as error:
            return Done(0, failure=_trace(error))

    def close(self) -> None:
        """Nothing to release."""


@dataclass
class _Member(Worker):
    """One process of a pool, and the pipe to it."""

    opened: bool = False
    busy: bool = field(default=False)


class ProcessPool(Pool):
    """Processes of this machine, each with a pipe of its own, so that a batch stays with its worker."""

    def __init__(self, size: int, opener: Opener, arguments: tuple[Any, ...]) -> None:
        self.size = size
        self._opener, self._arguments = opener, arguments
        self._members: list[_Member] = []
        try:
            for _ in range(size):
                self._members.append(_started())
        except BaseException:
            self.close()
            raise

    def submit(self, worker: int, job: Any) -> None:
        """Gives a job to a worker; one that died meanwhile is replaced."""
        if not self._members[worker].process.is_alive():
            self._replace(worker)
        try:
            self._send(worker, job)
        except (BrokenPipeError, ConnectionError):
            self._replace(worker)
            self._send(worker, job)

    def wait(self, told: Callable[[int, float], None]) -> Done:
        """Listens to all workers that have a job."""
        from multiprocessing.connection import wait

        while True:
            busy = {worker: member for worker, member in enumerate(self._members) if member.busy}
            by_handle = {member.pipe: worker for worker, member in busy.items()}
            by_handle |= {member.process.sentinel: worker for worker, member in busy.items()}
            for worker in {by_handle[handle] for handle in wait(list(by_handle))}:
                done = self._heard(worker, told)
                if done is not None:
                    self._members[worker].busy = False
                    return done

    def close(self) -> None:
        """Ends the processes; those that do not listen are killed."""
        members, self._members = self._members, []
        end_workers(members)

    def _send(self, worker: int, job: Any) -> None:
        member = self._members[worker]
        if not member.opened:
            member.pipe.send((self._opener, self._arguments))
            member.opened = True
        member.pipe.send(job)
        member.busy = True

    def _replace(self, worker: int) -> None:
        lost = self._members[worker]
        lost.lost()
        lost.pipe.close()
        self._members[worker] = _started()

    def _heard(self, worker: int, told: Callable[[int, float], None]) -> Done | None:
        """One message of a worker; what it said last counts, even if it is gone."""
        member = self._members[worker]
        try:
            if member.pipe.poll():
                kind, content = member.pipe.recv()
                if kind == "told":
                    told(worker, content)
                    return None
                return Done(worker, content) if kind == "result" else Done(worker, failure=content)
        except (EOFError, OSError):
            pass  # it died with half a word
        return Done(worker, failure=member.lost())


def _started() -> _Member:
    worker = start_worker(_serve)
    return _Member(worker.process, worker.pipe)


def _serve(pipe: Any) -> None:
    """The life of a worker: opened by the first message, then one answer to every job."""
    begin_worker()
    try:
        opener, arguments = pipe.recv()
        work: Work | None = None
        while True:
            job = pipe.recv()
            try:
                if work is None:
                    work = opener(*arguments)
                answer = ("result", work(job, _teller(pipe)))
                pipe.send(answer)
            except Exception as error:
                pipe.send(("failure", _trace(error)))
    except (EOFError, BrokenPipeError, ConnectionError):
        return


def _teller(pipe: Any) -> Tell:
    """Sends fractions, but not more often than anybody looks."""
    last = 0.0

    def tell(fraction: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _TELL_SECONDS:
            last = now
            pipe.send(("told", float(fraction)))

    return tell


class RayPool(Pool):
    """Actors on a Ray cluster; a job of a lost actor is computed again by a new one. Nothing is told from inside."""

    def __init__(self, address: str | None, opener: Opener, arguments: tuple[Any, ...]) -> None:
        try:
            import ray
        except ImportError as error:
            raise MissingExtraError("running on a Ray cluster", "ray") from error
        self._ray = ray
        self._started = not ray.is_initialized()
        if self._started:
            try:
                ray.init(
                    address=address or os.environ.get("RAY_ADDRESS"),
                    include_dashboard=False,
                    log_to_driver=False,
                    logging_level="error",
                    runtime_env={"env_vars": ONE_THREAD},
                )
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise OptionError(
                    f"cannot reach the Ray cluster {address or 'on this machine'}: {error}; start one with "
                    "`ray start --head` or use --workers N"
                ) from error
        shared = [ray.put(argument) for argument in arguments]
        actor = ray.remote(num_cpus=1, max_restarts=2, max_task_retries=2)(_Actor)
        self.size = max(1, int(ray.cluster_resources().get("CPU", 1)))
        self._actors = [actor.remote(opener, *shared) for _ in range(self.size)]
        self._tickets: dict[Any, int] = {}

    def submit(self, worker: int, job: Any) -> None:
        """Gives a job to an actor."""
        self._tickets[self._actors[worker].compute.remote(job)] = worker

    def wait(self, told: Callable[[int, float], None]) -> Done:
        """Waits for the first object."""
        ticket = self._ray.wait(list(self._tickets), num_returns=1)[0][0]
        worker = self._tickets.pop(ticket)
        try:
            result, failure = self._ray.get(ticket)
        except Exception as error:
            return Done(worker, failure=_trace(error))
        return Done(worker, result, failure)

    def close(self) -> None:
        """Ends the actors, and the cluster if it was started here."""
        for actor in self._actors:
            self._ray.kill(actor)
        if self._started:
            self._ray.shutdown()


class _Actor:
    """The same work as in a process, inside a Ray actor."""

    def __init__(self, opener: Opener, *arguments: Any) -> None:
        self._work = opener(*arguments)

    def compute(self, job: Any) -> tuple[Any, str]:
        try:
            return self._work(job, lambda fraction: None), ""
        except Exception as error:
            return None, _trace(error)


def _trace(error: BaseException) -> str:
    return "".join(traceback.format_exception(error))
