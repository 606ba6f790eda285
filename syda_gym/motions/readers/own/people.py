"""Are these people? What every foreign recording is asked, asked of files that say themselves whose joints they hold.

Such a file knows its bodies, so three things more can be asked: are limbs as long as the body says, is the left
shoulder on the left, and do hands hang. Nothing is refused: a data set that somebody made is said to be odd.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.plausibility import DOUBTFUL, bends_backward, examine

__all__ = ["doubts"]

_SINGLE = 1.5  # one recording is short and noisy: it must be odder than all of a person's together to be named
_LENGTHS = 1.3  # times longer or shorter than the body says
_SPREAD = 0.1  # standard deviation of a limb's length within one recording, from which it is examined closely
_TILT = 35.0  # degrees; what the trunk of other recordings may lean
_RAISED = 0.95  # share of the frames with every hand above its shoulder
_NAMED = 3


def doubts(motions: Motions) -> tuple[str, ...]:
    """What is odd about the people in motions.

    Limbs keep their length and are as long on the left as on the right, in all recordings of a person together and in
    each one; they are as long as the body says; the left shoulder is on the left and shoulders are level; elbows bend
    forward; hands hang.

    Args:
        motions: whose humans are looked at; robots are not. Mirrored takes are their twins' images and left out.

    Returns:
        One line each, with the body's name; empty if nothing is odd.
    """
    found: list[str] = []
    for name, body in motions.bodies.items():
        takes = [take for take in motions.takes if name in take.frames and not take.mirrored]
        takes = takes or [take for take in motions.takes if name in take.frames]
        if isinstance(body, HumanSkeleton) and takes:
            points = [body.arm_points(take.frames[name]) for take in takes]
            single = _of_recordings(body, [take.recording for take in takes], points)
            lines = [*_of_person(body, np.concatenate(points), examined=not single), *single]
            found += [f"odd for a person: {name}: {line}" for line in lines]
    return tuple(found)


def _of_person(body: HumanSkeleton, points: FloatArray, *, examined: bool) -> list[str]:
    """What is odd in all recordings together; limbs are not ``examined`` where single recordings tell more."""
    findings = examine(_joints(body, points)) if examined else []
    lines = [finding.text for finding in findings if finding.weight >= DOUBTFUL]
    measured = np.median(np.linalg.norm(np.diff(points, axis=2), axis=-1), axis=(0, 1))
    for limb, length, said in zip(("upper arm", "forearm"), measured, (body.upper_arm, body.forearm), strict=True):
        if not 1.0 / _LENGTHS <= length / said <= _LENGTHS:
            lines.append(
                f"the {limb} is {length:.3g} m long, the body says {said:.3g} m; are frames in metres, and this body's?"
            )
    lines += _bearing(body, points)
    raised = (points[:, :, 2, 2] > points[:, :, 0, 2]).all(axis=1).mean()
    if raised > _RAISED and len(body.sides) == 2:
        lines.append("both hands are above the shoulders all the time; do the body's axes say rightly what is up?")
    return lines


def _of_recordings(body: HumanSkeleton, names: Sequence[str], points: Sequence[FloatArray]) -> list[str]:
    """What is odd in some recordings and not in all, with their names."""
    where: dict[str, list[str]] = {}
    for name, frames in zip(names, points, strict=True):
        for line in dict.fromkeys((*_limbs(body, frames), *_bearing(body, frames))):
            where.setdefault(line, []).append(name)
    lines = []
    for line, recordings in where.items():
        if len(recordings) == len(names):
            continue
        more = f" and {len(recordings) - _NAMED} more" if len(recordings) > _NAMED else ""
        lines.append(f"{line} (in {', '.join(recordings[:_NAMED])}{more})")
    return lines


def _limbs(body: HumanSkeleton, points: FloatArray) -> list[str]:
    """Findings about a single recording; the slow questions are asked only where quick ones say that they may tell."""
    lengths = np.linalg.norm(points[:, :, 1:] - points[:, :, :-1], axis=-1)
    middle = lengths.mean(axis=0)
    if not middle.min() > 0.0:
        return ["shoulder, elbow and hand coincide"]
    beside = middle / body.arm_lengths
    if lengths.std(axis=0).max() < _SPREAD * middle.min() and beside.max() < _LENGTHS * beside.min():
        return []
    return [finding.text for finding in examine(_joints(body, points)) if finding.weight >= _SINGLE]


def _bearing(body: HumanSkeleton, points: FloatArray) -> list[str]:
    """Whether somebody stands upright, looks forward and has left and right where they belong."""
    lines = []
    if len(body.sides) == 2:
        across = (points[:, 0, 0] - points[:, 1, 0]).mean(axis=0)
        tilt = float(np.degrees(np.arctan2(np.hypot(across[0], across[2]), across[1])))
        if tilt > 180.0 - _TILT:
            lines.append("the left shoulder is on the right: left and right seem swapped, or an axis mirrored")
        elif tilt > _TILT:
            lines.append("the line through the shoulders is not the body's left; are its axes right?")
    ahead = float((points[:, :, 2, 0] - points[:, :, 1, 0]).mean())  # elbows that bend backward point so on the whole
    if ahead < 0.0 and bends_backward(_joints(body, points), np.broadcast_to(np.eye(3), (len(points), 3, 3))):
        lines.append("elbows bend backward: left and right seem swapped, or an axis mirrored")
    return lines


def _joints(body: HumanSkeleton, points: FloatArray) -> dict[str, FloatArray]:
    return {
        side[0].upper() + part: points[:, arm, place]
        for arm, side in enumerate(body.sides)
        for place, part in enumerate(("Shoulder", "Elbow", "Hand"))
    }
