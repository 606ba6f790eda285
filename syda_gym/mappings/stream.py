"""FrameStream: a mapping for live use, which remembers the frames before."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.mappings.chain import ChainMapping
from syda_gym.mappings.mapping import Mapping

__all__ = ["FrameStream"]


class FrameStream:
    """Maps one frame after the other and gives what the whole clip would give, row by row.

    Without ``fps`` that is ``mapping(clip)``: every frame for itself, apart from the past frames that a window looks
    at. With ``fps`` it is ``mapping.follow`` over the clip: among equally good joint angles the nearest to those
    before, within the speeds of the joints that follow limbs.

    Args:
        mapping: with or without a window, or a chain.
        fps: frames per second.

    Raises:
        OptionError: ``fps`` is not positive.
    """

    def __init__(self, mapping: Mapping, fps: float | None = None) -> None:
        if fps is not None and not (np.isfinite(fps) and fps > 0.0):
            raise OptionError(f"fps must be positive, got {fps}")
        self.mapping, self.fps = mapping, fps
        links = mapping.links if isinstance(mapping, ChainMapping) else (mapping,)
        self._links = [_Link(link) for link in links]

    def reset(self) -> None:
        """Forgets the past, at the start of a clip."""
        self._links = [_Link(link.mapping) for link in self._links]

    def __call__(self, frame: ArrayLike, dt: float | None = None) -> FloatArray:
        """The image ``(F_target,)`` of the next frame ``(F_source,)``.

        Args:
            frame: the next frame.
            dt: time since the frame before [s], where it is not ``1 / fps``.

        Raises:
            EmbodimentError: not a frame of the source, or values that are not finite; the past stays as it was.
        """
        current: FloatArray = self.mapping.source.check(frame)[0]
        step = dt if dt is not None or self.fps is None else 1.0 / self.fps
        done = []
        for link in self._links:  # a frame that some link cannot take leaves all of them as they were
            ahead = link.copy()
            current = ahead(current, step)
            done.append(ahead)
        self._links = done
        return current


class _Link:
    """One mapping with its own past frames and its own memory."""

    def __init__(self, mapping: Mapping) -> None:
        self.mapping = mapping
        self.memory = mapping.begin()
        self.past: deque[FloatArray] = deque(maxlen=mapping.window + 1)

    def copy(self) -> _Link:
        twin = _Link.__new__(_Link)
        twin.mapping, twin.memory, twin.past = self.mapping, self.memory, self.past.copy()
        return twin

    def __call__(self, frame: FloatArray, dt: float | None) -> FloatArray:
        if not self.mapping.window:
            if dt is None:
                return self.mapping(frame)
            mapped, self.memory = self.mapping.follow(frame, self.memory, dt)
            return np.asarray(mapped[0])
        self.past.append(frame)
        rows = np.stack(self.past)
        if dt is None:
            return np.asarray(self.mapping(rows)[-1])
        mapped, self.memory = self.mapping.follow(rows, self.memory, dt, skip=len(rows) - 1)
        return np.asarray(mapped[0])
