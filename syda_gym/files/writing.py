"""Writing files so that nothing is ever half-written."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from syda_gym.errors import StorageError

__all__ = ["asset", "atomic_path", "fingerprint", "user_folder", "write_bytes", "write_json", "write_text"]

ASSETS = Path(__file__).parents[1] / "assets"


def asset(*parts: str) -> Path:
    """Returns the path of a file shipped with the package, for example ``asset("robots", "pepper.yaml")``."""
    return ASSETS.joinpath(*parts)


def user_folder(*parts: str) -> Path:
    """A folder of this user's own: ``$SYDA_GYM_HOME`` or ``~/.syda_gym``, and ``parts`` below it; need not exist."""
    home = os.environ.get("SYDA_GYM_HOME")
    return (Path(home) if home else Path.home() / ".syda_gym").joinpath(*parts)


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields a temporary path beside ``path`` that replaces it only when the block succeeds.

    Args:
        path: the final file; its folder is created.

    Yields:
        The path to write to. On any exception it is removed and ``path`` stays as it was.

    Raises:
        StorageError: the folder cannot be written.
    """
    final = Path(path)
    try:
        final.parent.mkdir(parents=True, exist_ok=True)
        temporary = _fresh(final)
    except OSError as error:
        raise StorageError(f"cannot write {final}: {error.strerror}; choose a folder you may write") from error
    try:
        yield temporary
        os.replace(temporary, final)
    except OSError as error:
        raise StorageError(f"cannot write {final}: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _fresh(final: Path) -> Path:
    """A new empty file beside ``final``, with the permissions that the user's umask gives to any file."""
    while True:
        path = final.with_name(f".{final.stem}-{secrets.token_hex(6)}{final.suffix}")
        try:
            os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        except FileExistsError:
            continue
        return path


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Writes UTF-8 text atomically and returns the path."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Path(path)


def write_bytes(path: str | os.PathLike[str], data: bytes) -> Path:
    """Writes bytes atomically, for example a picture, and returns the path."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)
    return Path(path)


def write_json(path: str | os.PathLike[str], value: Any) -> Path:
    """Writes JSON (sorted keys, indented) atomically and returns the path."""
    return write_text(path, json.dumps(value, indent=1, sort_keys=True) + "\n")


def fingerprint(*parts: bytes | str) -> str:
    """Returns 16 hex digits that identify the given bytes and texts (SHA-256, shortened)."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()[:16]
