"""Interquartile means, intervals, differences and correlations against values known from elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.errors import OptionError
from syda_gym.evaluation import statistics


def test_iqm_drops_a_quarter_at_either_end():
    assert statistics.iqm([0.0, 1.0, 2.0, 1000.0]) == 1.5
    assert statistics.iqm([5.0]) == 5.0
    assert np.allclose(statistics.iqm([[0, 1, 2, 9], [4, 4, 4, 4]], axis=1), [1.5, 4.0])


def test_estimate_covers_the_truth_about_as_often_as_it_says():
    rng = np.random.default_rng(3)
    hits = 0
    for trial in range(60):
        values = np.concatenate([rng.normal(m, 1.0, 20) for m in (0.0, 5.0, 9.0)])
        strata = np.repeat(["a", "b", "c"], 20)
        found = statistics.estimate(values, strata, statistic=np.mean, resamples=300, seed=trial)
        hits += found.low <= (0.0 + 5.0 + 9.0) / 3 <= found.high
    assert 50 <= hits <= 60


def test_stratified_interval_is_narrower_than_a_pooled_one():
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(m, 0.1, 10) for m in (0.0, 5.0, 9.0)])
    strata = np.repeat([0, 1, 2], 10)
    within = statistics.estimate(values, strata)
    pooled = statistics.estimate(values)
    over = statistics.clustered_estimate(values, strata)
    assert within.value == pooled.value == over.value
    assert within.high - within.low < 0.5 * (pooled.high - pooled.low)
    assert over.high - over.low > pooled.high - pooled.low


def test_single_value_strata_fall_back_to_one_stratum():
    values = [1.0, 2.0, 3.0, 4.0, 5.0]
    found = statistics.estimate(values, ["a", "b", "c", "d", "e"])
    assert found == statistics.estimate(values)
    assert found.low < found.value < found.high


def test_a_mixture_of_single_and_repeated_strata_keeps_the_single_value_fixed():
    found = statistics.estimate([0.0, 1.0, 100.0], ["a", "a", "b"], statistic=np.mean)
    assert found.value == pytest.approx(101 / 3)
    assert found.low == pytest.approx(100 / 3)
    assert found.high == pytest.approx(102 / 3)


def test_same_seed_same_bits_and_order_of_strata_does_not_matter():
    values = np.random.default_rng(1).normal(size=30)
    strata = np.repeat(["x", "y", "z"], 10)
    first = statistics.estimate(values, strata, seed=5)
    assert first == statistics.estimate(values, strata, seed=5)
    assert first != statistics.estimate(values, strata, seed=6)
    assert statistics.estimate(values[::-1], strata[::-1], seed=5).value == pytest.approx(first.value)


def test_no_data_and_constant_data():
    nothing = statistics.estimate([np.nan, np.inf])
    assert np.isnan(nothing.value)
    assert nothing.count == 0
    assert statistics.estimate([2.0, 2.0, 2.0]) == statistics.Estimate(2.0, 2.0, 2.0, 3)


def test_paired_difference_sees_a_small_shift_under_a_large_spread():
    rng = np.random.default_rng(2)
    baseline = rng.normal(0.0, 10.0, 60)
    values = baseline - 0.5 + rng.normal(0.0, 0.1, 60)
    found = statistics.paired_difference(values, baseline, np.repeat(np.arange(6), 10))
    assert found.excludes_zero
    assert found.low < -0.5 < found.high
    with pytest.raises(OptionError, match="equal lengths"):
        statistics.paired_difference(values, baseline[:-1])


def test_probability_of_improvement_matches_the_mann_whitney_statistic():
    from scipy import stats

    rng = np.random.default_rng(4)
    a, b = rng.normal(0.0, 1.0, 15), rng.normal(0.7, 1.0, 12)
    u = stats.mannwhitneyu(b, a).statistic / (15 * 12)
    found = statistics.probability_of_improvement(a, b, np.zeros(15), np.zeros(12))
    assert found.value == pytest.approx(u)
    assert found.low < found.value < found.high
    upside_down = statistics.probability_of_improvement(a, b, np.zeros(15), np.zeros(12), lower_is_better=False)
    assert upside_down.value == pytest.approx(1 - u)
    with pytest.raises(OptionError, match="in common"):
        statistics.probability_of_improvement(a, b, ["p"] * 15, ["q"] * 12)


def test_spearman_value_and_interval():
    # Bonett & Wright's interval for rho = 0.8181..., N = 10, computed by hand from their formula.
    x = np.arange(10.0)
    y = np.array([1.0, 0.0, 3.0, 2.0, 5.0, 4.0, 9.0, 6.0, 7.0, 8.0])
    found = statistics.spearman(x, y)
    rho = 1 - 6 * np.sum((x - y) ** 2) / (10 * 99)
    half = 1.959963984540054 * np.sqrt((1 + rho**2 / 2) / 7)
    assert found.value == pytest.approx(rho)
    assert (found.low, found.high) == pytest.approx((np.tanh(np.arctanh(rho) - half), np.tanh(np.arctanh(rho) + half)))
    assert np.isnan(statistics.spearman([1, 2], [1, 2]).value)
    assert np.isnan(statistics.spearman([1, 1, 1, 1], [1, 2, 3, 4]).value)
    assert (
        statistics.spearman([1, 2, 3], [1, 2, 3]).low,
        statistics.spearman([1, 2, 3], [1, 2, 3]).high,
    ) == (-1, 1)


@pytest.mark.parametrize(
    "call",
    [
        lambda: statistics.estimate([1.0, 2.0], ["a"]),
        lambda: statistics.estimate([1.0, 2.0], confidence=1.0),
        lambda: statistics.estimate([1.0, 2.0], resamples=0),
        lambda: statistics.spearman([1.0, 2.0], [1.0]),
    ],
)
def test_bad_input_is_named(call):
    with pytest.raises(OptionError):
        call()


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30), st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_the_interval_stays_within_the_range_of_the_values(values, groups):
    strata = np.arange(len(values)) % groups
    found = statistics.estimate(values, strata, resamples=50)
    slack = 1e-9 + 1e-9 * max(map(abs, values))
    assert min(values) - slack <= found.low <= found.high <= max(values) + slack
    assert min(values) - slack <= found.value <= max(values) + slack


def test_agrees_with_rliable_on_a_fixture():
    # Written down from rliable 1.2.0 (20,000 and 5,000 repetitions) on the same 10 runs x 6 tasks.
    rng = np.random.default_rng(2024)
    ours = rng.gamma(4.0, 0.015, size=(10, 6)) + np.arange(6) * 0.01
    theirs = rng.gamma(4.0, 0.018, size=(10, 6)) + np.arange(6) * 0.01
    tasks = np.tile(np.arange(6), 10)
    for values, expected in (
        (ours, (0.08155071, 0.07354543, 0.09052286)),
        (theirs, (0.0915153, 0.08282053, 0.10214173)),
    ):
        found = statistics.estimate(values.ravel(), tasks, resamples=20000)
        assert found.value == pytest.approx(expected[0], abs=1e-6)
        assert (found.low, found.high) == pytest.approx(expected[1:], abs=4e-4)
    found = statistics.probability_of_improvement(
        ours.ravel(), theirs.ravel(), tasks, lower_is_better=False, resamples=5000
    )
    assert found.value == pytest.approx(0.40666667, abs=1e-6)
    assert (found.low, found.high) == pytest.approx((0.30166667, 0.51833333), abs=8e-3)
