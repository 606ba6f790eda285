from __future__ import annotations

import numpy as np
import pytest

from syda_gym.errors import MappingError, RouteError
from syda_gym.mappings import ChainMapping, fit


def test_a_chain_equals_both_applied_in_turn(adult_kid, kid_pepper):
    first, second = fit(adult_kid, preset="paper", epochs=2), fit(kid_pepper, preset="paper", epochs=2)
    chain = first >> second
    assert chain.route == ("adult", "kid", "pepper")
    assert np.array_equal(chain(adult_kid.source), second(first(adult_kid.source)))
    assert np.allclose(chain(adult_kid.source[5]), second(first(adult_kid.source[5])))


def test_chains_of_chains_unfold(adult_kid, kid_pepper):
    first, second = fit(adult_kid, preset="paper", epochs=1), fit(kid_pepper, preset="paper", epochs=1)
    chain = first >> (second >> second.inverse())
    assert chain.route == ("adult", "kid", "pepper", "kid")
    assert len(chain.links) == 3
    back = chain.inverse()
    assert back.route == ("kid", "pepper", "kid", "adult")


def test_a_missing_link_is_named(adult_kid, adult_pepper):
    first, second = fit(adult_kid, preset="paper", epochs=1), fit(adult_pepper, preset="paper", epochs=1)
    with pytest.raises(RouteError, match="from 'kid' to 'adult' is missing"):
        first >> second
    with pytest.raises(MappingError, match="at least one"):
        ChainMapping([])


def test_a_chain_without_inverse_says_which_link(adult_kid, kid_pepper):
    chain = fit(adult_kid, preset="paper", epochs=1) >> fit(kid_pepper, "direct", "paper", epochs=1)
    with pytest.raises(MappingError, match="direct"):
        chain.inverse()
