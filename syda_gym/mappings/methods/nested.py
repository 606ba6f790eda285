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
from syda_gym.mappings.methods.arm_problem import ArmCoder, ArmProblem, action_groups, thinned
from syda_gym.mappings.models.linear import Ridge
from syda_gym.mappings.models.scaling import Scaler
from syda_gym.motions.clip import PairedMotions

__all__ = [
    "HOP_SHRINKAGES",
    "LEAST_ACTIONS",
    "NOISES",
    "Choice",
    "choose_hop_shrinkage",
    "choose_input",
    "held_out_gaps",
]

NOISES = (0.1, 0.2, 0.3, 0.45, 0.7, 1.0)
"""Candidates for the input noise, in standard deviations; fixed in advance."""

HOP_SHRINKAGES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Candidates for the penalty of a hop between bodies of one kind, weakest first; fixed in advance."""

_FALLBACK_SHRINKAGE = 10.0
LEAST_ACTIONS = 3
"""With fewer there is nothing to choose by."""

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

Predict = Callable[[FloatArray, FloatArray, FloatArray], Sequence[FloatArray]]
"""Fits inputs to outputs and predicts the outputs of further inputs, once for each candidate."""


def choose_input(problem: ArmProblem) -> Choice:
    """The choice whose stand-in errs least on held-out training actions, both ways taken together.

    The errors of each way are measured in units of the least of them, because a model maps both ways and humans are
    larger than robots. The recipe's own choice with fewer than three actions.
    """
    source, target = problem.main
    there = held_out_gaps(problem.pair, source, target, problem.target_coder, _stand_ins)
    back = held_out_gaps(problem.pair, target, source, problem.source_coder, _stand_ins)
    if there is None or back is None:
        return Choice()
    return CHOICES[int(np.argmin(sum(way.mean(axis=1) / way.mean(axis=1).min() for way in (there, back))))]


def choose_hop_shrinkage(problem: ArmProblem) -> float:
    """The hardest penalty of a hop within one standard error of the best; 10 with fewer than three actions.

    The one-standard-error rule (Breiman et al. 1984) because a hop that follows its recording session too closely
    ruins the chain that it is part of, which the pair's own frames cannot tell.
    """
    source, target = problem.main
    errors = held_out_gaps(problem.pair, source, target, problem.target_coder, _hops)
    if errors is None:
        return _FALLBACK_SHRINKAGE
    means = errors.mean(axis=1)
    best = int(np.argmin(means))
    limit = means[best] + errors[best].std(ddof=1) / np.sqrt(errors.shape[1])
    return max(value for value, mean in zip(HOP_SHRINKAGES, means, strict=True) if mean <= limit)


def held_out_gaps(
    pair: PairedMotions, source: FloatArray, target: FloatArray, coder: ArmCoder, predict: Predict
) -> FloatArray | None:
    """Landmark errors of candidates on training actions that are held out in turn.

    Args:
        pair: the training frames.
        source: inputs of each row ``(N, K, D)``.
        target: outputs of each row ``(N, K, E)``.
        coder: of the outputs.
        predict: fits every candidate and predicts with it.

    Returns:
        ``(candidates, groups)`` [m], ``None`` with fewer than three actions.
    """
    groups = action_groups(pair)
    if len(groups) < LEAST_ACTIONS:
        return None
    columns = []
    for names in groups:
        held_out = np.isin(pair.actions, names)
        x, y = (thinned(codes[~held_out], _MAX_ROWS) for codes in (source, target))
        new, wanted = (thinned(codes[held_out], _MAX_ROWS) for codes in (source, target))
        columns.append([_gap(coder, predicted, wanted) for predicted in predict(x, y, new)])
    return np.array(columns).T


def _stand_ins(x: FloatArray, y: FloatArray, new: FloatArray) -> list[FloatArray]:
    return [Ridge.fit(x, y, choice.noise**2, scale=choice.scale(x))(new) for choice in CHOICES]


def _hops(x: FloatArray, y: FloatArray, new: FloatArray) -> list[FloatArray]:
    return [new + Ridge.fit(x, y - x, shrinkage)(new) for shrinkage in HOP_SHRINKAGES]


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
