"""Checking a data set folder: everything that is wrong or odd, each with its place and what to do."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, MotionError
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.dataset import INDEX, dataset_root, read_index, read_take
from syda_gym.motions.pairing.alignment import pair_quality
from syda_gym.motions.readers.own.npz import body_from_spec

__all__ = ["Finding", "validate_dataset"]


@dataclass(frozen=True)
class Finding:
    """One remark of the validator.

    Attributes:
        level: ``"error"`` (cannot be used), ``"warning"`` (usable, but look at it) or ``"info"``.
        place: file, take or action.
        message: what was expected, what came, what to do.
    """

    level: str
    place: str
    message: str


def validate_dataset(folder: str | os.PathLike[str]) -> tuple[Finding, ...]:
    """Checks a data set folder thoroughly and lists everything that it finds, not only the first fault.

    Args:
        folder: the data set.

    Returns:
        Errors first, then warnings, then information; no errors means that ``read_dataset`` takes it.
    """
    try:
        root = dataset_root(folder)
        index = read_index(root)
        bodies = {name: body_from_spec(root / INDEX, spec) for name, spec in index["bodies"].items()}
    except (MotionError, EmbodimentError) as error:
        return (Finding("error", INDEX, str(error)),)
    findings, takes = [], []
    for entry in index["takes"]:
        try:
            takes.append(read_take(root, entry, bodies))
        except (MotionError, EmbodimentError) as error:
            findings.append(Finding("error", str(entry.get("file", entry)), str(error)))
    listed = {str(entry.get("file")) for entry in index["takes"]}
    for path in sorted((root / "takes").glob("*.csv")):
        if f"takes/{path.name}" not in listed:
            findings.append(Finding("warning", f"takes/{path.name}", f"not listed in {INDEX}; it is ignored"))
    if takes:
        findings += _examined(Motions(root.name, tuple(takes), bodies))
    order = {"error": 0, "warning": 1, "info": 2}
    return tuple(sorted(findings, key=lambda finding: order[finding.level]))


def _examined(motions: Motions) -> list[Finding]:
    """What a person should know about motions that can be read."""
    findings = []
    seen: set[tuple[str, bool]] = set()
    for take in motions.takes:
        if (take.recording, take.mirrored) in seen:
            findings.append(Finding("warning", take.recording, "two takes have this name; clips will be joined"))
        seen.add((take.recording, take.mirrored))
        for name, frames in take.frames.items():
            findings += _beyond_limits(take, motions.bodies[name], frames)
        for name, marks in take.filled.items():
            if marks.mean() > 0.2:
                findings.append(
                    Finding(
                        "warning", take.recording, f"{100 * marks.mean():.0f} % of {name} are filled gaps; record again"
                    )
                )
    if not motions.pairs:
        findings.append(Finding("warning", "takes", "no take has two bodies; nothing can be fitted"))
    for a, b in motions.pairs:
        pair = motions.pair(a, b)
        count = len(pair.action_names)
        if count < 2:
            findings.append(Finding("warning", f"{a}-{b}", f"{count} action; leave-one-action-out needs at least two"))
        for quality in pair_quality(pair):
            said = f"{a}-{b}: correlation {quality.correlation:.2f} at a lag of {quality.lag:+.2f} s"
            if quality.verdict == "poor":
                findings.append(Finding("warning", quality.action, f"{said}; are the two doing the same? record again"))
            elif abs(quality.lag) > 0.4:
                findings.append(Finding("warning", quality.action, f"{said}; align them with pair_recordings"))
            else:
                findings.append(Finding("info", quality.action, f"{said}, {quality.verdict}"))
    return findings


def _beyond_limits(take: Take, body: Embodiment, frames: FloatArray) -> list[Finding]:
    if not isinstance(body, Robot):
        return []
    findings = []
    outside = body.violations(frames, tolerance=1e-6)
    if outside.any():
        frame, joint = np.argwhere(outside)[0]
        findings.append(
            Finding(
                "warning", take.recording,
                f"{body.name}: {int(outside.sum())} angles outside their limits, first {body.joint_names[joint]} in "
                f"frame {frame}",
            )
        )  # fmt: skip
    rate = np.abs(np.diff(frames, axis=0)) * take.fps
    if (rate > body.speed * (1.0 + 1e-6)).any():
        frame, joint = np.argwhere(rate > body.speed)[0]
        findings.append(
            Finding(
                "warning", take.recording,
                f"{body.name}: {body.joint_names[joint]} moves at {rate[frame, joint]:.1f} rad/s in frame {frame}, "
                f"faster than its {body.speed[joint]:.1f}",
            )
        )  # fmt: skip
    return findings
