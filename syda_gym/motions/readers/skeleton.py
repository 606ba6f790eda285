"""From joint positions as a tool has stored them to motions: gaps, units, axes, heading, proportions.

Whatever the source, the result is one human, always seen from its own body: origin below the middle of the shoulders,
x to the subject's right, y up, z backward (as in the paper's recordings), metres. What was found out is said in
``Motions.notes``; what changes the numbers (other units than metres) is said aloud as a ``MotionWarning`` too.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from syda_gym.embodiments.embodiment import FloatArray, Side
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.errors import EmbodimentError, MotionError
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.readers.joint_names import missing_hint

__all__ = ["MotionWarning", "Recording", "motions_from"]

_ARM = ("Shoulder", "Elbow", "Hand")
_UNITS = (
    ("metres", 1.0, 0.25, 0.95),
    ("centimetres", 0.01, 0.25, 0.95),
    ("millimetres", 0.001, 0.25, 0.95),
    ("inches", 0.0254, 0.40, 0.75),
    ("CMU units of 0.45 inch", 0.0254 / 0.45, 0.40, 0.75),
)
_UNKNOWN_ARM = 0.58  # m; an adult's arm, for files in units of their own
_LEAST_TRACKED = 0.3
_HEADING_SECONDS = 0.5
_STATURE_PER_ARM = 1.0 / 0.332
MAX_FRAMES = 1_000_000
_LARGEST = 1e9  # in the file's unit; beyond it lengths lose their precision, and no camera sees so far


class MotionWarning(UserWarning):
    """A recording was understood, but not as it stands: other units, long gaps, left and right look swapped."""


@dataclass
class Recording:
    """Joint positions of one person as they stand in a file.

    Attributes:
        path: the file.
        format: name of the format.
        joints: canonical joint to ``(N, 3)`` in the file's units and axes; NaN where a joint was not tracked.
        fps: frames per second, where the file says so.
        timestamps: ``(N,)`` [s], where the file has them.
        lines: ``(N,)`` line of the file for each frame, for messages.
        up: the axis that points up if trunk and head are not there to tell, for example ``(0, 1, 0)``.
        names: the joint names of the file, for messages.
        notes: what the reader already found out.
    """

    path: Path
    format: str
    joints: Mapping[str, FloatArray]
    fps: float | None = None
    timestamps: FloatArray | None = None
    lines: NDArray[np.int64] | None = None
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    names: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)

    def where(self, frame: int) -> str:
        """How a message calls a frame: by line if the format has lines."""
        return f"line {self.lines[frame]}" if self.lines is not None else f"frame {frame}"


def motions_from(recording: Recording, body: str = "operator") -> Motions:
    """Turns a recording into motions of one human.

    Untracked positions are filled by linear interpolation in time between the nearest tracked ones (held at the ends)
    and flagged in ``filled``. The unit is found by the arm's length, up by the trunk, the heading by the line through
    the shoulders, smoothed over half a second.

    Args:
        recording: positions as read.
        body: name of the human.

    Returns:
        Motions with one take, whose action is the file's name.

    Raises:
        MotionError: no complete arm, joints that are hardly ever tracked, arms of no length, times that run backward.
    """
    notes = recording.notes
    sides = _sides(recording)
    times, keep = _times(recording)
    joints, gaps = _filled(recording, times, keep, sides)
    scale = _scale(recording, joints, sides)
    joints = {name: scale * values for name, values in joints.items()}
    fps = _rate(recording, times)
    basis = _basis(recording, joints, sides, fps)
    _check_forward(recording, joints, basis)
    points = np.stack([np.stack([joints[s[0].upper() + p] for p in _ARM], axis=1) for s in sides], axis=1)
    human = _human(recording.path, body, points, joints, basis, sides)
    origin = _middle(joints, points, basis, human)
    local = np.einsum("nij,nakj->naki", basis, points - origin[:, None, None])
    frames = human.frames_from_points(local)
    marks = np.concatenate([np.repeat(gaps[s[0].upper() + p][:, None], 3, axis=1) for s in sides for p in _ARM], axis=1)
    stamps = None if recording.timestamps is None else times
    take = Take(
        recording.path.stem, recording.path.stem, fps, {body: frames}, filled={body: marks} if marks.any() else {},
        timestamps=stamps,
    )  # fmt: skip
    return Motions(f"{recording.format}:{recording.path.name}", (take,), {body: human}, notes=tuple(notes))


def _sides(recording: Recording) -> tuple[Side, ...]:
    sides: list[Side] = []
    for side in ("left", "right"):
        wanted = [side[0].upper() + part for part in _ARM]
        missing = [joint for joint in wanted if joint not in recording.joints]
        if not missing:
            sides.append(side)
        elif len(missing) < 3:
            raise MotionError(
                f"{recording.path}: joint {missing[0]} is missing; {missing_hint(missing[0], recording.names)}"
            )
    if not sides:
        raise MotionError(f"{recording.path}: no arm found; LShoulder: {missing_hint('LShoulder', recording.names)}")
    if len(sides) == 1:
        recording.notes.append(f"only the {sides[0]} arm is in the file")
    return tuple(sides)


def _times(recording: Recording) -> tuple[FloatArray, NDArray[np.intp]]:
    """Times [s] and which frames to keep: of several frames with one timestamp the last."""
    count = len(next(iter(recording.joints.values())))
    if count < 2:
        raise MotionError(f"{recording.path}: {count} frames; expected at least two")
    if count > MAX_FRAMES:
        raise MotionError(f"{recording.path}: {count} frames; at most {MAX_FRAMES} are read. Cut it into pieces")
    if recording.timestamps is None:
        return np.arange(count) / (recording.fps or 30.0), np.arange(count)
    times = np.asarray(recording.timestamps, dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(times))
    if len(bad):
        raise MotionError(f"{recording.path}, {recording.where(int(bad[0]))}: the timestamp is no number")
    steps = np.diff(times)
    if (steps < 0).any():
        frame = int(np.flatnonzero(steps < 0)[0]) + 1
        raise MotionError(
            f"{recording.path}, {recording.where(frame)}: time runs backward, {times[frame - 1]} s to {times[frame]} s"
        )
    keep = np.flatnonzero(np.r_[steps > 0, True])
    if len(keep) < count:
        recording.notes.append(f"{count - len(keep)} frames repeat a timestamp and were dropped")
    if len(keep) < 2:
        raise MotionError(f"{recording.path}: all frames have the same timestamp {times[0]} s")
    return times[keep], keep


def _rate(recording: Recording, times: FloatArray) -> float:
    if recording.timestamps is None and recording.fps is None:
        recording.notes.append("no timestamps and no frame rate in the file: 30 frames per second assumed")
    fps = float((len(times) - 1) / (times[-1] - times[0]))
    if not 0.1 <= fps <= 10_000.0:
        raise MotionError(f"{recording.path}: {fps:.3g} frames per second by its timestamps; are they in seconds?")
    longest = float(np.diff(times).max())
    if longest > 3.0 / fps:
        recording.notes.append(
            f"frames are missing: the longest step is {longest:.3f} s at {fps:.1f} frames per second"
        )
    return fps


def _filled(
    recording: Recording, times: FloatArray, keep: NDArray[np.intp], sides: tuple[Side, ...]
) -> tuple[dict[str, FloatArray], dict[str, NDArray[np.bool_]]]:
    """Positions without gaps, and where the gaps of each joint were."""
    needed = {side[0].upper() + part for side in sides for part in _ARM}
    joints: dict[str, FloatArray] = {}
    gaps: dict[str, NDArray[np.bool_]] = {}
    for name, raw in recording.joints.items():
        values = raw[keep]
        huge = np.flatnonzero((np.abs(values) > _LARGEST).any(axis=1))
        if len(huge):
            place = recording.where(int(keep[huge[0]]))
            raise MotionError(f"{recording.path}, {place}: {name} has a coordinate beyond {_LARGEST:.0e}")
        lost: NDArray[np.bool_] = np.asarray(~np.isfinite(values).all(axis=1))
        tracked = 1.0 - float(lost.mean())
        if tracked < _LEAST_TRACKED:
            if name in needed:
                first = recording.where(int(keep[np.flatnonzero(lost)[0]]))
                raise MotionError(
                    f"{recording.path}: {name} is tracked in {100 * tracked:.0f} % of the frames only (first gap at "
                    f"{first}); at least {100 * _LEAST_TRACKED:.0f} % are needed"
                )
            continue
        gaps[name] = lost
        joints[name] = values
        if lost.any():
            known = np.flatnonzero(~lost)
            joints[name] = np.stack([np.interp(times, times[known], values[known, axis]) for axis in range(3)], axis=1)
            if name in needed:
                longest = _longest(lost, times)
                recording.notes.append(
                    f"{name}: {int(lost.sum())} of {len(lost)} frames untracked, filled by linear interpolation in "
                    f"time (longest gap {longest:.2f} s)"
                )
                if longest > 1.0:
                    _say(
                        f"{recording.path}: {name} is untracked for {longest:.1f} s; what is filled in there is a guess"
                    )
    return joints, gaps


def _longest(lost: NDArray[np.bool_], times: FloatArray) -> float:
    edges = np.diff(np.r_[0, lost.astype(int), 0])
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    last = len(times) - 1
    spans = times[np.minimum(stops, last)] - times[np.maximum(starts - 1, 0)]
    return float(spans.max())


def _scale(recording: Recording, joints: Mapping[str, FloatArray], sides: tuple[Side, ...]) -> float:
    """Factor to metres, by the length of the arms."""
    lengths = [
        np.linalg.norm(joints[s + "Elbow"] - joints[s + "Shoulder"], axis=1)
        + np.linalg.norm(joints[s + "Hand"] - joints[s + "Elbow"], axis=1)
        for s in (side[0].upper() for side in sides)
    ]
    arm = float(np.median(np.concatenate(lengths)))
    if not arm > 1e-9:
        raise MotionError(f"{recording.path}: shoulder, elbow and hand coincide; expected an arm of some length")
    for unit, scale, low, high in _UNITS:
        if low <= arm * scale <= high:
            recording.notes.append(f"units: {unit} (the arm is {arm:.3g} long, that is {arm * scale:.3f} m)")
            if scale != 1.0:
                _say(f"{recording.path} is in {unit}: the arm is {arm:.3g} long; converted to metres")
            return scale
    note = f"units unknown: the arm is {arm:.3g} long; scaled to an adult's {_UNKNOWN_ARM} m"
    recording.notes.append(note)
    _say(f"{recording.path}: {note}")
    return _UNKNOWN_ARM / arm


def _basis(recording: Recording, joints: Mapping[str, FloatArray], sides: tuple[Side, ...], fps: float) -> FloatArray:
    """Body axes (rows: forward, left, up) in the file's axes for every frame, ``(N, 3, 3)``."""
    up, trunk = _up(recording, joints)
    across = _across(joints, sides)
    if across is None:
        raise MotionError(f"{recording.path}: one arm and neither hips nor neck; the heading cannot be found")
    level = across - np.outer(across @ up, up)
    level = gaussian_filter1d(level, _HEADING_SECONDS * fps, axis=0, mode="nearest")
    length = np.linalg.norm(level, axis=1, keepdims=True)
    if (length < 1e-3 * np.median(np.linalg.norm(across, axis=1))).any():
        frame = int(np.argmin(length))
        raise MotionError(
            f"{recording.path}, {recording.where(frame)}: the shoulders lie on top of each other; no heading"
        )
    left = level / length
    forward = np.cross(left, up)
    basis = np.stack([forward, left, np.broadcast_to(up, left.shape)], axis=1)
    facing, lefts = forward.mean(axis=0), left.mean(axis=0)
    recording.notes.append(
        f"axes: {_axis_name(up)} is up, the subject faces {_axis_name(facing)}, its left is {_axis_name(lefts)}"
    )
    swing = float(np.degrees(np.arccos(np.clip(forward @ facing / max(np.linalg.norm(facing), 1e-9), -1, 1)).max()))
    if swing > 25.0:
        recording.notes.append(f"the subject turns by up to {swing:.0f} degrees; the turn is taken out")
    if trunk is not None and trunk > 35.0:
        _say(f"{recording.path}: the trunk leans {trunk:.0f} degrees from the nearest axis; is up really an axis?")
    return basis


