"""Scores of predictors: rank correlation with the error of routes, with bootstrap intervals over pairs of ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.evaluation.prediction.results import PredictorScore, RouteResult
from syda_gym.evaluation.statistics import CONFIDENCE, Estimate

__all__ = ["PredictorScore", "score_predictors"]


def score_predictors(
    routes: Sequence[RouteResult], *, seed: int = 0, resamples: int = 1000
) -> tuple[PredictorScore, ...]:
    """Scores every predictor of the routes, best first by ``choice`` plus ``all``.

    Intervals redraw the pairs of ends, because routes between the same ends share frames and links.

    Args:
        routes: chains with errors and predictions.
        seed: of the bootstrap.
        resamples: bootstrap samples.
    """
    ends = np.array(_labels(routes))
    groups = [np.flatnonzero(ends == label) for label in range(ends.max() + 1)]
    rng = np.random.default_rng(seed)
    draws = [rng.integers(0, len(groups), len(groups)) for _ in range(resamples)]
    error = np.array([route.error for route in routes])
    metres = np.array([route.metres for route in routes])
    hops = np.array([route.hops for route in routes])
    scores = []
    for name in routes[0].predicted:
        predicted = np.array([route.predicted[name] for route in routes])
        single = [group[hops[group] == 1] for group in groups]
        scores.append(
            PredictorScore(
                name,
                all=_bootstrap(predicted, -error, groups, draws),
                metres=_bootstrap(predicted, -metres, groups, draws),
                pairs=_bootstrap(predicted, -error, single, draws),
                choice=_mean_over(np.array([_rank(predicted[g], -error[g]) for g in groups]), draws),
                regret=_mean_over(np.array([_regret(predicted, error, g[hops[g] > 1]) for g in groups]), draws),
            )
        )
    return tuple(sorted(scores, key=lambda s: -(np.nan_to_num(s.all.value) + np.nan_to_num(s.choice.value))))


def _labels(routes: Sequence[RouteResult]) -> list[int]:
    numbers: dict[tuple[str, str], int] = {}
    return [numbers.setdefault((route.bodies[0], route.bodies[-1]), len(numbers)) for route in routes]


def _bootstrap(predicted: FloatArray, wanted: FloatArray, groups: list[Any], draws: list[Any]) -> Estimate:
    rows = np.concatenate(groups)
    picks = (np.concatenate([groups[i] for i in draw]) for draw in draws)
    values = np.array([_rank(predicted[pick], wanted[pick]) for pick in picks])
    return _estimate(_rank(predicted[rows], wanted[rows]), values, len(rows))


def _mean_over(values: FloatArray, draws: list[Any]) -> Estimate:
    """Mean over groups, those without a value left out."""
    if not np.isfinite(values).any():
        return Estimate(np.nan, np.nan, np.nan, 0)
    means = np.array([np.nanmean(values[draw]) for draw in draws if np.isfinite(values[draw]).any()])
    return _estimate(float(np.nanmean(values)), means, int(np.isfinite(values).sum()))


def _estimate(value: float, values: FloatArray, count: int) -> Estimate:
    finite = values[np.isfinite(values)]
    if not np.isfinite(value) or not len(finite):
        return Estimate(value, np.nan, np.nan, count)
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(finite, [tail, 100.0 - tail])
    return Estimate(value, float(low), float(high), count)


def _rank(predicted: FloatArray, wanted: FloatArray) -> float:
    """Spearman's correlation; a predictor that does not distinguish scores 0, too few routes give no value."""
    if len(predicted) < 3:
        return float("nan")
    if np.ptp(predicted) <= 1e-12 * max(1.0, np.abs(predicted).max()) or np.ptp(wanted) == 0.0:
        return 0.0
    return float(np.corrcoef(stats.rankdata(predicted), stats.rankdata(wanted))[0, 1])


def _regret(predicted: FloatArray, error: FloatArray, group: Any) -> float:
    """Relative excess error of the preferred route; equally good predictions count by their mean."""
    if len(group) < 2:
        return float("nan")
    best = predicted[group] >= predicted[group].max() - 1e-12
    return float(error[group][best].mean() / error[group].min() - 1.0)
