"""Validation: held-out errors of a method under a protocol, over seeds, with what else a fair report needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError, OptionError, nearest_name
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.fitting.fit import METHODS, fit_many
from syda_gym.mappings.fitting.windows import WindowRow, window_study
from syda_gym.mappings.limits import speed_violations
from syda_gym.mappings.mapping import Mapping, map_clips
from syda_gym.mappings.models.autoencoder_training import Progress
from syda_gym.motions.clip import PairedMotions

__all__ = ["Fold", "Validation", "aligned_error", "cross_validate", "fit_folds", "held_out_errors"]


@dataclass(frozen=True, eq=False)
class Fold:
    """One fitted fold of one seed.

    Attributes:
        seed: of the split and of the fit.
        test: the held-out rows.
        mapping: source to target, fitted to the other rows.
        back: target to source; ``None`` if it was not asked for.
    """

    seed: int
    test: PairedMotions
    mapping: CodedMapping
    back: Mapping | None


@dataclass(frozen=True, eq=False)
class Validation:
    """Errors of all held-out frames.

    Attributes:
        protocol: how rows were held out.
        errors: ``(seeds, N, landmarks)`` source to target [m].
        errors_back: ``(seeds, N, landmarks)`` target to source [m], or ``None``.
        actions: ``(seeds, N)``.
        limit_violations: share of the target's joint angles outside the limits before they are enforced.
        speed_violations: share of joint steps beyond the speed limits before they are enforced; only where whole clips
            are held out.
        aligned: mean error per seed after the best shift of each test recording: an oracle, it knows the answer.
        covered: ``(seeds, N)`` whether the error bound holds, or ``None`` without bounds.
        bounds: ``(seeds, N)`` error bounds [m], or ``None``.
        controls: for a mapping with a window, what a window gains and how much of that the bare frame index gives; see
            ``windows.window_study``. No result of a window means anything without them.
    """

    protocol: str
    errors: FloatArray
    errors_back: FloatArray | None
    actions: np.ndarray[Any, np.dtype[np.str_]]
    limit_violations: float
    speed_violations: float | None
    aligned: FloatArray | None
    covered: np.ndarray[Any, np.dtype[np.bool_]] | None
    bounds: FloatArray | None
    controls: tuple[WindowRow, ...] = ()

    @property
    def means(self) -> FloatArray:
        """Mean error of each seed [m]."""
        means: FloatArray = self.errors.mean(axis=(1, 2))
        return means

    def per_action(self, values: FloatArray | None = None) -> dict[str, float]:
        """Mean over rows and seeds of each action; of the errors, or of ``values`` ``(seeds, N)``."""
        rows = self.errors.mean(axis=2) if values is None else values
        return {str(name): float(rows[self.actions == name].mean()) for name in np.unique(self.actions)}


def fit_folds(
    pair: PairedMotions,
    method: str = "syda",
    preset: str | None = None,
    *,
    protocol: str = "loao",
    seeds: Sequence[int] = (0,),
    back: bool = True,
    progress: Progress | None = None,
    **options: Any,
) -> list[Fold]:
    """Fits every fold of every seed together, as one batched network where the method is one.

    Args:
        pair: all rows.
        method: as for ``fit``.
        preset: as for ``fit``.
        protocol: ``rand3`` (the paper's; it leaks), ``twin3`` or ``loao``.
        seeds: of splits and fits.
        back: also map target to source: by the inverse, or by a fit of the reversed pair where there is none.
        progress: told the finished fraction.
        **options: as for ``fit``.

    Returns:
        The folds, seed by seed.
    """
    if method not in METHODS:
        raise OptionError(f"unknown method {method!r}; {nearest_name(method, METHODS)}")
    splits = [(int(seed), mask) for seed in seeds for mask in pair.fold_masks(protocol, seed=int(seed))]
    training: dict[bytes, PairedMotions] = {}
    pairs = [training.setdefault(mask.tobytes(), pair.rows(~mask)) for _, mask in splits]
    numbers = [seed for seed, _ in splits]
    forward = fit_many(pairs, method, preset, numbers, progress=progress, **options)
    backward: list[Mapping | None] = [None] * len(splits)
    if back:
        try:
            backward = [mapping.inverse() for mapping in forward]
        except MappingError:
            turned = {id(one): one.reversed() for one in training.values()}
            try:
                backward = [*fit_many([turned[id(one)] for one in pairs], method, preset, numbers, **options)]
            except MappingError:
                backward = [None] * len(splits)  # some baselines only reach robots
    return [
        Fold(seed, pair.rows(mask), mapping, inverse)
        for (seed, mask), mapping, inverse in zip(splits, forward, backward, strict=True)
    ]


def held_out_errors(pair: PairedMotions, folds: Sequence[Fold], protocol: str) -> Validation:
    """Scores fitted folds on their held-out rows."""
    seeds = list(dict.fromkeys(fold.seed for fold in folds))
    groups = [[fold for fold in folds if fold.seed == seed] for seed in seeds]
    errors, errors_back, actions, bounds = [], [], [], []
    outside: list[float] = []
    too_fast: list[np.ndarray[Any, np.dtype[np.bool_]]] = []
    aligned = []
    whole_clips = protocol == "loao"
    for group in groups:
        forward, backward, names, limits, shifted = [], [], [], [], []
        for fold in group:
            test, mapping = fold.test, fold.mapping
            raw = map_clips(mapping, test, raw=True)
            mapped = mapping.target.clamp(raw) if isinstance(mapping.target, Robot) else raw
            forward.append(landmark_error(test.target_body, mapped, test.target))
            names.append(test.actions)
            if isinstance(mapping.target, Robot):
                outside.append(float(mapping.target.violations(raw, 1e-6).mean()))
                if whole_clips:
                    too_fast += [
                        speed_violations(mapping.target, raw[rows], test.fps).ravel() for rows in test.clip_rows()
                    ]
            if whole_clips:
                shifted.append(aligned_error(test, mapped))
            if fold.back is not None:
                backward.append(landmark_error(test.source_body, fold.back(test.target), test.source))
            if mapping.confidence is not None and mapping.confidence.bound is not None:
                limits.append(mapping.error_bound(test.source))
        errors.append(np.concatenate(forward))
        actions.append(np.concatenate(names))
        if backward:
            errors_back.append(np.concatenate(backward))
        if len(limits) == len(group):
            bounds.append(np.concatenate(limits))
        if shifted:
            aligned.append(float(np.concatenate(shifted).mean()))
    stacked = np.stack(errors)
    bound = np.stack(bounds) if bounds else None
    return Validation(
        protocol=protocol,
        errors=stacked,
        errors_back=np.stack(errors_back) if errors_back else None,
        actions=np.stack(actions),
        limit_violations=float(np.mean(outside)) if outside else 0.0,
        speed_violations=float(np.concatenate(too_fast).mean()) if too_fast else None,
        aligned=np.array(aligned) if aligned else None,
        covered=stacked.mean(axis=2) <= bound if bound is not None else None,
        bounds=bound,
    )


def cross_validate(
    pair: PairedMotions,
    method: str = "syda",
    preset: str | None = None,
    *,
    protocol: str = "loao",
    seeds: Sequence[int] = (0,),
    back: bool = True,
    progress: Progress | None = None,
    **options: Any,
) -> Validation:
    """Fits and scores all folds; arguments as for ``fit_folds``.

    Example:
        >>> result = cross_validate(motions.pair("adult", "pepper"), protocol="loao")  # doctest: +SKIP
        >>> result.means, result.per_action()  # doctest: +SKIP
    """
    folds = fit_folds(pair, method, preset, protocol=protocol, seeds=seeds, back=back, progress=progress, **options)
    result = held_out_errors(pair, folds, protocol)
    window = folds[0].mapping.window
    return replace(result, controls=tuple(window_study(pair, window))) if window else result


def aligned_error(test: PairedMotions, mapped: FloatArray, limit: int = 6) -> FloatArray:
    """Errors after the best time shift of each recording, an oracle that separates timing from mapping.

    Args:
        test: the held-out rows, whole clips.
        mapped: frames mapped from ``test.source``.
        limit: largest shift [frames].

    Returns:
        ``(N, landmarks)`` [m], clip by clip.
    """
    clips = test.clip_rows()
    result = []
    for name in dict.fromkeys(test.recordings.tolist()):
        own = [rows for rows in clips if test.recordings[rows[0]] == name]
        trials = []
        for shift in range(-limit, limit + 1):
            moved = [rows[np.clip(np.arange(len(rows)) + shift, 0, len(rows) - 1)] for rows in own]
            trials.append(
                landmark_error(test.target_body, mapped[np.concatenate(own)], test.target[np.concatenate(moved)])
            )
        result.append(min(trials, key=lambda errors: float(errors.mean())))
    return np.concatenate(result)
