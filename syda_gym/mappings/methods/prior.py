"""The ``general`` preset, the default: a geometric prior, and what a pair's recordings add to it.

The image of a limb is its direction after one rotation; that needs no recording. What two bodies do differently is
learned on top of it, as a ridge of what the image leaves over, both ways. With few actions the ridge is shrunk hard, so
that one action cannot spoil what geometry knows; from three actions on each way chooses its penalty among its training
actions.

It is SyDa's linear case in closed form. A linear dual autoencoder with the cross losses A-to-B and B-to-A, whose inputs
carry noise of s standard deviations, has ridges with penalty s^2 as its optimum (Bishop 1995); the synergies are the
singular directions of the correction. ``docs/mappings.md`` holds what training it step by step gave instead.
"""

from __future__ import annotations

from collections.abc import Sequence

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
"""The penalty where fewer than three actions leave nothing to choose by."""

_LAG = 6
_LEAN = 0.1


def fit_general(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """A geometric prior plus a shrunk correction, both ways; between bodies of one kind a hop.

    Options: ``lag`` (largest lag searched for, 6 frames), ``window`` (past frames that a human's code shows, 0),
    ``confidence`` (hold actions out for the error bound, true), ``shrinkage`` (of the correction; 3 below three
    actions, else chosen among the training actions), ``hop_shrinkage`` (likewise, of a hop).
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
    shares = upper_share(problem.source_coder), upper_share(problem.target_coder)
    prior = _image(_flat(source), _flat(target), *shares)
    ends = problem.source_coder, problem.target_coder
    there = _correction(problem.pair, source, target, prior, ends[1], shares, shrinkage)
    back = _correction(problem.pair, *problem.main_back, prior.inverse(), _current(ends[0]), shares[::-1], shrinkage)
    return PriorRegressor(prior, there, back)


def _correction(
    pair: PairedMotions,
    source: FloatArray,
    target: FloatArray,
    prior: GeometricRegressor,
    coder: ArmCoder,
    shares: tuple[float, float],
    shrinkage: float | None,
) -> Ridge:
    """The ridge of what the geometric image leaves over, one way."""

    def candidates(x: FloatArray, y: FloatArray, new: FloatArray) -> list[FloatArray]:
        image = _image(x, y, *shares)
        return [image(new) + ridge(new) for ridge in Ridge.path(x, y - image(x), SHRINKAGES)]

    if shrinkage is None:
        errors = held_out_gaps(pair, source, target, coder, candidates)
        chosen = FEW_SHRINKAGE if errors is None else SHRINKAGES[int(np.argmin(errors.mean(axis=1)))]
    else:
        chosen = float(shrinkage)
    x, y = (thinned(codes) for codes in (source, target))
    return Ridge.path(x, y - prior(x), [chosen])[0]


def _image(source: FloatArray, target: FloatArray, source_share: float, target_share: float) -> GeometricRegressor:
    rotation = fitted_rotation(source[..., -6:], target[..., -6:], _LEAN)
    return GeometricRegressor(rotation, source_share, target_share)


def _current(coder: ArmCoder) -> ArmCoder:
    """Of a window the coder of the current frame, which is all that a way back can give."""
    return coder.inner if isinstance(coder, WindowCoder) else coder


def _flat(codes: FloatArray) -> FloatArray:
    return codes.reshape(-1, codes.shape[-1])
