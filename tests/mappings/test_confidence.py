from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import landmark_error
from syda_gym.mappings import fit
from syda_gym.mappings.confidence import action_maximum
from syda_gym.mappings.fitting.fit import fit_many
from syda_gym.mappings.methods import general
from tests.mappings.conftest import make_pair


def test_the_bound_is_the_worst_action_s_own_quantile():
    errors = np.concatenate([np.full(1000, 0.01), np.linspace(0.0, 0.1, 11)])
    actions = np.array(["easy"] * 1000 + ["hard"] * 11)
    assert np.isclose(action_maximum(errors, actions), 0.09)
    assert action_maximum(errors, actions) > 5 * np.quantile(errors, 0.9)


@pytest.mark.parametrize("method", ["syda", "ridge"])
def test_the_bound_covers_unseen_actions(method):
    pair = make_pair("adult", "pepper", actions=7, frames=12, seed=5)
    covered = []
    for name in pair.action_names[:2]:
        mapping = fit(pair.without_actions([name]), method)
        test = pair.only_actions([name])
        errors = landmark_error(test.target_body, mapping(test.source), test.target).mean(axis=1)
        bound = mapping.error_bound(test.source)
        assert bound.shape == (len(test),)
        covered.append((errors <= bound).mean())
    assert np.mean(covered) >= 0.85


def test_frames_unlike_the_training_are_flagged(adult_pepper):
    mapping = fit(adult_pepper)
    rng = np.random.default_rng(0)
    shuffled = rng.permuted(adult_pepper.source.reshape(-1, 6, 3), axis=1).reshape(-1, 18)
    assert mapping.unfamiliar(adult_pepper.source).mean() < 0.02
    assert mapping.unfamiliar(shuffled).mean() > 0.3
    difficulty = mapping.difficulty(adult_pepper.source)
    assert ((difficulty >= 0.0) & (difficulty <= 1.0)).all()
    assert mapping.difficulty(shuffled).mean() > difficulty.mean()


def test_chains_combine_bounds_and_flags(adult_kid, kid_pepper):
    hop, link = fit(adult_kid), fit(kid_pepper)
    chain = hop >> link
    frames = adult_kid.source[:20]
    between = hop(frames)
    expected = hop.error_bound(frames) * link.confidence.gain + link.error_bound(between)
    assert np.allclose(chain.error_bound(frames), expected)
    assert (chain.error_bound(frames) > link.error_bound(between)).all()
    assert np.array_equal(chain.difficulty(frames), np.maximum(hop.difficulty(frames), link.difficulty(between)))
    assert np.array_equal(chain.unfamiliar(frames), hop.unfamiliar(frames) | link.unfamiliar(between))


def test_folds_share_the_fits_that_hold_out_the_same_two_actions(monkeypatch):
    pair = make_pair("adult", "pepper", actions=4, frames=12, seed=5)
    folds = [pair.without_actions([name]) for name in pair.action_names]
    trained, train = [], general.train
    monkeypatch.setattr(general, "train", lambda jobs, *rest: trained.extend(jobs) or train(jobs, *rest))
    together = fit_many(folds, preset="synergies", epochs=3)
    assert len(trained) == 4 + 6  # each fold, and each pair of actions once rather than twice
    for fold, mapping in zip(folds, together, strict=True):
        alone = fit(fold, preset="synergies", epochs=3)
        assert np.isclose(mapping.confidence.bound, alone.confidence.bound, rtol=1e-4)
        assert np.allclose(mapping(pair.source), alone(pair.source), atol=1e-4)
