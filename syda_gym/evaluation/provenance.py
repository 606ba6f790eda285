"""Provenance: which versions and which code made a number, so that a stored one is only taken for what it is."""

from __future__ import annotations

import json
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import syda_gym
from syda_gym.files import fingerprint

__all__ = ["code_fingerprint", "made_by", "versions"]

_PACKAGES = ("syda-gym", "numpy", "scipy", "torch", "gymnasium", "pybullet", "pin", "stable-baselines3")
_SHOWS_ONLY = ("cli", "teleoperation", "evaluation/report")  # rooms that no stored number depends on


def versions() -> dict[str, str]:
    """Versions of everything that decides the numbers, the fingerprint of this package's code among them."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found | {"code": code_fingerprint()}


def made_by() -> str:
    """16 hex digits of ``versions()``: part of the key of everything that is stored to be taken again."""
    return fingerprint(json.dumps(versions(), sort_keys=True))


@cache
def code_fingerprint() -> str:
    """16 hex digits of the package's code and assets, without the rooms that only show."""
    root = Path(syda_gym.__file__).parent
    parts: list[bytes | str] = []
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).as_posix()
        if "__pycache__" in name or not path.is_file() or name.startswith(tuple(f"{room}/" for room in _SHOWS_ONLY)):
            continue
        if path.suffix == ".py" or name.startswith("assets/"):
            parts += [name, path.read_bytes()]
    return fingerprint(*parts)
