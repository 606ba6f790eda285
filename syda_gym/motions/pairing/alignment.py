"""Time alignment of two recordings of one action, and how well they fit together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MotionError, OptionError
from syda_gym.motions.clip import MotionClip, Motions, PairedMotions, Take
from syda_gym.motions.pairing.conform import limb_directions_of
from syda_gym.motions.resampling import resampled

__all__ = ["ActionQuality", "Alignment", "align", "pair_quality", "pair_recordings"]

GOOD, FAIR = 0.85, 0.6
"""Correlation from which a pair counts as good, and as fair; below it the recordings hardly show one action."""

_LEAST_OVERLAP = 0.5


@dataclass(frozen=True)
class Alignment:
    """How two recordings fit in time.

    Attributes:
        shift: frames by which the source lags behind the target (negative: it runs ahead).
        lag: the same in seconds, to a fraction of a frame.
        correlation: of the limb directions at that shift, about their means, -1 to 1.
        unshifted: the correlation without any shift.
    """

    shift: int
    lag: float
    correlation: float
    unshifted: float


@dataclass(frozen=True)
class ActionQuality:
    """How well the recordings of one action pair up.

    Attributes:
        action: its label.
        recordings: how many.
        frames: paired frames.
        lag: median lag of the source behind the target [s].
        correlation: median over the recordings, at the best shift.
        amplitude: how far the source's limbs move relative to the target's, median.
        jitter: high-frequency share of the source's motion (third differences against first), median.
        verdict: ``"good"``, ``"fair"`` or ``"poor"``.
    """

    action: str
    recordings: int
    frames: int
    lag: float
    correlation: float
    amplitude: float
    jitter: float
    verdict: str


def align(
    source: Embodiment, source_frames: FloatArray, target: Embodiment, target_frames: FloatArray, *, fps: float,
    max_lag: float = 1.0,
) -> Alignment:  # fmt: skip
    """Finds the shift in time at which two bodies' limbs point most alike.

    Args:
        source: who follows, for example the human.
        source_frames: ``(N, F)``.
        target: who leads, for example the robot.
        target_frames: ``(M, G)``, at the same frame rate; N and M may differ.
        fps: frames per second of both.
        max_lag: largest shift either way [s].

    Returns:
        The best shift of those that leave at least half of the shorter recording.

    Raises:
        MotionError: the bodies share no arm, or a recording is shorter than four frames.
        OptionError: ``fps`` or ``max_lag`` is not positive.
    """
    if not (np.isfinite(fps) and fps > 0 and np.isfinite(max_lag) and max_lag > 0):
        raise OptionError(f"fps and max_lag must be positive, got {fps} and {max_lag}")
    sides = [side for side in source.sides if side in target.sides]
    if not sides:
        raise MotionError(f"{source.name!r} and {target.name!r} have no arm in common; they cannot be aligned")
    a, b = (
        limb_directions_of(body, frames)[:, [body.sides.index(side) for side in sides]].reshape(len(frames), -1)
        for body, frames in ((source, source_frames), (target, target_frames))
    )
    if min(len(a), len(b)) < 4:
        raise MotionError(f"{len(a)} and {len(b)} frames are too few to align; at least 4 are needed")
    least = max(4, int(_LEAST_OVERLAP * min(len(a), len(b))))
    reach = round(max_lag * fps)
    shifts = [s for s in range(-reach, reach + 1) if min(len(a) - max(s, 0), len(b) - max(-s, 0)) >= least]
    scores = np.array([_correlation(*_overlap(a, b, shift)) for shift in shifts])
    best = int(np.argmax(scores))
    peak = float(shifts[best])
    if 0 < best < len(shifts) - 1:
        left, middle, right = scores[best - 1 : best + 2]
        curve = left - 2.0 * middle + right
        if curve < -1e-12:
            peak += 0.5 * float((left - right) / curve)
    return Alignment(shifts[best], peak / fps, float(scores[best]), float(scores[shifts.index(0)]))


def pair_recordings(
    operator: MotionClip, robot: MotionClip, *, fps: float | None = None, max_lag: float = 1.0, same_clock: bool = False
) -> tuple[Take, Alignment]:
    """Pairs an operator's recording with what the robot (or another body) did at the time.

    Args:
        operator: who mimicked, or was mimicked.
        robot: the other body.
        fps: frame rate of the pair; by default the lower one of both.
        max_lag: largest shift either way [s].
        same_clock: both have timestamps of one clock, from which the first alignment is taken.

    Returns:
        A take with equal lengths, shifted by the lag that was found and cut to the overlap; and the alignment.

    Raises:
        MotionError: no overlap in time, no common arm, or both have one name.
    """
    if operator.body.name == robot.body.name:
        raise MotionError(f"both recordings are of {robot.body.name!r}; a pair needs two bodies")
    rate = fps if fps is not None else min(operator.fps, robot.fps)
    start = 0.0
    if same_clock:
        if operator.timestamps is None or robot.timestamps is None:
            raise MotionError("same_clock needs timestamps in both recordings")
        start = float(operator.timestamps[0] - robot.timestamps[0])
    first, second = (_at_rate(clip, rate) for clip in (operator, robot))
    skip = round(start * rate)  # frames by which the operator's recording starts later
    if skip >= len(second.frames[robot.body.name]) or -skip >= len(first.frames[operator.body.name]):
        raise MotionError(
            f"{operator.recording} and {robot.recording} do not overlap: one starts {abs(start):.1f} s after the other"
        )
    a = first.frames[operator.body.name][max(-skip, 0) :]
    b = second.frames[robot.body.name][max(skip, 0) :]
    found = align(operator.body, a, robot.body, b, fps=rate, max_lag=max_lag)
    marks = first.filled.get(operator.body.name)
    cut, other = _overlap(a, b, found.shift)
    filled = {}
    if marks is not None:
        kept = _overlap(marks[max(-skip, 0) :].astype(float), b, found.shift)[0] > 0.5
        filled = {operator.body.name: kept} if kept.any() else {}
    take = Take(
        f"{operator.recording}+{robot.recording}",
        robot.action,
        rate,
        {operator.body.name: cut, robot.body.name: other},
        filled=filled,
    )
    return take, found


def pair_quality(pair: PairedMotions, *, max_lag: float = 1.0) -> tuple[ActionQuality, ...]:
    """Judges every action of a pair: does the source do what the target does?

    Args:
        pair: two bodies.
        max_lag: largest shift considered [s].

    Returns:
        One entry per action, in order of name.
    """
    clips: dict[str, list[tuple[Alignment, float, float, int]]] = {}
    for clip in pair.clips():
        if len(clip) < 4:
            continue
        found = align(
            pair.source_body, clip.source.frames, pair.target_body, clip.target.frames, fps=pair.fps, max_lag=max_lag
        )
        a, b = (limb_directions_of(part.body, part.frames) for part in (clip.source, clip.target))
        amplitude = float(_spread(a) / max(_spread(b), 1e-9))
        clips.setdefault(clip.source.action, []).append((found, amplitude, _jitter(a), len(clip)))
    return tuple(_judged(action, entries) for action, entries in sorted(clips.items()))


def _judged(action: str, entries: Sequence[tuple[Alignment, float, float, int]]) -> ActionQuality:
    correlation = float(np.median([found.correlation for found, *_ in entries]))
    verdict = "good" if correlation >= GOOD else "fair" if correlation >= FAIR else "poor"
    return ActionQuality(
        action=action,
        recordings=len(entries),
        frames=sum(count for *_, count in entries),
        lag=float(np.median([found.lag for found, *_ in entries])),
        correlation=correlation,
        amplitude=float(np.median([amplitude for _, amplitude, _, _ in entries])),
        jitter=float(np.median([jitter for _, _, jitter, _ in entries])),
        verdict=verdict,
    )


def _overlap(a: FloatArray, b: FloatArray, shift: int) -> tuple[FloatArray, FloatArray]:
    """Both where they overlap if ``a`` lags by ``shift`` frames."""
    first, second = a[max(shift, 0) :], b[max(-shift, 0) :]
    count = min(len(first), len(second))
    return first[:count], second[:count]


def _correlation(a: FloatArray, b: FloatArray) -> float:
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    norm = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / norm if norm > 1e-12 else 0.0


def _spread(limbs: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum((limbs - limbs.mean(axis=0)) ** 2, axis=-1))))


def _jitter(limbs: FloatArray) -> float:
    if len(limbs) < 5:
        return 0.0
    third = np.linalg.norm(np.diff(limbs, n=3, axis=0), axis=-1).mean()
    return float(third / max(np.linalg.norm(np.diff(limbs, axis=0), axis=-1).mean(), 1e-9))


def _at_rate(clip: MotionClip, fps: float) -> Take:
    name = clip.body.name
    filled = {} if clip.filled is None else {name: clip.filled}
    take = Take(clip.recording, clip.action, clip.fps, {name: clip.frames}, clip.mirrored, filled, clip.timestamps)
    return resampled(Motions(clip.recording, (take,), {name: clip.body}), fps).takes[0]
