"""Figures of the bed's study: every predictor over pairs, chains and choices, beside the ceiling of the sessions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.evaluation.statistics import CONFIDENCE
from syda_gym.routes.measured import measured_bodies

if TYPE_CHECKING:
    from syda_gym.evaluation.prediction.bed_work import BedJob, BedSettings

__all__ = ["bed_figures", "score"]

Names = tuple[str, ...]


def bed_figures(
    settings: BedSettings, results: Sequence[Mapping[str, Any]], jobs: Sequence[BedJob], *, resamples: int = 300
) -> dict[str, Any]:
    """Everything that the study says.

    Args:
        settings: what was done.
        results: of the jobs.
        jobs: in the same order.
        resamples: bootstrap samples over pairs of ends.

    Returns:
        JSON-able figures.
    """
    by_job = dict(zip(jobs, results, strict=True))
    sessions = [by_job[job] for job in jobs if job.kind == "session"]
    # Sorted, because a piece that is read again has its keys in another order than one that was just computed.
    routes = sorted((tuple(text.split(">")) for text in sessions[0]["errors"]), key=lambda route: (len(route), route))
    errors = np.array([[session["errors"][">".join(route)] for route in routes] for session in sessions])
    predictions = _predictions(by_job, sessions, routes)
    table = _Table(routes, errors, resamples, settings.seed)
    known = _known(by_job, routes)
    paper = table.only(known)
    return {
        "bodies": {name: body.kind for name, body in settings.bed.bodies.items()},
        "motions": settings.bed.name,
        "clips": len(settings.bed.plan),
        "actions": len(set(settings.bed.plan.actions)),
        "sessions": len(sessions),
        "folds": settings.folds,
        "fps": settings.fps,
        "method": settings.method,
        "preset": settings.preset or "general",
        "seed": settings.seed,
        "pairs": int((table.hops == 1).sum()),
        "chains": int((table.hops > 1).sum()),
        "mean_error": {str(h): float(errors[:, table.hops == h].mean()) for h in np.unique(table.hops)},
        "ceiling": table.ceiling(),
        "random_regret": table.random_regret(),
        "scores": {name: table.score(values) for name, values in predictions.items()},
        "where_the_paper_knows_everybody": {
            "bodies": sorted({name for route, kept in zip(routes, known, strict=True) if kept for name in route}),
            "pairs": int((paper.hops == 1).sum()),
            "chains": int((paper.hops > 1).sum()),
            "ceiling": paper.ceiling(),
            "scores": {
                **{n: paper.score(v[:, known]) for n, v in predictions.items() if n in _BESIDE_PAPER},
                "T paper": paper.score(
                    np.repeat(_products(by_job, "paper", routes, "T")[known][None], len(sessions), 0)
                ),
            },
        },
        "without_one_body": table.leave_one_out(
            {name: predictions[name] for name in ("planned motion", "measured") if name in predictions},
            tuple(settings.bed.bodies),
        ),
        "cpu_seconds": {f"{job.kind} {job.what}": float(by_job[job]["cpu_seconds"]) for job in jobs},
    }


_BESIDE_PAPER = ("planned motion", "T general", "coverage", "hops", "measured")


def score(predicted: FloatArray, error: FloatArray) -> float:
    """Spearman's correlation of a prediction (higher is better) with minus the error; 0 if it says nothing."""
    if len(error) < 3:
        return float("nan")
    if np.ptp(predicted) <= 1e-12 * max(1.0, float(np.abs(predicted).max())):
        return 0.0
    return float(np.corrcoef(rankdata(predicted), rankdata(-error))[0, 1])


