"""Checkpoints: the state of a training in one safetensors file, from which it goes on as if nothing had happened."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from syda_gym.errors import StorageError
from syda_gym.files import atomic_path, check_tensors

__all__ = ["FORMAT", "load_checkpoint", "restore_model", "save_checkpoint"]

FORMAT = 1

_MAX_BYTES = 2**30


def save_checkpoint(
    model: Any, path: str | os.PathLike[str], state: Mapping[str, Any], extras: Mapping[str, Any] | None = None
) -> Path:
    """Writes weights, optimisers and counters of a Stable-Baselines3 model, in one file and all at once.

    Args:
        model: the algorithm.
        path: of the file.
        state: JSON-able data of the training around the model.
        extras: further tensors.

    Raises:
        StorageError: the file cannot be written; an earlier one stays as it was.
    """
    from safetensors.torch import save_file

    tensors, groups = _flatten(model)
    about = {"format": FORMAT, "state": dict(state), "groups": groups, "steps": int(model.num_timesteps)}
    about["updates"] = int(getattr(model, "_n_updates", 0))
    with atomic_path(path) as temporary:
        save_file({**tensors, **(extras or {})}, str(temporary), metadata={"training": json.dumps(about)})
    return Path(path)


def load_checkpoint(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Reads a checkpoint.

    Returns:
        Tensors by name, and what else was stored: ``state``, ``groups``, ``steps``, ``updates``.

    Raises:
        StorageError: missing, corrupt, or of another format.
    """
    from safetensors import SafetensorError, safe_open

    file = Path(path)
    if not file.is_file():
        raise StorageError(f"no checkpoint {file}; give the folder of an earlier training, or start without resume")
    check_tensors(file, "a checkpoint", _MAX_BYTES)
    try:
        with safe_open(str(file), framework="pt") as content:
            tensors = {name: content.get_tensor(name) for name in content.keys()}  # noqa: SIM118 (no mapping)
            about = json.loads((content.metadata() or {}).get("training", "null"))
    except (SafetensorError, OSError, ValueError) as error:
        raise StorageError(f"checkpoint {file} is corrupt: {error}; use an earlier one or start anew") from error
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise StorageError(f"{file} is no checkpoint of format {FORMAT}; start the training anew")
    return tensors, about


def restore_model(model: Any, tensors: Mapping[str, Any], about: Mapping[str, Any]) -> None:
    """Puts weights, optimisers and counters back into a model that was built with the same hyper-parameters.

    Raises:
        StorageError: the checkpoint is of another network or algorithm.
    """
    parameters = model.get_parameters()
    try:
        for name, current in parameters.items():
            if "param_groups" in current:
                parameters[name] = _optimiser(name, tensors, about["groups"][name])
            else:
                parameters[name] = {key: tensors[f"{name}/{key}"] for key in current}
        model.set_parameters(parameters, exact_match=True)
        for name in model._get_torch_save_params()[1]:
            getattr(model, name).data.copy_(tensors[f"variable/{name}"])
    except (KeyError, RuntimeError, ValueError) as error:
        raise StorageError(f"the checkpoint is of another network or algorithm: {error}; start anew") from error
    model.num_timesteps = int(about["steps"])
    model._n_updates = int(about["updates"])


def _flatten(model: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Tensors by flat name, and the optimisers' groups as plain data."""
    tensors: dict[str, Any] = {}
    groups: dict[str, Any] = {}
    for name, content in model.get_parameters().items():
        if "param_groups" in content:
            groups[name] = content["param_groups"]
            for index, entry in content["state"].items():
                tensors |= {f"{name}/{index}/{key}": value.detach().clone() for key, value in entry.items()}
        else:
            tensors |= {f"{name}/{key}": value.detach().clone().contiguous() for key, value in content.items()}
    for name in model._get_torch_save_params()[1]:
        tensors[f"variable/{name}"] = getattr(model, name).detach().clone()
    return tensors, groups


def _optimiser(name: str, tensors: Mapping[str, Any], groups: Any) -> dict[str, Any]:
    state: dict[int, dict[str, Any]] = {}
    for key, value in tensors.items():
        if key.startswith(f"{name}/"):
            index, entry = key[len(name) + 1 :].split("/")
            state.setdefault(int(index), {})[entry] = value
    return {"state": state, "param_groups": groups}
