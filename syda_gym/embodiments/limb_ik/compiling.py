"""compiled: functions that numba compiles on first use and keeps; with what such functions share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

__all__ = ["compiled", "copy"]

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compiles on first use and keeps the code: beside its file, or in the user's cache where that is read-only.

    What is kept counts as long as the file of the function that Python calls stays as it is. Who edits a function that
    another file's functions call must touch that file too.
    """
    try:
        made: Function = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # no folder can be written: compile in every process
        made = numba.njit(error_model="numpy")(function)
    return made


@compiled
def copy(source, result):
    """Loops instead of numpy's assignment: they take numba a fraction of the time to compile."""
    for i in range(len(source)):
        result[i] = source[i]