class _Table:
    """Errors ``(sessions, routes)`` and how predictions of them are scored."""

    def __init__(self, routes: Sequence[Names], errors: FloatArray, resamples: int, seed: int) -> None:
        self.routes, self.errors = list(routes), errors
        self.resamples, self.seed = resamples, seed
        self.hops = np.array([len(route) - 1 for route in routes])
        ends: dict[tuple[str, str], int] = {}
        self.ends = np.array([ends.setdefault((route[0], route[-1]), len(ends)) for route in routes])
        self.groups = [np.flatnonzero(self.ends == end) for end in range(len(ends))]

    def only(self, kept: NDArray[np.bool_]) -> _Table:
        """A part of the routes."""
        routes = [route for route, keep in zip(self.routes, kept, strict=True) if keep]
        return _Table(routes, self.errors[:, kept], self.resamples, self.seed)

    def score(self, predicted: FloatArray) -> dict[str, Any]:
        """All scores of predictions ``(sessions, routes)``, higher is better; against sessions, and their average."""
        average, mean = self.errors.mean(axis=0), predicted.mean(axis=0)
        found: dict[str, Any] = {}
        rng = np.random.default_rng(self.seed)
        draws = [rng.integers(0, len(self.groups), len(self.groups)) for _ in range(self.resamples)]
        for what, hops in (("pairs", self.hops == 1), ("chains", self.hops > 1)):
            parts = [group[hops[group]] for group in self.groups]
            rows = np.concatenate(parts)
            found[what] = _interval(
                self._mean(predicted, rows), [self._mean(predicted, _drawn(parts, draw)) for draw in draws]
            )
            found[f"{what}_average"] = _interval(
                score(mean[rows], average[rows]),
                [score(mean[rows], average[rows]) for rows in (_drawn(parts, draw) for draw in draws)],
            )
        chosen = [group[self.hops[group] > 1] for group in self.groups]
        choices = np.array([[score(p[g], e[g]) for g in chosen] for p, e in zip(predicted, self.errors, strict=True)])
        lost = np.array([[_regret(p[g], e[g]) for g in chosen] for p, e in zip(predicted, self.errors, strict=True)])
        for name, values in (("choice", choices.mean(axis=0)), ("regret", lost.mean(axis=0))):
            found[name] = _interval(_known_mean(values), [_known_mean(values[draw]) for draw in draws])
        found["regret_average"] = _known_mean([_regret(mean[g], average[g]) for g in chosen])
        return found

    def ceiling(self) -> dict[str, float]:
        """Agreement of sessions (reliability), its root (what a perfect predictor has), and the same of the average."""
        count = len(self.errors)
        found: dict[str, float] = {}
        chosen = [group[self.hops[group] > 1] for group in self.groups]
        couples = [(i, j) for i in range(count) for j in range(i)]
        for what, rows in (("pairs", self.hops == 1), ("chains", self.hops > 1)):
            agreement = float(np.mean([score(-self.errors[i, rows], self.errors[j, rows]) for i, j in couples]))
            found |= _ceilings(what, agreement, count)
        choices = [score(-self.errors[i, g], self.errors[j, g]) for i, j in couples for g in chosen]
        agreement = _known_mean(choices)
        found |= _ceilings("choice", agreement, count)
        both = [(i, j) for i in range(count) for j in range(count) if i != j]
        regrets = [_regret(-self.errors[i, g], self.errors[j, g]) for i, j in both for g in chosen]
        found["oracle_regret"] = _known_mean(regrets)
        return found

    def random_regret(self) -> float:
        """Excess error of a chain drawn by chance over the best one of the same ends."""
        chosen = [group[self.hops[group] > 1] for group in self.groups]
        return _known_mean([e[g].mean() / e[g].min() - 1.0 for e in self.errors for g in chosen if len(g) > 1])

    def leave_one_out(self, predictions: Mapping[str, FloatArray], names: Names) -> dict[str, Any]:
        """Scores without any one body: body to pairs and chains."""
        found: dict[str, Any] = {}
        for name, predicted in predictions.items():
            found[name] = {}
            for body in names:
                kept = np.array([body not in route for route in self.routes])
                single, chain = kept & (self.hops == 1), kept & (self.hops > 1)
                found[name][body] = {
                    "pairs": self._mean(predicted, np.flatnonzero(single)),
                    "chains": self._mean(predicted, np.flatnonzero(chain)),
                }
        return found

    def _mean(self, predicted: FloatArray, rows: NDArray[np.intp]) -> float:
        return float(np.mean([score(p[rows], e[rows]) for p, e in zip(predicted, self.errors, strict=True)]))


