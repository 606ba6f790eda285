"""Comparisons that come with the package are those that sampling would give."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.evaluation.prediction.tables import links_table
from syda_gym.routes import general, metric
from syda_gym.routes.general import Sampling, general_workspace
from syda_gym.routes.metric import pair_arms, transferability
from syda_gym.routes.routing import BodyGraph, best_route
from syda_gym.routes.shipped import shipped_comparison
from syda_gym.routes.workspace.store import WorkspaceStore

BUNDLED = ("adult", "kid", "pepper", "nao", "tall", "child", "long_arms", "stiff", "left_only")


def test_every_pair_of_bundled_bodies_is_there():
    bodies = [catalog.get(name) for name in BUNDLED]
    for a in bodies:
        for b in bodies:
            for pair in pair_arms(a, b)[0]:
                assert shipped_comparison(pair.source, pair.target, Sampling()) is not None, (a.name, b.name)


def test_a_shipped_comparison_is_what_sampling_gives():
    pair = pair_arms(catalog.get("adult"), catalog.get("pepper"))[0][0]
    shipped = shipped_comparison(pair.source, pair.target, Sampling())
    store = WorkspaceStore()
    a = general_workspace(pair.source, Sampling(), 0, 3, store)
    b = general_workspace(pair.target, Sampling(), 1, 3, store)
    terms = general.compare(a, b)
    np.testing.assert_allclose(shipped[0][:3], (terms.S, terms.C, terms.coverage), atol=1e-9)


def test_bundled_bodies_are_not_sampled_and_other_options_are(monkeypatch):
    def refuse(*_, **__):
        raise RuntimeError("sampled")

    monkeypatch.setattr(metric.general, "general_workspace", refuse)
    assert transferability("kid", "nao", "general").T > 0.0
    for other in ({"seed": 5}, {"samples": 2**12}, {"store": WorkspaceStore()}):
        with pytest.raises(RuntimeError, match="sampled"):
            transferability("kid", "nao", "general", **other)


def test_the_general_t_of_a_pair_is_one_value_wherever_it_is_asked():
    """One resolution for all, and it stands in the result: T rises with the samples by some percent."""
    t = transferability("adult", "pepper", "general")
    assert (t.samples, t.cell) == (Sampling.samples, Sampling.cell) == (2**20, 0.1)
    assert t.T == best_route("adult", "pepper", [("adult", "pepper")], "general").T
    assert t.T == BodyGraph((), [("adult", "pepper")], "general").link("adult", "pepper").T
    assert t.T == BodyGraph((), [("adult", "pepper")], predictor="T").link("adult", "pepper").T
    assert "1,048,576 samples" in links_table([t]).title
