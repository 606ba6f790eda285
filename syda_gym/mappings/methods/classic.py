"""The classic regressors as methods: ridge, kernel ridge, nearest neighbour, and the ``accurate`` ensemble.

All work per arm on the codes of ``arm_coders``; robots are decoded by inverse kinematics.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.methods.arm_problem import ArmProblem, Coding, fit_problems
from syda_gym.mappings.methods.general import GENERAL, fit_hops, fit_networks, take_options
from syda_gym.mappings.methods.jobs import FitJob
from syda_gym.mappings.models.autoencoder_training import Progress
from syda_gym.mappings.models.hop import MeanRegressor, TwoWay
from syda_gym.mappings.models.linear import KernelRidge, Nearest, Ridge
from syda_gym.mappings.models.regressors import Regressor

__all__ = ["fit_accurate", "fit_kernel_ridge", "fit_nearest", "fit_ridge"]

_COMMON = {"lag": 0, "window": 0, "confidence": True}


def fit_ridge(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """Ridge regression. Options: ``lag`` (6), ``window`` (0), ``confidence`` (true), ``shrinkage`` (0.1)."""
    own = _options(jobs, {**_COMMON, "lag": 6, "shrinkage": 0.1})
    return _fit(jobs, "ridge", own, lambda x, y: Ridge.fit(x, y, float(own["shrinkage"])))


def fit_kernel_ridge(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """Kernel ridge regression.

    Options: ``lag`` (0), ``window`` (0), ``confidence`` (true), ``shrinkage`` (1e-3), ``gamma`` (1).
    """
    own = _options(jobs, {**_COMMON, "shrinkage": 1e-3, "gamma": 1.0})
    return _fit(
        jobs, "kernel_ridge", own, lambda x, y: KernelRidge.fit(x, y, float(own["shrinkage"]), float(own["gamma"]))
    )


def fit_nearest(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """Nearest neighbour. Options: ``lag`` (0), ``window`` (0), ``confidence`` (true), ``neighbours`` (1)."""
    own = _options(jobs, {**_COMMON, "neighbours": 1})
    return _fit(jobs, "nearest", own, lambda x, y: Nearest.fit(x, y, int(own["neighbours"])))


def fit_accurate(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """The ``accurate`` preset: the mean of four regressors, fitted both ways; between humans the hop of ``general``.

    Robust ridge, and kernel ridge of what the geometric image leaves over, each once on the whole code and once on limb
    directions alone; back to a human robust ridge, kernel ridge and the inverse of ``general``. Options: ``lag``
    (8), ``window`` (0), ``confidence`` (true), ``shrinkage`` (0.1), ``gamma`` (0.3), ``kernel_shrinkage`` (3),
    ``hop_shrinkage`` (chosen among the training actions, see ``nested``).
    """
    own = _options(
        jobs,
        {**_COMMON, "lag": 8, "shrinkage": 0.1, "gamma": 0.3, "kernel_shrinkage": 3.0, "hop_shrinkage": None},
    )

    def fitter(problems: Sequence[ArmProblem]) -> list[Regressor]:
        if problems[0].pair.source_body.kind == problems[0].pair.target_body.kind:
            return fit_hops(problems, own["hop_shrinkage"])
        networks = fit_networks(problems, GENERAL, progress)
        # Only the network depends on the seed; fits of the same frames share the other members.
        closed: dict[int, tuple[MeanRegressor, list[Regressor]]] = {}
        for problem in problems:
            if id(problem.pair) not in closed:
                closed[id(problem.pair)] = _members(problem, own)
        return [
            _both_ways(problem, network, *closed[id(problem.pair)])
            for problem, network in zip(problems, networks, strict=True)
        ]

    return fit_problems(jobs, "syda", fitter, coding=_coding(own), confidence=bool(own["confidence"]))


def _members(problem: ArmProblem, own: dict[str, Any]) -> tuple[MeanRegressor, list[Regressor]]:
    """Four members towards a robot, two towards a human."""
    human, robot = problem.rows if problem.pair.target_body.kind == "robot" else problem.rows[::-1]
    shrinkage, penalty, gamma = (float(own[name]) for name in ("shrinkage", "kernel_shrinkage", "gamma"))
    width = human.shape[1]  # a window's current frame comes last
    members: list[Regressor] = []
    for start in (0, width - 6):
        members.append(Ridge.fit(human[:, start:], robot, shrinkage, robust=True))
        members.append(KernelRidge.fit(human[:, start:], robot - human[:, -6:], penalty, gamma))
    columns = [(0, width), (0, width), (width - 6, width), (width - 6, width)]
    there = MeanRegressor(members, columns, [False, True, False, True])
    home: list[Regressor] = [
        Ridge.fit(robot, human, shrinkage, robust=True),
        KernelRidge.fit(robot, human, penalty, gamma),
    ]
    return there, home


def _both_ways(problem: ArmProblem, network: Regressor, there: MeanRegressor, home: list[Regressor]) -> Regressor:
    """The members both ways; towards a human together with the SyDa network."""
    to_robot = problem.pair.target_body.kind == "robot"
    back = network.inverse() if to_robot else network
    mean = MeanRegressor([*home, back], [(0, 6)] * 3, [False] * 3)
    return TwoWay(there, mean) if to_robot else TwoWay(mean, there)


def _fit(
    jobs: Sequence[FitJob],
    method: str,
    own: dict[str, Any],
    fit_rows: Callable[[FloatArray, FloatArray], Regressor],
) -> list[CodedMapping]:
    def fitter(problems: Sequence[ArmProblem]) -> list[Regressor]:
        return [fit_rows(*problem.rows) for problem in problems]

    return fit_problems(jobs, method, fitter, coding=_coding(own), confidence=bool(own["confidence"]))


def _coding(own: dict[str, Any]) -> Coding:
    return Coding(int(own["lag"]), window=int(own["window"]))


def _options(jobs: Sequence[FitJob], defaults: dict[str, Any]) -> dict[str, Any]:
    own, unknown = take_options(jobs[0].options, defaults)
    if unknown:
        raise OptionError(f"unknown options {sorted(unknown)}; known: {sorted(defaults)}")
    return own
