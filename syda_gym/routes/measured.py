"""A predictor from what fitting has shown: how predictable each body is, from the training errors of fitted pairs.

In the validation study the error of a chain is nearly that of its two ends, as if they had been paired directly: what
a body adds of its own (style, noise, timing) cannot be known from another, whoever stands between. So the error of a
pair is split into a share of the body that leads and one of the body that follows,

    e(A, B)^2 = v(A) + u(B),

by least squares over the fitted pairs, and a chain is predicted by its ends plus a small share of every body between.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from syda_gym.errors import OptionError, RouteError, nearest_name
from syda_gym.routes.metric import Transferability

__all__ = ["MeasuredBodies", "measured_bodies"]

_BETWEEN = 0.05  # share that a body between adds, from the validation study
_RIDGE = 1e-3


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
