"""Is this a person? The same questions for every format, asked of joint positions alone.

Limbs keep their length and are as long on the left as on the right; forearm, upper arm, trunk and legs are in
proportion; the head is on the other side of the shoulders than the hips. What fails is refused or doubted aloud, and
where a file may be read in several ways, the way that fails least is taken.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["DOUBTFUL", "Finding", "bends_backward", "examine"]

DOUBTFUL = 1.0
"""Weight of a finding from which it is said aloud."""

_LIMBS = (
    ("Shoulder", "Elbow", "upper arm"),
    ("Elbow", "Hand", "forearm"),
    ("Hip", "Knee", "thigh"),
    ("Knee", "Foot", "shin"),
)
_SAMPLE = 400  # frames that are looked at
_SIDE_NAMES = {"L": "left", "R": "right"}
# Ratios of a grown or growing person, generous to both sides for sensors that put joints elsewhere.
_RATIOS = (
    ("forearm", "upper arm", 0.55, 1.45), ("thigh", "upper arm", 0.8, 2.4), ("shin", "thigh", 0.6, 1.6),
    ("shoulder width", "arm", 0.25, 1.25), ("trunk", "arm", 0.5, 1.8), ("hip width", "arm", 0.0, 0.9),
    ("neck to head", "arm", 0.05, 0.8),
)  # fmt: skip
_HANGING = np.cos(np.deg2rad(45.0))
_BENT = np.cos(np.deg2rad(35.0))


@dataclass(frozen=True)
class Finding:
    """One thing that is odd about a person.

    Attributes:
        text: what, with its number.
        weight: how odd: 1 is doubtful, 3 is no person.
        arms: whether it concerns the arms, which are what is read.
    """

    text: str
    weight: float
    arms: bool


def examine(joints: Mapping[str, FloatArray]) -> list[Finding]:
    """What is odd about a person.

    Args:
        joints: canonical joint to ``(N, 3)`` in any unit; NaN where a joint was not tracked.

    Returns:
        Findings, the oddest first.
    """
    step = max(1, len(next(iter(joints.values()))) // _SAMPLE) if joints else 1
    sample = {name: values[::step] for name, values in joints.items()}
    lengths: dict[str, dict[str, float]] = {}
    findings: list[Finding] = []
    for upper, lower, limb in _LIMBS:
        for side in "LR":
            length = _length(sample, side + upper, side + lower)
            if len(length) < 2:
                continue
            middle = float(np.median(length))
            lengths.setdefault(limb, {})[side] = middle
            # The middle 40 % of the frames: what a sensor guesses now and then does not count, a wrong joint does.
            spread = float(np.subtract(*np.percentile(length, [70, 30]))) / max(middle, 1e-12)
            if spread > 0.15:
                findings.append(
                    Finding(
                        f"the {_SIDE_NAMES[side]} {limb} changes its length by {100 * spread:.0f} %",
                        min(3.0, spread / 0.2),
                        "arm" in limb,
                    )
                )
    findings += _uneven(lengths)
    findings += _ratios(sample, {limb: float(np.mean(list(sides.values()))) for limb, sides in lengths.items()})
    findings += _order(sample)
    return sorted(findings, key=lambda finding: -finding.weight)


def _uneven(lengths: Mapping[str, Mapping[str, float]]) -> list[Finding]:
    findings = []
    for limb, sides in lengths.items():
        if len(sides) == 2:
            ratio = max(sides.values()) / max(min(sides.values()), 1e-12)
            if ratio > 1.3:
                findings.append(
                    Finding(
                        f"one {limb} is {min(ratio, 999):.3g} times as long as the other",
                        min(3.0, float(np.log(ratio)) / 0.35),
                        "arm" in limb,
                    )
                )
    return findings


def _ratios(sample: Mapping[str, FloatArray], lengths: dict[str, float]) -> list[Finding]:
    arm = lengths.get("upper arm", 0.0) + lengths.get("forearm", 0.0)
    if arm <= 0.0:
        return []
    known = {**lengths, "arm": arm}
    for name, first, second in (("shoulder width", "LShoulder", "RShoulder"), ("hip width", "LHip", "RHip"),
                                ("neck to head", "Neck", "Head")):  # fmt: skip
        length = _length(sample, first, second)
        if len(length):
            known[name] = float(np.median(length))
    hips, shoulders = _middle(sample, "Hip"), _middle(sample, "Shoulder")
    if hips is not None and shoulders is not None:
        trunk = np.linalg.norm(shoulders - hips, axis=1)
        if np.isfinite(trunk).any():
            known["trunk"] = float(np.nanmedian(trunk))
    findings = []
    for part, whole, low, high in _RATIOS:
        if part in known and known.get(whole, 0.0) > 0.0:
            ratio = known[part] / known[whole]
            if not low <= ratio <= high:
                beyond = float(np.log(low / max(ratio, 1e-9)) if ratio < low else np.log(ratio / high))
                article = "the " if part != "neck to head" else ""
                findings.append(
                    Finding(
                        f"{article}{part} is {ratio:.2g} times the {whole}",
                        min(3.0, 0.6 + beyond / 0.4),
                        part in ("forearm", "shoulder width"),
                    )
                )
    return findings


def _order(sample: Mapping[str, FloatArray]) -> list[Finding]:
    """Head beyond the shoulders, feet beyond the hips."""
    hips, shoulders = _middle(sample, "Hip"), _middle(sample, "Shoulder")
    if hips is None or shoulders is None:
        return []
    trunk = shoulders - hips
    findings = []
    if "Head" in sample:
        beyond = np.einsum("nj,nj->n", sample["Head"] - shoulders, trunk)
        known = np.isfinite(beyond)
        if known.any() and float(np.median(beyond[known])) <= 0.0:
            findings.append(Finding("the head is not above the shoulders", 2.0, False))
    feet = _middle(sample, "Foot")
    if feet is not None:
        below = np.einsum("nj,nj->n", feet - shoulders, trunk)
        known = np.isfinite(below)
        if known.any() and float(np.median(below[known])) >= 0.0:
            findings.append(Finding("the feet are not below the shoulders", 2.0, False))
    return findings


def bends_backward(joints: Mapping[str, FloatArray], basis: FloatArray) -> bool:
    """Whether elbows bend the wrong way: the forearm of a hanging upper arm points behind the body.

    Args:
        joints: canonical joint to ``(N, 3)`` without gaps.
        basis: ``(N, 3, 3)`` forward, left and up of the body.

    Returns:
        Whether nearly all bent elbows under a hanging upper arm, in at least a tenth of the frames, point backward.
    """
    forward, count = 0, 0
    frames = len(basis)
    for side in "LR":
        if not all(side + part in joints for part in ("Shoulder", "Elbow", "Hand")):
            continue
        upper = _unit(joints[f"{side}Elbow"] - joints[f"{side}Shoulder"])
        fore = _unit(joints[f"{side}Hand"] - joints[f"{side}Elbow"])
        hanging = np.einsum("nj,nj->n", upper, basis[:, 2]) < -_HANGING
        bent = np.einsum("nj,nj->n", upper, fore) < _BENT
        ahead = np.einsum("nj,nj->n", fore, basis[:, 0])
        used = hanging & bent & (np.abs(ahead) > 0.3)
        forward += int((ahead[used] > 0).sum())
        count += int(used.sum())
    return count >= max(5, frames // 10) and forward < 0.15 * count


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    return result


def _middle(sample: Mapping[str, FloatArray], part: str) -> FloatArray | None:
    if f"L{part}" not in sample or f"R{part}" not in sample:
        return None
    middle: FloatArray = 0.5 * (sample[f"L{part}"] + sample[f"R{part}"])
    return middle


def _length(sample: Mapping[str, FloatArray], first: str, second: str) -> FloatArray:
    if first not in sample or second not in sample:
        return np.zeros(0)
    length = np.linalg.norm(sample[first] - sample[second], axis=1)
    known: FloatArray = length[np.isfinite(length)]
    return known
