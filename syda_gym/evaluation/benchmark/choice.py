"""Which way to go, judged: the dry run's fixed choice, its choice for every clip, and the best in hindsight.

Nothing is played for it. A route that is chosen for a clip gives the episode that the route's own cell has played.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import SydaError
from syda_gym.evaluation.benchmark.results import Results
from syda_gym.evaluation.chains import Route, name_of
from syda_gym.evaluation.report.model import Cell, Column, Table
from syda_gym.evaluation.statistics import Estimate, clustered_estimate
from syda_gym.motions.clip import Motions
from syda_gym.routes.piloting.per_motion import routes_for_clips
from syda_gym.routes.routing import BodyGraph

__all__ = ["RouteChoice", "RouteChoices", "choice_table", "route_choices"]

_GROUP = ("method", "agent", "disturbance")


@dataclass(frozen=True)
class RouteChoice:
    """One pair of ends with one method, agent and disturbance.

    Attributes:
        ends: ``adult>pepper``.
        method: of the fits.
        agent: who acts.
        disturbance: what disturbs.
        routes: how many could be taken.
        fixed: the route that ``route="auto"`` takes among them.
        best: the one with the least mean error, known afterwards.
        clips: episodes, seeds averaged.
        changed: clips for which ``route="per_motion"`` takes another one than ``fixed``.
        gained: those of them that became better by it.
        error: mean landmark error of the fixed route [m], intervals over actions.
        per_motion: of the route chosen for each clip [m].
        best_error: of ``best`` [m].
        least: of the best route for each clip, known afterwards [m].
        difference: per motion minus fixed, clip by clip [m].
    """

    ends: str
    method: str
    agent: str
    disturbance: str
    routes: int
    fixed: str
    best: str
    clips: int
    changed: int
    gained: int
    error: Estimate
    per_motion: Estimate
    best_error: Estimate
    least: Estimate
    difference: Estimate

    @property
    def verdict(self) -> str:
        """Of the difference; a verdict needs an interval without zero."""
        if not self.changed or not self.difference.excludes_zero:
            return "no difference shown"
        return "better" if self.difference.value < 0.0 else "worse"


@dataclass(frozen=True)
class RouteChoices:
    """All that could be judged, and why other ends could not.

    Attributes:
        choices: one a pair of ends, method, agent and disturbance.
        skipped: a line each.
    """

    choices: tuple[RouteChoice, ...]
    skipped: tuple[str, ...] = ()

    def as_list(self) -> list[dict[str, Any]]:
        """JSON-able."""
        return [{**asdict(one), "verdict": one.verdict} for one in self.choices]


def route_choices(results: Results, motions: Motions, *, seed: int = 0) -> RouteChoices:
    """Compares the fixed choice of a route with the choice for every clip.

    Args:
        results: of a benchmark; ends between which two or more routes were played are compared.
        motions: the data set that was played.
        seed: of the dry run.
    """
    episodes = results.select(kind="episodes")
    by_ends: dict[Route, list[Route]] = {}
    for text in dict.fromkeys(str(row["route"]) for row in episodes.rows):
        route = tuple(text.split(">"))
        by_ends.setdefault((route[0], route[-1]), []).append(route)
    found: list[RouteChoice] = []
    skipped: list[str] = []
    for ends, routes in by_ends.items():
        if len(routes) < 2:
            continue
        try:
            ranked, chosen = _asked(motions, ends, routes, seed)
        except SydaError as error:
            skipped.append(f"{name_of(ends)}: {error}")
            continue
        names = {name_of(route) for route in routes}
        own = Results(tuple(row for row in episodes.rows if row["route"] in names), results.about)
        for key, part in own.groups(*_GROUP).items():
            judged = _judged(ends, key, part, ranked, chosen)
            if judged is not None:
                found.append(judged)
    return RouteChoices(tuple(found), tuple(skipped))


def choice_table(found: RouteChoices) -> Table:
    """The comparison as a table."""
    columns = [  # what a narrow terminal leaves out stands last
        Column("Ends"),
        Column("Method"),
        Column("Fixed route", tip="what route='auto' takes among those played"),
        Column("Its error", "cm", 2, 100, "mean landmark error, interval over actions"),
        Column("One for each clip", "cm", 2, 100, "what route='per_motion' takes"),
        Column("Changed", tip="clips with another route than the fixed one"),
        Column("Verdict"),
        Column("Difference", "cm", 2, 100, "per clip minus fixed over the same clips"),
        Column("of them better"),
        Column("Best for each clip in hindsight", "cm", 2, 100, "what no choice can beat"),
        Column("Best fixed in hindsight"),
        Column("Its error", "cm", 2, 100),
        Column("Agent"),
        Column("Disturbance"),
        Column("Routes"),
        Column("Clips"),
    ]
    rows: list[list[Cell]] = [
        [
            one.ends, one.method, one.fixed, one.error, one.per_motion, one.changed, one.verdict, one.difference,
            one.gained, one.least, one.best, one.best_error, one.agent, one.disturbance, one.routes, one.clips,
        ]
        for one in found.choices
    ]  # fmt: skip
    note = (
        "Both choices are the dry run's, made before any fit: once for the shipped motions, or for every clip that is "
        "to be played. A verdict needs an interval of the difference without zero."
    )
    return Table("One route for all, or one for each clip", columns, rows, note)


def _asked(motions: Motions, ends: Route, routes: Sequence[Route], seed: int) -> tuple[list[Route], dict[str, Route]]:
    """Routes as the dry run ranks them, and the one that it takes for each clip, by the clip's name."""
    bodies = {name: motions.bodies[name] for route in routes for name in route}
    pairs = [(bodies[a], bodies[b]) for route in routes for a, b in zip(route[:-1], route[1:], strict=True)]
    graph = BodyGraph((), pairs, directed=True, seed=seed)
    judged = [graph.route(route) for route in routes]
    ranked = [one.bodies for one in sorted(judged, key=lambda one: -one.score)]
    pair = motions.pair(*ends)
    clips = pair.clips()
    chosen = routes_for_clips(bodies, ranked, [clip.source.frames for clip in clips], pair.fps, seed=seed)
    return ranked, {clip.name: ranked[index] for clip, index in zip(clips, chosen, strict=True)}