def _ceilings(what: str, agreement: float, count: int) -> dict[str, float]:
    many = count * agreement / (1.0 + (count - 1.0) * agreement)  # Spearman and Brown
    return {
        f"{what}_reliability": agreement,
        what: float(np.sqrt(max(agreement, 0.0))),
        f"{what}_average": float(np.sqrt(max(many, 0.0))),
    }


def _known_mean(values: Any) -> float:
    """Mean of what is known; not a number where nothing is."""
    finite = np.asarray(values)[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else float("nan")


def _drawn(parts: Sequence[NDArray[np.intp]], draw: NDArray[np.intp]) -> NDArray[np.intp]:
    return np.concatenate([parts[end] for end in draw])


def _interval(value: float, drawn: Sequence[float]) -> dict[str, float]:
    tail = 50.0 * (1.0 - CONFIDENCE)
    finite = [one for one in drawn if np.isfinite(one)] or [float("nan")]
    low, high = np.percentile(finite, [tail, 100.0 - tail])
    return {"value": value, "low": float(low), "high": float(high)}


def _regret(predicted: FloatArray, error: FloatArray) -> float:
    """Excess error of the preferred route over the best; equally good predictions count by their mean."""
    if len(error) < 2:
        return float("nan")
    best = predicted >= predicted.max() - 1e-12
    return float(error[best].mean() / error.min() - 1.0)


def _predictions(
    by_job: Mapping[BedJob, Mapping[str, Any]], sessions: Sequence[Mapping[str, Any]], routes: Sequence[Names]
) -> dict[str, FloatArray]:
    """Predictor to values ``(sessions, routes)``, higher is better."""
    count = len(sessions)
    found: dict[str, FloatArray] = {}
    for job, result in by_job.items():
        if job.kind == "dry_run":
            values = np.array([-result["errors"][">".join(route)] for route in routes])
            found[job.what] = np.repeat(values[None], count, axis=0)
    for term, name in (("T", "T general"), ("C", "C general"), ("coverage", "coverage"), ("L", "length ratio")):
        found[name] = np.repeat(_products(by_job, "general", routes, term)[None], count, axis=0)
    found["hops"] = np.repeat(-np.array([[len(route) - 1.0 for route in routes]]), count, axis=0)
    found["measured"] = np.stack([_measured(session["training"], routes) for session in sessions])
    return found


def _measured(training: Mapping[str, float], routes: Sequence[Names]) -> FloatArray:
    errors = {(a, b): value for (a, b), value in ((tuple(t.split(">")), v) for t, v in sorted(training.items()))}
    bodies = measured_bodies(errors)
    return np.array([-bodies.error(route) for route in routes])


def _products(
    by_job: Mapping[BedJob, Mapping[str, Any]], definition: str, routes: Sequence[Names], term: str
) -> FloatArray:
    """Products along routes (Eq. 11), NaN where a link is unknown."""
    links = next(result["links"] for job, result in by_job.items() if (job.kind, job.what) == ("T", definition))
    none = {term: float("nan")}
    return np.array(
        [
            float(np.prod([links.get(f"{a}>{b}", none)[term] for a, b in zip(route[:-1], route[1:], strict=True)]))
            for route in routes
        ]
    )


def _known(by_job: Mapping[BedJob, Mapping[str, Any]], routes: Sequence[Names]) -> NDArray[np.bool_]:
    return np.isfinite(_products(by_job, "paper", routes, "T"))
