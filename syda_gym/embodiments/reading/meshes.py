"""find_mesh: the file that a mesh's address in a URDF means, if it is there."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import unquote

__all__ = ["find_mesh"]

_LEVELS = 6  # folders above the URDF that may hold its package


def find_mesh(address: str, urdf: Path) -> Path | None:
    """Looks for a mesh beside the URDF, in the folders above it, and where ROS keeps packages.

    Args:
        address: ``package://NAME/...``, ``model://...``, ``file://...``, or a path.
        urdf: the file that names it.

    Returns:
        An existing file, or ``None``.
    """
    text = address.strip().replace("\\", "/")
    scheme, _, rest = text.rpartition("://")
    if scheme == "file" or not scheme:
        plain = Path(unquote(rest if scheme else text))
        for candidate in (plain, urdf.parent / plain):
            if candidate.is_file():
                return candidate.resolve()
        return None
    inside = rest.partition("/")[2]
    for folder in _folders(urdf):
        for candidate in (folder / rest, folder / inside):
            if candidate.is_file():
                return candidate.resolve()
    return None


def _folders(urdf: Path) -> list[Path]:
    above = list(urdf.resolve().parents[:_LEVELS])
    ros = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    shares = [f"{prefix}/share" for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    return [*above, *(Path(folder) for folder in (*ros, *shares) if folder)]
