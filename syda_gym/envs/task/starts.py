"""StartSampler: which clip and which frame an episode begins with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.task.repertoire import ClipEntry

__all__ = ["BIN", "StartSampler"]

BIN = 10
"""Frames that share one estimate of how badly the policy tracks them."""

_LEAST = 10  # frames that an episode has at least, where the clip is long enough
_MEMORY = 0.8  # share of the old estimate that is kept
_UNIFORM = 0.2  # share of the draws that stays uniform, so that no frame is forgotten


class StartSampler:
    """Draws clips and start frames.

    With ``failures``, stretches of ``BIN`` frames are drawn in proportion to a running mean of the landmark error of
    the episodes that passed there (as motion trackers sample where their policy fails), mixed with a uniform share.

    Args:
        clips: to choose from.
        start: ``first``, ``uniform`` or ``failures``.
    """

    def __init__(self, clips: Sequence[ClipEntry], start: str) -> None:
        self._clips = clips
        self._start = start
        self._choices = [max(clip.length - _LEAST, 0) + 1 for clip in clips]
        bins = [-(-choices // BIN) for choices in self._choices]
        self._first_bin = np.concatenate([[0], np.cumsum(bins)]).astype(np.intp)
        self._clip_of_bin = np.repeat(np.arange(len(clips)), bins)
        self.errors: FloatArray = np.full(int(self._first_bin[-1]), np.nan)

    def draw(self, first: float, second: float, clip: int | None = None) -> tuple[int, int]:
        """A clip and a frame.

        Args:
            first: random number in [0, 1) that chooses the clip.
            second: random number in [0, 1) that chooses the frame.
            clip: the clip, where it is given.
        """
        if self._start == "failures":
            return self._draw_failure(first, second, clip)
        if clip is None:
            clip = int(first * len(self._clips))
        return clip, int(second * self._choices[clip]) if self._start == "uniform" else 0

    def learn(self, clip: int, frame: int, frames: int, error: float) -> None:
        """Takes note of the mean landmark error [m] of an episode of ``frames`` frames that began at ``frame``."""
        if self._start != "failures":
            return
        first = int(self._first_bin[clip]) + min(frame, self._choices[clip] - 1) // BIN
        last = int(self._first_bin[clip]) + min(frame + frames - 1, self._choices[clip] - 1) // BIN
        touched = slice(first, last + 1)
        old = self.errors[touched]
        self.errors[touched] = np.where(np.isnan(old), error, _MEMORY * old + (1.0 - _MEMORY) * error)

    def weights(self) -> FloatArray:
        """Chance of each stretch, over all clips; it sums to 1."""
        known = self.errors[~np.isnan(self.errors)]
        errors = np.where(np.isnan(self.errors), known.max() if len(known) else 1.0, self.errors)
        share = errors / errors.sum() if errors.sum() > 0.0 else np.full(len(errors), 1.0 / len(errors))
        return np.asarray((1.0 - _UNIFORM) * share + _UNIFORM / len(errors))

    def _draw_failure(self, first: float, second: float, clip: int | None) -> tuple[int, int]:
        weights = self.weights()
        if clip is not None:
            weights = np.where(self._clip_of_bin == clip, weights, 0.0)
        edges = np.cumsum(weights) / weights.sum()
        chosen = min(int(np.searchsorted(edges, first, side="right")), len(edges) - 1)
        clip = int(self._clip_of_bin[chosen])
        low = (chosen - int(self._first_bin[clip])) * BIN
        high = min(low + BIN, self._choices[clip])
        return clip, low + int(second * (high - low))
