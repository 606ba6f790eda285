"""Pools: where cells are computed - processes of this machine, or actors of a Ray cluster.

Every pool computes in fresh processes with one thread each, ``--workers 1`` included, so that results do not depend on
which pool it was. A worker keeps the fits of the batch that it works on; ``Schedule`` keeps batches together.
"""

from __future__ import annotations

import os
import traceback
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from syda_gym.errors import MissingExtraError, OptionError
from syda_gym.evaluation.benchmark.cells import Cell
from syda_gym.motions.clip import Motions

__all__ = ["Outcome", "Pool", "Schedule", "make_pool"]

Outcome = dict[str, Any]
"""What a worker returns: ``cell``, ``rows`` and ``timing``, or ``cell`` and ``failure`` (a trace)."""

_ONE_THREAD = {
    name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
}


class Pool(ABC):
    """A number of workers, each of which computes one cell at a time.

    Attributes:
        size: number of workers.
    """

    size: int

    @abstractmethod
    def submit(self, worker: int, cell: Cell) -> Any:
        """Gives a cell to a worker and returns a ticket."""

    @abstractmethod
    def wait(self, tickets: Sequence[Any]) -> Any:
        """Waits until one of the tickets is done and returns it."""

    @abstractmethod
    def outcome(self, ticket: Any, cell: Cell) -> Outcome:
        """What came of a ticket that is done; a lost worker is a failure of its cell."""

    @abstractmethod
    def close(self) -> None:
        """Releases the workers at once; work in progress is dropped."""


class Schedule:
    """Hands out cells so that cells of one batch go to one worker as long as there are other batches."""

    def __init__(self, cells: Sequence[Cell], workers: int) -> None:
        self._batches: dict[tuple[str, str, int], list[Cell]] = {}
        for cell in cells:
            self._batches.setdefault(cell.batch, []).append(cell)
        self._mine: list[tuple[str, str, int] | None] = [None] * workers

    def next(self, worker: int) -> Cell | None:
        """The next cell for a worker, ``None`` if all are handed out."""
        mine = self._mine[worker]
        if mine is None or mine not in self._batches:
            left = [batch for batch in self._batches if batch not in self._mine]
            # Nobody's batch first; otherwise help with the longest one.
            self._mine[worker] = mine = (
                left[0] if left else max(self._batches, key=lambda batch: len(self._batches[batch]), default=None)
            )
            if mine is None:
                return None
        cells = self._batches[mine]
        cell = cells.pop(0)
        if not cells:
            del self._batches[mine]
        return cell


def make_pool(workers: str | int, motions: Motions) -> Pool:
    """Opens a pool.

    Args:
        workers: a number of processes, ``ray`` for a Ray cluster on this machine (or the one that ``RAY_ADDRESS``
            names), or ``ray:ADDRESS`` for a running cluster; ``ray`` takes as many workers as it has processors.
        motions: the data set, sent to every worker once.

    Raises:
        OptionError: none of these.
        MissingExtraError: Ray is asked for and not installed.
    """
    text = str(workers).strip()
    if text == "ray" or text.startswith("ray:"):
        return RayPool(text[4:] or None, motions)
    if not text.isdigit() or not 1 <= int(text) <= 1024:
        raise OptionError(f"workers must be a number from 1 to 1024, 'ray' or 'ray:ADDRESS', got {workers!r}")
    return ProcessPool(int(text), motions)


