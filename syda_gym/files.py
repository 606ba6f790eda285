"""Writing files so that nothing is ever half-written, and reading text with a size limit."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from syda_gym.errors import StorageError

__all__ = [
    "asset",
    "atomic_path",
    "fingerprint",
    "read_json",
    "user_folder",
    "write_bytes",
    "write_json",
    "write_text",
]

ASSETS = Path(__file__).parent / "assets"


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
        handle, name = tempfile.mkstemp(prefix=f".{final.stem}-", suffix=final.suffix, dir=final.parent)
        os.close(handle)
    except OSError as error:
        raise StorageError(f"cannot write {final}: {error.strerror}; choose a folder you may write") from error
    temporary = Path(name)
    try:
        yield temporary
        os.chmod(temporary, 0o644)  # mkstemp makes private files; results are meant to be shared
        os.replace(temporary, final)
    except OSError as error:
        raise StorageError(f"cannot write {final}: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)


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


def read_json(path: str | os.PathLike[str], limit: int = 64 * 2**20) -> Any:
    """Reads a JSON file of at most ``limit`` bytes.

    Raises:
        StorageError: the file is missing, larger than ``limit``, or not JSON.
    """
    source = Path(path)
    if not source.is_file():
        raise StorageError(f"no file {source}; check the path")
    if source.stat().st_size > limit:
        raise StorageError(f"{source} is larger than {limit} bytes; expected a small JSON file")
    try:
        return json.loads(source.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise StorageError(f"{source} is not valid JSON: {error}; write it again") from error


def fingerprint(*parts: bytes | str) -> str:
    """Returns 16 hex digits that identify the given bytes and texts (SHA-256, shortened)."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()[:16]
