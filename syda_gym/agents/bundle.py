"""Bundle: what is stored of an agent, and what is checked before it acts again.

A bundle is two files: ``NAME.safetensors`` with weights and normalisation, and ``NAME.json`` with the stack, the
interface (robot, observation layout, rates), the mapping's card, how it was trained, figures, versions, and a
fingerprint of the weights. Neither can run code when it is read.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.agent import Agent
from syda_gym.agents.interface import Interface
from syda_gym.agents.stacks import build_stack, stack_arrays, stack_spec
from syda_gym.errors import AgentError, StorageError
from syda_gym.files import atomic_path, check_tensors, fingerprint, read_json, shortened, write_json

__all__ = ["FORMAT", "load_agent", "package_versions", "read_card", "save_agent"]

FORMAT = 1
"""Version of the format; others are refused."""

_MAX_BYTES = 256 * 2**20
_MOST_AGENTS = 16
_PACKAGES = ("syda-gym", "numpy", "torch", "stable-baselines3", "gymnasium", "pybullet")


def save_agent(
    agent: Agent,
    path: str | os.PathLike[str],
    *,
    mapping: Mapping[str, Any] | None = None,
    training: Mapping[str, Any] | None = None,
    figures: Mapping[str, Any] | None = None,
) -> Path:
    """Stores an agent with everything below it.

    Args:
        agent: what to store.
        path: file name with or without ``.safetensors``; its folder is created.
        mapping: card of the mapping that it was trained on.
        training: how it was trained: options, hyper-parameters, seed, command.
        figures: what it reached, and on what.

    Returns:
        Path of the ``.json``.

    Raises:
        StorageError: the folder cannot be written; an earlier bundle stays as it was.
    """
    from safetensors.numpy import save_file

    weights, card_path = _paths(path)
    arrays = {name: np.ascontiguousarray(value) for name, value in stack_arrays(agent).items()}
    card = {
        "format": FORMAT,
        "stack": stack_spec(agent),
        "interface": agent.interface.spec(),
        "mapping": dict(mapping or {}),
        "training": dict(training or {}),
        "figures": dict(figures or {}),
        "versions": package_versions(),
        "weights": _fingerprint(arrays),
    }
    # The weights first, so that a card never points at weights that are not there; the fingerprint tells if only one
    # of the two arrived.
    with atomic_path(weights) as temporary:
        save_file(arrays, str(temporary))
    write_json(card_path, card)
    return card_path


def load_agent(path: str | os.PathLike[str], where: Any) -> Agent:
    """Loads an agent for an environment.

    Args:
        path: of the bundle, with or without suffix.
        where: the environment that it shall act in, or an ``Interface``.

    Raises:
        StorageError: files missing, corrupt, of another format, or not belonging together.
        AgentError: another robot, observation layout or rate.
    """
    weights, card_path = _paths(path)
    card = read_card(card_path)
    arrays = _read_arrays(weights)
    if _fingerprint(arrays) != card["weights"]:
        raise StorageError(
            f"{weights.name} and {card_path.name} do not belong together (fingerprint {_fingerprint(arrays)}, expected "
            f"{card['weights']}); store the agent again"
        )
    interface = where if isinstance(where, Interface) else Interface.of(where)
    try:
        interface.check(card["interface"], f"the agent in {card_path.name}")
        return build_stack(interface, card["stack"], arrays)
    except AgentError as error:
        raise AgentError(f"{card_path}: {error}") from error
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        raise StorageError(
            f"{card_path} is damaged: {type(error).__name__}: {str(error)[:400]}; train again or copy the bundle again"
        ) from error


def read_card(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The JSON side of a bundle.

    Raises:
        StorageError: missing, not JSON, or not a bundle of this format.
    """
    card_path = _paths(path)[1]
    card = read_json(card_path)
    if not isinstance(card, dict) or card.get("format") != FORMAT:
        found = card.get("format") if isinstance(card, dict) else None
        raise StorageError(
            f"{card_path}: expected an agent bundle of format {FORMAT}, got format {shortened(found, 60)}; train again"
        )
    if isinstance(card.get("stack"), list) and len(card["stack"]) > _MOST_AGENTS:
        raise StorageError(f"{card_path}: a stack of {len(card['stack'])} agents; at most {_MOST_AGENTS} are read")
    for key, kind in (("stack", list), ("interface", dict), ("weights", str)):
        if not isinstance(card.get(key), kind):
            raise StorageError(
                f"{card_path}: expected {key!r} to be a {kind.__name__}; the file is damaged, train again"
            )
    return card


def _paths(path: str | os.PathLike[str]) -> tuple[Path, Path]:
    given = Path(path)
    stem = given.with_suffix("") if given.suffix in (".safetensors", ".json") else given
    return stem.with_name(stem.name + ".safetensors"), stem.with_name(stem.name + ".json")


def _read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    from safetensors import SafetensorError
    from safetensors.numpy import load_file

    if not path.is_file():
        raise StorageError(f"no file {path}; a bundle is a .safetensors and a .json side by side")
    check_tensors(path, "the weights of an agent", _MAX_BYTES)
    try:
        arrays: dict[str, NDArray[Any]] = load_file(str(path))
    except (SafetensorError, ValueError, KeyError, OSError) as error:
        raise StorageError(f"{path} is corrupt: {error}; train or download it again") from error
    for name, value in arrays.items():
        if not np.isfinite(value).all():
            raise StorageError(f"{path}: {name!r} holds values that are not finite; train again")
        if name.endswith(".std") and not (value > 0.0).all():
            raise StorageError(f"{path}: {name!r} holds a standard deviation that is not positive; train again")
    return arrays


def _fingerprint(arrays: Mapping[str, NDArray[Any]]) -> str:
    parts: list[bytes | str] = []
    for name in sorted(arrays):
        parts += [name, str(arrays[name].shape), str(arrays[name].dtype), arrays[name].tobytes()]
    return fingerprint(*parts)


def package_versions() -> dict[str, str]:
    """Versions of the packages that matter for the numbers, of those that are installed."""
    found = {}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
