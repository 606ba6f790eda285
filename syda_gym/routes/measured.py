"""A predictor from what fitting has shown: how predictable each body is, from the training errors of fitted pairs.

In the validation study the error of a chain is nearly that of its two ends, as if they had been paired directly: what
a body adds of its own (style, noise, timing) cannot be known from another, whoever stands between. So the error of a
pair is split into a share of the body that leads and one of the body that follows,

    e(A, B)^2 = v(A) + u(B),

by least squares over the fitted pairs, and a chain is predicted by its ends plus a small share of every body between.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import OptionError, RouteError, nearest_name
from syda_gym.mappings.fitting.fit import fit_many
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions
from syda_gym.routes.metric import Transferability

__all__ = [
    "MOST_TRAINING_FRAMES",
    "MeasuredBodies",
    "fit_options",
    "landmark_gap",
    "measure_bodies",
    "measured_bodies",
]

_BETWEEN = 0.05  # share that a body between adds, from the validation study
_RIDGE = 1e-3
_LAG_SECONDS = 0.2
MOST_TRAINING_FRAMES = 400
"""Rows of a pair on which a training error is taken; more of them move nothing."""


@dataclass(frozen=True)
class MeasuredBodies:
    """Predictability of bodies; as a function of a link it is a predictor for ``routing``.

    Attributes:
        leading: body to v(A), the variance lost when it leads, in arm lengths squared.
        following: body to u(B), the variance of what it adds of its own.
    """

    leading: Mapping[str, float]
    following: Mapping[str, float]

    def error(self, route: Sequence[str]) -> float:
        """Predicted error of a route, mean landmark distance over the target's arm length.

        Raises:
            RouteError: a body that no measured pair holds.
        """
        for name in route:
            if name not in self.leading:
                raise RouteError(f"no measured pair holds {name!r}; {nearest_name(name, self.leading)}")
        between = sum(self._cost(name) for name in route[1:-1])
        return float(np.sqrt(self.leading[route[0]] + self.following[route[-1]] + _BETWEEN * between))

    def __call__(self, link: Transferability) -> float:
        """Score in (0, 1] of a link, so that the best product over a route avoids unpredictable bodies between."""
        for name in (link.source, link.target):
            if name not in self.leading:
                raise RouteError(f"no measured pair holds {name!r}; {nearest_name(name, self.leading)}")
        return float(np.exp(-0.5 * (self._cost(link.source) + self._cost(link.target))))

    def _cost(self, name: str) -> float:
        return self.leading[name] + self.following[name]


def measured_bodies(errors: Mapping[tuple[str, str], float]) -> MeasuredBodies:
    """Splits the errors of fitted pairs into shares of the bodies.

    Args:
        errors: ordered pair to its error over the target's arm length, for example the training error.

    Returns:
        The shares; none is negative. With few pairs they are pulled towards being equal.

    Raises:
        OptionError: no pair, or an error that is negative or not finite.
    """
    if not errors or not all(np.isfinite(value) and value >= 0.0 for value in errors.values()):
        raise OptionError(f"need the errors of fitted pairs, finite and not negative; got {dict(errors)}")
    names = sorted({name for pair in errors for name in pair})
    count = len(names)
    squares = np.array([value**2 for value in errors.values()])
    design = np.zeros((len(errors), 2 * count))
    for row, (a, b) in zip(design, errors, strict=True):
        row[names.index(a)] = row[count + names.index(b)] = 1.0
    half = 0.5 * squares.mean()  # both shares of an average body; what the pairs do not tell stays there
    ridge = np.sqrt(_RIDGE) * np.eye(2 * count)
    found = lsq_linear(
        np.vstack([design, ridge]), np.concatenate([squares, np.full(2 * count, half) @ ridge]), bounds=(0.0, np.inf)
    ).x
    return MeasuredBodies(
        dict(zip(names, found[:count].tolist(), strict=True)), dict(zip(names, found[count:].tolist(), strict=True))
    )


def measure_bodies(
    motions: str | Motions,
    pairs: Sequence[tuple[str, str]] | None = None,
    *,
    method: str = "syda",
    preset: str | None = None,
    fps: float = 5.0,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> MeasuredBodies:
    """Fits pairs and turns their training errors into a predictor for routing.

    Args:
        motions: recordings.
        pairs: which to fit; all that were recorded together by default.
        method: how pairs are fitted.
        preset: of the method.
        fps: frames per second that are kept.
        seed: of the fits.
        progress: told the stage (``fit``) and its finished fraction.

    Returns:
        Pass it as ``predictor`` to ``best_route``, or ask its ``error(route)``.
    """
    recorded = load_motions(load_motions(motions), fps=fps)
    chosen = list(pairs or recorded.pairs)
    errors: dict[tuple[str, str], float] = {}
    for done, (a, b) in enumerate(chosen):
        if recorded.bodies[a].kind > recorded.bodies[b].kind:
            a, b = b, a  # human to robot is the fitted direction
        pair = recorded.pair(a, b)
        (model,) = fit_many([pair], method, preset, [seed], **fit_options(preset, fps))
        rows = np.arange(len(pair))[:: max(1, len(pair) // MOST_TRAINING_FRAMES)]
        for link, given, wanted in ((model, pair.source, pair.target), (model.inverse(), pair.target, pair.source)):
            gap = landmark_gap(link.source, link.target, link(given[rows]), wanted[rows])
            errors[link.source.name, link.target.name] = gap / link.target.reach
        if progress:
            progress("fit", (done + 1) / len(chosen))
    return measured_bodies(errors)


def landmark_gap(source: Embodiment, target: Embodiment, mapped: FloatArray, wanted: FloatArray) -> float:
    """Mean distance of elbows and wrists [m] on the arms that both bodies have.

    Args:
        source: who leads.
        target: who follows.
        mapped: frames ``(N, F)`` of the target that a mapping gave.
        wanted: frames ``(N, F)`` that it should have given.
    """
    arms = [i for i, side in enumerate(target.sides) if side in source.sides] or list(range(len(target.sides)))
    gap = target.arm_points(mapped)[:, arms, 1:] - target.arm_points(wanted)[:, arms, 1:]
    return float(np.linalg.norm(gap, axis=-1).mean())


def fit_options(preset: str | None, fps: float) -> dict[str, Any]:
    """No error bound, and a lag of the same time at any frame rate."""
    return {} if preset == "paper" else {"lag": max(1, round(_LAG_SECONDS * fps)), "confidence": False}