def _up(recording: Recording, joints: Mapping[str, FloatArray]) -> tuple[FloatArray, float | None]:
    """The file's axis that points up, and by how many degrees the trunk leans from it."""
    below = _first_of(joints, ("LHip", "RHip"), ("Pelvis",), ("Torso",))
    above = _first_of(joints, ("LShoulder", "RShoulder"), ("Neck",), ("Head",))
    if below is None or above is None:
        recording.notes.append("no trunk in the file: up is taken as the format has it")
        return np.array(recording.up), None
    trunk = np.median(above - below, axis=0)
    trunk = trunk / max(float(np.linalg.norm(trunk)), 1e-12)
    axis = int(np.argmax(np.abs(trunk)))
    up = np.zeros(3)
    up[axis] = 1.0 if trunk[axis] > 0 else -1.0
    return up, float(np.degrees(np.arccos(np.clip(trunk @ up, -1.0, 1.0))))


def _first_of(joints: Mapping[str, FloatArray], *groups: tuple[str, ...]) -> FloatArray | None:
    """The mean of the first group of joints that is there."""
    for names in groups:
        if all(name in joints for name in names):
            mean: FloatArray = np.mean([joints[name] for name in names], axis=0)
            return mean
    return None


def _across(joints: Mapping[str, FloatArray], sides: tuple[Side, ...]) -> FloatArray | None:
    """From right to left: shoulders, else hips, else from the trunk's middle to the one shoulder."""
    for left, right in (("LShoulder", "RShoulder"), ("LHip", "RHip")):
        if left in joints and right in joints:
            return joints[left] - joints[right]
    for centre in ("Neck", "Torso", "Pelvis"):
        if centre in joints:
            sign = 1.0 if sides[0] == "left" else -1.0
            return sign * (joints[sides[0][0].upper() + "Shoulder"] - joints[centre])
    return None


