"""Ending: signals that end a run are noted, not thrown, so that none falls between a command and its record."""

from __future__ import annotations

import contextlib
import signal
import threading
from types import FrameType
from typing import Any

__all__ = ["Ending"]

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
_OFTEN = 5  # how many signals end a program that does not react


class Ending:
    """While it is entered, Ctrl-C, a termination signal and a terminal that hangs up are counted.

    The run looks at the count between two steps. Outside the main thread, where Python takes no signals, it counts
    nothing. Whoever sends many gets a ``KeyboardInterrupt``, for a program that hangs.

    Attributes:
        asked: how many signals came.
    """

    def __init__(self) -> None:
        self.asked = 0
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Ending:
        if threading.current_thread() is threading.main_thread():
            for name in _SIGNALS:
                number = getattr(signal, name, None)
                if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as nohup leaves it
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            with contextlib.suppress(TypeError, ValueError):  # a handler that Python did not install
                signal.signal(number, handler)
        self._before.clear()

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self.asked += 1
        if self.asked >= _OFTEN:
            raise KeyboardInterrupt
