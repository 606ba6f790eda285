"""WorkspaceStore: sampled workspaces kept in memory, and on disk if the user wants."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path

import numpy as np

from syda_gym.files import atomic_path
from syda_gym.routes.workspace.sampling import Workspace

__all__ = ["MEMORY", "WorkspaceStore", "cache_folder"]

_VERSION = "1"


class WorkspaceStore:
    """Keeps workspaces by key, dropping the least recently used ones.

    Args:
        folder: also keep them as ``.npz`` files there, for example ``cache_folder()``; ``None`` for memory alone.
        limit: bytes to keep in memory.
    """

    def __init__(self, folder: str | os.PathLike[str] | None = None, limit: int = 256 * 2**20) -> None:
        self.folder = Path(folder) if folder is not None else None
        self.limit = limit
        self._items: OrderedDict[str, Workspace] = OrderedDict()

    def get(self, key: str, make: Callable[[], Workspace]) -> Workspace:
        """The workspace called ``key``, made on first use.

        Args:
            key: a fingerprint of everything that the workspace depends on.
            make: samples the workspace.
        """
        if key not in self._items:
            self._items[key] = self._read(key) or self._made(key, make)
            self._drop_oldest()
        self._items.move_to_end(key)
        return self._items[key]

    def clear(self) -> None:
        """Forgets what is in memory; files stay."""
        self._items.clear()

    def _made(self, key: str, make: Callable[[], Workspace]) -> Workspace:
        workspace = make()
        if self.folder is not None:
            with atomic_path(self._path(key)) as temporary:
                np.savez_compressed(
                    temporary,
                    cell=workspace.cell,
                    counts=workspace.counts,
                    manipulability=workspace.manipulability,
                    rank=workspace.rank,
                )
        return workspace

    def _read(self, key: str) -> Workspace | None:
        if self.folder is None or not self._path(key).is_file():
            return None
        try:
            with np.load(self._path(key), allow_pickle=False) as data:
                return Workspace(float(data["cell"]), data["counts"], data["manipulability"], int(data["rank"]))
        except (OSError, ValueError, KeyError, EOFError):
            return None  # a damaged cache file costs a second of sampling, nothing else

    def _path(self, key: str) -> Path:
        assert self.folder is not None
        return self.folder / f"{key}-v{_VERSION}.npz"

    def _drop_oldest(self) -> None:
        size = sum(item.counts.nbytes + item.manipulability.nbytes for item in self._items.values())
        while size > self.limit and len(self._items) > 1:
            _, item = self._items.popitem(last=False)
            size -= item.counts.nbytes + item.manipulability.nbytes


def cache_folder() -> Path:
    """The user's folder for sampled workspaces: ``$SYDA_GYM_HOME/cache`` or ``~/.syda_gym/cache``."""
    home = os.environ.get("SYDA_GYM_HOME")
    return (Path(home) if home else Path.home() / ".syda_gym") / "cache" / "workspaces"


MEMORY = WorkspaceStore()
"""The store that every call shares unless it is given another."""
