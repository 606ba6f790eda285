"""Saving and loading mappings: ``NAME.safetensors`` with the numbers and ``NAME.json`` with the card."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import StorageError, SydaError
from syda_gym.files import atomic_path, check_tensors, fingerprint, read_bytes, read_json, write_json
from syda_gym.mappings.card import MappingCard
from syda_gym.mappings.chain import ChainMapping
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding import arm_coders, mink_ik, window_coder
from syda_gym.mappings.coding.coders import Coder, restore_coder
from syda_gym.mappings.confidence import Confidence
from syda_gym.mappings.mapping import Mapping
from syda_gym.mappings.models import heads, hop, linear, prior, rotation
from syda_gym.mappings.models.regressors import Regressor, restore_regressor

__all__ = ["load_mapping", "save_mapping"]

# Importing these enters their coders and models among those that can be rebuilt.
_PARTS = (arm_coders, mink_ik, window_coder, heads, hop, linear, prior, rotation)

_MAX_BYTES = 256 * 2**20
_MOST_LINKS = 16
_WIDEST = 4096  # numbers of a code; models that are one affine map are written out as such, width times width
Arrays = dict[str, FloatArray]


def save_mapping(mapping: Mapping, path: str | os.PathLike[str]) -> Path:
    """Writes a mapping or a chain.

    Args:
        mapping: what to write.
        path: with or without the ending; ``PATH.safetensors`` and ``PATH.json`` are written.

    Returns:
        The path of the ``.safetensors`` file.

    Raises:
        StorageError: the files cannot be written, or the mapping is of a type that cannot be stored.
    """
    from safetensors.numpy import save_file

    weights, card = _paths(path)
    links = mapping.links if isinstance(mapping, ChainMapping) else (mapping,)
    arrays: Arrays = {}
    entries = []
    for index, link in enumerate(links):
        if not isinstance(link, CodedMapping):
            raise StorageError(f"{link!r} cannot be stored; only fitted mappings and chains of them can")
        entries.append(_describe(link))
        arrays.update({f"{index}/{name}": np.ascontiguousarray(value) for name, value in _collect(link).items()})
    with atomic_path(weights) as temporary:
        save_file(arrays, str(temporary))
        mark = fingerprint(temporary.read_bytes())
    write_json(card, {"weights": mark, "links": entries})
    return weights


def load_mapping(path: str | os.PathLike[str]) -> Mapping:
    """Reads what ``save_mapping`` wrote; nothing in the files is executed.

    Args:
        path: with or without the ending.

    Returns:
        The mapping, equal to the saved one bit by bit.

    Raises:
        StorageError: a file is missing, corrupt, of another version, does not match its card, or the body it was fitted
            for has changed.
    """
    weights, card = _paths(path)
    content = read_json(card)
    if not isinstance(content, dict) or not isinstance(content.get("links"), list) or not content["links"]:
        raise StorageError(f"{card}: expected the keys 'weights' and 'links'; save the mapping again")
    if len(content["links"]) > _MOST_LINKS:
        raise StorageError(f"{card}: a chain of {len(content['links'])} links; at most {_MOST_LINKS} are read")
    arrays = _read_arrays(weights, content.get("weights"))
    links = []
    for index, entry in enumerate(content["links"]):
        prefix = f"{index}/"
        part = {name[len(prefix) :]: value for name, value in arrays.items() if name.startswith(prefix)}
        try:
            links.append(_rebuild(entry, part, card))
        except StorageError:
            raise
        except (
            SydaError,
            KeyError,
            TypeError,
            ValueError,
            IndexError,
            AttributeError,
            ArithmeticError,
            RecursionError,
        ) as error:
            raise StorageError(
                f"{card} and {weights.name} do not fit together: {type(error).__name__}: {str(error)[:400]}; "
                f"fit and save again"
            ) from error
    return links[0] if len(links) == 1 else ChainMapping(links)


def _paths(path: str | os.PathLike[str]) -> tuple[Path, Path]:
    base = Path(path)
    if base.suffix in (".safetensors", ".json"):
        base = base.with_suffix("")
    return base.parent / f"{base.name}.safetensors", base.parent / f"{base.name}.json"


def _describe(link: CodedMapping) -> dict[str, Any]:
    def part(value: Coder | Regressor) -> dict[str, Any]:
        return {"kind": value.kind, "settings": value.settings()}

    return {
        "card": link.card.to_json(),
        "source_coder": part(link.source_coder),
        "target_coder": part(link.target_coder),
        "regressor": part(link.regressor),
        "confidence": link.confidence.settings() if link.confidence else None,
        "confidence_back": link.confidence_back.settings() if link.confidence_back else None,
    }


def _collect(link: CodedMapping) -> Arrays:
    parts = {
        "source_coder": link.source_coder.arrays(),
        "target_coder": link.target_coder.arrays(),
        "regressor": link.regressor.arrays(),
    }
    result = {f"{part}/{name}": value for part, values in parts.items() for name, value in values.items()}
    for name, confidence in (("confidence", link.confidence), ("confidence_back", link.confidence_back)):
        if confidence is not None:
            result.update(confidence.arrays(name))
    return result


def _read_arrays(path: Path, mark: Any) -> Arrays:
    from safetensors import SafetensorError
    from safetensors.numpy import load

    if not path.is_file():
        raise StorageError(f"no file {path}; a mapping is a .safetensors file and a .json card beside it")
    data = read_bytes(path, _MAX_BYTES, "a mapping of this library")
    if fingerprint(data) != mark:
        raise StorageError(f"{path} does not match its card: it was changed or belongs to another mapping")
    _check_shapes(path, check_tensors(path, "the weights of a mapping", _MAX_BYTES))
    try:
        arrays = load(data)
    except (SafetensorError, ValueError, KeyError) as error:
        raise StorageError(f"{path} is corrupt: {error}; fit and save again") from error
    for name, value in arrays.items():
        if not np.issubdtype(value.dtype, np.floating) or not np.isfinite(value).all():
            raise StorageError(f"{path}: {name!r} holds values that are not finite numbers; fit and save again")
        if name.endswith(".spread") and not (value > 0.0).all():
            raise StorageError(f"{path}: {name!r} holds a spread that is not positive; fit and save again")
    return arrays


def _check_shapes(path: Path, shapes: dict[str, tuple[int, ...]]) -> None:
    """Refuses shapes that would be blown up: scales and biases are vectors, rows are no longer than a code."""
    for name, shape in shapes.items():
        vector = name.endswith((".mean", ".spread", "bias"))
        if (vector and len(shape) != 1) or (shape and shape[-1] > _WIDEST) or len(shape) > 3:
            raise StorageError(
                f"{path}: {name[:80]!r} has shape {shape}; expected {'a vector' if vector else 'rows'} of at most "
                f"{_WIDEST} numbers"
            )


def _rebuild(entry: dict[str, Any], arrays: Arrays, where: Path) -> CodedMapping:
    card = MappingCard.from_json(entry["card"], str(where))
    source, target = _body(card.source, where), _body(card.target, where)
    _check_features(card.source_features, source, where)
    _check_features(card.target_features, target, where)
    mapping = CodedMapping(
        card,
        restore_coder(entry["source_coder"], source, _below(arrays, "source_coder/")),
        restore_coder(entry["target_coder"], target, _below(arrays, "target_coder/")),
        restore_regressor(entry["regressor"], _below(arrays, "regressor/")),
        *(
            Confidence.restore(entry[name], arrays, name) if entry[name] else None
            for name in ("confidence", "confidence_back")
        ),
    )
    # Sizes are checked by use: one frame must pass and give finite numbers of the right width.
    result = mapping.raw(_probe(mapping))
    if result.shape != (1, target.n_features) or not np.isfinite(result).all():
        raise StorageError(f"{where}: the stored weights do not map {source.name!r} to {target.name!r}; fit again")
    return mapping


def _probe(mapping: CodedMapping) -> FloatArray:
    standing = getattr(mapping.source, "standing", None)
    rest: FloatArray = standing() if standing is not None else mapping.source.rest  # type: ignore[attr-defined]
    return np.asarray(rest, dtype=np.float64)[None]


def _body(spec: dict[str, Any], where: Path) -> Embodiment:
    try:
        return catalog.from_spec(spec)
    except (SydaError, TypeError) as error:
        raise StorageError(f"{where}: {error}") from error


def _check_features(stored: list[str], body: Embodiment, where: Path) -> None:
    now = [f"{feature.name} [{feature.unit}]" for feature in body.features]
    if stored != now:
        raise StorageError(f"{where}: stored features of {body.name!r} are {stored}, the body has {now}; fit again")


def _below(arrays: Arrays, prefix: str) -> Arrays:
    return {name[len(prefix) :]: value for name, value in arrays.items() if name.startswith(prefix)}
