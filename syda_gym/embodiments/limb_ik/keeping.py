"""may_keep: whether compiled code may be kept in, and read from, a folder."""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path

__all__ = ["may_keep"]

_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def may_keep(folder: str | os.PathLike[str], source: str | os.PathLike[str]) -> bool:
    """Whether only those can write in ``folder`` who could change the source itself.

    What numba keeps are pickles, which run code when they are read. So the folder must belong to whoever runs this, or
    to whom the source belongs, and nobody may write there who may not write beside the source. A folder of one's own
    that stands elsewhere, in the user's cache, is closed to everybody else (0700).

    Args:
        folder: where code would be kept.
        source: the Python file that it comes from.
    """
    if os.name != "posix":  # there the user's folders are the user's by inheritance
        return True
    try:
        kept, beside = Path(folder), Path(source).resolve().parent
        at, there = kept.stat(), beside.stat()
        if at.st_uid == os.getuid() and beside not in kept.resolve().parents:
            with contextlib.suppress(OSError):
                kept.chmod(0o700)
            at = kept.stat()
        writers = at.st_mode & _OTHERS & ~there.st_mode
        return not writers and at.st_uid in (os.getuid(), there.st_uid)
    except OSError:
        return False
