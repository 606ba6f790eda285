"""The vocabulary of the synthetic motions: upper-body actions as key poses of wrist and elbow.

A key pose says where a wrist is, seen from its own shoulder and in units of the arm's length: ``(forward, outward,
up)``, outward being left for the left arm. A fourth number turns the elbow about the line from shoulder to wrist
[degrees], outward and up for positive values. All poses stay away from a straight elbow, where its
direction has no meaning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["ACTIONS", "FAMILIES", "REST", "Action", "limb_directions"]

Pose = tuple[float, ...]

REST: Pose = (0.14, 0.13, -0.94)
"""Arms hanging, elbows a little bent."""

_SHORTEST, _LONGEST = 0.45, 0.965  # wrist distance in arm lengths: elbow bent by 127 to 30 degrees
_ELBOW = np.array([-0.50, 0.38, -0.78])  # where an elbow falls by itself: back, out and down


@dataclass(frozen=True)
class Action:
    """One action: key poses of the leading and of the other arm, repeated as a cycle.

    Attributes:
        name: label, unique.
        family: kind of gesture; whole families can be held out.
        lead: key poses of the leading arm.
        other: key poses of the other arm, as many.
    """

    name: str
    family: str
    lead: tuple[Pose, ...]
    other: tuple[Pose, ...]


def limb_directions(poses: Sequence[Pose] | FloatArray) -> FloatArray:
    """Unit directions of upper arm and forearm at key poses.

    The two links count as equally long, so that the elbow's flexion follows from the wrist's distance alone.

    Args:
        poses: K poses of 3 or 4 numbers, see the module.

    Returns:
        ``(K, 2, 3)``: upper arm and forearm, (forward, outward, up).
    """
    table = np.array([(*pose, 0.0)[:4] for pose in poses], dtype=np.float64)
    wrist, swivel = table[:, :3], np.deg2rad(table[:, 3])
    distance = np.linalg.norm(wrist, axis=1)
    line = wrist / distance[:, None]
    distance = np.clip(distance, _SHORTEST, _LONGEST)
    elbow = _ELBOW - (line @ _ELBOW)[:, None] * line
    elbow /= np.linalg.norm(elbow, axis=1, keepdims=True)
    # Turning about the line so that the elbow rises outward, whichever way the arm points.
    side = np.cross(elbow, line)
    side *= np.where(side[:, 1:2] < 0.0, -1.0, 1.0)
    elbow = np.cos(swivel)[:, None] * elbow + np.sin(swivel)[:, None] * side
    bend = np.sqrt(1.0 - distance**2)[:, None]
    along = distance[:, None] * line
    return np.stack([along + bend * elbow, along - bend * elbow], axis=1)


def _one(name: str, family: str, *poses: Pose) -> Action:
    """Only the leading arm acts."""
    return Action(name, family, poses, (REST,) * len(poses))


def _both(name: str, family: str, *poses: Pose) -> Action:
    """Both arms do the same, mirrored."""
    return Action(name, family, poses, poses)


def _turns(name: str, family: str, *poses: Pose) -> Action:
    """The arms alternate: one is half a cycle behind."""
    half = len(poses) // 2
    return Action(name, family, poses, poses[half:] + poses[:half])


def _duo(name: str, family: str, *pairs: tuple[Pose, Pose]) -> Action:
    """The arms do different things."""
    return Action(name, family, tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs))


def _ring(centre: Pose, radius: float, plane: str, turns: int = 1) -> tuple[Pose, ...]:
    """Eight poses on a circle; ``plane`` names the two axes it lies in, for example ``"ou"`` (outward, up)."""
    axes = ["fou".index(letter) for letter in plane]
    poses = []
    for step in range(8):
        angle = turns * 2.0 * np.pi * step / 8
        pose = list(centre)
        pose[axes[0]] += radius * float(np.cos(angle))
        pose[axes[1]] += radius * float(np.sin(angle))
        poses.append(tuple(pose))
    return tuple(poses)


ACTIONS: tuple[Action, ...] = (
    # Reaches: out and back, held for a moment.
    _one("reach_high_front", "reach", (0.70, 0.05, 0.55), (0.70, 0.05, 0.55), REST),
    _one("reach_low_front", "reach", (0.72, 0.05, -0.55), (0.72, 0.05, -0.55), REST),
    _one("reach_side", "reach", (0.20, 0.88, 0.05), (0.20, 0.88, 0.05), REST),
    _one("reach_across", "reach", (0.72, -0.38, -0.10), (0.72, -0.38, -0.10), REST),
    _one("reach_up_side", "reach", (0.20, 0.62, 0.62), (0.20, 0.62, 0.62), REST),
    _one("reach_low_side", "reach", (0.15, 0.70, -0.58), (0.15, 0.70, -0.58), REST),
    _both("reach_both_front", "reach", (0.90, 0.05, -0.05), (0.90, 0.05, -0.05), REST),
    _duo(
        "reach_split", "reach",
        ((0.70, 0.1, 0.5), (0.2, 0.6, -0.6)),
        ((0.70, 0.1, 0.5), (0.2, 0.6, -0.6)),
        (REST, REST),
    ),
    # Waves.
    _one("wave_high", "wave", (0.35, 0.20, 0.62, 10), (0.30, 0.62, 0.52, 10)),
    _one("wave_side", "wave", (0.25, 0.55, 0.25, 20), (0.22, 0.80, 0.30, 20)),
    _one("wave_low", "wave", (0.50, 0.10, -0.45), (0.42, 0.52, -0.42)),
    _both("wave_both", "wave", (0.30, 0.22, 0.65, 10), (0.25, 0.65, 0.55, 10)),
    _turns("wave_in_turn", "wave", (0.30, 0.30, 0.65), (0.28, 0.60, 0.55), (0.35, 0.25, -0.60), (0.25, 0.20, -0.80)),
    # Pointing.
    _one("point_front", "point", (0.93, 0.0, 0.05), (0.93, 0.0, 0.05), (0.62, 0.05, -0.35)),
    _one("point_up", "point", (0.30, 0.10, 0.89), (0.30, 0.10, 0.89), (0.62, 0.10, 0.15)),
    _one("point_side", "point", (0.25, 0.89, 0.12), (0.25, 0.89, 0.12), (0.45, 0.50, -0.20)),
    _one("point_down", "point", (0.55, 0.15, -0.75), (0.55, 0.15, -0.75), (0.62, 0.10, -0.25)),
    _one("point_sweep", "point", (0.80, -0.30, 0.05), (0.92, 0.05, 0.05), (0.70, 0.60, 0.05), (0.92, 0.05, 0.05)),
    # Bows of the arms.
    _both("bow_down", "bow", (0.75, 0.25, 0.10), (0.45, 0.05, -0.65), (0.45, 0.05, -0.65), REST),
    _both("bow_open", "bow", (0.45, 0.72, 0.20), (0.35, 0.72, -0.45), REST),
    _duo(
        "bow_courtly", "bow",
        ((0.48, -0.30, -0.30), (0.1, 0.72, -0.35)),
        ((0.48, -0.32, -0.35), (0.1, 0.72, -0.45)),
        (REST, REST),
    ),
    # Clapping near: the hands approach without touching.
    _both("clap_chest", "clap", (0.68, -0.12, -0.12), (0.62, 0.35, -0.12)),
    _both("clap_high", "clap", (0.55, -0.08, 0.60), (0.45, 0.42, 0.60)),
    _both("clap_low", "clap", (0.58, -0.10, -0.58), (0.48, 0.42, -0.55)),
    # Crossing the arms, one hand above the other.
    _duo(
        "cross_chest", "cross",
        ((0.58, -0.38, 0.05), (0.58, -0.36, -0.22)),
        ((0.52, 0.30, -0.15), (0.52, 0.30, -0.30)),
    ),
    _duo(
        "cross_low", "cross",
        ((0.55, -0.38, -0.42), (0.55, -0.34, -0.62)),
        ((0.32, 0.55, -0.60), (0.32, 0.55, -0.60)),
    ),
    _duo(
        "cross_in_turn", "cross",
        ((0.58, -0.38, 0.0), (0.35, 0.65, -0.15)), ((0.55, 0.15, -0.2), (0.55, 0.15, -0.2)),
        ((0.35, 0.65, -0.15), (0.58, -0.38, 0.0)), ((0.55, 0.15, -0.2), (0.55, 0.15, -0.2)),
    ),
    # Lifts.
    _both("lift_box", "lift", (0.62, 0.02, -0.60), (0.72, 0.02, -0.12), (0.72, 0.02, -0.12)),
    _both("lift_overhead", "lift", (0.62, 0.05, -0.15), (0.35, 0.10, 0.84), (0.35, 0.10, 0.84)),
    _both("lift_sides", "lift", (0.12, 0.40, -0.82), (0.20, 0.87, 0.02)),
    _turns("lift_in_turn", "lift", (0.78, 0.08, 0.25), (0.78, 0.08, 0.25), REST, REST),
    # Circles.
    _one("circle_front", "circle", *_ring((0.72, 0.12, 0.02), 0.32, "ou")),
    _one("circle_side", "circle", *_ring((0.20, 0.76, 0.05), 0.34, "fu")),
    _both("circle_both", "circle", *_ring((0.70, 0.15, -0.10), 0.30, "ou")),
    _turns("circle_table", "circle", *_ring((0.62, 0.15, -0.42), 0.24, "fo", -1)),
    # Pushes.
    _one("push_front", "push", (0.55, 0.12, -0.12, 15), (0.93, 0.08, 0.02, 15)),
    _one("push_side", "push", (0.35, 0.42, -0.12, 20), (0.22, 0.90, 0.02, 20)),
    _turns("push_in_turn", "push", (0.92, 0.0, 0.05, 10), (0.55, 0.15, -0.15, 10)),
    _both("push_up", "push", (0.42, 0.22, 0.35, 10), (0.28, 0.15, 0.88, 10)),
    # Swings.
    _turns("swing_walk", "swing", (0.50, 0.05, -0.72), (-0.18, 0.15, -0.90)),
    _both("swing_both", "swing", (0.78, 0.08, 0.20), (0.10, 0.15, -0.92)),
    _both("swing_open", "swing", (0.85, 0.0, 0.05), (0.30, 0.86, 0.0)),
    # Signals, different with each arm.
    _duo("salute", "signal", ((0.45, 0.02, 0.45, 45), REST), ((0.45, 0.02, 0.45, 45), REST), (REST, REST)),
    _duo(
        "stop_traffic", "signal",
        ((0.35, 0.10, 0.86), (0.25, 0.86, 0.0)),
        ((0.90, 0.05, 0.1), (0.25, 0.86, 0.0)),
        (REST, REST),
    ),
    _duo(
        "archer", "signal",
        ((0.80, 0.42, 0.08), (0.68, -0.22, 0.05, 35)),
        ((0.80, 0.42, 0.08), (0.38, 0.38, 0.05, 35)),
        (REST, REST),
    ),
    _both("shrug", "signal", (0.42, 0.55, -0.25), (0.42, 0.55, -0.25), (0.35, 0.25, -0.62)),
    # Work.
    _one("throw", "work", (0.15, 0.50, 0.55, 20), (0.80, 0.05, 0.30), (0.62, -0.20, -0.50)),
    _duo(
        "pour", "work",
        ((0.60, 0.05, 0.15, 35), (0.65, 0.0, -0.35)),
        ((0.58, -0.15, 0.15, 50), (0.65, 0.0, -0.35)),
        ((0.62, 0.15, -0.3), (0.62, 0.1, -0.4)),
    ),
    _turns("drum", "work", (0.62, 0.08, 0.02), (0.66, 0.05, -0.42)),
    _turns("climb", "work", (0.50, 0.10, 0.74), (0.62, 0.15, -0.10)),
    _duo(
        "sweep_floor", "work",
        ((0.62, 0.30, -0.48), (0.58, -0.25, -0.25)),
        ((0.60, -0.25, -0.50), (0.60, 0.25, -0.25)),
    ),
    _one("knock", "work", (0.72, 0.08, 0.12), (0.62, 0.10, 0.12), (0.72, 0.08, 0.12), (0.60, 0.10, -0.10)),
)  # fmt: skip
"""Every action of the synthetic motions."""

FAMILIES: dict[str, str] = {action.name: action.family for action in ACTIONS}
"""Action name to family."""
