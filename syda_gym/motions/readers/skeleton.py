"""From joint positions as a tool has stored them to motions: units, axes, heading, proportions.

Whatever the source, the result is one human, always seen from its own body: origin below the middle of the shoulders,
x to the subject's right, y up, z backward (as in the paper's recordings), metres. What was found out is said in
``Motions.notes``; what changes the numbers (other units than metres) or is no person for sure is said aloud as a
``MotionWarning`` too.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from syda_gym.embodiments.embodiment import FloatArray, Side
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.errors import EmbodimentError, MotionError
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.readers.gaps import filled, frame_clock, frame_rate
from syda_gym.motions.readers.joint_names import missing_hint
from syda_gym.motions.readers.plausibility import DOUBTFUL, bends_backward, examine
from syda_gym.motions.readers.recording import MotionWarning, Recording, say
from syda_gym.motions.readers.said import NOTHING_SAID, Said

__all__ = ["MotionWarning", "Recording", "motions_from"]

_ARM = ("Shoulder", "Elbow", "Hand")
# Name, metres per unit, shortest and longest arm [m], and how unlikely the unit is before the arm is looked at.
_UNITS = (
    ("metres", 1.0, 0.25, 0.95, 0.0),
    ("centimetres", 0.01, 0.25, 0.95, 0.0),
    ("millimetres", 0.001, 0.25, 0.95, 0.0),
    ("inches", 0.0254, 0.25, 0.75, 0.5),
    ("CMU units of 0.45 inch", 0.0254 / 0.45, 0.40, 0.95, 0.8),
)
_CMU_JOINTS = {"LHipJoint", "RHipJoint", "lhipjoint", "rhipjoint", "LeftFingerBase"}  # that only CMU's files have
_NEAR = 0.5  # how much likelier a unit must be than the next for the other to go unmentioned
_UNKNOWN_ARM = 0.58  # m; an adult's arm, for files in units of their own
_HEADING_SECONDS = 0.5
_STATURE_PER_ARM = 1.0 / 0.332
_NO_PERSON = 3.5  # weight of what is odd about the arms from which a file is refused


def motions_from(recording: Recording, said: Said = NOTHING_SAID, body: str = "operator") -> Motions:
    """Turns a recording into motions of one human.

    Untracked positions are filled by linear interpolation in time between the nearest tracked ones (held at the ends)
    and flagged in ``filled``. The unit is found by the arm's length, up by the trunk, the heading by the line through
    the shoulders, smoothed over half a second.

    Args:
        recording: positions as read.
        said: what a person says about the file; it goes before what is found.
        body: name of the human.

    Returns:
        Motions with one take, whose action is the file's name.

    Raises:
        MotionError: no complete arm, joints that are hardly ever tracked, arms of no length, times that run backward,
            limbs that are nobody's.
    """
    notes = recording.notes
    for doubt in recording.doubts:
        recording.doubt(doubt)
    sides = _sides(recording)
    clock = frame_clock(recording, said)
    joints, gaps = filled(recording, clock, {side[0].upper() + part for side in sides for part in _ARM})
    if recording.image:
        _refuse_image(recording, joints)
    if recording.left_handed or said.left_handed:
        joints = {name: values * [-1.0, 1.0, 1.0] for name, values in joints.items()}
        notes.append("axes are left-handed, as was said: x is turned round")
    scale = _scale(recording, joints, sides, said)
    joints = {name: scale * values for name, values in joints.items()}
    _check_person(recording, joints, bool(said.joints or said.order))
    fps = frame_rate(recording, clock, said)
    basis = _basis(recording, joints, sides, fps, said)
    _check_forward(recording, joints, basis)
    points = np.stack([np.stack([joints[s[0].upper() + p] for p in _ARM], axis=1) for s in sides], axis=1)
    human = _human(recording.path, body, points, joints, basis, sides)
    origin = _middle(joints, points, basis, human)
    local = np.einsum("nij,nakj->naki", basis, points - origin[:, None, None])
    frames = human.frames_from_points(local)
    marks = np.concatenate([np.repeat(gaps[s[0].upper() + p][:, None], 3, axis=1) for s in sides for p in _ARM], axis=1)
    take = Take(
        recording.path.stem, recording.path.stem, fps, {body: frames}, filled={body: marks} if marks.any() else {},
        timestamps=clock.times if clock.stamped else None,
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


def _refuse_image(recording: Recording, joints: Mapping[str, FloatArray]) -> None:
    """World landmarks have their origin between the hips; landmarks of a picture lie in 0..1, their depth near 0."""
    trunk = [joints[name] for name in ("LShoulder", "RShoulder", "LHip", "RHip") if name in joints]
    if len(trunk) < 3 or "LHip" not in joints or "RHip" not in joints:
        return
    inside = np.mean([((points[:, :2] > 0.0) & (points[:, :2] < 1.0)).mean() for points in trunk])
    hips = np.abs(np.median(0.5 * (joints["LHip"] + joints["RHip"]), axis=0))
    if inside > 0.95 and float(np.hypot(hips[0], hips[1])) > 0.15 and hips[2] < 0.2:
        raise MotionError(
            f"{recording.path}: these are image landmarks (all within 0..1, hips away from the origin), whose depth is "
            "unknown; dump pose_world_landmarks instead"
        )


def _check_person(recording: Recording, joints: Mapping[str, FloatArray], told: bool) -> None:
    """Refuses or doubts what is no person, whatever the format."""
    findings = examine(joints)
    arms = [finding for finding in findings if finding.arms]
    if sum(finding.weight for finding in arms) > _NO_PERSON and not told:
        raise MotionError(
            f"{recording.path}: these are no person's arms: {', '.join(finding.text for finding in arms[:3])}. Are "
            f"other joints "
            "meant? Say which is which: --joints LShoulder=..., LElbow=..., LHand=..."
        )
    for finding in findings:
        if finding.weight >= DOUBTFUL:
            recording.doubt(f"odd for a person: {finding.text}")
        else:
            recording.notes.append(f"odd for a person: {finding.text}")


def _scale(recording: Recording, joints: Mapping[str, FloatArray], sides: tuple[Side, ...], said: Said) -> float:
    """Factor to metres, as was said, as the file says, or by the length of the arms."""
    lengths = [
        np.linalg.norm(joints[s + "Elbow"] - joints[s + "Shoulder"], axis=1)
        + np.linalg.norm(joints[s + "Hand"] - joints[s + "Elbow"], axis=1)
        for s in (side[0].upper() for side in sides)
    ]
    arm = float(np.median(np.concatenate(lengths)))
    if not arm > 1e-9:
        raise MotionError(f"{recording.path}: shoulder, elbow and hand coincide; expected an arm of some length")
    for unit, source in ((said.unit, "as was said"), (recording.unit, "as the file says")):
        if unit is not None:
            recording.notes.append(
                f"units: {unit:g} m, {source} (the arm is {arm:.3g} long, that is {arm * unit:.3f} m)"
            )
            if not 0.2 <= arm * unit <= 1.0:
                recording.doubt(
                    f"the arm is {arm * unit:.3g} m long with units of {unit:g} m, {source}; --unit says another"
                )
            return unit
    cmu = bool(_CMU_JOINTS & set(recording.names))
    scored = sorted(
        (abs(float(np.log(arm * scale / 0.55))) + (0.1 if cmu and name.startswith("CMU") else prior), name, scale)
        for name, scale, low, high, prior in _UNITS
        if low <= arm * scale <= high
    )
    if not scored:
        note = f"units unknown: the arm is {arm:.3g} long; scaled to an adult's {_UNKNOWN_ARM} m"
        recording.doubt(f"{note}. --unit says what they are")
        return _UNKNOWN_ARM / arm
    score, name, scale = scored[0]
    recording.notes.append(f"units: {name} (the arm is {arm:.3g} long, that is {arm * scale:.3f} m)")
    if scale != 1.0:
        say(f"{recording.path} is in {name}: the arm is {arm:.3g} long; converted to metres")
    if len(scored) > 1 and scored[1][0] < score + _NEAR:
        _, other, factor = scored[1]
        recording.doubt(
            f"units may be {other} as well: the arm is {arm * scale:.2f} m long in {name}, {arm * factor:.2f} m in "
            f"{other}; --unit "
            "says which"
        )
    return scale


def _basis(
    recording: Recording, joints: Mapping[str, FloatArray], sides: tuple[Side, ...], fps: float, said: Said
) -> FloatArray:
    """Body axes (rows: forward, left, up) in the file's axes for every frame, ``(N, 3, 3)``."""
    up, trunk = _up(recording, joints, said)
    across = _across(joints, sides)
    if across is None:
        raise MotionError(f"{recording.path}: one arm and neither hips nor neck; the heading cannot be found")
    level = across - np.outer(across @ up, up)
    level = _smooth(level, _HEADING_SECONDS * fps)
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
        recording.doubt(
            f"the trunk leans {trunk:.0f} degrees from {_axis_name(up)}; is that really up? --up says which axis is"
        )
    return basis


