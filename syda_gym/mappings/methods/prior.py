"""The ``general`` preset, the default: a geometric prior, and what a pair's recordings add to it.

The image of a limb is its direction after one rotation; that needs no recording. What two bodies do differently is
learned on top of it, as a ridge of what the image leaves over, both ways. With up to three actions the ridge is shrunk
hard, so that they cannot spoil what geometry knows. From four on six penalties are judged on training actions held out
in turn, from five on also without the image (enough actions may know better than geometry), and the mapping is the mean
of these candidates, weighed by how well each can be told from the best: nine actions cannot say which is right, and a
mean does not have to know.

It is SyDa's linear case in closed form. A linear dual autoencoder with the cross losses A-to-B and B-to-A, whose inputs
carry noise of s standard deviations, has ridges with penalty s^2 as its optimum (Bishop 1995); the synergies are the
singular directions of the map. ``docs/mappings.md`` says what training such networks step by step gave instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError, nearest_name
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.window_coder import WindowCoder
from syda_gym.mappings.methods.arm_problem import (
    ArmCoder,
    ArmProblem,
    Coding,
    fit_problems,
    thinned,
    upper_share,
)
from syda_gym.mappings.methods.general import fit_hops, take_options
from syda_gym.mappings.methods.jobs import FitJob
from syda_gym.mappings.methods.nested import held_out_gaps
from syda_gym.mappings.models.autoencoder_training import Progress
from syda_gym.mappings.models.linear import Ridge
from syda_gym.mappings.models.prior import PriorRegressor
from syda_gym.mappings.models.regressors import Regressor
from syda_gym.mappings.models.rotation import GeometricRegressor, fitted_rotation
from syda_gym.motions.clip import PairedMotions

__all__ = ["FEW_SHRINKAGE", "SHRINKAGES", "fit_general"]

SHRINKAGES = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Candidates for the penalty of a correction, weakest first; fixed in advance."""

FEW_SHRINKAGE = 3.0
"""The penalty where fewer than four actions leave too little to judge by."""

_LAG = 6
_LEAN = 0.1
_JUDGED_ACTIONS = 4
_FREE_ACTIONS = 5


def fit_general(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """A geometric prior plus a shrunk correction, both ways; between bodies of one kind a hop.

    Options: ``lag`` (largest lag searched for, 6 frames), ``window`` (past frames that a human's code shows, 0),
    ``confidence`` (hold actions out for the error bound, true), ``shrinkage`` (of the correction; 3 below four
    actions, else a mean over candidates), ``hop_shrinkage`` (likewise, of a hop).
    """
    defaults = {"lag": _LAG, "window": 0, "confidence": True, "shrinkage": None, "hop_shrinkage": None}
    own, unknown = take_options(jobs[0].options, defaults)
    for name in unknown:
        raise OptionError(
            f"unknown option {name!r}; {nearest_name(name, defaults)}. Networks have others, see preset='synergies'"
        )

    def fitter(problems: Sequence[ArmProblem]) -> list[Regressor]:
        if problems[0].pair.source_body.kind == problems[0].pair.target_body.kind:
            return fit_hops(problems, own["hop_shrinkage"])
        fitted: dict[int, Regressor] = {}  # nothing is random: fits of the same frames are one fit
        for number, problem in enumerate(problems, start=1):
            if id(problem.pair) not in fitted:
                fitted[id(problem.pair)] = _corrected(problem, own["shrinkage"])
            if progress is not None:
                progress(number / len(problems))
        return [fitted[id(problem.pair)] for problem in problems]

    coding = Coding(int(own["lag"]), window=int(own["window"]))
    return fit_problems(jobs, "syda", fitter, coding=coding, confidence=bool(own["confidence"]))


def _corrected(problem: ArmProblem, shrinkage: float | None) -> PriorRegressor:
    """Rotation and both corrections; the way back takes the robot's frames as recorded, lag and all."""
    source, target = problem.main
    lengths = upper_share(problem.source_coder), upper_share(problem.target_coder)
    prior = _image(_flat(source), _flat(target), *lengths)
    there, kept = _correction(_Way(problem.pair, source, target, problem.target_coder, *lengths), prior, shrinkage)
    back, kept_back = _correction(
        _Way(problem.pair, *problem.main_back, _current(problem.source_coder), *lengths[::-1]),
        prior.inverse(),
        shrinkage,
    )
    return PriorRegressor(prior, there, back, (kept, kept_back))


@dataclass(frozen=True, eq=False)
class _Way:
    """One direction: codes of both ends ``(N, K, D)`` and ``(N, K, E)``, the output's coder, upper arms' shares."""

    pair: PairedMotions
    source: FloatArray
    target: FloatArray
    coder: ArmCoder
    source_share: float
    target_share: float


def _correction(way: _Way, prior: GeometricRegressor, shrinkage: float | None) -> tuple[Ridge, float]:
    """The ridge of what the geometric image leaves over, and the share of the image that is kept."""

    def predict(x: FloatArray, y: FloatArray, new: FloatArray) -> list[FloatArray]:
        image = _image(x, y, way.source_share, way.target_share)
        kept = [image(new) + ridge(new) for ridge in Ridge.path(x, y - image(x), SHRINKAGES)]
        return [*kept, *(ridge(new) for ridge in Ridge.path(x, y, SHRINKAGES))] if free else kept

    free = len(way.pair.action_names) >= _FREE_ACTIONS
    x, y = thinned(way.source), thinned(way.target)
    errors = None
    if shrinkage is None and len(way.pair.action_names) >= _JUDGED_ACTIONS:
        errors = held_out_gaps(way.pair, way.source, way.target, way.coder, predict)
    if errors is None:
        chosen = FEW_SHRINKAGE if shrinkage is None else float(shrinkage)
        return Ridge.path(x, y - prior(x), [chosen])[0], 1.0
    weights = _weights(errors)
    models = Ridge.path(x, y - prior(x), SHRINKAGES)
    if free:
        models += Ridge.path(x, y, SHRINKAGES)
    return Ridge.mean(models, weights.tolist()), float(weights[: len(SHRINKAGES)].sum())


def _weights(errors: FloatArray) -> FloatArray:
    """Weights of candidates, adding up to one, from errors ``(candidates, groups)`` on held-out actions.

    A candidate's weight is that of a normal density at its distance from the best, in standard errors of that distance
    over actions.
    """
    behind = errors - errors[np.argmin(errors.mean(axis=1))]
    standard_error = behind.std(axis=1, ddof=1) / np.sqrt(errors.shape[1])
    densities: FloatArray = np.exp(-0.5 * (behind.mean(axis=1) / np.maximum(standard_error, 1e-12)) ** 2)
    weights: FloatArray = densities / densities.sum()
    return weights


def _image(source: FloatArray, target: FloatArray, source_share: float, target_share: float) -> GeometricRegressor:
    rotation = fitted_rotation(source[..., -6:], target[..., -6:], _LEAN)
    return GeometricRegressor(rotation, source_share, target_share)


def _current(coder: ArmCoder) -> ArmCoder:
    """Of a window the coder of the current frame, which is all that a way back can give."""
    return coder.inner if isinstance(coder, WindowCoder) else coder


def _flat(codes: FloatArray) -> FloatArray:
    return codes.reshape(-1, codes.shape[-1])
