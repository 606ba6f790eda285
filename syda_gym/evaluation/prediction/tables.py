"""Transferability, routes and their validation as tables for the terminal and the report."""

from __future__ import annotations

from collections.abc import Sequence

from syda_gym.evaluation.prediction.results import PredictionStudy
from syda_gym.evaluation.report.model import Cell, Column, Table
from syda_gym.routes.metric import Transferability
from syda_gym.routes.route import Route
from syda_gym.routes.suggestion import SpanningPairs, Suggestion

__all__ = ["links_table", "prediction_table", "routes_table", "suggestions_table"]


def links_table(links: Sequence[Transferability]) -> Table:
    """Every term of every pair, with its tie band and notes."""
    if links[0].definition == "dry_run":
        return _rehearsed_table(links)
    columns = [
        Column("A to B"),
        Column("T", tip="alpha L C (Eq. 10)"),
        Column("±", tip="half-width of the band in which values of T tie"),
        Column("C", tip="S + (1 - S)(1 - D)"),
        Column("L", tip="arm length ratio (Eq. 7)"),
        Column("S", tip="share of sufficient manipulability (Eq. 8)"),
        Column("1-D", tip="capability where manipulability lacks (Eq. 9)"),
        Column("cover", tip="share of A's workspace that B reaches"),
    ]
    rows: list[list[Cell]] = [
        [f"{t.source} > {t.target}", t.T, t.tolerance, t.C, t.L, t.S, 1.0 - t.D, t.coverage] for t in links
    ]
    if any(t.alpha != 1.0 for t in links):  # else the column says nothing and costs room on the terminal
        columns.append(Column("alpha", digits=2, tip="noise coefficient"))
        rows = [[*row, t.alpha] for row, t in zip(rows, links, strict=True)]
    notes = dict.fromkeys(f"{t.source} > {t.target}: {note}" for t in links for note in t.notes)
    return Table(_title(links[0]), columns, rows, "\n".join(notes))


def _title(link: Transferability) -> str:
    """With the resolution, on which the general T depends by some percent."""
    at = "" if link.samples is None else f", {link.samples:,} samples, cells of {link.cell:g} arm lengths"
    return f"Transferability, {link.definition} definition{at}"


def _rehearsed_table(links: Sequence[Transferability]) -> Table:
    columns = [
        Column("A to B"),
        Column("expected error [mm]", digits=1, tip="on actions that no fit has seen"),
        Column("±", digits=1, tip="standard error over actions"),
        Column("T", tip="alpha C (Eq. 10 in arm lengths)"),
        Column("C", tip="S + (1 - S)(1 - D)"),
        Column("S", tip="share of frames within a tenth of the arm's length (the form of Eq. 8)"),
        Column("1-D", tip="how near the other frames come (the form of Eq. 9)"),
        Column("alpha", digits=2, tip="what noise and imprecision leave of C"),
    ]
    rows: list[list[Cell]] = [
        [
            f"{t.source} > {t.target}", 1000.0 * (t.error or 0.0), 1000.0 * (t.standard_error or 0.0), t.T, t.C, t.S,
            1.0 - t.D, t.alpha,
        ]
        for t in links
    ]  # fmt: skip
    notes = dict.fromkeys(f"{t.source} > {t.target}: {note}" for t in links for note in t.notes)
    return Table("Transferability, rehearsed (dry run)", columns, rows, "\n".join(notes))


def routes_table(routes: Sequence[Route], predictor: str = "T") -> Table:
    """Routes with what is expected of them, the best one emphasised."""
    ties = [" > ".join(other.bodies) for other in routes[0].ties]
    title = f"Routes from {routes[0].bodies[0]} to {routes[0].bodies[-1]}"
    if routes[0].error is not None:
        return _rehearsed_routes(routes, title, ties)
    columns = [Column("route"), Column("hops"), Column("T", digits=4), Column("±", digits=4), Column("links")]
    if predictor != "T":
        columns.insert(2, Column(predictor, digits=4))
    rows: list[list[Cell]] = []
    for route in routes:
        links = " x ".join(f"{link.T:.3f}" for link in route.links)
        row: list[Cell] = [" > ".join(route.bodies), str(route.hops), route.T, route.tolerance, links]
        if predictor != "T":
            row.insert(2, route.score)
        rows.append(row)
    note = f"Within sampling noise of the best: {'; '.join(ties)}." if ties else ""
    return Table(title, columns, rows, note, strong=[0])


def _rehearsed_routes(routes: Sequence[Route], title: str, ties: list[str]) -> Table:
    columns = [
        Column("route"),
        Column("hops"),
        Column("expected error [mm]", digits=1),
        Column("±", digits=1),
        Column("T", digits=3),
    ]
    rows: list[list[Cell]] = []
    notes = [f"Tie with the best (margin below its standard error): {'; '.join(ties)}."] if ties else []
    for route in routes:
        known = route.error is not None
        error, spread = 1000.0 * (route.error or 0.0), 1000.0 * (route.standard_error or 0.0)
        rows.append([" > ".join(route.bodies), str(route.hops), *((error, spread, route.T) if known else ("-",) * 3)])
        if route.note:
            notes.append(f"{' > '.join(route.bodies)} {route.note}.")
    return Table(title, columns, rows, " ".join(notes), strong=[0])


def suggestions_table(suggestions: Sequence[Suggestion], spanning: SpanningPairs | None = None) -> Table:
    """Pairs to record next by what they add, and the smallest set that connects everyone."""
    columns = [
        Column("pair to record next"),
        Column("gain", digits=4),
        Column("sum of T", digits=4),
        Column("connects"),
    ]
    rows: list[list[Cell]] = [
        [" - ".join(s.pair), s.gain, s.total, f"{len(s.connects)} ordered pairs" if s.connects else "-"]
        for s in suggestions
    ]
    note = ""
    if spanning is not None and spanning.pairs:
        kind = "best" if spanning.exact else "best found"
        pairs = ", ".join(" - ".join(pair) for pair in spanning.pairs)
        note = f"Smallest set that connects all bodies ({kind}): {pairs}; sum of T {spanning.total:.3f}."
    return Table("What to record next", columns, rows, note)


def prediction_table(study: PredictionStudy, full: bool = False) -> Table:
    """Rank correlations of every predictor with the held-out error of routes.

    Args:
        study: from ``validate``.
        full: over routes on which every body has both arms.
    """
    columns = [
        Column("predictor"),
        Column("all routes", digits=2, tip="Spearman with minus the error over arm length"),
        Column("in metres", digits=2, tip="the same with the error in metres"),
        Column("single links", digits=2),
        Column("choice of route", digits=2, tip="mean Spearman over routes between the same ends"),
        Column("regret", "%", digits=0, scale=100.0, tip="excess error of the chain it prefers over the best chain"),
    ]
    scores = study.full_scores if full else study.scores
    rows: list[list[Cell]] = [[s.name, s.all, s.metres, s.pairs, s.choice, s.regret] for s in scores]
    kind = "synthetic" if study.synthetic else "recorded"
    among = "those with two arms of " if full else ""
    note = (
        f"{scores[0].all.count} routes among {among}{len(study.bodies)} bodies ({', '.join(study.bodies)}), "
        f"{kind} motions, {study.folds} groups of actions held out in turn; 95 % bootstrap intervals over ends."
    )
    which = ", routes of two-armed bodies alone" if full else ""
    return Table(f"Does it predict? Spearman with the held-out error, 1 is perfect{which}", columns, rows, note)
