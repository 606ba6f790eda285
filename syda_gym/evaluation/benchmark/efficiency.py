"""Sample efficiency: what a new body costs in recordings, through a chain and by a pair of its own.

A chain needs one new pair to some known body; a direct pair needs recordings with the robot itself. With few recordings
the chain wins, because its other links were fitted on all data; with many the direct pair wins, because a chain adds up
the errors of its links.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syda_gym.errors import OptionError
from syda_gym.evaluation.benchmark.results import Results
from syda_gym.evaluation.report.model import Column, CurvePlot, Table
from syda_gym.evaluation.statistics import Estimate, clustered_estimate
from syda_gym.routes.routing import models_chained, models_direct

__all__ = ["EfficiencyCurve", "efficiency_curve", "models_plot"]


@dataclass(frozen=True)
class EfficiencyCurve:
    """Error against the number of paired actions of the new body.

    Attributes:
        chain: route through which the new body reaches the robot.
        direct: the pair that it competes with.
        new_body: who is new.
        actions: numbers of paired actions.
        chained: landmark error of the chain for each number [m], interval over actions.
        paired: landmark error of the direct pair [m].
        difference: chain minus direct over the same clips [m].
    """

    chain: str
    direct: str
    new_body: str
    actions: tuple[int, ...]
    chained: tuple[Estimate, ...]
    paired: tuple[Estimate, ...]
    difference: tuple[Estimate, ...]

    def chain_wins(self) -> tuple[int, ...]:
        """Numbers of actions at which the chain is better beyond doubt."""
        return tuple(k for k, d in zip(self.actions, self.difference, strict=True) if d.high < 0)

    def direct_wins(self) -> tuple[int, ...]:
        """Numbers of actions at which the direct pair is better beyond doubt."""
        return tuple(k for k, d in zip(self.actions, self.difference, strict=True) if d.low > 0)

    def advice(self, available: int) -> str:
        """Whether to chain or to record more, for a new body with some paired actions.

        Args:
            available: paired actions that the new body has, with whichever partner.

        Returns:
            One sentence with the figures that it rests on.
        """
        if available < 1:
            return f"Record at least one action of {self.new_body}; the curve begins at {self.actions[0]}."
        index = int(np.argmin([abs(k - available) for k in self.actions]))
        chained, paired, difference = self.chained[index], self.paired[index], self.difference[index]
        figures = (
            f"at {self.actions[index]} paired actions the chain {self.chain} has {100 * chained.value:.1f} cm, "
            f"the direct pair {self.direct} {100 * paired.value:.1f} cm"
        )
        if difference.high < 0:
            enough = [k for k in self.direct_wins() if k > available]
            more = f" A direct pair overtakes it with {enough[0]} actions." if enough else ""
            return f"Chain: {figures}.{more}"
        if difference.low > 0:
            return f"Use the direct pair: {figures}."
        return f"No difference shown: {figures}. Chain, for it needs no recording with the robot."

    def plot(self) -> CurvePlot:
        """The curve with its intervals."""
        series = {f"chain {self.chain}": self.chained, f"direct pair {self.direct}": self.paired}
        x = [float(k) for k in self.actions]
        return CurvePlot(
            f"What recordings of {self.new_body} are worth",
            f"paired actions of {self.new_body}",
            "landmark error on unseen actions [cm]",
            x,
            series,
            100.0,
            "Bands are 95 % bootstrap intervals over actions; the chain's other links are fitted on all other actions.",
        )

    def table(self) -> Table:
        """The curve as a table with verdicts."""
        columns = [
            Column("Paired actions"),
            Column(f"Chain {self.chain}", "cm", 1, 100),
            Column(f"Direct pair {self.direct}", "cm", 1, 100),
            Column("Difference", "cm", 1, 100, "chain minus direct over the same clips"),
            Column("Verdict"),
        ]
        rows = [
            [k, c, p, d, "chain" if d.high < 0 else "direct pair" if d.low > 0 else "no difference shown"]
            for k, c, p, d in zip(self.actions, self.chained, self.paired, self.difference, strict=True)
        ]
        return Table(f"Chain or direct pair for {self.new_body}", columns, rows)


def efficiency_curve(results: Results) -> EfficiencyCurve | None:
    """The curve of a benchmark, ``None`` if it holds none.

    Draws and seeds of one clip are averaged before anything else, for they are no new motions.
    """
    part = results.select(kind="efficiency")
    if not part.rows:
        return None
    routes = sorted({row["route"] for row in part.rows}, key=lambda route: route.count(">"))
    if len(routes) < 2:
        raise OptionError(f"the efficiency curve needs the chain and the direct pair, found only {routes}")
    direct, chain = routes[0], routes[-1]
    plan = results.about.get("config", {}).get("efficiency") or {}
    numbers = tuple(sorted({int(row["actions"]) for row in part.rows}))
    chained, paired, difference = [], [], []
    for count in numbers:
        ours, theirs = (_by_clip(part.select(route=route, actions=count)) for route in (chain, direct))
        clips = [clip for clip in ours if clip in theirs]
        actions = [ours[clip][1] for clip in clips]
        a, b = (np.array([side[clip][0] for clip in clips]) for side in (ours, theirs))
        chained.append(clustered_estimate(a, actions, statistic=np.mean))
        paired.append(clustered_estimate(b, actions, statistic=np.mean))
        difference.append(clustered_estimate(a - b, actions, statistic=np.mean))
    return EfficiencyCurve(
        chain,
        direct,
        str(plan.get("new_body", chain.split(">")[0])),
        numbers,
        tuple(chained),
        tuple(paired),
        tuple(difference),
    )


def models_plot(humans: Sequence[int] = (1, 2, 3, 5, 8, 10), robots: int = 3) -> CurvePlot:
    """Number of models as humans are added: every pair (Eq. 5) against chains (Eq. 6)."""
    series = {
        "a model a pair (Eq. 5)": [Estimate.exactly(models_direct(n, robots)) for n in humans],
        "chains (Eq. 6)": [Estimate.exactly(models_chained(n, robots)) for n in humans],
    }
    return CurvePlot(
        f"Models needed for {robots} robots", "humans", "models", [float(n) for n in humans], series,
        note="Chains need one pair for every further body.",
    )  # fmt: skip


def _by_clip(results: Results) -> dict[str, tuple[float, str]]:
    found: dict[str, list[float]] = {}
    actions: dict[str, str] = {}
    for row in results.rows:
        found.setdefault(str(row["motion"]), []).append(float(row["landmark_error"]))
        actions[str(row["motion"])] = str(row["action"])
    return {clip: (float(np.mean(values)), actions[clip]) for clip, values in found.items()}
