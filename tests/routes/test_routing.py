"""Routes through the graph of fitted pairs."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.errors import EmbodimentError, OptionError, RouteError
from syda_gym.routes.metric import Transferability
from syda_gym.routes.routing import (
    BodyGraph,
    best_route,
    models_chained,
    models_direct,
    ranked_routes,
)

FAST = {"definition": "general", "samples": 2**14, "repeats": 2}
PAIRS = [("adult", "kid"), ("kid", "pepper"), ("adult", "stiff"), ("stiff", "pepper"), ("kid", "stiff")]


def test_the_best_route_has_the_largest_product_of_all() -> None:
    routes = ranked_routes("adult", "pepper", PAIRS, count=100, **FAST)
    assert len(routes) == 4
    assert [route.T for route in routes] == sorted((route.T for route in routes), reverse=True)
    best = best_route("adult", "pepper", PAIRS, **FAST)
    assert best.bodies == routes[0].bodies
    assert math.isclose(best.T, math.prod(link.T for link in best.links))
    assert best.links[0].source == "adult"
    assert best.links[-1].target == "pepper"


def test_max_hops() -> None:
    short = ranked_routes("adult", "pepper", PAIRS, count=100, max_hops=2, **FAST)
    assert {route.bodies for route in short} == {("adult", "kid", "pepper"), ("adult", "stiff", "pepper")}
    with pytest.raises(RouteError, match="within 1 hops"):
        best_route("adult", "pepper", PAIRS, max_hops=1, **FAST)
    with pytest.raises(OptionError, match="max_hops"):
        best_route("adult", "pepper", PAIRS, max_hops=0, **FAST)


def test_pairs_serve_both_ways_unless_directed() -> None:
    assert best_route("pepper", "adult", PAIRS[:2], **FAST).bodies == ("pepper", "kid", "adult")
    with pytest.raises(RouteError, match="no path"):
        best_route("pepper", "adult", PAIRS[:2], directed=True, **FAST)


def test_the_two_chains_of_the_paper_tie_in_the_general_definition() -> None:
    from syda_gym.routes.paper import paper_human

    graph = BodyGraph([paper_human("adult"), paper_human("kid"), "pepper"], definition="general")
    by_kid, by_adult = graph.route(("adult", "kid", "pepper")), graph.route(("kid", "adult", "pepper"))
    assert pytest.approx(0.298, abs=0.01) == by_kid.T
    assert pytest.approx(0.298, abs=0.01) == by_adult.T
    assert abs(by_kid.T - by_adult.T) < by_kid.tolerance


def test_scaled_copies_on_the_way_cost_only_length() -> None:
    """A route by a body with the same arm ties with the direct pair if no length is lost."""
    direct = [("kid", "pepper"), ("kid", "adult"), ("adult", "pepper")]
    best = best_route("kid", "pepper", direct, **FAST)
    assert best.bodies == ("kid", "pepper")
    by_adult = next(r for r in ranked_routes("kid", "pepper", direct, **FAST) if r.hops == 2)
    assert pytest.approx(by_adult.links[0].C * by_adult.links[1].T) == by_adult.T


def test_a_one_armed_body_on_the_way_loses_an_arm() -> None:
    around = ranked_routes("tall", "pepper", [("tall", "left_only"), ("left_only", "pepper")], **FAST)[0]
    assert around.carried == 0.5
    assert pytest.approx(0.5 * around.links[0].T * around.links[1].T) == around.T
    ends = ranked_routes("left_only", "pepper", [("left_only", "tall"), ("tall", "pepper")], **FAST)[0]
    assert ends.carried == 1.0  # its only arm is all that is asked for


def test_noisy_pairs_are_avoided_with_alpha() -> None:
    alpha = {frozenset(("adult", "kid")): 0.2}
    assert best_route("adult", "pepper", PAIRS[:4], **FAST).bodies == ("adult", "kid", "pepper")
    quiet = best_route("adult", "pepper", PAIRS[:4], alpha=alpha, **FAST)
    assert quiet.bodies == ("adult", "stiff", "pepper")
    assert [link.alpha for link in quiet.links] == [1.0, 1.0]


def test_predictors() -> None:
    fewest = best_route("adult", "pepper", [*PAIRS, ("adult", "pepper")], predictor="hops", **FAST)
    assert fewest.bodies == ("adult", "pepper")
    assert fewest.score == pytest.approx(math.exp(-1.0))
    via = best_route(
        "adult", "pepper", PAIRS, predictor=lambda link: 1.0 if "stiff" in (link.source, link.target) else 0.1, **FAST
    )
    assert via.bodies == ("adult", "stiff", "pepper")
    with pytest.raises(OptionError, match="did you mean 'hops'"):
        best_route("adult", "pepper", PAIRS, predictor="hop", **FAST)
    with pytest.raises(OptionError, match=r"score in \[0, 1\]"):
        best_route("adult", "pepper", PAIRS, predictor=lambda link: 2.0, **FAST)


def test_bad_routes() -> None:
    with pytest.raises(RouteError, match="did you mean 'pepper'"):
        best_route("adult", "peper", PAIRS, **FAST)
    with pytest.raises(RouteError, match="both 'adult'"):
        best_route("adult", "adult", PAIRS, **FAST)
    with pytest.raises(RouteError, match=r"lead to kid.*suggest"):
        best_route("adult", "nao", [("adult", "kid"), ("pepper", "nao")], **FAST)
    with pytest.raises(RouteError, match="twice"):
        best_route("adult", "kid", [("adult", "adult")])
    with pytest.raises(EmbodimentError, match="unknown embodiment"):
        best_route("adult", "kid", [("adult", "nobody")])


@given(humans=st.integers(1, 50), robots=st.integers(1, 50))
def test_chains_never_need_more_models(humans: int, robots: int) -> None:
    assert models_direct(humans, robots) == humans * robots
    assert models_chained(humans, robots) <= models_direct(humans, robots)


def test_model_counts_need_someone() -> None:
    with pytest.raises(OptionError):
        models_direct(0, 3)


class _Drawn(BodyGraph):
    """A graph whose links are given, to test routing apart from the metric."""

    def __init__(self, scores: dict[tuple[int, int], float]) -> None:
        super().__init__(definition="general")
        self._scores = scores
        self.judge.link = self.link  # type: ignore[method-assign]
        for a, b in scores:
            for name in (str(a), str(b)):
                self.bodies[name] = catalog.get("adult")
                self.graph.add_node(name)
            self.graph.add_edge(str(a), str(b))

    def link(self, a: str, b: str) -> Transferability:
        t = self._scores[int(a), int(b)]
        return Transferability(a, b, "general", t, 0.0, 1.0, 1.0, t, 1.0, t)


@settings(deadline=None, max_examples=50)
@given(
    scores=st.dictionaries(
        st.tuples(st.integers(0, 4), st.integers(0, 4)).filter(lambda e: e[0] != e[1]),
        st.floats(0.01, 1.0),
        min_size=1,
        max_size=14,
    ),
    hops=st.one_of(st.none(), st.integers(1, 4)),
)
def test_the_first_route_is_the_best_of_all_simple_paths(scores: dict, hops: int | None) -> None:  # type: ignore[type-arg]
    import networkx

    graph = _Drawn(scores)
    (start, _), (_, end) = next(iter(scores)), list(scores)[-1]
    if start == end:
        return
    paths = list(networkx.all_simple_paths(graph.graph, str(start), str(end), cutoff=hops))
    if not paths:
        with pytest.raises(RouteError):
            next(graph.routes(str(start), str(end), hops))
        return
    expected = max(math.prod(scores[int(a), int(b)] for a, b in zip(p[:-1], p[1:], strict=True)) for p in paths)
    assert pytest.approx(expected) == next(graph.routes(str(start), str(end), hops)).T