def _check_forward(recording: Recording, joints: Mapping[str, FloatArray], basis: FloatArray) -> None:
    """Toes and nose point forward; if they do not, left and right are swapped or an axis is mirrored."""
    votes = [
        np.median(np.einsum("nj,nj->n", joints[tip] - joints[base], basis[:, 0]))
        for base, tip in (("LFoot", "LToe"), ("RFoot", "RToe"), ("Neck", "Nose"))
        if base in joints and tip in joints
    ]
    if votes and max(votes) < -0.02:
        note = "toes or nose point backward: left and right seem swapped, or an axis mirrored"
        recording.notes.append(note)
        _say(f"{recording.path}: {note}")


def _human(
    path: Path,
    name: str,
    points: FloatArray,
    joints: Mapping[str, FloatArray],
    basis: FloatArray,
    sides: tuple[Side, ...],
) -> HumanSkeleton:
    links = np.median(np.linalg.norm(np.diff(points, axis=2), axis=-1), axis=(0, 1))
    stature = float(links.sum()) * _STATURE_PER_ARM
    feet = [joints[foot] for foot in ("LFoot", "RFoot") if foot in joints]
    if "Head" in joints and feet:
        tall = np.einsum("nj,nj->n", joints["Head"] - np.mean(feet, axis=0), basis[:, 2])
        measured = 1.12 * float(np.median(tall))  # head joint to crown and ankle to sole, Drillis and Contini
        if 0.75 * stature < measured < 1.3 * stature:
            stature = measured
    shoulders = 0.173 * stature
    if len(sides) == 2:
        shoulders = float(np.median(np.linalg.norm(points[:, 0, 0] - points[:, 1, 0], axis=-1)))
    try:
        return HumanSkeleton(
            name, height=stature, upper_arm=float(links[0]), forearm=float(links[1]), shoulders=shoulders, sides=sides
        )
    except EmbodimentError as error:
        raise MotionError(f"{path}: the joints make no human: {error}") from error


def _middle(
    joints: Mapping[str, FloatArray], points: FloatArray, basis: FloatArray, human: HumanSkeleton
) -> FloatArray:
    """The torso point of every frame: below the middle of the shoulders, as in ``HumanSkeleton.standing``."""
    middle = points[:, :, 0].mean(axis=1)
    if len(human.sides) == 1:
        outward = 0.5 * human.shoulders * (1.0 if human.sides[0] == "left" else -1.0)
        middle = middle - outward * basis[:, 1]
    shoulder_height = human.arm_points(human.standing())[0, 0, 0, 2]
    origin: FloatArray = middle - float(shoulder_height) * basis[:, 2]
    return origin


def _axis_name(vector: FloatArray) -> str:
    axis = int(np.argmax(np.abs(vector)))
    return f"{'+' if vector[axis] > 0 else '-'}{'xyz'[axis]}"


def _say(text: str) -> None:
    warnings.warn(text, MotionWarning, stacklevel=4)
