"""What the study of the paper found, as plain data, and the parts it is made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from syda_gym.evaluation.paper.cells import Cell
from syda_gym.evaluation.pools import Tell

__all__ = ["Study", "Task", "paper_transferability"]


class Task(Protocol):
    """A part of the study that a process of its own can compute."""

    @property
    def name(self) -> str:
        """For progress and files."""

    @property
    def cost(self) -> float:
        """Relative time."""

    def compute(self, tell: Tell) -> dict[str, Any] | str:
        """JSON-able figures, or why there are none; ``tell`` is told the finished fraction."""


@dataclass(frozen=True)
class Study:
    """All parts that could be computed.

    Attributes:
        data: name of the data set.
        seeds: how many.
        cells: by contender, protocol and human.
        few_shot: newcomer to rows of ``few_shot.FewShotRow`` as dictionaries; empty in a partial study.
        windows: human to rows of ``windows.WindowRow`` as dictionaries; empty in a partial study.
        skipped: part to the reason why it is missing: an optional dependency.
        failed: part to the trace of what went wrong, or why its worker was lost; the next run tries it again.
    """

    data: str
    seeds: int
    cells: dict[tuple[str, str, str], Cell]
    few_shot: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    windows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)

    def cell(self, contender: str, protocol: str, human: str) -> Cell | None:
        """One cell, ``None`` if there is none."""
        return self.cells.get((contender, protocol, human))


def paper_transferability() -> dict[str, dict[str, float]]:
    """The transferability figures of Tables 2 and 5 as this library computes them, ``{"H2-R1": {"T": ...}}``."""
    from syda_gym.routes.metric import transferability

    names = {"H1": "kid", "H2": "adult", "R1": "pepper"}
    result = {}
    for a, b in (("H2", "R1"), ("H1", "R1"), ("R1", "H1"), ("R1", "H2"), ("H2", "H1"), ("H1", "H2")):
        t = transferability(names[a], names[b], definition="paper")
        result[f"{a}-{b}"] = {"S": float(t.S), "D": float(t.D), "alpha": float(t.alpha), "T": float(t.T)}
    return result
