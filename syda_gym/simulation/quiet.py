"""quiet: what PyBullet prints while it loads a robot, gathered into one line."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import tempfile
import threading
from collections.abc import Iterator

__all__ = ["quiet"]

_logger = logging.getLogger("syda_gym.simulation")
_lock = threading.Lock()
_told: set[str] = set()


@contextlib.contextmanager
def quiet(name: str) -> Iterator[None]:
    """Holds back PyBullet's own messages, which it prints past Python, and tells them in one line, once per robot.

    Args:
        name: of the robot.
    """
    with _lock, tempfile.TemporaryFile() as caught:
        kept: list[tuple[int, int]] = []
        try:
            for stream in (1, 2):
                kept.append((stream, os.dup(stream)))
            for flushed in (sys.stdout, sys.stderr):
                with contextlib.suppress(Exception):
                    flushed.flush()
            for stream, _ in kept:
                os.dup2(caught.fileno(), stream)
        except OSError:  # a process without these streams
            kept = _restore(kept)
        try:
            yield
        finally:
            _restore(kept)
            caught.seek(0)
            text = caught.read().decode(errors="replace").splitlines()
            # Its own marks of file and line say nothing to a user.
            lines = [line.strip() for line in text if line.strip() and not line.startswith(("b3", "pybullet build"))]
            if lines and name not in _told:
                _told.add(name)
                more = f" (and {len(lines) - 1} more lines)" if len(lines) > 1 else ""
                _logger.warning("%s: PyBullet says: %s%s", name, lines[0][:160], more)


def _restore(kept: list[tuple[int, int]]) -> list[tuple[int, int]]:
    for stream, copy in kept:
        with contextlib.suppress(OSError):
            os.dup2(copy, stream)
            os.close(copy)
    return []
