"""One file, several ways to read it: the way that makes a person is taken, and if none does, all are listed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.readers.layouts import Layout, layouts_of
from syda_gym.motions.readers.plausibility import examine
from syda_gym.motions.readers.said import Said

__all__ = ["Way", "best_way", "by_points", "points_to_joints"]

_WORST = 3.5  # total weight of findings beyond which nothing is a person
_CLEAR = 0.5  # by how much the best way must beat one that reads other arms
_SHOWN = 4


@dataclass
class Way:
    """One way to read a file.

    Attributes:
        label: for messages.
        layout: order of the joints.
        joints: what comes out.
        first: frames of what comes out that are looked at; all if left out.
        extra: weight of what speaks against this way besides the person itself.
    """

    label: str
    layout: Layout
    joints: dict[str, FloatArray]
    extra: float = 0.0


def by_points(points: FloatArray, said: Said, format: str | None = None, label: str = "") -> list[Way]:
    """The ways to read points without names.

    Args:
        points: ``(N, points, 3)``.
        said: an order or joints that somebody gave.
        format: only layouts of this format.
        label: what goes before the layout in messages.
    """
    count = points.shape[1]
    if said.order:
        if len(said.order) != count:
            return []
        layouts = [Layout("the order that was given", format or "table", said.order)]
    else:
        layouts = layouts_of(count, format) or layouts_of(count)
    if said.joints and not layouts:
        layouts = [Layout("the joints that were given", format or "table", ("-",) * count)]
    return [Way(label + layout.name, layout, points_to_joints(points, layout, said)) for layout in layouts]


def points_to_joints(points: FloatArray, layout: Layout, said: Said) -> dict[str, FloatArray]:
    """Canonical joints ``(N, 3)`` from points ``(N, P, 3)``; what somebody said goes before the layout."""
    places: dict[str, list[int]] = {}
    for index, name in enumerate(layout.joints[: points.shape[1]]):
        if name != "-":
            places.setdefault(name, []).append(index)
    for joint, place in said.joints.items():
        if place.isdigit() and int(place) < points.shape[1]:
            places[joint] = [int(place)]
    joints = {name: points[:, indices].mean(axis=1) for name, indices in places.items()}
    if layout.zero_is_gap:
        joints = {
            name: np.where((values == 0.0).all(axis=1)[:, None], np.nan, values) for name, values in joints.items()
        }
    return joints


def best_way(path: Path, ways: Sequence[Way], found: str) -> tuple[Way, str | None]:
    """The way that makes a person.

    Args:
        path: file, for messages.
        ways: ways to read it.
        found: what the file holds, for messages, for example ``60 columns of numbers``.

    Returns:
        The best way, and a doubt if another that reads other arms is nearly as good.

    Raises:
        MotionError: no way makes a person; the message lists what was found.
    """
    if not ways:
        raise MotionError(
            f"{path}: {found}, which is no order of joints that is known. Say which is which: --joints LShoulder=0 "
            f"(number of "
            "the point, from 0), or a layout in YAML"
        )
    judged = []
    for way in ways:
        findings = examine(way.joints)
        missing = 0.0 if any(_arm(way, side) for side in "LR") else 3.0
        judged.append((sum(finding.weight for finding in findings) + way.extra + missing, way, findings))
    judged.sort(key=lambda entry: entry[0])
    weight, best, findings = judged[0]
    if len(ways) > 1 and weight > _WORST:
        lines = "; ".join(
            f"as {way.label}: {', '.join(f.text for f in odd[:2]) or 'no complete arm'}"
            for _, way, odd in judged[:_SHOWN]
        )
        raise MotionError(
            f"{path}: {found}, which make no person: {lines}. Say which is which: --joints LShoulder=0 (number of "
            f"the point, "
            "from 0), or a layout in YAML"
        )
    for other, way, _ in judged[1:]:
        if other < weight + _CLEAR and other <= _WORST and not _same_arms(best, way):
            return (
                best,
                f"read as {best.label}, though {way.label} makes a person as well; --joints says which is right",
            )
    return best, None


def _arm(way: Way, side: str) -> bool:
    return all(
        side + part in way.joints and np.isfinite(way.joints[side + part]).all(axis=1).any()
        for part in ("Shoulder", "Elbow", "Hand")
    )


def _same_arms(first: Way, second: Way) -> bool:
    for side in "LR":
        for part in ("Shoulder", "Elbow", "Hand"):
            one, other = first.joints.get(side + part), second.joints.get(side + part)
            if one is None or other is None or not np.array_equal(one, other, equal_nan=True):
                return False
    return True
