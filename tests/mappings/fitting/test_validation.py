from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import landmark_error
from syda_gym.errors import OptionError
from syda_gym.mappings import fit
from syda_gym.mappings.fitting.held_out import aligned_error, cross_validate


def test_every_row_is_predicted_once_by_a_mapping_that_never_saw_its_action(adult_pepper):
    result = cross_validate(adult_pepper, "ridge", protocol="loao", confidence=False)
    assert result.errors.shape == (1, len(adult_pepper), 4)
    assert result.errors_back is not None
    name = adult_pepper.action_names[1]
    mapping = fit(adult_pepper.without_actions([name]), "ridge", confidence=False)
    test = adult_pepper.only_actions([name])
    expected = landmark_error(test.target_body, mapping(test.source), test.target).mean()
    assert np.isclose(result.per_action()[name], expected)


def test_seeds_are_kept_apart(adult_pepper):
    result = cross_validate(adult_pepper, "nearest", protocol="rand3", seeds=(0, 1), back=False, confidence=False)
    assert result.errors.shape == (2, len(adult_pepper), 4)
    assert result.means[0] != result.means[1]
    assert result.errors_back is None
    assert result.aligned is None


def test_bounds_are_scored_when_fitted(adult_pepper):
    pair = adult_pepper.rows(np.arange(0, 120, 3))
    result = cross_validate(pair, "ridge", protocol="loao", back=False)
    assert result.covered is not None
    assert result.covered.mean() > 0.7
    assert result.bounds is not None
    assert (result.bounds > 0.0).all()


def test_the_paper_s_network_violates_limits_before_they_are_enforced(adult_pepper):
    result = cross_validate(adult_pepper, "syda", "paper", protocol="loao", back=False, epochs=3)
    assert result.limit_violations > 0.0
    assert result.speed_violations is not None


def test_alignment_undoes_a_shift(adult_pepper):
    test = adult_pepper.only_actions(["reach2"])
    late = np.concatenate([np.repeat(test.target[:1], 3, axis=0), test.target[:-3]])
    assert aligned_error(test, late)[3:-3].max() < 1e-9 + landmark_error(test.target_body, late, test.target).max()
    plain = landmark_error(test.target_body, late, test.target).mean()
    assert aligned_error(test, late).mean() < 0.3 * plain


def test_unknown_names_are_refused(adult_pepper):
    with pytest.raises(OptionError, match="protocol"):
        cross_validate(adult_pepper, "ridge", protocol="loo")
    with pytest.raises(OptionError, match="method"):
        cross_validate(adult_pepper, "rigde")
