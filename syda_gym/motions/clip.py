"""What is moved: clips of one body, takes of several bodies, and paired frames of two bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MotionError, OptionError, nearest_name
from syda_gym.files import fingerprint

__all__ = ["PROTOCOLS", "MotionClip", "Motions", "PairedClip", "PairedMotions", "Take"]

PROTOCOLS = ("rand3", "twin3", "loao")
"""Ways to split a pair: random rows (the paper's, leaks), random rows with twins together, leave-one-action-out."""


@dataclass(frozen=True, eq=False)
class MotionClip:
    """A stretch of motion of one body.

    Attributes:
        body: who moves.
        frames: ``(N, F)`` in the body's own features.
        fps: frames per second.
        action: label of what is done.
        recording: name of the recording that it was cut from.
        mirrored: whether it is the left-right mirror image of a recorded clip.
        filled: ``(N, F)`` marks values that were gaps and have been filled; ``None`` if there were none.
        timestamps: ``(N,)`` [s] as recorded, increasing; ``None`` if frames are evenly spaced by ``fps``.
    """

    body: Embodiment
    frames: FloatArray
    fps: float
    action: str
    recording: str
    mirrored: bool = False
    filled: NDArray[np.bool_] | None = None
    timestamps: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", _checked(self.body, self.frames, self.recording))
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise MotionError(f"{self.recording}: fps must be positive, got {self.fps}")
        if self.filled is not None and self.filled.shape != self.frames.shape:
            raise MotionError(
                f"{self.recording}: filled has shape {self.filled.shape}, frames {self.frames.shape}; they must agree"
            )
        if self.timestamps is not None and np.shape(self.timestamps) != (len(self.frames),):
            raise MotionError(f"{self.recording}: {np.size(self.timestamps)} timestamps for {len(self.frames)} frames")

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return len(self) / self.fps


@dataclass(frozen=True, eq=False)
class PairedClip:
    """The same stretch of time performed by two bodies, frame by frame."""

    source: MotionClip
    target: MotionClip

    def __post_init__(self) -> None:
        if len(self.source) != len(self.target):
            raise MotionError(
                f"{self.source.recording}: {len(self.source)} frames of {self.source.body.name!r} against "
                f"{len(self.target)} of {self.target.body.name!r}; a paired clip needs equal lengths"
            )

    def __len__(self) -> int:
        return len(self.source)

    @property
    def name(self) -> str:
        """Recording name, with ``~mirror`` behind it for the mirrored half."""
        return self.source.recording + ("~mirror" if self.source.mirrored else "")


@dataclass(frozen=True, eq=False)
class Take:
    """One stretch of time performed by several bodies together, frame by frame.

    Attributes:
        recording: name, unique together with ``mirrored``.
        action: label of what is done.
        fps: frames per second.
        frames: body name to ``(N, F)``, all with the same N.
        mirrored: whether it is the left-right mirror of another take of the same recording.
        filled: body name to ``(N, F)``, true where a gap has been filled; bodies without gaps are left out.
        timestamps: ``(N,)`` [s] as recorded, where a recording has them; ``fps`` is then their mean rate.
    """

    recording: str
    action: str
    fps: float
    frames: Mapping[str, FloatArray]
    mirrored: bool = False
    filled: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    timestamps: FloatArray | None = None


class PairedMotions:
    """All frames of two bodies that were recorded together.

    Attributes:
        source_body: who is read.
        target_body: who is predicted.
        source: ``(N, F_source)``.
        target: ``(N, F_target)``.
        actions: ``(N,)`` action of each row.
        recordings: ``(N,)`` recording of each row.
        mirrored: ``(N,)`` whether the row belongs to the mirrored half.
        times: ``(N,)`` frame index within its clip.
        fps: frames per second.

    Raises:
        MotionError: unequal lengths, no rows, wrong shapes or values that are not finite.
    """

    def __init__(
        self,
        source_body: Embodiment,
        target_body: Embodiment,
        source: ArrayLike,
        target: ArrayLike,
        *,
        actions: Sequence[str] | NDArray[np.str_] | None = None,
        recordings: Sequence[str] | NDArray[np.str_] | None = None,
        mirrored: ArrayLike | None = None,
        times: ArrayLike | None = None,
        fps: float = 10.0,
    ) -> None:
        self.source_body = source_body
        self.target_body = target_body
        label = f"{source_body.name}>{target_body.name}"
        self.source = _checked(source_body, source, label)
        self.target = _checked(target_body, target, label)
        count = len(self.source)
        if count != len(self.target):
            raise MotionError(
                f"{label}: {count} source frames against {len(self.target)} target frames; pairs need equal lengths"
            )
        self.actions = _column(actions, np.array(["all"] * count), count, "actions", label).astype(np.str_)
        self.recordings = _column(recordings, self.actions, count, "recordings", label).astype(np.str_)
        self.mirrored = _column(mirrored, np.zeros(count), count, "mirrored", label).astype(bool)
        self.times = _column(times, np.arange(count), count, "times", label).astype(np.int64)
        self.fps = float(fps)

    @classmethod
    def from_clips(cls, clips: Sequence[PairedClip]) -> PairedMotions:
        """Joins paired clips of the same two bodies."""
        if not clips:
            raise MotionError("no paired clips; at least one is needed")
        first = clips[0]
        lengths = [len(clip) for clip in clips]
        return cls(
            first.source.body,
            first.target.body,
            np.concatenate([clip.source.frames for clip in clips]),
            np.concatenate([clip.target.frames for clip in clips]),
            actions=np.repeat([clip.source.action for clip in clips], lengths),
            recordings=np.repeat([clip.source.recording for clip in clips], lengths),
            mirrored=np.repeat([clip.source.mirrored for clip in clips], lengths),
            times=np.concatenate([np.arange(length) for length in lengths]),
            fps=first.source.fps,
        )

    def __len__(self) -> int:
        return len(self.source)

    def __repr__(self) -> str:
        return (
            f"PairedMotions({self.source_body.name!r} > {self.target_body.name!r}, {len(self)} frames, "
            f"{len(self.action_names)} actions)"
        )

    @property
    def action_names(self) -> tuple[str, ...]:
        """The distinct actions, sorted."""
        return tuple(str(name) for name in np.unique(self.actions))

    @cached_property
    def twins(self) -> NDArray[np.int64]:
        """``(N,)`` group of each row: a frame and its mirror image share a group."""
        keys = np.char.add(np.char.add(self.recordings, "@"), self.times.astype(np.str_))
        return np.unique(keys, return_inverse=True)[1].astype(np.int64)

    @property
    def fingerprint(self) -> str:
        """16 hex digits that identify the data."""
        return fingerprint(self.source.tobytes(), self.target.tobytes(), "|".join(self.actions.tolist()))

    def rows(self, which: ArrayLike) -> PairedMotions:
        """The same pair with only some rows (a boolean mask or indices)."""
        index = np.asarray(which)
        if (index.dtype == bool and not index.any()) or (index.dtype != bool and index.size == 0):
            raise MotionError(f"{self!r}: the selection leaves no rows")
        return PairedMotions(
            self.source_body,
            self.target_body,
            self.source[index],
            self.target[index],
            actions=self.actions[index],
            recordings=self.recordings[index],
            mirrored=self.mirrored[index],
            times=self.times[index],
            fps=self.fps,
        )

    def only_actions(self, names: Sequence[str]) -> PairedMotions:
        """Rows of the named actions.

        Raises:
            MotionError: an action does not occur.
        """
        for name in names:
            if name not in self.action_names:
                raise MotionError(f"{self!r} has no action {name!r}; {nearest_name(name, self.action_names)}")
        return self.rows(np.isin(self.actions, list(names)))

    def without_actions(self, names: Sequence[str]) -> PairedMotions:
        """Rows of all other actions; names that do not occur are ignored."""
        return self.rows(~np.isin(self.actions, list(names)))

    def reversed(self) -> PairedMotions:
        """The same rows with source and target swapped."""
        return PairedMotions(
            self.target_body,
            self.source_body,
            self.target,
            self.source,
            actions=self.actions,
            recordings=self.recordings,
            mirrored=self.mirrored,
            times=self.times,
            fps=self.fps,
        )

    def clips(self) -> tuple[PairedClip, ...]:
        """The rows as clips in time order, one per recording and half (never across the mirror seam)."""
        result = []
        for rows in self.clip_rows():
            source, target = (
                MotionClip(
                    body,
                    frames[rows],
                    self.fps,
                    str(self.actions[rows[0]]),
                    str(self.recordings[rows[0]]),
                    bool(self.mirrored[rows[0]]),
                )
                for body, frames in ((self.source_body, self.source), (self.target_body, self.target))
            )
            result.append(PairedClip(source, target))
        return tuple(result)

    def clip_rows(self) -> tuple[NDArray[np.intp], ...]:
        """Row indices of each clip, in time order within a clip and in order of first appearance."""
        keys = np.char.add(self.recordings, np.where(self.mirrored, "~", " "))
        names, first = np.unique(keys, return_index=True)
        groups = []
        for name in names[np.argsort(first)]:
            rows = np.flatnonzero(keys == name)
            groups.append(rows[np.argsort(self.times[rows], kind="stable")])
        return tuple(groups)

    def folds(self, protocol: str = "loao", *, seed: int = 0) -> Iterator[tuple[PairedMotions, PairedMotions]]:
        """Splits into training and test pairs.

        ``rand3`` is the paper's 3-fold cross-validation over random rows; it leaks, because every recording holds its
        own mirror image and neighbouring frames are near-duplicates. ``twin3`` keeps mirror twins together. ``loao``
        leaves one action out, with its mirror image and its repeats: the honest one.

        Args:
            protocol: one of ``PROTOCOLS``.
            seed: of the random splits.

        Yields:
            ``(train, test)``.

        Raises:
            OptionError: unknown protocol.
            MotionError: too few actions or rows to split.
        """
        for mask in self.fold_masks(protocol, seed=seed):
            yield self.rows(~mask), self.rows(mask)

    def fold_masks(self, protocol: str, *, seed: int = 0) -> list[NDArray[np.bool_]]:
        """The test rows of each fold of ``folds`` as boolean masks ``(N,)``."""
        if protocol == "loao":
            if len(self.action_names) < 2:
                raise MotionError(f"{self!r}: leave-one-action-out needs at least two actions")
            return [self.actions == name for name in self.action_names]
        if protocol == "rand3":
            groups = np.arange(len(self))
        elif protocol == "twin3":
            groups = self.twins
        else:
            raise OptionError(f"unknown protocol {protocol!r}; {nearest_name(protocol, PROTOCOLS)}")
        distinct = np.unique(groups)
        if len(distinct) < 3:
            raise MotionError(f"{self!r}: three folds need at least three frames")
        order = np.random.default_rng(seed).permutation(distinct)
        return [np.isin(groups, order[part::3]) for part in range(3)]


@dataclass(frozen=True, eq=False)
class Motions:
    """A dataset: takes of several bodies.

    Attributes:
        name: where it comes from, for reports.
        takes: the recordings.
        bodies: body name to embodiment.
        families: action to its family (reach, wave, ...), where known.
        synthetic: whether the motions were generated rather than recorded.
        notes: what a reader found out about a recording: units, axes, gaps and how they were filled.
    """

    name: str
    takes: tuple[Take, ...]
    bodies: Mapping[str, Embodiment]
    families: Mapping[str, str] = field(default_factory=dict)
    synthetic: bool = False
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.takes:
            raise MotionError(f"{self.name}: no takes; expected at least one recording")
        for take in self.takes:
            lengths = {body: len(frames) for body, frames in take.frames.items()}
            if len(set(lengths.values())) > 1:
                raise MotionError(f"{self.name}: take {take.recording!r} has unequal lengths {lengths}")
            for body in take.frames:
                if body not in self.bodies:
                    raise MotionError(f"{self.name}: take {take.recording!r} has frames of unknown body {body!r}")

    def __repr__(self) -> str:
        return f"Motions({self.name!r}, {len(self.takes)} takes of {', '.join(self.bodies)})"

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Unordered pairs of bodies that share a take, each sorted by the order of ``bodies``."""
        order = {name: index for index, name in enumerate(self.bodies)}
        found = {(a, b) for take in self.takes for a in take.frames for b in take.frames if order[a] < order[b]}
        return tuple(sorted(found, key=lambda pair: (order[pair[0]], order[pair[1]])))

    def pair(self, source: str, target: str) -> PairedMotions:
        """All frames in which both bodies were recorded together.

        Raises:
            MotionError: unknown body, or no take has both.
        """
        for name in (source, target):
            if name not in self.bodies:
                raise MotionError(f"{self.name} has no body {name!r}; {nearest_name(name, self.bodies)}")
        clips = [
            PairedClip(self._clip(take, source), self._clip(take, target))
            for take in self.takes
            if source in take.frames and target in take.frames
        ]
        if not clips or source == target:
            pairs = ", ".join(f"{a}-{b}" for a, b in self.pairs)
            raise MotionError(f"{self.name}: {source!r} and {target!r} were never recorded together; pairs: {pairs}")
        return PairedMotions.from_clips(clips)

    def clips(self, body: str) -> tuple[MotionClip, ...]:
        """Every clip of one body."""
        found = tuple(self._clip(take, body) for take in self.takes if body in take.frames)
        if not found:
            raise MotionError(f"{self.name} has no clip of {body!r}; {nearest_name(body, self.bodies)}")
        return found

    def _clip(self, take: Take, body: str) -> MotionClip:
        return MotionClip(
            self.bodies[body],
            take.frames[body],
            take.fps,
            take.action,
            take.recording,
            take.mirrored,
            take.filled.get(body),
            take.timestamps,
        )


def _checked(body: Embodiment, frames: ArrayLike, where: str) -> FloatArray:
    try:
        array = body.check(frames)
    except ValueError as error:
        raise MotionError(f"{where}: {error}") from error
    if len(array) == 0:
        raise MotionError(f"{where}: no frames of {body.name!r}")
    return array


def _column(given: object, default: NDArray[np.generic], count: int, what: str, label: str) -> NDArray[np.generic]:
    values: NDArray[np.generic] = default if given is None else np.asarray(given)
    if values.shape != (count,):
        raise MotionError(f"{label}: {what} must have one entry per frame ({count}), got shape {values.shape}")
    return values
