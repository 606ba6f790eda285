"""The presets of SyDa that generalise: ``general`` (the default) and ``interpolation``.

Both share one dual autoencoder between a body's arms, the right arm mirrored (``arm_coders``), add the cross losses
A-to-B and B-to-A to Eq. 2 to 4, and decode a robot's limb directions by inverse kinematics within its limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from syda_gym.errors import OptionError
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.methods.arm_problem import ArmProblem, Coding, fit_problems
from syda_gym.mappings.methods.jobs import FitJob
from syda_gym.mappings.methods.nested import Choice, choose_hop_shrinkage, choose_input
from syda_gym.mappings.methods.syda import with_options
from syda_gym.mappings.models.autoencoder_training import Job, Progress, train
from syda_gym.mappings.models.hop import HopRegressor
from syda_gym.mappings.models.regressors import DirectRegressor, DualRegressor, Regressor
from syda_gym.mappings.models.settings import TrainingSettings

__all__ = [
    "GENERAL",
    "INTERPOLATION",
    "fit_direct_general",
    "fit_hops",
    "fit_interpolation",
    "fit_nested",
    "fit_networks",
    "fit_synergies",
    "take_options",
]

GENERAL = TrainingSettings(
    hidden_a=(),
    hidden_b=(),
    latent=6,
    slope=1.0,
    activated=False,
    cross=1.0,
    rate=3e-3,
    decay=1e-2,
    cosine=True,
    batch=64,
    epochs=80,
    noise=0.3,
)
"""Linear encoder and decoder with six synergies an arm: low capacity is what carries over to unseen actions."""

INTERPOLATION = TrainingSettings(
    hidden_a=(64, 64),
    hidden_b=(64, 64),
    latent=10,
    slope=0.01,
    activated=False,
    cross=1.0,
    rate=3e-3,
    cosine=True,
    batch=64,
    epochs=120,
)
"""For test poses that come from trained actions: capacity pays there."""

_LAG = 6
_RECIPE = Choice()
_ROWS_PER_STEP = 32


def fit_synergies(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """SyDa with shared arms, low capacity, cross losses and lag compensation; between humans a hop.

    Options: ``lag`` (largest lag searched for, 6 frames), ``window`` (past frames that a human's code shows, 0),
    ``confidence`` (hold actions out for the error bound, true), ``hop_shrinkage`` (chosen among the training actions,
    see ``nested``), and the fields of ``TrainingSettings``.
    """
    return _fit(jobs, GENERAL, "syda", progress)


def fit_nested(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """``general`` with input noise and scaling chosen among the training actions, see ``nested``; options alike."""
    return _fit(jobs, GENERAL, "syda", progress, select=True)


def fit_direct_general(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """The direct autoencoder with the codes, sizes and loss of ``general``."""
    return _fit(jobs, replace(GENERAL, dual=False), "direct", progress)


def fit_interpolation(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """SyDa with shared arms and 64-64-10 networks, without lag compensation.

    Options as for ``general``.
    """
    return _fit(jobs, INTERPOLATION, "syda", progress, lag=0, placed=True)


def take_options(options: dict[str, Any], defaults: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Splits options into those named in ``defaults`` (filled up) and the others.

    Raises:
        OptionError: a value of another type than its default (``None`` stands for an optional number), or a negative
            number.
    """
    own = {name: options.get(name, default) for name, default in defaults.items()}
    for name, value in own.items():
        default = defaults[name]
        if default is None and value is None:
            continue
        expected = float if default is None else type(default)
        if expected is bool:
            fits = isinstance(value, bool)
        else:
            kinds = int if expected is int else int | float
            fits = isinstance(value, kinds) and not isinstance(value, bool) and value >= 0
        if not fits:
            raise OptionError(f"option {name!r} must be a {expected.__name__} (not negative), got {value!r}")
    return own, {name: value for name, value in options.items() if name not in defaults}


def _fit(
    jobs: Sequence[FitJob],
    preset: TrainingSettings,
    method: str,
    progress: Progress | None,
    lag: int = _LAG,
    placed: bool = False,
    select: bool = False,
) -> list[CodedMapping]:
    defaults = {"lag": lag, "window": 0, "confidence": True, "hop_shrinkage": None}
    own, rest = take_options(jobs[0].options, defaults)
    settings = with_options(preset, rest)

    def fitter(problems: Sequence[ArmProblem]) -> list[Regressor]:
        if method == "syda" and problems[0].pair.source_body.kind == problems[0].pair.target_body.kind:
            return fit_hops(problems, own["hop_shrinkage"])
        if select and "noise" not in rest:
            return _fit_selected(problems, settings, progress)
        return fit_networks(problems, settings, progress)

    coding = Coding(int(own["lag"]), placed, int(own["window"]))
    return fit_problems(jobs, method, fitter, coding=coding, confidence=bool(own["confidence"]))


def fit_hops(problems: Sequence[ArmProblem], shrinkage: float | None) -> list[Regressor]:
    """Hops between bodies of one kind; without a shrinkage each chooses its own among its training actions."""
    by_pair = {
        id(problem.pair): choose_hop_shrinkage(problem) if shrinkage is None else float(shrinkage)
        for problem in {id(problem.pair): problem for problem in problems}.values()
    }
    return [HopRegressor.fit(*problem.rows, by_pair[id(problem.pair)]) for problem in problems]


def _fit_selected(
    problems: Sequence[ArmProblem], settings: TrainingSettings, progress: Progress | None
) -> list[Regressor]:
    """Networks whose input noise and scaling each training set chose for itself; equal choices train together."""
    distinct = {id(problem.pair): problem for problem in problems}
    chosen = {key: choose_input(problem) for key, problem in distinct.items()}
    choices = [chosen[id(problem.pair)] for problem in problems]
    fitted: dict[int, Regressor] = {}
    for choice in sorted(set(choices)):
        places = [place for place, own in enumerate(choices) if own == choice]
        own_settings = replace(settings, noise=choice.noise)
        models = fit_networks([problems[place] for place in places], own_settings, progress, choice)
        fitted.update(zip(places, models, strict=True))
    return [fitted[place] for place in range(len(problems))]


def fit_networks(
    problems: Sequence[ArmProblem],
    settings: TrainingSettings,
    progress: Progress | None,
    choice: Choice = _RECIPE,
) -> list[Regressor]:
    """Trains one network per problem on its rows, all together."""
    scales, data = [], []
    for problem in problems:
        x, y = problem.rows
        scale_a, scale_b = choice.scale(x), choice.scale(y)
        scales.append((scale_a, scale_b))
        data.append(Job(scale_a(x), scale_b(y), problem.seed))
    # Larger recordings take larger batches, not more steps: the time of a fit stays the same.
    most = max(len(job.a) for job in data)
    settings = replace(settings, batch=max(settings.batch, -(-most // _ROWS_PER_STEP)))
    kind = DualRegressor if settings.dual else DirectRegressor
    trained = train(data, settings, progress)
    return [kind(stacks, *scale) for stacks, scale in zip(trained, scales, strict=True)]
