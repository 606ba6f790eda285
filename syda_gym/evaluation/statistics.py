"""Aggregates with honest intervals: interquartile means, bootstrap, paired differences, rank correlation.

The recommendations follow Agarwal et al., "Deep Reinforcement Learning at the Edge of the Statistical
Precipice" (NeurIPS 2021, https://arxiv.org/abs/2108.13264): interquartile means instead of means or medians,
and intervals from a bootstrap stratified by task. Here a task (stratum) is a test action, and the values
within it are episodes: recordings, their mirror images and seeds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from syda_gym.errors import OptionError

__all__ = [
    "Estimate",
    "clustered_estimate",
    "estimate",
    "iqm",
    "paired_difference",
    "probability_of_improvement",
    "spearman",
]

FloatArray = NDArray[np.float64]
RESAMPLES = 2000
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Estimate:
    """A number and the interval that it is known to.

    Attributes:
        value: the point estimate; not a number if there was no data.
        low: lower end of the interval.
        high: upper end of the interval.
        count: how many values it rests on.
    """

    value: float
    low: float
    high: float
    count: int = 1

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval lies on one side of zero: only then does a difference deserve a verdict."""
        return bool(self.low > 0.0 or self.high < 0.0)

    def to_dict(self) -> dict[str, Any]:
        """As a JSON-able dictionary."""
        return asdict(self)

    @classmethod
    def exactly(cls, value: float, count: int = 1) -> Estimate:
        """A number without spread."""
        return cls(float(value), float(value), float(value), count)


def iqm(values: ArrayLike, axis: int | None = None) -> Any:
    """Interquartile mean: the mean after a quarter of the values is cut off at either end.

    Args:
        values: any shape.
        axis: along which to aggregate; ``None`` for all values.

    Returns:
        A float, or an array without ``axis``. Equals ``rliable.metrics.aggregate_iqm`` on a matrix.
    """
    array = np.asarray(values, dtype=np.float64)
    result = stats.trim_mean(array.ravel() if axis is None else array, 0.25, axis=0 if axis is None else axis)
    return float(result) if np.ndim(result) == 0 else result


