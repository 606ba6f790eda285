"""ObservationLayout: which number of the flat observation means what, and between which bounds it lies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.embodiments.robot import Robot

__all__ = ["MAX_AGE", "Entry", "ObservationLayout", "teleop_layout"]

MAX_AGE = 10.0
"""Ages of packets are reported up to this many seconds."""

_FARTHEST = 10.0  # m; human features are clipped to it
_SLACK = 0.1  # rad by which physics may overshoot a joint limit
_OVERSPEED = 2.0  # joint speeds are clipped at this multiple of the limit


@dataclass(frozen=True, eq=False)
class Entry:
    """One number of the observation.

    Attributes:
        index: position.
        block: name of its block.
        name: what it is.
        unit: ``m``, ``rad``, ``rad/s``, ``s`` or ``1``.
        low: lower bound.
        high: upper bound.
    """

    index: int
    block: str
    name: str
    unit: str
    low: float
    high: float


class ObservationLayout(Mapping[str, slice]):
    """Blocks of the observation by name: ``layout["q"]`` is the slice of the joint angles.

    Attributes:
        entries: one ``Entry`` per number.
        size: length of the observation.
        low: lower bounds ``(size,)`` float32.
        high: upper bounds ``(size,)`` float32.
    """

    def __init__(self, entries: tuple[Entry, ...]) -> None:
        self.entries = entries
        self.size = len(entries)
        self.low: NDArray[np.float32] = _float32([entry.low for entry in entries], -1)
        self.high: NDArray[np.float32] = _float32([entry.high for entry in entries], 1)
        blocks: dict[str, slice] = {}
        for entry in entries:
            first = blocks[entry.block].start if entry.block in blocks else entry.index
            blocks[entry.block] = slice(first, entry.index + 1)
        self._blocks = blocks

    def __getitem__(self, block: str) -> slice:
        return self._blocks[block]

    def __iter__(self) -> Iterator[str]:
        return iter(self._blocks)

    def __len__(self) -> int:
        return len(self._blocks)

    def table(self) -> str:
        """The layout as a Markdown table, one row a number."""
        rows = ["| index | block | meaning | unit | low | high |", "|---|---|---|---|---|---|"]
        rows += [
            f"| {entry.index} | `{entry.block}` | {entry.name} | {entry.unit} | {entry.low:.4g} | {entry.high:.4g} |"
            for entry in self.entries
        ]
        return "\n".join(rows)

    def __repr__(self) -> str:
        parts = ", ".join(f"{name}[{part.start}:{part.stop}]" for name, part in self._blocks.items())
        return f"ObservationLayout({self.size}: {parts})"


def teleop_layout(operator: Embodiment, robot: Robot, *, preview: int, history: int) -> ObservationLayout:
    """The layout of ``SydaTeleop-v0``.

    Args:
        operator: who leads.
        robot: who follows.
        preview: future base commands that are shown.
        history: past base commands and joint angles that are shown.
    """
    rows: list[tuple[str, str, str, float, float]] = []
    joints = list(zip(robot.joint_names, robot.lower.tolist(), robot.upper.tolist(), strict=True))
    for index, feature in enumerate(operator.features):
        low, high = -_FARTHEST, _FARTHEST
        if isinstance(operator, Robot):
            low, high = float(operator.lower[index]), float(operator.upper[index])
        rows.append(("operator", f"{operator.name}: {feature.name}, newest packet", feature.unit, low, high))
    for step in range(preview + 1):
        ahead = f", {step} frames ahead" if step else ""
        for name, low, high in joints:
            span = high - low + _SLACK
            rows.append(("base_error", f"{name}: base command{ahead} minus angle", "rad", -span, span))
    for name, low, high in joints:
        rows.append(("q", f"{name}: angle", "rad", low - _SLACK, high + _SLACK))
    for (name, _, _), speed in zip(joints, robot.speed.tolist(), strict=True):
        limit = _OVERSPEED * (speed if np.isfinite(speed) else 50.0)
        rows.append(("qd", f"{name}: speed", "rad/s", -limit, limit))
    for name, _, _ in joints:
        rows.append(("previous_action", f"{name}: previous action", "1", -1.0, 1.0))
    rows.append(("packet_age", "age of the newest packet", "s", 0.0, MAX_AGE))
    for kind, label in (("base_history", "base command"), ("q_history", "angle")):
        for step in range(1, history + 1):
            for name, low, high in joints:
                span = high - low + 2 * _SLACK
                rows.append((kind, f"{name}: {label} {step} frames ago minus angle", "rad", -span, span))
    return ObservationLayout(tuple(Entry(index, *row) for index, row in enumerate(rows)))


def _float32(values: list[float], outward: int) -> NDArray[np.float32]:
    """Float32 bounds that never lie inside the float64 ones."""
    exact = np.array(values)
    rounded = exact.astype(np.float32)
    inside = rounded > exact if outward < 0 else rounded < exact
    rounded[inside] = np.nextafter(rounded[inside], np.float32(outward * np.inf))
    return rounded
