"""compiled: functions that numba compiles on first use and keeps; with what such functions share."""

from __future__ import annotations

import inspect
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, TypeVar

import numba

from syda_gym.embodiments.limb_ik.keeping import may_keep

__all__ = ["compiled", "copy", "first_call"]

Function = TypeVar("Function", bound=Callable[..., Any])


_called: set[Callable[..., Any]] = set()
# Numba's own list of what is compiled is made anew whenever one asks, which takes longer than most calls.


def compiled(function: Function) -> Function:
    """Compiles on first use and keeps the code: beside its file, or in the user's cache where that is read-only.

    Nothing is kept in, or read from, a folder in which somebody else could write (``may_keep``): there, every process
    compiles anew.

    What is kept counts as long as the file of the function that Python calls stays as it is. Who edits a function that
    another file's functions call must touch that file too.
    """
    try:
        made: Any = numba.njit(cache=True, error_model="numpy")(function)
        # With NUMBA_DISABLE_JIT, for a debugger, it is the function itself.
        keep = made is not function and may_keep(made._cache.cache_path, inspect.getfile(function))
    except RuntimeError:  # no folder can be written
        keep = False
    result: Function = made if keep else numba.njit(error_model="numpy")(function)
    return result


def first_call(function: Callable[..., Any], *arguments: Any) -> Any:
    """Calls a compiled function; if that compiles it, Ctrl-C and a request to terminate wait until it is done.

    LLVM calls back into Python while it compiles, where an exception is lost and leaves half a function.
    """
    if function in _called:
        return function(*arguments)
    with _undisturbed():
        result = function(*arguments)
        _called.add(function)
    return result


@contextmanager
def _undisturbed() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():  # signals are another thread's
        yield
        return
    waiting: list[int] = []

    def wait(number: int, frame: FrameType | None) -> None:
        waiting.append(number)

    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), wait) for name in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler or signal.SIG_DFL)
        for number in waiting[-1:]:
            signal.raise_signal(number)


@compiled
def copy(source, result):
    """Loops instead of numpy's assignment: they take numba a fraction of the time to compile."""
    for i in range(len(source)):
        result[i] = source[i]
