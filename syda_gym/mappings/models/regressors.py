"""Regressors: from codes of one body to codes of another, with an inverse where the model has one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MappingError, StorageError, nearest_name
from syda_gym.mappings.models.networks import Stack, stacks_from_arrays
from syda_gym.mappings.models.scaling import Scaler

__all__ = ["REGRESSORS", "Affine", "DirectRegressor", "DualRegressor", "Regressor", "restore_regressor"]

Arrays = dict[str, FloatArray]
Affine = tuple[FloatArray, FloatArray]
"""Weight ``(D, E)`` and bias ``(E,)``."""


REGRESSORS: dict[str, type[Regressor]] = {}
"""Kind to class, of every model whose file has been imported."""


def restore_regressor(entry: dict[str, Any], arrays: Arrays) -> Regressor:
    """Rebuilds a regressor from its stored kind, settings and arrays.

    Raises:
        StorageError: an unknown kind.
    """
    kind = str(entry["kind"])
    if kind not in REGRESSORS:
        raise StorageError(f"unknown model {kind!r}; {nearest_name(kind, REGRESSORS)}")
    return REGRESSORS[kind].restore(entry["settings"], arrays)


class Regressor(ABC):
    """A fitted function from codes ``(..., D_source)`` to codes ``(..., D_target)``."""

    kind: ClassVar[str]

    def __init_subclass__(cls, **options: Any) -> None:
        """Enters the model into ``REGRESSORS``, so that what is stored under its kind can be rebuilt."""
        super().__init_subclass__(**options)
        REGRESSORS[cls.kind] = cls

    @abstractmethod
    def __call__(self, codes: FloatArray) -> FloatArray:
        """Maps codes."""

    def inverse(self) -> Regressor:
        """The regressor from target codes to source codes.

        Raises:
            MappingError: this model has no inverse.
        """
        raise MappingError(
            f"a {self.kind!r} model has no inverse; fit the reversed pair (pair.reversed()), or use method='syda', "
            "whose models map both ways"
        )

    def affine(self) -> Affine | None:
        """The whole model as one affine map, where it is one: then a single frame costs one small product."""
        return None

    @abstractmethod
    def arrays(self) -> Arrays:
        """Fitted numbers, for storage."""

    def settings(self) -> dict[str, Any]:
        """JSON-able settings, for storage."""
        return {}

    @classmethod
    @abstractmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> Regressor:
        """Rebuilds what ``settings`` and ``arrays`` describe."""


class DirectRegressor(Regressor):
    """The direct autoencoder of the paper's comparison: A's encoder and B's decoder, trained on A-to-B alone.

    Args:
        stacks: one per entry of ``names``.
        scale_a: standardisation of A's codes.
        scale_b: standardisation of B's codes.
    """

    kind = "direct"
    names: ClassVar[tuple[str, ...]] = ("encode_a", "decode_b")

    def __init__(self, stacks: dict[str, Stack], scale_a: Scaler, scale_b: Scaler) -> None:
        self.stacks = stacks
        self.scale_a = scale_a
        self.scale_b = scale_b
        self._affine = _collapsed(stacks, scale_a, scale_b)

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Encodes with A, decodes with B."""
        if self._affine is not None:
            return codes @ self._affine[0] + self._affine[1]
        return self.scale_b.undo(self.stacks["decode_b"](self.synergies(codes)))

    def affine(self) -> Affine | None:
        """The collapsed layers if all of them are linear."""
        return self._affine

    def synergies(self, codes: FloatArray) -> FloatArray:
        """The latent features (synergies) of A's codes."""
        return self.stacks["encode_a"](self.scale_a(codes))

    def arrays(self) -> Arrays:
        """Weights, biases and scales."""
        result = {key: value for name, stack in self.stacks.items() for key, value in stack.arrays(name).items()}
        return {**result, **self.scale_a.arrays("scale_a"), **self.scale_b.arrays("scale_b")}

    def settings(self) -> dict[str, Any]:
        """The activation."""
        encoder = self.stacks["encode_a"]
        return {"slope": encoder.slope, "activated": encoder.activated}

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> Self:
        """Rebuilds the model."""
        stacks = stacks_from_arrays(arrays, cls.names, float(settings["slope"]), bool(settings["activated"]))
        if set(stacks) != set(cls.names):
            raise MappingError(f"expected the networks {', '.join(cls.names)}, got {', '.join(stacks) or 'none'}")
        return cls(stacks, Scaler.restore(arrays, "scale_a"), Scaler.restore(arrays, "scale_b"))


class DualRegressor(DirectRegressor):
    """SyDa: two autoencoders with shared latent features; A's encoder followed by B's decoder, or the other way.

    Args:
        stacks: ``encode_a``, ``decode_a``, ``encode_b``, ``decode_b``.
        scale_a: standardisation of A's codes.
        scale_b: standardisation of B's codes.
    """

    kind = "syda"
    names: ClassVar[tuple[str, ...]] = ("encode_a", "decode_a", "encode_b", "decode_b")

    def reconstruct(self, codes: FloatArray) -> FloatArray:
        """A's codes through A's own autoencoder."""
        return self.scale_a.undo(self.stacks["decode_a"](self.synergies(codes)))

    def inverse(self) -> DualRegressor:
        """The same model with A and B exchanged."""
        swapped = {"encode_a": "encode_b", "decode_a": "decode_b", "encode_b": "encode_a", "decode_b": "decode_a"}
        return type(self)({name: self.stacks[swapped[name]] for name in self.names}, self.scale_b, self.scale_a)


def _collapsed(stacks: dict[str, Stack], scale_a: Scaler, scale_b: Scaler) -> Affine | None:
    """Weight and bias of A-to-B as one affine map if all layers are linear, for speed; otherwise ``None``."""
    path = (stacks["encode_a"], stacks["decode_b"])
    if any(stack.slope != 1.0 for stack in path):
        return None
    zero = np.zeros((1, len(scale_a.mean)))
    through = np.concatenate([zero, np.eye(len(scale_a.mean))])
    images = scale_b.undo(path[1](path[0](scale_a(through))))
    return images[1:] - images[:1], images[0]
