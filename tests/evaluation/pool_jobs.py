"""What workers of a pool do in ``test_pools``; light, for every worker imports it."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import Any


def opened(offset: int) -> Callable[[Any, Callable[[float], None]], Any]:
    """A work that obeys its job."""

    def work(job: tuple[str, float], tell: Callable[[float], None]) -> Any:
        kind, value = job
        if kind == "add":
            return {"sum": value + offset, "process": os.getpid(), "threads": os.environ["OMP_NUM_THREADS"]}
        if kind == "sleep":
            for part in range(10):
                tell(part / 10)
                time.sleep(value / 10)
            return {"process": os.getpid()}
        if kind == "die":
            os.kill(os.getpid(), int(value))
            time.sleep(60.0)
        if kind == "exit":
            os._exit(int(value))
        if kind == "deaf":
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            tell(0.5)
            time.sleep(120.0)
        if kind == "unsendable":
            return lambda: value
        raise ValueError(f"no such job: {kind}")

    return work


def broken() -> Any:
    """An opener that fails."""
    raise RuntimeError("cannot open")
