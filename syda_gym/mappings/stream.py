"""FrameStream: a mapping for live use, which remembers the past frames that a window looks at."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.mapping import Mapping

__all__ = ["FrameStream"]


class FrameStream:
    """Maps one frame after the other and gives what the whole clip would give, row by row.

    Args:
        mapping: with or without a window; without one nothing is remembered.
    """

    def __init__(self, mapping: Mapping) -> None:
        self.mapping = mapping
        self._past: deque[FloatArray] = deque(maxlen=mapping.window + 1)

    def reset(self) -> None:
        """Forgets the past, at the start of a clip."""
        self._past.clear()

    def __call__(self, frame: ArrayLike) -> FloatArray:
        """The image ``(F_target,)`` of the next frame ``(F_source,)``.

        Raises:
            EmbodimentError: not a frame of the source, or values that are not finite; the past stays as it was.
        """
        if not self.mapping.window:
            return self.mapping(frame)
        self._past.append(self.mapping.source.check(frame)[0])
        result: FloatArray = self.mapping(np.stack(self._past))[-1]
        return result
