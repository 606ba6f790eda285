"""Two results side by side: paired differences with intervals, and a verdict only where they part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from syda_gym.errors import OptionError, nearest_name
from syda_gym.evaluation.benchmark.results import Results
from syda_gym.evaluation.report.model import Cell, Column, Table
from syda_gym.evaluation.statistics import Estimate, clustered_estimate, probability_of_improvement

__all__ = ["BETTER_HIGH", "Comparison", "compare", "comparison_table"]

BETTER_HIGH = ("success", "coverage", "reward")
"""Figures of which more is better; of all others less is."""

_SAME_EPISODE = ("kind", "route", "agent", "disturbance", "actions", "draw", "motion")


@dataclass(frozen=True)
class Comparison:
    """One chain, compared.

    Attributes:
        route: bodies of the chain, or ``"all"``.
        first: what is compared, for example ``syda, base``.
        second: with what.
        figure: the compared figure.
        difference: first minus second over the same episodes, interval over actions.
        improvement: probability that the first is better on a random episode of the same action.
        verdict: ``"better"``, ``"worse"`` or ``"no difference shown"``: a verdict needs an interval without zero.
        episodes: number of paired episodes.
    """

    route: str
    first: str
    second: str
    figure: str
    difference: Estimate
    improvement: Estimate
    verdict: str
    episodes: int


def compare(
    first: Results,
    second: Results,
    figure: str = "landmark_error",
    *,
    labels: tuple[str, str] = ("A", "B"),
    ignore: Sequence[str] = (),
) -> list[Comparison]:
    """Compares two results chain by chain and over all chains.

    Episodes are paired by chain, agent, disturbance and motion; seeds are averaged first, for a seed is no new
    motion. The interval is a bootstrap over whole actions.

    Args:
        first: A.
        second: B.
        figure: a column of the results.
        labels: names of A and B.
        ignore: columns that may differ between paired episodes, for example ``("agent",)``.

    Raises:
        OptionError: they have no episode in common, or no such figure.
    """
    names = [name for name in _SAME_EPISODE if name not in ignore]
    ours, theirs = _by_episode(first, names, figure), _by_episode(second, names, figure)
    shared = [key for key in ours if key in theirs]
    if not shared:
        raise OptionError(
            f"{labels[0]} and {labels[1]} have no episode in common; compare results of the same motions, routes, "
            "agents and disturbances"
        )
    place = names.index("route")
    routes = list(dict.fromkeys(key[place] for key in shared))
    parts = [(route, [key for key in shared if key[place] == route]) for route in routes]
    if len(routes) > 1:
        parts.insert(0, ("all", shared))
    return [_compared(route, keys, ours, theirs, figure, labels) for route, keys in parts]


def comparison_table(comparisons: Sequence[Comparison], scale: float = 1.0, unit: str = "", digits: int = 4) -> Table:
    """Comparisons as a table."""
    columns = [
        Column("Chain"),
        Column("Difference", unit, digits, scale, "first minus second, interval over actions"),
        Column("Probability of improvement", "", 2),
        Column("Verdict"),
        Column("Episodes"),
    ]
    rows: list[list[Cell]] = [[c.route, c.difference, c.improvement, c.verdict, c.episodes] for c in comparisons]
    first = comparisons[0]
    return Table(
        f"{first.figure}: {first.first} minus {first.second}",
        columns,
        rows,
        "A verdict is given only where the 95 % interval of the paired difference leaves out zero.",
    )


def _by_episode(results: Results, names: Sequence[str], figure: str) -> dict[tuple[Any, ...], tuple[float, str]]:
    """Mean over seeds of a figure for each episode, with its action."""
    if results.rows and figure not in results.rows[0]:
        raise OptionError(f"no figure {figure!r}; {nearest_name(figure, results.rows[0])}")
    found: dict[tuple[Any, ...], list[float]] = {}
    actions: dict[tuple[Any, ...], str] = {}
    for row in results.rows:
        if row[figure] is not None:
            key = tuple(row[name] for name in names)
            found.setdefault(key, []).append(float(row[figure]))
            actions[key] = str(row["action"])
    return {key: (float(np.mean(values)), actions[key]) for key, values in found.items()}


def _compared(
    route: str,
    keys: Sequence[tuple[Any, ...]],
    ours: dict[tuple[Any, ...], tuple[float, str]],
    theirs: dict[tuple[Any, ...], tuple[float, str]],
    figure: str,
    labels: tuple[str, str],
) -> Comparison:
    a = np.array([ours[key][0] for key in keys])
    b = np.array([theirs[key][0] for key in keys])
    actions = [ours[key][1] for key in keys]
    difference = clustered_estimate(a - b, actions, statistic=np.mean)
    higher = figure in BETTER_HIGH
    improvement = probability_of_improvement(a, b, actions, lower_is_better=not higher)
    gain = difference.low > 0 if higher else difference.high < 0
    verdict = "no difference shown" if not difference.excludes_zero else "better" if gain else "worse"
    if len(set(actions)) < 2:
        verdict = "no difference shown"
    return Comparison(route, *labels, figure, difference, improvement, verdict, len(keys))