def estimate(
    values: ArrayLike,
    strata: Sequence[Hashable] | NDArray[Any] | None = None,
    *,
    statistic: Callable[..., Any] = iqm,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Estimate:
    """A statistic with a stratified percentile-bootstrap interval.

    Values are redrawn with replacement within their stratum, so that every action keeps its weight. Strata of
    a single value cannot vary; where every stratum is single, all values are redrawn together instead, for
    otherwise the interval would have no width and pretend to certainty.

    Args:
        values: ``(N,)``; values that are not finite are left out.
        strata: ``(N,)`` label of each value, for example its action; ``None`` for a single stratum.
        statistic: takes ``(values, axis=...)``.
        confidence: of the interval, in (0, 1).
        resamples: number of bootstrap samples.
        seed: of the bootstrap.

    Raises:
        OptionError: ``strata`` has another length, or confidence or resamples are out of range.
    """
    _check(confidence, resamples)
    array, labels = _finite(values, strata)
    if len(array) == 0:
        return Estimate(math.nan, math.nan, math.nan, 0)
    groups = _groups(array, labels)
    point = float(statistic(np.concatenate(groups), axis=-1))
    if np.ptp(array) == 0.0 or len(array) == 1:
        return Estimate(point, point, point, len(array))

    def pooled(*samples: FloatArray, axis: int = -1) -> Any:
        return statistic(np.concatenate(samples, axis=axis), axis=axis)

    # scipy refuses samples of one value; a stratum of one is constant, so it joins as a fixed column.
    varying = [group for group in groups if len(group) > 1]
    fixed = np.concatenate([np.empty(0), *(group for group in groups if len(group) == 1)])

    def with_fixed(*samples: FloatArray, axis: int = -1) -> Any:
        constant = np.broadcast_to(fixed, (*samples[0].shape[:-1], len(fixed)))
        return pooled(*samples, constant, axis=axis)

    result = stats.bootstrap(
        varying,
        with_fixed if len(fixed) else pooled,
        n_resamples=resamples,
        batch=max(1, 4_000_000 // len(array)),
        vectorized=True,
        axis=-1,
        confidence_level=confidence,
        method="percentile",
        rng=np.random.default_rng(seed),
    )
    interval = result.confidence_interval
    return Estimate(point, float(interval.low), float(interval.high), len(array))


def clustered_estimate(
    values: ArrayLike,
    clusters: Sequence[Hashable] | NDArray[Any],
    *,
    statistic: Callable[..., Any] = iqm,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Estimate:
    """A statistic with an interval over clusters: whole actions are redrawn, not episodes within them.

    ``estimate`` answers "what if these actions were recorded again"; this answers "what if other actions had
    been recorded", which is what a claim about new motions needs. It is wider.

    Args:
        values: ``(N,)``.
        clusters: ``(N,)`` label of each value.
        statistic: takes ``(values, axis=...)``.
        confidence: of the interval.
        resamples: number of bootstrap samples.
        seed: of the bootstrap.
    """
    _check(confidence, resamples)
    array, labels = _finite(values, clusters)
    if len(array) == 0:
        return Estimate(math.nan, math.nan, math.nan, 0)
    groups = _split(array, labels)
    point = float(statistic(array, axis=-1))
    if len(groups) == 1:
        return Estimate(point, point, point, len(array))
    rng = np.random.default_rng(seed)
    draws = rng.integers(len(groups), size=(resamples, len(groups)))
    sampled = np.empty(resamples)
    # Clusters differ in size, so samples differ in length; those of one length are aggregated together.
    lengths = np.array([len(group) for group in groups])[draws].sum(axis=1)
    for length in np.unique(lengths):
        rows = np.flatnonzero(lengths == length)
        samples = np.array([np.concatenate([groups[i] for i in draws[row]]) for row in rows])
        sampled[rows] = statistic(samples, axis=-1)
    low, high = np.quantile(sampled, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Estimate(point, float(low), float(high), len(array))


def paired_difference(
    values: ArrayLike,
    baseline: ArrayLike,
    strata: Sequence[Hashable] | NDArray[Any] | None = None,
    **options: Any,
) -> Estimate:
    """Interquartile mean of ``values - baseline`` over the same episodes, with its stratified interval.

    Args:
        values: ``(N,)``.
        baseline: ``(N,)`` of the same episodes in the same order.
        strata: ``(N,)`` as for ``estimate``.
        **options: passed on to ``estimate``.

    Raises:
        OptionError: lengths differ.
    """
    first, second = np.asarray(values, dtype=np.float64), np.asarray(baseline, dtype=np.float64)
    if first.shape != second.shape:
        raise OptionError(f"paired values need equal lengths, got {first.shape} and {second.shape}")
    return estimate(first - second, strata, **options)


def probability_of_improvement(
    values: ArrayLike,
    baseline: ArrayLike,
    strata: Sequence[Hashable] | NDArray[Any] | None = None,
    baseline_strata: Sequence[Hashable] | NDArray[Any] | None = None,
    *,
    lower_is_better: bool = True,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Estimate:
    """Probability that a random episode beats a random baseline episode of its stratum, ties counted half.

    The Mann-Whitney statistic averaged over strata, as ``rliable.metrics.probability_of_improvement``.

    Args:
        values: ``(N,)``.
        baseline: ``(M,)``.
        strata: ``(N,)`` labels; ``None`` for one stratum.
        baseline_strata: ``(M,)`` labels; ``None`` for the same labels as ``strata``.
        lower_is_better: true for errors.
        confidence: of the interval.
        resamples: number of bootstrap samples.
        seed: of the bootstrap.

    Raises:
        OptionError: the two sides have no stratum in common.
    """
    _check(confidence, resamples)
    first, labels = _finite(values, strata)
    second, other = _finite(baseline, strata if baseline_strata is None else baseline_strata)
    sign = -1.0 if lower_is_better else 1.0
    ours = dict(zip(_names(labels), _split(sign * first, labels), strict=True))
    theirs = dict(zip(_names(other), _split(sign * second, other), strict=True))
    shared = [name for name in ours if name in theirs]
    if not shared:
        raise OptionError("the two results have no stratum (action) in common; compare runs on the same motions")
    pairs = [(ours[name], theirs[name]) for name in shared]
    rng = np.random.default_rng(seed)
    point = float(np.mean([_superiority(a[None], b[None])[0] for a, b in pairs]))
    sampled = np.mean(
        [
            _superiority(
                a[rng.integers(len(a), size=(resamples, len(a)))],
                b[rng.integers(len(b), size=(resamples, len(b)))],
            )
            for a, b in pairs
        ],
        axis=0,
    )
    low, high = np.quantile(sampled, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Estimate(point, float(low), float(high), len(first))


def spearman(first: ArrayLike, second: ArrayLike, *, confidence: float = CONFIDENCE) -> Estimate:
    """Spearman's rank correlation with an interval.

    The interval is Fisher's z with the variance of Bonett and Wright (2000), (1 + rho^2 / 2) / (N - 3), which
    holds for small samples where a bootstrap of ranks does not.

    Args:
        first: ``(N,)``.
        second: ``(N,)``.
        confidence: of the interval.

    Returns:
        The correlation; not a number if fewer than three pairs or one side is constant. With three pairs the
        interval is all of [-1, 1].

    Raises:
        OptionError: lengths differ.
    """
    x, y = np.asarray(first, dtype=np.float64).ravel(), np.asarray(second, dtype=np.float64).ravel()
    if x.shape != y.shape:
        raise OptionError(f"a correlation needs equal lengths, got {len(x)} and {len(y)}")
    keep = np.isfinite(x) & np.isfinite(y)
    x, y = x[keep], y[keep]
    count = len(x)
    if count < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return Estimate(math.nan, -1.0, 1.0, count)
    rho = float(stats.spearmanr(x, y).statistic)
    if count == 3 or abs(rho) >= 1.0 - 1e-12:
        wide = count == 3
        return Estimate(rho, -1.0 if wide else rho, 1.0 if wide else rho, count)
    half = float(stats.norm.ppf((1 + confidence) / 2)) * math.sqrt((1 + rho**2 / 2) / (count - 3))
    z = math.atanh(rho)
    return Estimate(rho, math.tanh(z - half), math.tanh(z + half), count)


def _superiority(a: FloatArray, b: FloatArray) -> FloatArray:
    """Share of pairs with a > b, ties half, per row: (R, n) and (R, m) -> (R,)."""
    wins = np.zeros(len(a))
    step = max(1, 2_000_000 // (a.shape[1] * b.shape[1]))
    for start in range(0, len(a), step):
        part = slice(start, start + step)
        x, y = a[part, :, None], b[part, None, :]
        wins[part] = ((x > y) + 0.5 * (x == y)).mean(axis=(1, 2))
    return wins


def _check(confidence: float, resamples: int) -> None:
    if not 0.0 < confidence < 1.0:
        raise OptionError(f"confidence must be between 0 and 1, for example 0.95; got {confidence}")
    if resamples < 1:
        raise OptionError(f"resamples must be at least 1, got {resamples}")


def _finite(values: ArrayLike, labels: Any) -> tuple[FloatArray, NDArray[Any]]:
    array = np.asarray(values, dtype=np.float64).ravel()
    names = np.zeros(len(array), dtype=np.int64) if labels is None else np.asarray(labels).ravel()
    if len(names) != len(array):
        raise OptionError(f"{len(array)} values but {len(names)} strata; give one label a value")
    keep = np.isfinite(array)
    return array[keep], names[keep]


def _names(labels: NDArray[Any]) -> list[Any]:
    return [name.item() for name in np.unique(labels)]


def _split(array: FloatArray, labels: NDArray[Any]) -> list[FloatArray]:
    return [array[labels == name] for name in np.unique(labels)]


def _groups(array: FloatArray, labels: NDArray[Any]) -> list[FloatArray]:
    groups = _split(array, labels)
    return groups if any(len(group) > 1 for group in groups) else [array]
