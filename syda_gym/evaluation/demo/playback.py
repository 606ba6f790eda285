"""Recordings of episodes as tracks of bodies, for the report's playback and the film."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from syda_gym.evaluation.report import (
    PlaybackChain,
    Track,
    track,
)

if TYPE_CHECKING:
    from syda_gym.evaluation.episodes import Recording
    from syda_gym.mappings.mapping import Mapping

__all__ = ["playback_chain"]


_SHOWN_HZ = 15.0  # frames per second of playback and film


def playback_chain(name: str, recording: Recording, mapping: Mapping, *, bound: float | None = None) -> PlaybackChain:
    """One playback entry from a recording and the chain that drove it."""
    stride = _stride(recording)
    error = recording.landmark_error.mean(axis=1)[::stride]
    return PlaybackChain(
        name,
        _tracks(recording, mapping),
        recording.fps / stride,
        error.tolist(),
        track(mapping.target, recording.reference[::stride]),
        bound,
        recording.motion,
    )


def _tracks(recording: Recording, mapping: Mapping) -> list[Track]:
    """Operator, intermediates and the simulated robot."""
    stride = _stride(recording)
    frames = recording.operator[::stride]
    tracks = [track(mapping.source, frames)]
    for link in list(getattr(mapping, "links", (mapping,)))[:-1]:
        frames = link(frames)
        tracks.append(track(link.target, frames))
    return [*tracks, track(mapping.target, recording.q[::stride])]


def _stride(recording: Recording) -> int:
    return max(1, round(recording.fps / _SHOWN_HZ))


def _liveliest(operator: Track) -> int:
    """The frame whose pose is farthest from the first one."""
    shape = operator.points if operator.points.size else operator.poses
    return int(np.abs(shape - shape[0]).sum(axis=(1, 2)).argmax())
