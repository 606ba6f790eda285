"""What a file of motions holds, for people: bodies, actions, rates, gaps, units and axes, and a picture."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions
from syda_gym.motions.stick_figures import draw_clips

__all__ = ["BodyInfo", "MotionsInfo", "describe"]


@dataclass(frozen=True)
class BodyInfo:
    """One body of a data set.

    Attributes:
        name: its name.
        kind: ``"human"`` or ``"robot"``.
        sides: arms.
        features: numbers per frame.
        height: stature [m].
        upper_arm: nominal length [m], mean of the arms.
        forearm: nominal length [m], mean of the arms.
        takes: how many takes it is in.
        frames: how many frames.
        filled: share of its values that were gaps and have been filled.
        fastest: highest speed of a wrist between frames without gaps [m/s].
    """

    name: str
    kind: str
    sides: tuple[str, ...]
    features: int
    height: float
    upper_arm: float
    forearm: float
    takes: int
    frames: int
    filled: float
    fastest: float


@dataclass(frozen=True)
class MotionsInfo:
    """A summary of motions.

    Attributes:
        name: of the data set, with its format.
        synthetic: generated, not recorded.
        takes: number of takes.
        actions: distinct actions, sorted.
        families: distinct families, sorted.
        frames: frames of all takes.
        seconds: duration of all takes [s].
        fps: lowest and highest frame rate.
        timestamps: whether the recordings carry their own times.
        bodies: every body.
        pairs: pairs of bodies that were recorded together, with their paired frames.
        notes: what the reader found out: units, axes, gaps.
        picture: PNG that was drawn, if one was asked for.
    """

    name: str
    synthetic: bool
    takes: int
    actions: tuple[str, ...]
    families: tuple[str, ...]
    frames: int
    seconds: float
    fps: tuple[float, float]
    timestamps: bool
    bodies: tuple[BodyInfo, ...]
    pairs: tuple[tuple[str, str, int], ...]
    notes: tuple[str, ...]
    picture: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """The summary as JSON-able values."""
        return asdict(self)


def describe(
    motions: str | os.PathLike[str] | Motions, *, picture: str | os.PathLike[str] | None = None, clips: int = 3
) -> MotionsInfo:
    """Summarises motions.

    Args:
        motions: motions, or what ``load_motions`` takes.
        picture: PNG file to draw the first clips of every body into.
        clips: how many takes to draw.

    Returns:
        The summary.

    Raises:
        MotionError: the file cannot be read.
        StorageError: the picture cannot be written.
    """
    loaded = load_motions(motions)
    lengths = [len(next(iter(take.frames.values()))) for take in loaded.takes]
    rates = [take.fps for take in loaded.takes]
    if picture is not None:
        _draw(loaded, Path(picture), clips)
    return MotionsInfo(
        name=loaded.name,
        synthetic=loaded.synthetic,
        takes=len(loaded.takes),
        actions=tuple(sorted({take.action for take in loaded.takes})),
        families=tuple(sorted(set(loaded.families.values()))),
        frames=sum(lengths),
        seconds=float(sum(length / rate for length, rate in zip(lengths, rates, strict=True))),
        fps=(min(rates), max(rates)),
        timestamps=any(take.timestamps is not None for take in loaded.takes),
        bodies=tuple(_body(loaded, name) for name in loaded.bodies if any(name in t.frames for t in loaded.takes)),
        pairs=tuple((a, b, _paired(loaded, a, b)) for a, b in loaded.pairs),
        notes=loaded.notes,
        picture=None if picture is None else str(picture),
    )


def _body(motions: Motions, name: str) -> BodyInfo:
    clips = motions.clips(name)
    body = clips[0].body
    lengths = body.arm_lengths.mean(axis=0)
    total = sum(clip.frames.size for clip in clips)
    filled = sum(int(clip.filled.sum()) for clip in clips if clip.filled is not None)
    fastest = 0.0
    for clip in clips:
        steps = np.linalg.norm(np.diff(body.landmarks(clip.frames)[:, 1::2], axis=0), axis=-1) * clip.fps
        if clip.filled is not None:  # the jump at the end of a gap is no speed
            gap = np.flatnonzero(clip.filled.any(axis=1))
            steps = np.delete(steps, np.concatenate([gap, gap - 1]).clip(0, max(0, len(steps) - 1)), axis=0)
        fastest = max(fastest, float(steps.max(initial=0.0)))
    return BodyInfo(
        name, body.kind, tuple(body.sides), body.n_features, body.height, float(lengths[0]), float(lengths[1]),
        len(clips), sum(len(clip) for clip in clips), filled / total, fastest,
    )  # fmt: skip


def _paired(motions: Motions, a: str, b: str) -> int:
    return sum(len(take.frames[a]) for take in motions.takes if a in take.frames and b in take.frames)


def _draw(motions: Motions, path: Path, count: int) -> None:
    chosen = []
    # Takes from all over the data set, not the first action three times.
    places = np.unique(np.linspace(0, len(motions.takes) - 1, max(1, count)).round().astype(int))
    for place in places:
        take = motions.takes[place]
        for name in list(take.frames)[:3]:
            chosen += [c for c in motions.clips(name) if (c.recording, c.mirrored) == (take.recording, take.mirrored)][
                :1
            ]
    draw_clips(
        chosen,
        path,
        title=motions.name + (" (synthetic)" if motions.synthetic and "synthetic" not in motions.name else ""),
    )
