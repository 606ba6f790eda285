"""Settings chosen among the training actions alone."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import landmark_error
from syda_gym.mappings import fit, fit_many
from syda_gym.mappings.methods.arm_problem import ArmProblem, Coding
from syda_gym.mappings.methods.nested import HOP_SHRINKAGES, NOISES, Choice, choose_hop_shrinkage, choose_input
from syda_gym.motions.clip import PairedMotions


def disturbed(pair: PairedMotions, scale: float, actions: list[str]) -> PairedMotions:
    """The same pair with noise on the source frames of some actions."""
    source = pair.source.copy()
    rows = np.isin(pair.actions, actions)
    source[rows] += np.random.default_rng(0).normal(scale=scale, size=source[rows].shape)
    return PairedMotions(
        pair.source_body,
        pair.target_body,
        source,
        pair.target,
        actions=pair.actions,
        recordings=pair.recordings,
        times=pair.times,
    )


def problem(pair: PairedMotions) -> ArmProblem:
    return ArmProblem.build(pair, 0, Coding())


def shuffled(pair: PairedMotions) -> PairedMotions:
    """Targets that have nothing to do with their sources."""
    order = np.random.default_rng(0).permutation(len(pair))
    return PairedMotions(
        pair.source_body, pair.target_body, pair.source, pair.target[order], actions=pair.actions, times=pair.times
    )


def test_where_there_is_nothing_to_learn_the_most_noise_is_chosen(adult_pepper):
    assert choose_input(problem(adult_pepper)).noise < 0.5
    assert choose_input(problem(shuffled(adult_pepper))).noise == NOISES[-1]


def test_a_hop_follows_its_recordings_only_where_that_helps(adult_kid):
    """Both make the same motion, so the hardest penalty serves; shaking one of them calls for a correction."""
    shaken = disturbed(adult_kid, 0.1, list(adult_kid.action_names))
    assert choose_hop_shrinkage(problem(adult_kid)) == HOP_SHRINKAGES[-1]
    assert choose_hop_shrinkage(problem(shaken)) < HOP_SHRINKAGES[-1]


def test_the_held_out_action_takes_no_part(adult_pepper):
    """Whatever happens to the test action, the mapping fitted without it stays the same bit by bit."""
    spoilt = disturbed(adult_pepper, 0.5, ["reach4"])
    one, other = (
        fit(pair.without_actions(["reach4"]), preset="nested", epochs=3, confidence=False)
        for pair in (adult_pepper, spoilt)
    )
    assert np.array_equal(one(adult_pepper.source), other(adult_pepper.source))


def test_two_actions_are_too_few_to_choose(adult_pepper, adult_kid):
    assert choose_input(problem(adult_pepper.only_actions(["reach0", "reach1"]))) == Choice(0.3, False)
    assert choose_hop_shrinkage(problem(adult_kid.only_actions(["reach0", "reach1"]))) == pytest.approx(10.0)


def test_fits_with_different_choices_keep_their_order(adult_pepper):
    noisy = disturbed(adult_pepper, 0.08, list(adult_pepper.action_names))
    pairs = [adult_pepper, noisy, adult_pepper]
    together = fit_many(pairs, preset="nested", seeds=[0, 0, 1], epochs=5, confidence=False)
    for pair, seed, mapping in zip(pairs, (0, 0, 1), together, strict=True):
        alone = fit(pair, preset="nested", seed=seed, epochs=5, confidence=False)
        assert landmark_error(pair.target_body, alone(pair.source), mapping(pair.source)).max() < 1e-3


def test_a_given_noise_is_not_chosen_again(adult_pepper):
    given = fit(adult_pepper, preset="nested", noise=0.3, epochs=3, confidence=False)
    fixed = fit(adult_pepper, preset="synergies", epochs=3, confidence=False)
    assert np.array_equal(given(adult_pepper.source), fixed(adult_pepper.source))
