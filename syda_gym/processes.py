"""Processes: workers that are spawned, follow their parent into its end, and are never left behind.

They are spawned rather than forked, since PyBullet clients and the threads of numerical libraries do not survive a
fork. So a script that starts some must guard what it does by ``if __name__ == "__main__":``, as for any such process.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

__all__ = ["ONE_THREAD", "Worker", "begin_worker", "end_workers", "start_worker", "why_lost"]

ONE_THREAD = {
    name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
}
"""Environment variables that keep numerical libraries to one thread."""

_PATIENCE_SECONDS = 3.0  # until a worker that was ended is killed


@dataclass
class Worker:
    """A process and the pipe to it."""

    process: Any
    pipe: Any

    def lost(self) -> str:
        """Waits for the end of a process that no longer answers, kills it if need be, and says how it ended."""
        self.process.join(_PATIENCE_SECONDS)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        return why_lost(self.process.exitcode)


def start_worker(serve: Callable[..., None], *arguments: Any) -> Worker:
    """Starts a process with one thread for numerical libraries.

    Args:
        serve: a function at the top of a module; it is called with its end of the pipe and ``arguments``, and begins
            with ``begin_worker``.
        *arguments: that can be pickled, or are shared memory.
    """
    import multiprocessing
    from multiprocessing import resource_tracker

    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=serve, args=(theirs, *arguments), daemon=True)
    if os.name == "posix":
        resource_tracker.ensure_running()  # otherwise started below, where it would let Ctrl-C through again
    with _environment(ONE_THREAD), _interrupts_held_back():
        process.start()
    theirs.close()
    return Worker(process, ours)


def begin_worker() -> None:
    """What a worker does first: it leaves Ctrl-C to its parent, and ends when its parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends Ctrl-C to everybody; the caller decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    _follow_parent()


def end_workers(workers: Sequence[Worker]) -> None:
    """Ends processes at once; those that do not listen are killed."""
    for worker in workers:
        worker.process.terminate()
    deadline = time.monotonic() + _PATIENCE_SECONDS
    for worker in workers:
        worker.process.join(max(0.0, deadline - time.monotonic()))
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()
        worker.pipe.close()


def why_lost(code: int | None) -> str:
    """What an exit code says about the end of a worker."""
    if code is not None and code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        hint = "; out of memory? try fewer workers" if name == "SIGKILL" else ""
        return f"the worker was ended by {name}{hint}"
    return f"the worker ended by itself with exit code {code}"


def _follow_parent() -> None:
    """Ends this process when its parent is gone: a killed run leaves nobody behind."""
    import multiprocessing
    from multiprocessing.connection import wait
    from threading import Thread

    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            wait([parent.sentinel])
            os._exit(1)

    Thread(target=follow, name="follow-parent", daemon=True).start()


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


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """A process started inside the block hears no Ctrl-C until it says so; this one hears it after the block."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
