"""The predictor from training errors."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from syda_gym.errors import OptionError, RouteError
from syda_gym.routes.measured import measured_bodies
from syda_gym.routes.routing import best_route

FAST = {"definition": "general", "samples": 2**12, "repeats": 2}
LEADING = {"adult": 0.004, "kid": 0.02, "stiff": 0.001, "pepper": 0.002}
FOLLOWING = {"adult": 0.006, "kid": 0.03, "stiff": 0.002, "pepper": 0.001}
ERRORS = {(a, b): float(np.sqrt(LEADING[a] + FOLLOWING[b])) for a, b in permutations(LEADING, 2)}


def test_shares_are_found_again() -> None:
    bodies = measured_bodies(ERRORS)
    for pair, error in ERRORS.items():
        assert bodies.error(pair) == pytest.approx(error, rel=0.02)


def test_a_pair_that_was_never_fitted_is_predicted_from_the_others() -> None:
    known = {pair: error for pair, error in ERRORS.items() if pair != ("kid", "pepper")}
    assert measured_bodies(known).error(("kid", "pepper")) == pytest.approx(ERRORS["kid", "pepper"], rel=0.1)


def test_routes_avoid_unpredictable_bodies_between() -> None:
    pairs = [("adult", "kid"), ("kid", "pepper"), ("adult", "stiff"), ("stiff", "pepper")]
    route = best_route("adult", "pepper", pairs, predictor=measured_bodies(ERRORS), **FAST)
    assert route.bodies == ("adult", "stiff", "pepper")
    assert 0.0 < route.score < 1.0


def test_longer_routes_cost_more() -> None:
    bodies = measured_bodies(ERRORS)
    assert bodies.error(("adult", "pepper")) < bodies.error(("adult", "kid", "pepper"))


def test_bad_input() -> None:
    with pytest.raises(OptionError, match="fitted pairs"):
        measured_bodies({})
    with pytest.raises(OptionError, match="not negative"):
        measured_bodies({("a", "b"): -1.0})
    with pytest.raises(RouteError, match="no measured pair holds 'nao'"):
        measured_bodies(ERRORS).error(("adult", "nao"))
