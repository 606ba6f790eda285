"""Frames in time, and what was not tracked filled between its neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import Said
from syda_gym.motions.readers.times import seconds

__all__ = ["MAX_FRAMES", "Clock", "filled", "frame_clock", "frame_rate"]

MAX_FRAMES = 1_000_000
_LARGEST = 1e9  # in the file's unit; beyond it lengths lose their precision, and no camera sees so far
_LEAST_TRACKED = 0.3
_COARSE = 0.3  # share of frames that repeat a stamp from which stamps are coarser than frames
_SLOWEST, _FASTEST = 0.1, 1_500.0  # frames per second
_ASSUMED = 30.0
_HELD = 0.15  # s in which a joint is bit for bit in one place, from which that is said
_SIGNS = 2  # different values by which a tool may say that a joint was lost


class Clock:
    """When the frames of a recording are.

    Attributes:
        times: ``(M,)`` [s], increasing.
        keep: ``(M,)`` which frames of the recording they are.
        stamped: whether they stood in the file.
    """

    def __init__(self, times: FloatArray, keep: NDArray[np.intp], stamped: bool) -> None:
        self.times = times
        self.keep = keep
        self.stamped = stamped


def frame_clock(recording: Recording, said: Said) -> Clock:
    """Times [s] and which frames to keep.

    Raises:
        MotionError: fewer than two frames, too many, or times that run backward or stand still.
    """
    count = len(next(iter(recording.joints.values()))) if recording.joints else 0
    if count < 2:
        raise MotionError(f"{recording.path}: {count} frames; expected at least two")
    if count > MAX_FRAMES:
        raise MotionError(f"{recording.path}: {count} frames; at most {MAX_FRAMES} are read. Cut it into pieces")
    every = np.arange(count)
    _in_order(recording)
    if recording.stamps is not None:
        times, doubt = seconds(recording.stamps)
        if times is None:
            return _counted(recording, said, recording.stamps.values)
        if doubt is not None and said.fps is not None:
            recording.notes.append(f"{recording.stamps.name} is doubtful; {said.fps:g} frames per second, as was said")
            return Clock(every / said.fps, every, False)
        if doubt is not None:
            recording.doubt(doubt)
        return _stamped(recording, times)
    return Clock(every / (recording.fps or said.fps or _ASSUMED), every, False)


def _in_order(recording: Recording) -> None:
    """Sorts frames that stand in another order than their times, as threads write them.

    Several recordings in one file, whose times run backward too, are left as they are: sorted they would jump to and
    fro between one and the other.
    """
    if recording.stamps is None:
        return
    values = np.asarray(recording.stamps.values, dtype=np.float64)
    if not np.isfinite(values).all() or not (np.diff(values) < 0).any() or len(np.unique(values)) < len(values):
        return
    order = np.argsort(values, kind="stable")
    sorted_joints = {name: positions[order] for name, positions in recording.joints.items()}
    if _path(sorted_joints) > _path(recording.joints):
        return
    moved = int((order != np.arange(len(order))).sum())
    recording.joints = sorted_joints
    recording.stamps = replace(recording.stamps, values=values[order])
    if recording.lines is not None:
        recording.lines = recording.lines[order]
    recording.doubt(f"{moved} frames are not in the order of their {recording.stamps.name}; they were sorted by it")


def _path(joints: Mapping[str, FloatArray]) -> float:
    """How far all joints move from frame to frame, added up."""
    return float(sum(np.nansum(np.linalg.norm(np.diff(positions, axis=0), axis=1)) for positions in joints.values()))


def frame_rate(recording: Recording, clock: Clock, said: Said) -> float:
    """Mean frames per second, with notes about what is missing.

    Raises:
        MotionError: a rate at which nobody is recorded.
    """
    times = clock.times
    if not clock.stamped and recording.fps is None and said.fps is None:
        recording.notes.append("no timestamps and no frame rate in the file: 30 frames per second assumed")
    fps = float((len(times) - 1) / (times[-1] - times[0]))
    if not _SLOWEST <= fps <= _FASTEST:
        raise MotionError(
            f"{recording.path}: {fps:.3g} frames per second by its times; expected {_SLOWEST} to {_FASTEST:g}. Say "
            f"the rate: --fps"
        )
    longest = float(np.diff(times).max())
    if longest > 3.0 / fps:
        recording.notes.append(
            f"frames are missing: the longest step is {longest:.3f} s at {fps:.1f} frames per second"
        )
    return fps


def _counted(recording: Recording, said: Said, numbers: FloatArray) -> Clock:
    """The stamps count frames: where numbers are left out, frames were."""
    known = np.isfinite(numbers)
    if not known.all() or (np.diff(numbers) <= 0).any():
        numbers = np.arange(len(numbers), dtype=np.float64)
    return Clock((numbers - numbers[0]) / (recording.fps or said.fps or _ASSUMED), np.arange(len(numbers)), False)


def _stamped(recording: Recording, times: FloatArray) -> Clock:
    bad = np.flatnonzero(~np.isfinite(times))
    if len(bad):
        raise MotionError(f"{recording.path}, {recording.where(int(bad[0]))}: the timestamp is no number")
    steps = np.diff(times)
    if (steps < 0).any():
        frame = int(np.flatnonzero(steps < 0)[0]) + 1
        raise MotionError(
            f"{recording.path}, {recording.where(frame)}: time runs backward, {times[frame - 1]:g} s to "
            f"{times[frame]:g} s; if "
            "several recordings follow one another in the file, cut it"
        )
    if not (steps > 0).any():
        raise MotionError(f"{recording.path}: all frames have the same timestamp {times[0]} s")
    repeats = steps == 0
    if repeats.mean() > _COARSE and not _same_frames(recording, repeats):
        spread = _spread(times)
        recording.doubt(
            f"times are coarser than frames: {len(times)} frames share {len(np.unique(times))} timestamps; spread "
            f"evenly between "
            "them"
        )
        return Clock(spread, np.arange(len(times)), True)
    keep = np.flatnonzero(np.r_[~repeats, True])
    if len(keep) < len(times):
        text = f"{len(times) - len(keep)} frames repeat a timestamp and were dropped"
        if len(keep) < 0.5 * len(times):
            recording.doubt(text)
        else:
            recording.notes.append(text)
    return Clock(times[keep], keep, True)


def _same_frames(recording: Recording, repeats: NDArray[np.bool_]) -> bool:
    """Whether frames that repeat a timestamp are the same frame, written twice."""
    moved = np.zeros(len(repeats), dtype=bool)
    for values in recording.joints.values():
        moved |= (np.nan_to_num(np.diff(values, axis=0)) != 0.0).any(axis=1)
    return bool((~moved[repeats]).mean() > 0.9)


def _spread(times: FloatArray) -> FloatArray:
    """Frames of one stamp spread over the time until the next one; the last ones at the mean rate before."""
    stamps, first, counts = np.unique(times, return_index=True, return_counts=True)
    step = float((stamps[-1] - stamps[0]) / max(1, first[-1]))
    ends = np.r_[stamps[1:], stamps[-1] + counts[-1] * step]
    return np.concatenate(
        [
            start + (end - start) * np.arange(count) / count
            for start, end, count in zip(stamps, ends, counts, strict=True)
        ]
    )


def filled(
    recording: Recording, clock: Clock, needed: set[str]
) -> tuple[dict[str, FloatArray], dict[str, NDArray[np.bool_]]]:
    """Positions without gaps, and where the gaps of each joint were.

    Args:
        recording: positions as read.
        clock: which frames are kept.
        needed: joints without which there is no arm.

    Raises:
        MotionError: a needed joint is hardly ever tracked, or a coordinate is absurd.
    """
    joints: dict[str, FloatArray] = {}
    gaps: dict[str, NDArray[np.bool_]] = {}
    for name, raw in _without_placeholders(recording).items():
        values = raw[clock.keep]
        if np.isinf(values).any():
            frame = int(clock.keep[np.flatnonzero(np.isinf(values).any(axis=1))[0]])
            raise MotionError(f"{recording.path}, {recording.where(frame)}: a coordinate is infinite")
        huge = np.flatnonzero((np.abs(values) > _LARGEST).any(axis=1))
        if len(huge):
            place = recording.where(int(clock.keep[huge[0]]))
            raise MotionError(f"{recording.path}, {place}: {name} has a coordinate beyond {_LARGEST:.0e}")
        lost: NDArray[np.bool_] = np.asarray(~np.isfinite(values).all(axis=1))
        tracked = 1.0 - float(lost.mean())
        if tracked < _LEAST_TRACKED:
            if name in needed:
                first = recording.where(int(clock.keep[np.flatnonzero(lost)[0]]))
                raise MotionError(
                    f"{recording.path}: {name} is tracked in {100 * tracked:.0f} % of the frames only (first gap at "
                    f"{first}); at least {100 * _LEAST_TRACKED:.0f} % are needed"
                )
            continue
        if name in needed and not name.endswith("Shoulder"):
            _say_held(recording, name, values, recording.joints[name[0] + "Shoulder"][clock.keep], clock.times)
        gaps[name] = lost
        joints[name] = _interpolated(recording, name, values, lost, clock.times, name in needed)
    return joints, gaps


def _say_held(recording: Recording, name: str, values: FloatArray, shoulder: FloatArray, times: FloatArray) -> None:
    """Says that a tool held a joint that it had lost: bit for bit in one place, while its shoulder moves."""
    still, resting = ((points[1:] == points[:-1]).all(axis=1) for points in (values, shoulder))
    held = np.r_[False, still & ~resting]
    if not held.any():
        return
    longest = _longest(held, times)
    if longest < _HELD:
        return
    text = (
        f"{name} does not move at all for {longest:.2f} s though its shoulder does: it seems to have been lost and "
        "held in place"
    )
    recording.doubt(text) if longest > 1.0 else recording.notes.append(text)


def _without_placeholders(recording: Recording) -> Mapping[str, FloatArray]:
    """Positions without those that stand for a lost joint: zeros, -1 or -9999 in all three coordinates.

    Nobody's joint has three equal coordinates again and again; where it has in every frame, it is the origin.
    """
    equal = {
        name: (values[:, 0] == values[:, 1]) & (values[:, 1] == values[:, 2])
        for name, values in recording.joints.items()
    }
    equal = {name: rows for name, rows in equal.items() if rows.any() and not rows.all()}
    signs = {float(value) for name, rows in equal.items() for value in np.unique(recording.joints[name][rows, 0])}
    if not signs or len(signs) > _SIGNS:
        return recording.joints
    count = sum(int(rows.sum()) for rows in equal.values())
    recording.notes.append(
        f"x = y = z = {', '.join(f'{sign:g}' for sign in sorted(signs))} in {count} places ({', '.join(equal)}): no "
        "place, but a sign that the joint was lost; taken as gaps"
    )
    return {
        name: np.where(equal[name][:, None], np.nan, values) if name in equal else values
        for name, values in recording.joints.items()
    }


def _interpolated(
    recording: Recording, name: str, values: FloatArray, lost: NDArray[np.bool_], times: FloatArray, needed: bool
) -> FloatArray:
    if not lost.any():
        return values
    known = np.flatnonzero(~lost)
    if needed:
        longest = _longest(lost, times)
        recording.notes.append(
            f"{name}: {int(lost.sum())} of {len(lost)} frames untracked, filled by linear interpolation in "
            f"time (longest gap {longest:.2f} s)"
        )
        if longest > 1.0:
            recording.doubt(f"{name} is untracked for {longest:.1f} s; what is filled in there is a guess")
    return np.stack([np.interp(times, times[known], values[known, axis]) for axis in range(3)], axis=1)


def _longest(lost: NDArray[np.bool_], times: FloatArray) -> float:
    edges = np.diff(np.r_[0, lost.astype(int), 0])
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    last = len(times) - 1
    spans = times[np.minimum(stops, last)] - times[np.maximum(starts - 1, 0)]
    return float(spans.max())