class ProcessPool(Pool):
    """Processes of this machine, each with its own queue, so that a batch stays with its worker."""

    def __init__(self, size: int, motions: Motions) -> None:
        self.size = size
        self._motions = motions
        self._executors = [self._executor() for _ in range(size)]

    def submit(self, worker: int, cell: Cell) -> Any:
        """Gives a cell to a worker; a worker that died is replaced."""
        from concurrent.futures.process import BrokenProcessPool

        with _environment(_ONE_THREAD):
            try:
                return self._executors[worker].submit(_compute, cell.to_dict())
            except BrokenProcessPool:
                self._executors[worker] = self._executor()
                return self._executors[worker].submit(_compute, cell.to_dict())

    def wait(self, tickets: Sequence[Any]) -> Any:
        """Waits for the first future."""
        from concurrent.futures import FIRST_COMPLETED, wait

        return next(iter(wait(tickets, return_when=FIRST_COMPLETED).done))

    def outcome(self, ticket: Any, cell: Cell) -> Outcome:
        """The result, or the trace of what went wrong."""
        try:
            return dict(ticket.result())
        except Exception as error:
            return _failure(cell, error)

    def close(self) -> None:
        """Ends the processes."""
        for executor in self._executors:
            processes = list((getattr(executor, "_processes", None) or {}).values())
            executor.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.terminate()
        for executor in self._executors:
            executor.shutdown(wait=True)

    def _executor(self) -> Any:
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor

        # Spawned, not forked: PyBullet clients and torch threads do not survive a fork.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(1, mp_context=context, initializer=_open_process, initargs=(self._motions,))


class RayPool(Pool):
    """Actors on a Ray cluster; a cell of a lost actor is computed again by a new one."""

    def __init__(self, address: str | None, motions: Motions) -> None:
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
                    runtime_env={"env_vars": _ONE_THREAD},
                )
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise OptionError(
                    f"cannot reach the Ray cluster {address or 'on this machine'}: {error}; start one with "
                    "`ray start --head` or use --workers N"
                ) from error
        self._motions = ray.put(motions)
        self._actor = ray.remote(num_cpus=1, max_restarts=2, max_task_retries=2)(_Actor)
        self.size = max(1, int(ray.cluster_resources().get("CPU", 1)))
        self._actors = [self._actor.remote(self._motions) for _ in range(self.size)]

    def submit(self, worker: int, cell: Cell) -> Any:
        """Gives a cell to an actor."""
        return self._actors[worker].compute.remote(cell.to_dict())

    def wait(self, tickets: Sequence[Any]) -> Any:
        """Waits for the first object."""
        return self._ray.wait(list(tickets), num_returns=1)[0][0]

    def outcome(self, ticket: Any, cell: Cell) -> Outcome:
        """The result, or the trace of what went wrong."""
        try:
            return dict(self._ray.get(ticket))
        except Exception as error:
            return _failure(cell, error)

    def close(self) -> None:
        """Ends the actors, and the cluster if it was started here."""
        for actor in self._actors:
            self._ray.kill(actor)
        if self._started:
            self._ray.shutdown()


class _Actor:
    """The same work as in a process, inside a Ray actor."""

    def __init__(self, motions: Motions) -> None:
        _open(motions)

    def compute(self, cell: dict[str, Any]) -> Outcome:
        return _compute(cell)


_worker: Any = None  # the worker of this process, opened once by the pool


def _open_process(motions: Motions) -> None:
    """Opens the worker of a process that ends when its parent is gone: a killed run leaves nobody behind."""
    import multiprocessing
    from multiprocessing.connection import wait
    from threading import Thread

    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            wait([parent.sentinel])
            os._exit(1)

    Thread(target=follow, name="follow-parent", daemon=True).start()
    _open(motions)


def _open(motions: Motions) -> None:
    global _worker
    from syda_gym.evaluation.benchmark.work import Worker

    _worker = Worker(motions)


def _compute(cell: dict[str, Any]) -> Outcome:
    """Runs in the worker: an exception becomes a trace, so that the rest goes on."""
    try:
        return dict(_worker.run(Cell.from_dict(cell)))
    except Exception as error:
        return {"cell": cell, "failure": "".join(traceback.format_exception(error))}


def _failure(cell: Cell, error: Exception) -> Outcome:
    return {"cell": cell.to_dict(), "failure": "".join(traceback.format_exception(error))}


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Environment variables that a process started inside the block inherits."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
