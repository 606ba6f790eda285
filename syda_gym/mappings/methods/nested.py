"""Nested selection: settings chosen by leave-one-action-out among the training actions alone.

Whoever chooses a setting by the error on the actions that they report, reports too little. Here every candidate is
scored on training actions that its own fit has not seen; the actions of a test fold take no part. Ridge regression in
closed form stands in for the network: a linear network that is trained with input noise of s standard deviations is, in
expectation, a ridge with penalty s^2 (Bishop 1995, *Training with noise is equivalent to Tikhonov regularization*).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.coding.arm_coders import HumanArmCoder
from syda_gym.mappings.coding.window_coder import WindowCoder
from syda_gym.mappings.methods.arm_problem import ArmCoder, ArmProblem, action_groups
from syda_gym.mappings.models.linear import Ridge
from syda_gym.mappings.models.scaling import Scaler

__all__ = ["HOP_SHRINKAGES", "NOISES", "Choice", "choose_hop_shrinkage", "choose_input"]

NOISES = (0.1, 0.2, 0.3, 0.45, 0.7, 1.0)
"""Candidates for the input noise, in standard deviations; fixed in advance."""

HOP_SHRINKAGES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Candidates for the penalty of a hop between bodies of one kind, weakest first; fixed in advance."""

_FALLBACK_SHRINKAGE = 10.0
_LEAST_ACTIONS = 3
_MAX_ROWS = 2000


@dataclass(frozen=True, order=True)
class Choice:
    """How a network's inputs are prepared.

    Attributes:
        noise: of the inputs, in standard deviations.
        by_vector: one scale for each vector in space rather than for each coordinate.
    """

    noise: float = 0.3
    by_vector: bool = False

    def scale(self, rows: FloatArray) -> Scaler:
        """The standardisation of codes ``(N, D)``."""
        return Scaler.by_vector(rows) if self.by_vector else Scaler.fit(rows)


CHOICES = tuple(Choice(noise, by_vector) for by_vector in (False, True) for noise in NOISES)

Predict = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Fits inputs to outputs and predicts the outputs of further inputs."""


def choose_input(problem: ArmProblem) -> Choice:
    """The choice whose stand-in errs least on held-out training actions, both ways taken together.

    The errors of each way are measured in units of the least of them, because a model maps both ways and humans are
    larger than robots. The recipe's own choice with fewer than three actions.
    """
    source, target = problem.main
    stand_ins = [_ridge(choice) for choice in CHOICES]
    there = _errors(problem, source, target, problem.target_coder, stand_ins)
    back = _errors(problem, target, source, problem.source_coder, stand_ins)
    if there is None or back is None:
        return Choice()
    return CHOICES[int(np.argmin(sum(way.mean(axis=1) / way.mean(axis=1).min() for way in (there, back))))]


def choose_hop_shrinkage(problem: ArmProblem) -> float:
    """The hardest penalty of a hop within one standard error of the best; 10 with fewer than three actions.

    The one-standard-error rule (Breiman et al. 1984) because a hop that follows its recording session too closely
    ruins the chain that it is part of, which the pair's own frames cannot tell.
    """
    source, target = problem.main
    hops = [_hop(shrinkage) for shrinkage in HOP_SHRINKAGES]
    errors = _errors(problem, source, target, problem.target_coder, hops)
    if errors is None:
        return _FALLBACK_SHRINKAGE
    means = errors.mean(axis=1)
    best = int(np.argmin(means))
    limit = means[best] + errors[best].std(ddof=1) / np.sqrt(errors.shape[1])
    return max(value for value, mean in zip(HOP_SHRINKAGES, means, strict=True) if mean <= limit)


def _ridge(choice: Choice) -> Predict:
    return lambda x, y, new: Ridge.fit(x, y, choice.noise**2, scale=choice.scale(x))(new)


def _hop(shrinkage: float) -> Predict:
    return lambda x, y, new: new + Ridge.fit(x, y - x, shrinkage)(new)


def _errors(
    problem: ArmProblem, source: FloatArray, target: FloatArray, coder: ArmCoder, candidates: Sequence[Predict]
) -> FloatArray | None:
    """Landmark errors ``(candidates, groups)`` [m] on training actions held out in turn, ``None`` with too few."""
    groups = action_groups(problem.pair)
    if len(groups) < _LEAST_ACTIONS:
        return None
    errors = np.empty((len(candidates), len(groups)))
    for column, names in enumerate(groups):
        held_out = np.isin(problem.pair.actions, names)
        x, y = (_thinned(codes[~held_out]) for codes in (source, target))
        new, wanted = (_thinned(codes[held_out]) for codes in (source, target))
        for row, predict in enumerate(candidates):
            errors[row, column] = _gap(coder, predict(x, y, new), wanted)
    return errors


def _thinned(codes: FloatArray) -> FloatArray:
    """Codes arm by arm ``(rows, D)``, at most about 2000 rows."""
    rows = codes[:: -(-codes.shape[0] * codes.shape[1] // _MAX_ROWS)]
    return rows.reshape(-1, rows.shape[-1])


def _gap(coder: ArmCoder, predicted: FloatArray, wanted: FloatArray) -> float:
    """Mean distance of elbow and wrist [m] as their codes place them, without regard to joint limits."""
    human = coder.inner if isinstance(coder, WindowCoder) else coder
    if isinstance(human, HumanArmCoder):
        places = ((predicted - wanted)[:, -12:-6] * human.lengths.sum()).reshape(-1, 2, 3)
    else:
        limbs = predicted.reshape(-1, 2, 3)
        limbs = limbs / np.maximum(np.linalg.norm(limbs, axis=-1, keepdims=True), 1e-9)
        lengths = human.robot.arm_lengths.mean(axis=0)
        places = np.cumsum((limbs - wanted.reshape(-1, 2, 3)) * lengths[:, None], axis=1)
    return float(np.linalg.norm(places, axis=-1).mean())