def _smooth(values: FloatArray, width: float) -> FloatArray:
    """A Gaussian over frames; three running means where it is so wide that its own sum would take long."""
    if width <= 150.0:
        result: FloatArray = gaussian_filter1d(values, width, axis=0, mode="nearest")
        return result
    size = int(np.sqrt(4.0 * width**2 + 1.0)) | 1
    for _ in range(3):
        values = uniform_filter1d(values, size, axis=0, mode="nearest")
    return values


def _up(recording: Recording, joints: Mapping[str, FloatArray], said: Said) -> tuple[FloatArray, float | None]:
    """The file's axis that points up, and by how many degrees the trunk leans from it."""
    below = _first_of(joints, ("LHip", "RHip"), ("Pelvis",), ("Torso",))
    above = _first_of(joints, ("LShoulder", "RShoulder"), ("Neck",), ("Head",))
    if below is None or above is None:
        if said.up is None:
            recording.notes.append("no trunk in the file: up is taken as the format has it")
        return np.array(said.up or recording.up), None
    trunk = np.median(above - below, axis=0)
    trunk = trunk / max(float(np.linalg.norm(trunk)), 1e-12)
    axis = int(np.argmax(np.abs(trunk)))
    up = np.zeros(3)
    up[axis] = 1.0 if trunk[axis] > 0 else -1.0
    if said.up is not None:
        up = np.array(said.up)
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
    """Toes, nose and elbows point forward; if they do not, left and right are swapped or an axis is mirrored."""
    votes = [
        np.median(np.einsum("nj,nj->n", joints[tip] - joints[base], basis[:, 0]))
        for base, tip in (("LFoot", "LToe"), ("RFoot", "RToe"), ("Neck", "Nose"), ("Head", "Nose"))
        if base in joints and tip in joints
    ]
    backward = bends_backward(joints, basis)
    if votes and max(votes) < -0.02:
        recording.doubt("toes or nose point backward: left and right seem swapped, or an axis mirrored")
    elif backward:
        recording.doubt(
            "elbows bend backward: left and right seem swapped, an axis mirrored, or other joints are meant"
        )


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
        raise MotionError(
            f"{path}: the joints make no human: {error}. --unit says what the file's numbers are"
        ) from error


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
