"""Which pair to record next, and the smallest set that connects everyone."""

from __future__ import annotations

from itertools import combinations

import networkx
import numpy as np
import pytest

from syda_gym.errors import OptionError, RouteError
from syda_gym.routes.suggestion import best_scores, spanning_pairs, suggest

FAST = {"definition": "general", "samples": 2**14, "repeats": 2}
BODIES = ("adult", "kid", "pepper", "nao", "stiff")


def test_best_scores_are_dijkstras() -> None:
    rng = np.random.default_rng(3)
    links = rng.uniform(0.05, 1.0, (7, 7)) * (rng.random((7, 7)) < 0.5)
    np.fill_diagonal(links, 0.0)
    graph = networkx.DiGraph()
    graph.add_nodes_from(range(7))
    for i, j in np.argwhere(links > 0):
        graph.add_edge(int(i), int(j), weight=-np.log(links[i, j]))
    best = best_scores(links)
    for i in range(7):
        lengths = networkx.single_source_dijkstra_path_length(graph, i)
        for j in range(7):
            assert best[i, j] == pytest.approx(np.exp(-lengths[j]) if j in lengths else 0.0)


def test_best_scores_within_hops() -> None:
    line = np.diag([0.5, 0.5, 0.5], k=1)
    assert best_scores(line, max_hops=2)[0, 2] == 0.25
    assert best_scores(line, max_hops=2)[0, 3] == 0.0
    assert best_scores(line)[0, 3] == 0.125


def test_the_suggested_pair_beats_every_other() -> None:
    fitted = [("adult", "kid"), ("pepper", "nao")]
    ranked = suggest(BODIES[:4], fitted, **FAST)
    assert len(ranked) == 4
    assert [s.gain for s in ranked] == sorted((s.gain for s in ranked), reverse=True)
    best = ranked[0]
    assert set(best.connects) >= {("adult", "pepper"), ("kid", "nao"), ("nao", "kid")}
    totals = [sum(s.gain for s in suggest(BODIES[:4], [*fitted, r.pair], **FAST)) for r in ranked]
    assert totals[0] == min(totals)  # the better the pair, the less is left to gain


def test_demands_and_hops_steer_the_suggestion() -> None:
    only = suggest(BODIES[:3], [("adult", "kid")], demands=[("kid", "pepper")], **FAST)
    assert only[0].pair == ("kid", "pepper")
    direct = suggest(BODIES[:3], [("adult", "kid")], demands=[("adult", "pepper")], max_hops=1, **FAST)
    assert direct[0].pair == ("adult", "pepper")
    assert direct[-1].gain == 0.0


def test_spanning_pairs_are_the_best_tree() -> None:
    found = spanning_pairs(BODIES, **FAST)
    assert found.exact
    assert len(found.pairs) == len(BODIES) - 1
    approximate = spanning_pairs(BODIES, exhaustive=0, **FAST)
    assert not approximate.exact
    assert approximate.total == pytest.approx(found.total, rel=0.02)
    for pairs in combinations(found.pairs, 3):
        assert spanning_pairs(BODIES, pairs, **FAST).total == pytest.approx(found.total)


def test_bad_input() -> None:
    with pytest.raises(OptionError, match="two bodies"):
        suggest(["adult"])
    with pytest.raises(RouteError, match="none of the bodies"):
        suggest(["adult", "kid"], demands=[("adult", "pepper")], **FAST)
    assert suggest(["adult", "kid"], [("adult", "kid")], **FAST) == []
