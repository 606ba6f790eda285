"""Cell files: finished pieces of long work, one file each, taken again only if they are what they should be."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from syda_gym.errors import StorageError
from syda_gym.files import fingerprint, read_json, write_json

__all__ = ["CELL_FORMAT", "CellFiles", "read_cell"]

CELL_FORMAT = 2
"""Version of the files; others are refused."""


def read_cell(path: Path, key: str) -> dict[str, Any] | None:
    """The content of a finished piece, ``None`` if there is none or what is there is not it.

    Args:
        path: of the file.
        key: everything that decides the content.

    Raises:
        StorageError: a file of another version; nothing is changed.
    """
    if not path.is_file():
        return None
    try:
        stored = read_json(path)
    except (StorageError, OSError):
        return None
    if isinstance(stored, dict) and stored.get("format") not in (None, CELL_FORMAT):
        raise StorageError(
            f"{path} has format {stored['format']!r}, this version writes {CELL_FORMAT}; choose another folder, "
            "nothing was changed"
        )
    content = stored.get("content") if isinstance(stored, dict) else None
    if not isinstance(content, dict) or stored.get("key") != key or stored.get("check") != _check(key, content):
        return None
    return content


class CellFiles:
    """The folder of a run's finished pieces.

    A file carries the key of its piece and a checksum of its content. One that is damaged, was cut short, or lies under
    the name of another is no finished piece: it is computed anew.

    Args:
        folder: ``OUT/cells``; the caller holds the lock of ``OUT``.

    Raises:
        StorageError: the folder cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for leftover in folder.glob(".*-*.json"):  # a killed process could not tidy up; the lock says nobody lives
                leftover.unlink(missing_ok=True)
        except OSError as error:
            raise StorageError(
                f"cannot write into {folder}: {error.strerror}; choose another folder with --out"
            ) from error

    def path(self, name: str) -> Path:
        """Where a piece lies."""
        return self.folder / f"{name}.json"

    def read(self, name: str, key: str) -> dict[str, Any] | None:
        """The content of a finished piece, see ``read_cell``."""
        return read_cell(self.path(name), key)

    def write(self, name: str, key: str, content: dict[str, Any]) -> None:
        """Stores a piece, whole or not at all."""
        write_json(
            self.path(name), {"format": CELL_FORMAT, "key": key, "check": _check(key, content), "content": content}
        )


def _check(key: str, content: dict[str, Any]) -> str:
    return fingerprint(key, json.dumps(content, sort_keys=True))
