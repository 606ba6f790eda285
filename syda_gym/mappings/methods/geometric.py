"""The geometric baselines: no learning beyond a rotation, then inverse kinematics on limb directions.

``geometric`` decodes in closed form (``embodiments.limb_ik``), ``mink`` by the differential inverse kinematics of the
optional library of that name.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syda_gym.errors import MappingError, OptionError
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.mink_ik import MinkArmCoder
from syda_gym.mappings.methods.arm_problem import ArmProblem, Coding, fit_problems, upper_share
from syda_gym.mappings.methods.general import take_options
from syda_gym.mappings.methods.jobs import FitJob
from syda_gym.mappings.models.autoencoder_training import Progress
from syda_gym.mappings.models.regressors import Regressor
from syda_gym.mappings.models.rotation import GeometricRegressor, fitted_rotation

__all__ = ["fit_fixed_axes", "fit_mink", "fit_procrustes"]


def fit_procrustes(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """Limb directions after a Procrustes rotation fitted to the training frames. Option: ``confidence`` (true)."""
    return _fit(jobs, "geometric", calibrated=True)


def fit_fixed_axes(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """Limb directions as they are in body axes. Option: ``confidence`` (true)."""
    return _fit(jobs, "geometric", calibrated=False)


def fit_mink(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """The Procrustes baseline decoded by mink instead of the closed form. Option: ``confidence`` (false).

    Raises:
        MissingExtraError: mink is not installed (extra ``ik``).
        MappingError: the target is no robot.
    """
    if jobs[0].pair.target_body.kind != "robot":
        raise MappingError("mink computes joint angles; its target must be a robot")
    return [
        CodedMapping(
            fitted.card,
            fitted.source_coder,
            MinkArmCoder(fitted.target, fitted.target_coder.settings(), fitted.target_coder.arrays()),
            fitted.regressor,
            fitted.confidence,
        )
        for fitted in _fit(jobs, "mink", calibrated=True, confidence=False)
    ]


def _fit(jobs: Sequence[FitJob], method: str, calibrated: bool, confidence: bool = True) -> list[CodedMapping]:
    own, unknown = take_options(jobs[0].options, {"confidence": confidence})
    if unknown:
        raise OptionError(f"unknown options {sorted(unknown)}; known: confidence")

    def fitter(problems: Sequence[ArmProblem]) -> list[Regressor]:
        return [_regressor(problem, calibrated) for problem in problems]

    return fit_problems(jobs, method, fitter, coding=Coding(), confidence=bool(own["confidence"]))


def _regressor(problem: ArmProblem, calibrated: bool) -> GeometricRegressor:
    source, target = problem.rows
    rotation = fitted_rotation(source[:, -6:], target[:, -6:]) if calibrated else np.eye(3)
    return GeometricRegressor(rotation, upper_share(problem.source_coder), upper_share(problem.target_coder))
