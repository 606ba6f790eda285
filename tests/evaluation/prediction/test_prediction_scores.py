"""Scores of predictors, on routes whose errors are known."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from syda_gym.evaluation.prediction.results import RouteResult
from syda_gym.evaluation.prediction.scores import score_predictors


def routes() -> list[RouteResult]:
    rng = np.random.default_rng(0)
    found = []
    for hops in (1, 2):
        for bodies in permutations("abcde", hops + 1):
            error = float(rng.uniform(0.05, 0.3)) * hops
            predicted = {
                "perfect": 1.0 / error,
                "backward": error,
                "chance": float(rng.random()),
                "ends": float(ord(bodies[0]) + 10 * ord(bodies[-1])),
                "constant": 1.0,
            }
            found.append(RouteResult(bodies, error, 0.5 * error, predicted))
    return found


def test_perfect_backward_and_constant_predictors() -> None:
    scores = {score.name: score for score in score_predictors(routes(), resamples=200)}
    assert next(iter(scores)) == "perfect"
    for field in ("all", "metres", "pairs", "choice"):
        assert np.isclose(getattr(scores["perfect"], field).value, 1.0)
        assert np.isclose(getattr(scores["backward"], field).value, -1.0)
        assert getattr(scores["constant"], field).value == 0.0
    assert scores["perfect"].regret.value == 0.0
    assert scores["backward"].regret.value > scores["constant"].regret.value > 0.0
    assert abs(scores["chance"].all.value) < 0.5
    assert scores["chance"].all.low < 0.0 < scores["chance"].all.high


def test_what_depends_on_the_ends_alone_cannot_choose_a_route() -> None:
    scores = {score.name: score for score in score_predictors(routes(), resamples=50)}
    assert scores["ends"].choice.value == 0.0
    assert scores["ends"].regret.value == scores["constant"].regret.value


def test_the_same_seed_gives_the_same_interval() -> None:
    assert score_predictors(routes(), seed=3, resamples=50) == score_predictors(routes(), seed=3, resamples=50)
