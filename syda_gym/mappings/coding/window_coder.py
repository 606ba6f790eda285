"""WindowCoder: a human's arm codes beside those of the frames before, so that a model may look at motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MappingError
from syda_gym.mappings.coding.arm_coders import HumanArmCoder
from syda_gym.mappings.coding.coders import Arrays, Coder
from syda_gym.motions.clip import PairedMotions

__all__ = ["WindowCoder", "encode_clips", "past_frames"]

_LONGEST = 250  # frames


class WindowCoder(Coder):
    """A causal window: rows are the consecutive frames of one clip, the current frame comes last in a code.

    Before the first frame of a clip the person is taken to have stood still.

    Args:
        body: a human.
        settings: ``window``, how many past frames are seen, and the ``inner`` coder's settings.
        arrays: the inner coder's arrays.
    """

    kind = "window"

    def __init__(self, body: Embodiment, settings: dict[str, Any], arrays: Arrays) -> None:
        super().__init__(body)
        self.window = int(settings["window"])
        if not 0 <= self.window <= _LONGEST:
            raise MappingError(f"a window of {self.window} frames; expected 0 to {_LONGEST}")
        self.inner = HumanArmCoder(body, settings["inner"], arrays)

    @classmethod
    def around(cls, inner: HumanArmCoder, window: int) -> WindowCoder:
        """A window of ``window`` past frames around a fitted coder."""
        return cls(inner.body, {"window": window, "inner": inner.settings()}, inner.arrays())

    @property
    def width(self) -> int:
        """The inner width once per frame of the window."""
        return self.inner.width * (1 + self.window)

    def encode(self, frames: FloatArray) -> FloatArray:
        """Codes ``(N, arms, width)`` of one clip in time order."""
        return past_frames(self.inner.encode(frames), self.window)

    def decode(self, codes: FloatArray) -> FloatArray:
        """Frames ``(N, F)`` of the current frames; what codes say about the past is not needed."""
        return self.inner.decode(codes[..., -self.inner.width :])

    def arrays(self) -> Arrays:
        """The inner coder's calibration."""
        return self.inner.arrays()

    def settings(self) -> dict[str, Any]:
        """The window and the inner coder's settings."""
        return {"window": self.window, "inner": self.inner.settings()}


def past_frames(codes: FloatArray, window: int, clips: Sequence[NDArray[np.intp]] | None = None) -> FloatArray:
    """Codes behind those of the ``window`` frames before, within each clip; the first frame is held.

    Args:
        codes: ``(N, K, D)``.
        window: frames to look back.
        clips: row indices of each clip in time order; one clip of all rows by default.

    Returns:
        ``(N, K, D (1 + window))``, oldest frame first, the current one last.
    """
    runs = [np.arange(len(codes))] if clips is None else clips
    parts = []
    for back in range(window, -1, -1):
        shifted = np.empty_like(codes)
        for rows in runs:
            shifted[rows] = codes[rows[np.maximum(np.arange(len(rows)) - back, 0)]]
        parts.append(shifted)
    return np.concatenate(parts, axis=-1)


def encode_clips(coder: Coder, pair: PairedMotions) -> FloatArray:
    """Codes of a pair's source frames; a window never reaches from one clip into another."""
    if isinstance(coder, WindowCoder):
        return past_frames(coder.inner.encode(pair.source), coder.window, pair.clip_rows())
    return coder.encode(pair.source)
