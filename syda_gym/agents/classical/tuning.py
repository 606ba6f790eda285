"""Tuning of the classical rivals on training motions, by the one documented objective."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from syda_gym.agents.agent import Agent
from syda_gym.agents.classical.rivals import RIVALS, Range, make_rival
from syda_gym.agents.figures import Figures
from syda_gym.agents.interface import Interface
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError, nearest_name

__all__ = ["Score", "Tuned", "tune"]

Score = Callable[[Agent], Figures]
"""Plays an agent on the training motions and returns its mean figures; always on the same motions and disturbances."""


@dataclass(frozen=True)
class Tuned:
    """What tuning found.

    Attributes:
        name: the rival.
        settings: its best settings.
        figures: its figures on the training motions with them.
        tried: number of settings that were played.
    """

    name: str
    settings: Mapping[str, float]
    figures: Figures
    tried: int

    def build(self, interface: Interface) -> Agent:
        """The tuned agent."""
        return make_rival(self.name, interface, **self.settings)


def tune(
    name: str,
    interface: Interface,
    score: Score,
    *,
    budget: int = 32,
    seed: int = 0,
    ranges: Mapping[str, Range] | None = None,
) -> Tuned:
    """Finds the settings of a rival with the least objective ``J`` (see ``Figures.objective``).

    Half of the budget is spread evenly (a scrambled Sobol sequence, on a logarithmic scale where a setting spans
    decades); the other half is drawn around the best so far with a spread that shrinks from a fifth of the range to a
    fiftieth. Deterministic in ``seed``.

    Args:
        name: of ``RIVALS``.
        interface: robot, rate, motors and observation layout.
        score: plays an agent on the training motions.
        budget: number of settings to play, at least 1; one is enough for a rival without settings.
        seed: of the search.
        ranges: where to look instead of in the rival's own ranges.

    Raises:
        AgentError: unknown rival or no budget.
    """
    if name not in RIVALS:
        raise AgentError(f"unknown agent {name!r}; {nearest_name(name, RIVALS)}")
    if budget < 1:
        raise AgentError(f"tuning needs a budget of at least 1, got {budget}")
    ranges = RIVALS[name].ranges if ranges is None else ranges
    search = _Search(ranges, budget if ranges else 1, seed)
    best: Tuned | None = None
    for index in range(search.budget):
        settings = search.candidate(index)
        figures = score(make_rival(name, interface, **settings))
        search.record(index, figures.objective)
        if best is None or figures.objective < best.figures.objective:
            best = Tuned(name, settings, figures, search.budget)
    assert best is not None
    return best


class _Search:
    """Candidates in the unit cube: first spread, then around the best."""

    def __init__(self, ranges: Mapping[str, Range], budget: int, seed: int) -> None:
        self.ranges = ranges
        self.budget = budget
        self._spread = (budget + 1) // 2
        self._rng = np.random.default_rng(seed)
        sobol = qmc.Sobol(max(len(ranges), 1), rng=np.random.default_rng(seed))
        exponent = int(np.ceil(np.log2(max(self._spread, 2))))
        self._points: FloatArray = sobol.random_base2(exponent)[: self._spread]
        self._best: FloatArray = self._points[0]
        self._least = np.inf
        self._last: FloatArray = self._points[0]

    def candidate(self, index: int) -> dict[str, float]:
        """Settings number ``index``."""
        if index < self._spread:
            self._last = self._points[index]
        else:
            progress = (index - self._spread) / max(self.budget - self._spread, 1)
            width = 0.2 * 0.1**progress
            self._last = np.clip(self._best + width * self._rng.standard_normal(len(self._best)), 0.0, 1.0)
        return {name: _place(r, float(x)) for (name, r), x in zip(self.ranges.items(), self._last, strict=False)}

    def record(self, index: int, value: float) -> None:
        """Remembers how good candidate ``index`` was."""
        if value < self._least:
            self._least, self._best = value, self._last


def _place(within: Range, x: float) -> float:
    """The setting at ``x`` in [0, 1] of its range."""
    if within.log:
        return float(within.low * (within.high / within.low) ** x)
    return within.low + (within.high - within.low) * x
