"""Remembering: a mapping that keeps what it gave, so that nobody has to ask the same frame twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.card import MappingCard
from syda_gym.mappings.mapping import Mapping

__all__ = ["Remembering"]


class Remembering(Mapping):
    """Another mapping with a memory of its raw outputs.

    The environment maps every operator frame once; the figures ask for the same frames again, as the observation shows
    them: in single precision. A frame is therefore known again by its single-precision digits.

    Args:
        mapping: the mapping itself.
    """

    def __init__(self, mapping: Mapping) -> None:
        self.mapping = mapping
        self.source, self.target = mapping.source, mapping.target
        self._known: dict[bytes, FloatArray] = {}

    @property
    def card(self) -> MappingCard:
        """Of the mapping itself."""
        return self.mapping.card

    @property
    def route(self) -> tuple[str, ...]:
        """Of the mapping itself."""
        return self.mapping.route

    @property
    def window(self) -> int:
        """Of the mapping itself."""
        return int(getattr(self.mapping, "window", 0))

    def raw(self, frames: FloatArray) -> FloatArray:
        """Maps the frames that are new and looks the others up."""
        if self.window:  # an output depends on more than its own frame
            return self.mapping.raw(frames)
        keys = [row.tobytes() for row in np.ascontiguousarray(frames, dtype=np.float32)]
        new: dict[bytes, int] = {}
        for index, key in enumerate(keys):
            if key not in self._known:
                new.setdefault(key, index)
        if new:
            self._known.update(zip(new, self.mapping.raw(frames[list(new.values())]), strict=True))
        return np.array([self._known[key] for key in keys])

    def inverse(self) -> Mapping:
        """Of the mapping itself."""
        return self.mapping.inverse()

    def error_bound(self, frames: ArrayLike) -> FloatArray:
        """Of the mapping itself."""
        return self.mapping.error_bound(frames)

    def difficulty(self, frames: ArrayLike) -> FloatArray:
        """Of the mapping itself."""
        return self.mapping.difficulty(frames)

    def unfamiliar(self, frames: ArrayLike) -> NDArray[np.bool_]:
        """Of the mapping itself."""
        return self.mapping.unfamiliar(frames)
