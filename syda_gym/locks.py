"""Locks: one writer a folder, so that two runs with the same ``--out`` never mix their files."""

from __future__ import annotations

import json
import os
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from syda_gym.errors import StorageError

__all__ = ["locked_folder"]

_NAME = ".{}.lock"


@contextmanager
def locked_folder(folder: str | os.PathLike[str], name: str = "syda-gym") -> Iterator[Path]:
    """Keeps a folder for this caller while the block runs.

    The lock belongs to the open file (``flock``), so the system drops it with the process: what a killed run leaves is
    an unlocked file, which the next run takes over.

    Args:
        folder: created if need be, and removed again if it was and the block leaves it empty.
        name: of the lock, for work inside work.

    Yields:
        The folder.

    Raises:
        StorageError: somebody else writes there; the message says who. Or the folder cannot be written.
    """
    root = Path(folder)
    path = root / _NAME.format(name)
    new = [place for place in (root, *root.parents) if not place.exists()]
    try:
        root.mkdir(parents=True, exist_ok=True)
        file = _acquired(path)
    except OSError as error:
        raise StorageError(
            f"cannot write into {root}: {error.strerror or error}; choose another folder with --out"
        ) from error
    if file is None:
        raise StorageError(
            f"{root} is being written by {_holder(path)}; wait for it, stop it, or choose another folder"
        )
    try:
        yield root
    finally:
        path.unlink(missing_ok=True)  # while it is still ours: who opened it meanwhile notices and tries again
        file.close()
        for place in new:  # work that was refused leaves no empty folder behind
            with suppress(OSError):
                place.rmdir()


def _acquired(path: Path) -> IO[str] | None:
    """The locked file, ``None`` if another holds it."""
    while True:
        file = path.open("a+", encoding="utf-8")
        if not _lock(file):
            file.close()
            return None
        if path.is_file() and os.path.samestat(os.fstat(file.fileno()), path.stat()):
            break
        file.close()  # its holder removed it between our opening and our locking
    file.truncate(0)
    about = {"process": os.getpid(), "host": socket.gethostname(), "since": time.time(), "command": sys.argv[:8]}
    file.write(json.dumps(about))
    file.flush()
    return file


def _lock(file: IO[str]) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt

            # A byte far behind the text, so that others can read who holds it.
            file.seek(2**30)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True


def _holder(path: Path) -> str:
    try:
        about = json.loads(path.read_text(encoding="utf-8")[:4096])
        since = time.strftime("%Y-%m-%d %H:%M", time.localtime(float(about["since"])))
        return f"process {int(about['process'])} on {about['host']} since {since}"
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        return "another process"