def _judged(
    ends: Route, key: tuple[Any, ...], part: Results, ranked: Sequence[Route], chosen: Mapping[str, Route]
) -> RouteChoice | None:
    """One row; ``None`` where some route has no episode of any clip."""
    errors: dict[tuple[str, str], list[float]] = {}
    actions: dict[str, str] = {}
    for row in part.rows:
        if row["landmark_error"] is not None:
            errors.setdefault((str(row["route"]), str(row["motion"])), []).append(float(row["landmark_error"]))
            actions[str(row["motion"])] = str(row["action"])
    names = [name_of(route) for route in ranked]
    clips = [clip for clip in actions if clip in chosen and all((name, clip) in errors for name in names)]
    if not clips:
        return None
    table = np.array([[np.mean(errors[name, clip]) for clip in clips] for name in names])
    taken = np.array([names.index(name_of(chosen[clip])) for clip in clips])
    picked = table[taken, np.arange(len(clips))]
    fixed, best = table[0], int(table.mean(axis=1).argmin())
    words = [actions[clip] for clip in clips]

    def mean(values: FloatArray) -> Estimate:
        return clustered_estimate(values, words, statistic=np.mean)

    method, agent, disturbance = map(str, key)
    return RouteChoice(
        ends=name_of(ends),
        method=method,
        agent=agent,
        disturbance=disturbance,
        routes=len(names),
        fixed=names[0],
        best=names[best],
        clips=len(clips),
        changed=int((taken != 0).sum()),
        gained=int((picked < fixed).sum()),
        error=mean(fixed),
        per_motion=mean(picked),
        best_error=mean(table[best]),
        least=mean(table.min(axis=0)),
        difference=mean(picked - fixed),
    )
