"""Changing the frame rate of motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions, Take

__all__ = ["resampled"]

_MOST_FRAMES = 2_000_000


def resampled(motions: Motions, fps: float) -> Motions:
    """The same motions at another frame rate, by linear interpolation in time (recorded timestamps are honoured).

    Args:
        motions: what to resample.
        fps: new frames per second.

    Returns:
        New motions; a value counts as filled if either of its neighbours was. Takes that already have the rate and no
        timestamps stay as they are.

    Raises:
        MotionError: that would be millions of frames.
    """
    return replace(motions, takes=tuple(_resampled(take, fps) for take in motions.takes))


def _resampled(take: Take, fps: float) -> Take:
    if take.timestamps is None and take.fps == fps:
        return take
    count = len(next(iter(take.frames.values())))
    times = np.arange(count) / take.fps if take.timestamps is None else take.timestamps - take.timestamps[0]
    if not times[-1] * fps < _MOST_FRAMES:
        raise MotionError(
            f"{take.recording}: {times[-1]:.3g} s at {fps:g} frames per second are more than {_MOST_FRAMES} frames"
        )
    # A small tolerance keeps the last frame when its time is a multiple of the new period up to rounding.
    wanted = np.arange(int(np.floor(times[-1] * fps + 1e-6)) + 1) / fps
    after = np.clip(np.searchsorted(times, wanted - 1e-9), 1, max(1, count - 1))
    if count == 1:
        return replace(take, fps=fps, timestamps=None)
    before = after - 1
    share = np.clip((wanted - times[before]) / (times[after] - times[before]), 0.0, 1.0)[:, None]
    share = np.where(share < 1e-6, 0.0, np.where(share > 1.0 - 1e-6, 1.0, share))
    return replace(
        take,
        fps=fps,
        frames={name: (1.0 - share) * f[before] + share * f[after] for name, f in take.frames.items()},
        filled={
            name: (marks[before] & (share < 1.0)) | (marks[after] & (share > 0.0))
            for name, marks in take.filled.items()
        },
        timestamps=None,
    )
