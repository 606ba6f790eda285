"""The benchmark's page: summary, paired differences, sample efficiency, route graph, playback."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.errors import SydaError
from syda_gym.evaluation.benchmark.choice import RouteChoices, choice_table, route_choices
from syda_gym.evaluation.benchmark.compare import compare
from syda_gym.evaluation.benchmark.efficiency import EfficiencyCurve, efficiency_curve, models_plot
from syda_gym.evaluation.benchmark.results import Results
from syda_gym.evaluation.cell_files import read_cell
from syda_gym.evaluation.report import (
    BarPlot,
    Column,
    Headline,
    Playback,
    PlaybackChain,
    Report,
    RouteEdge,
    RouteGraph,
    Section,
    Table,
    Text,
    track,
    write_report,
)
from syda_gym.evaluation.report.model import Block, Cell
from syda_gym.evaluation.statistics import iqm, spearman
from syda_gym.motions.clip import Motions
from syda_gym.routes.route import Route as ForeseenRoute

__all__ = ["differences_table", "summary_table", "write_benchmark_report"]

_GROUP = ("route", "method", "agent", "disturbance")
_MOST_SHOWN = 250  # chains in the playback

Scores = dict[tuple[str, str], float]
"""Transferability of links."""

Foreseen = dict[str, ForeseenRoute]
"""What the dry run expects of routes, by their names."""


def write_benchmark_report(
    results: Results, motions: Motions, folder: Path, choices: RouteChoices | None = None
) -> Path:
    """Writes ``report.html`` beside the results.

    Args:
        results: of ``run_benchmark``, with its folder.
        motions: the data set, for bodies and transferability.
        folder: where to write.
        choices: of ``route_choices``; asked for here if ``None``.
    """
    episodes = results.select(kind="episodes")
    scores, foreseen = _link_scores(episodes, motions), _foreseen(episodes, motions)
    curve = efficiency_curve(results)
    sections: list[Section] = []
    playback = _playback(results, motions)
    if playback is not None:
        sections.append(Section("Playback", [playback]))
    if episodes.rows:
        blocks: list[Block] = [summary_table(episodes, foreseen), _error_plot(episodes)]
        sections.append(Section("Every chain", blocks))
        parted = differences_table(episodes)
        if parted.rows:
            sections.append(Section("Paired differences", [parted]))
        sections.append(Section("Which way to go", _route_blocks(results, motions, scores, foreseen, choices)))
    if curve is not None:
        sections.append(Section("Sample efficiency", [curve.plot(), curve.table(), models_plot()]))
    if results.about["failures"]:
        sections.append(Section("Failed cells", [_failures(results)]))
    data = results.about["data"]
    kind = "synthetic motions" if data["synthetic"] else "recorded motions"
    report = Report(
        "Benchmark of mapping chains",
        f"{data['name']} ({kind}, {data['takes']} takes); every figure is of actions that the fits had not seen",
        _headlines(results, episodes, curve),
        sections,
        _provenance(results),
    )
    return write_report(report, folder)


def summary_table(episodes: Results, foreseen: Foreseen | None = None) -> Table:
    """Every combination of chain, method, agent and disturbance with its figures."""
    columns = [
        Column("Chain"),
        Column("Method"),
        Column("Agent"),
        Column("Disturbance"),
        Column("T", "", 3, 1, "of the chain as a whole, in the dry run"),
        Column("Landmark error", "cm", 2, 100, "interquartile mean, interval over episodes stratified by action"),
        Column(
            "over actions", "cm", 2, 100, "the same with an interval over whole actions: what other motions would give"
        ),
        Column("Mapping alone", "cm", 2, 100),
        Column("Joint error", "deg", 1, 180 / math.pi),
        Column("Success", "%", 0, 100),
        Column("Jitter", "mm/frame³", 2, 1000),
        Column("Speed violations", "%", 2, 100),
        Column("Limit violations", "%", 2, 100),
        Column("Self-collision", "%", 1, 100),
        Column("Bound holds", "%", 0, 100),
        Column("Latency", "ms", 2, 1000),
        Column("Episodes"),
    ]
    timings = _latencies(episodes)
    rows: list[list[Cell]] = []
    for key, group in episodes.groups(*_GROUP).items():
        known = (foreseen or {}).get(str(key[0]))
        rows.append([
            *key,
            known.T if known else math.nan,
            group.estimate("landmark_error"),
            group.estimate("landmark_error", over="actions"),
            group.estimate("mapping_error"),
            group.estimate("joint_error"),
            *(_mean(group, name) for name in (
                "success", "jitter", "speed_violations", "limit_violations", "self_collisions", "coverage"
            )),
            timings.get("|".join(map(str, key)), math.nan),
            len(group.rows),
        ])  # fmt: skip
    return Table("Every chain, method, agent and disturbance", columns, rows)


def differences_table(episodes: Results) -> Table:
    """Every method against the baseline method, and every agent against the base alone, episode by episode."""
    config = episodes.about["config"]
    baseline = config.get("baseline") or config["methods"][0]
    rows: list[list[Cell]] = []
    for column, reference in (("method", baseline), ("agent", "base")):
        others = [name for name in config["methods" if column == "method" else "agents"] if name != reference]
        fixed = "agent" if column == "method" else "method"
        for name in others:
            for (value,), part in episodes.groups(fixed).items():
                pair = part.select(**{column: name}), part.select(**{column: reference})
                if pair[0].rows and pair[1].rows:
                    for one in compare(*pair, labels=(name, reference), ignore=("agent",)):
                        rows.append([
                            f"{name} minus {reference}", str(value), one.route, one.difference, one.improvement,
                            one.verdict, one.episodes,
                        ])  # fmt: skip
    columns = [
        Column("Difference"),
        Column("With"),
        Column("Chain"),
        Column("Landmark error", "cm", 2, 100, "paired by motion, seeds averaged, interval over actions"),
        Column("Probability of improvement", "", 2),
        Column("Verdict"),
        Column("Motions"),
    ]
    note = "A verdict is given only where the 95 % interval of the paired difference leaves out zero."
    return Table(f"Against the method {baseline} and the agent base", columns, rows, note)


def _headlines(results: Results, episodes: Results, curve: EfficiencyCurve | None) -> list[Headline]:
    lines = []
    if episodes.rows:
        groups = episodes.groups(*_GROUP)
        best = min(groups, key=lambda key: iqm(groups[key].values("landmark_error")))
        error = groups[best].estimate("landmark_error", over="actions")
        lines.append(
            Headline(
                f"Least landmark error: {best[0]}",
                f"{100 * error.value:.1f} cm",
                f"{100 * error.low:.1f} to {100 * error.high:.1f} cm; {best[1]}, {best[2]}, disturbance {best[3]}",
                "good",
            )
        )
        lines.append(Headline("Episodes", f"{len(episodes.rows):,}", f"{len(groups)} combinations"))
    if curve is not None:
        wins = curve.chain_wins()
        lines.append(
            Headline(
                "A chain beats a direct pair",
                f"with {', '.join(map(str, wins))} actions" if wins else "nowhere shown",
                f"{curve.chain} against {curve.direct}",
                "good" if wins else "plain",
            )
        )
    failed = len(results.about["failures"])
    cells = len(results.about["cells"])
    lines.append(Headline("Cells", f"{cells - failed} of {cells}", f"{failed} failed", "warn" if failed else "good"))
    return lines


def _error_plot(episodes: Results) -> BarPlot:
    groups = episodes.groups(*_GROUP)
    names = {key: " ".join(part for part in map(str, key) if part not in ("base", "none")) for key in groups}
    methods = {key[1] for key in groups}
    if len(methods) == 1:
        names = {key: name.replace(f" {key[1]}", "", 1) for key, name in names.items()}
    series = {names[key]: [group.estimate("landmark_error", over="actions")] for key, group in groups.items()}
    return BarPlot("Landmark error", "landmark error [cm], interval over actions", ["all actions"], series, 100.0)


def _route_blocks(
    results: Results, motions: Motions, scores: Scores, foreseen: Foreseen, choices: RouteChoices | None
) -> list[Block]:
    episodes = results.select(kind="episodes")
    first = episodes.select(**{name: episodes.rows[0][name] for name in ("method", "agent", "disturbance")})
    errors = {str(key[0]): float(iqm(group.values("mapping_error"))) for key, group in first.groups("route").items()}
    bodies = {body: motions.bodies[body].kind for edge in scores for body in edge}
    edges = [RouteEdge(a, b, score, errors.get(f"{a}>{b}")) for (a, b), score in scores.items() if math.isfinite(score)]
    known = {route: foreseen[route] for route in errors if route in foreseen}
    blocks: list[Block] = []
    if known:
        best = max(known, key=lambda route: known[route].score)
        note = f"Thicker arrows carry a higher T; coloured: {best}, of which the dry run expects the least error."
        blocks.append(RouteGraph("Pairs by transferability", dict(bodies), edges, best.split(">"), note))
    if len(known) >= 4:
        reach = {route: motions.bodies[route.split(">")[-1]].reach for route in known}
        rank = spearman([-one.score for one in known.values()], [errors[route] / reach[route] for route in known])
        blocks.append(
            Text(
                f"Rank correlation of the error that the dry run expects with the mapping's, both over the arm's "
                f"length, over {rank.count} chains: {rank.value:+.2f} (95 % interval {rank.low:+.2f} to "
                f"{rank.high:+.2f}); a useful prediction is positive."
            )
        )
    asked = choices or route_choices(results, motions)
    if asked.choices:
        blocks.append(choice_table(asked))
    blocks += [Text(f"No route chosen for {line}") for line in asked.skipped]
    return blocks


def _foreseen(episodes: Results, motions: Motions) -> Foreseen:
    """The dry run of every route as a whole; those that it cannot judge are left out."""
    from syda_gym.routes.routing import BodyGraph

    names = [tuple(str(text).split(">")) for text in dict.fromkeys(row["route"] for row in episodes.rows)]
    edges = dict.fromkeys(edge for route in names for edge in zip(route[:-1], route[1:], strict=True))
    graph = BodyGraph((), [(motions.bodies[a], motions.bodies[b]) for a, b in edges], directed=True)
    found: Foreseen = {}
    for route in names:
        try:
            known = graph.route(route)
        except SydaError:
            continue
        if known.error is not None:
            found[">".join(route)] = known
    return found


def _edges(route: str) -> list[tuple[str, str]]:
    bodies = route.split(">")
    return list(zip(bodies[:-1], bodies[1:], strict=True))


def _link_scores(episodes: Results, motions: Motions) -> Scores:
    """Transferability of every link that a chain uses; not a number where the metric knows a body not."""
    from syda_gym.routes.metric import transferability

    scores: Scores = {}
    for route in dict.fromkeys(str(row["route"]) for row in episodes.rows):
        for a, b in _edges(route):
            if (a, b) not in scores:
                try:
                    scores[a, b] = transferability(motions.bodies[a], motions.bodies[b]).T
                except SydaError:
                    scores[a, b] = math.nan
    return scores


def _playback(results: Results, motions: Motions) -> Playback | None:
    """The first episode of every chain and method, with the first agent, disturbance and seed."""
    if results.folder is None:
        return None
    chains: list[PlaybackChain] = []
    seen: set[tuple[str, str]] = set()
    several = len(results.about["config"]["methods"]) > 1
    for key in results.about["cells"]:
        path = results.folder / "cells" / f"{key}.json"
        stored = read_cell(path, key) if len(chains) < _MOST_SHOWN else None
        if stored is None:
            continue
        cell = stored["cell"]
        name = (">".join(cell["route"]), cell["method"])
        if name in seen or not stored.get("shown"):
            continue
        seen.add(name)
        chains += [_playback_chain(one, cell, motions, several) for one in stored["shown"]]
    if not chains:
        return None
    note = "Drag to turn, wheel or pinch to zoom. The ghost is the robot's own recorded motion."
    return Playback("Operator, intermediates and robot", chains, note)


def _playback_chain(shown: dict[str, Any], cell: dict[str, Any], motions: Motions, several: bool) -> PlaybackChain:
    bodies = [motions.bodies[name] for name in cell["route"]]
    figures = [track(body, np.array(frames)) for body, frames in zip(bodies, shown["frames"], strict=True)]
    name = ">".join(cell["route"]) + (f" ({cell['method']})" if several else "")
    reference = track(bodies[-1], np.array(shown["reference"]))
    return PlaybackChain(name, figures, shown["fps"], shown["error"], reference, shown["bound"], shown["motion"])


def _failures(results: Results) -> Table:
    rows: list[list[Cell]] = [
        [failure["cell"], failure["trace"].strip().splitlines()[-1]] for failure in results.about["failures"]
    ]
    return Table(
        "Cells that failed", [Column("Cell"), Column("Last line of the trace")], rows, "Traces: benchmark.json."
    )


def _latencies(episodes: Results) -> dict[str, float]:
    """Median latency of each combination, from the timings."""
    found: dict[str, list[float]] = {}
    keys = ["|".join(map(str, key)) for key in episodes.groups(*_GROUP)]
    for timing in episodes.timings:
        parts = str(timing["name"]).split(", ")
        key = "|".join(parts[:4])
        if key in keys and float(timing.get("latency") or 0.0) > 0.0:
            found.setdefault(key, []).append(float(timing["latency"]))
    return {key: float(np.median(values)) for key, values in found.items()}


def _mean(group: Results, name: str) -> float:
    values = group.values(name)
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else math.nan


def _provenance(results: Results) -> dict[str, str]:
    about = results.about
    config = about["config"]
    return {
        "Command": about["command"] or "syda_gym.evaluation.benchmark.run_benchmark",
        "Data": f"{about['data']['name']}, fingerprint {about['data']['fingerprint']}",
        "Held out": "each action once" if config["folds"] == "loao" else f"{config['folds']} groups of actions",
        "Seeds": ", ".join(map(str, config["seeds"])),
        "Versions": ", ".join(f"{name} {value}" for name, value in about["versions"].items()),
    }
