"""Rehearsal: how well a route will carry motions, asked on paper before anything is recorded or fitted.

Every body imitates the operator's planned motion within its joint limits and joint speeds, robots in both of the ways
in which they are commonly led (limbs pointed, hands led to positions), because nobody knows yet how they will be
recorded; what would be recorded gets the noise of its sensor and a little imprecision. Each link is fitted by ridge
regression between arm codes without the actions of a fold, links are *composed* along the route, and the route is
scored on the held-out actions against what its last body would have shown itself:

    e_t = | p_B(t) - f_XB( ... f_AX( c_A(t) )) | / l_B,    mean over elbows and wrists

    C = S + (1 - S)(1 - D),  S = share of frames with e_t <= tau,  1 - D = mean of tau / e_t elsewhere   (Eq. 8, 9)
    alpha = C(with noise and imprecision) / C(without)
    T = alpha L C,  L = 1 because errors are counted in arm lengths                                      (Eq. 10)

It keeps the form of the paper's Eq. 8 to 10 and departs from it in three points. The measure is the operator's motion
instead of the whole workspace: what nobody does need not be followed. Noise is inside, as variance of the sensor, and
alpha is what it costs: as a factor in front it ruins the ranking. A chain is scored as a whole instead of by Eq. 11's
product: what a body cannot show is lost once, not once a link.

Routes are ranked by the expected error; T is the same on the paper's scale and saturates below tau.
"""

from __future__ import annotations

import zlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import EmbodimentError, MotionError, OptionError, RouteError, nearest_name
from syda_gym.routes.dry_run.imitation import SIDES, Retargeter
from syda_gym.routes.dry_run.memory import imitation_of
from syda_gym.routes.dry_run.plan import Plan
from syda_gym.routes.dry_run.positions import by_positions

__all__ = ["DEPTH_CAMERA", "IMPRECISION", "RETARGETERS", "TOLERANCE", "Rehearsal", "Score"]

DEPTH_CAMERA = 0.015
"""Noise of a landmark that a depth camera sees [m]; a robot's encoders are exact beside it."""

IMPRECISION = {"human": 0.045, "robot": 0.015}
"""How far an imitation lies beside the best one, per axis [arm lengths]; the paper's people repeat a pose within .06 to
.07 in three axes."""

TOLERANCE = 0.1
"""Tau: an error that counts as none [arm lengths]."""

RETARGETERS: dict[str, tuple[Retargeter | None, ...]] = {
    "either": (None, by_positions),
    "limbs": (None,),
    "positions": (by_positions,),
}
"""How robots may be led when they are recorded: limbs pointed by the library's solver (``None``), elbows and wrists led
to a person's positions, or, the default, nobody knows: both are rehearsed and count alike."""

_FOLDS = 4
_RIDGE = 0.05
_EVERY = 3  # frames at 15 Hz are near-duplicates; every third is fitted and scored
_KEPT_PREFIXES = 600
_LEAST_MOVEMENT = 0.02  # arm lengths; who moves less does not imitate
_MIRROR: FloatArray = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])  # the right arm becomes a left one


@dataclass(frozen=True)
class Score:
    """What the rehearsal expects of a route.

    Attributes:
        error: expected landmark error on actions that no link has seen [m].
        standard_error: of ``error``, over actions [m].
        relative: ``error`` over the arm's length of the last body.
        S: share of frames within the tolerance, without noise, in [0, 1] (the form of Eq. 8).
        D: how far the other frames lie beyond it, in [0, 1] (the form of Eq. 9).
        C: S + (1 - S)(1 - D), in [0, 1].
        alpha: what noise and imprecision leave of C, in (0, 1].
        T: alpha C, in [0, 1] (Eq. 10 with L = 1).
    """

    error: float
    standard_error: float
    relative: float
    S: float
    D: float
    C: float
    alpha: float
    T: float


@dataclass(frozen=True, eq=False)
class _Shown:
    """What is seen of one body: sides and limb directions ``(N, sides, 2, 3)``, without and with noise."""

    sides: tuple[str, ...]
    clean: FloatArray
    noisy: FloatArray


class Rehearsal:
    """Bodies that rehearse one plan together, so that every route among them can be scored.

    Args:
        bodies: name to body.
        plan: what the operator means to do.
        sensor: name to the noise of a landmark [m]; by default ``DEPTH_CAMERA`` for humans and 0 for robots.
        imprecision: name to imprecision per axis [arm lengths]; by default ``IMPRECISION``.
        retargeter: how robots will be led when they are recorded: a name of ``RETARGETERS``, or a function of one's own
            (``imitation.Retargeter``). With several ways their scored frames are pooled.
        seed: of folds and noise.

    Raises:
        MotionError: a plan with fewer than two actions, which leaves nothing to hold out.
        OptionError: noise for a body that is not here, or that is negative or not finite; an unknown retargeter.
    """

    def __init__(
        self,
        bodies: Mapping[str, Embodiment],
        plan: Plan,
        *,
        sensor: Mapping[str, float] | None = None,
        imprecision: Mapping[str, float] | None = None,
        retargeter: str | Retargeter = "either",
        seed: int = 0,
    ) -> None:
        names = np.unique(plan.actions)
        if len(names) < 2:
            raise MotionError(
                f"a rehearsal holds out actions and needs two or more; the plan has only {names[0]!r}. Add clips of "
                "other actions"
            )
        self.bodies = dict(bodies)
        self.plan = plan
        self.seed = seed
        self._ways = _ways(retargeter)
        self._sensor = _checked(sensor, self.bodies, "sensor")
        self._imprecision = _checked(imprecision, self.bodies, "imprecision")
        order = np.random.default_rng(seed).permutation(names)
        fold = {name: place % min(_FOLDS, len(names)) for place, name in enumerate(order)}
        self._keep = [np.arange(0, len(clip), _EVERY) for clip in plan.clips]
        actions = np.repeat(np.array(plan.actions), [len(rows) for rows in self._keep])
        self.actions = np.tile(actions, len(self._ways))
        folds = np.array([fold[action] for action in actions])
        self._rows: list[NDArray[np.intp]] = [np.flatnonzero(folds == k) for k in range(folds.max() + 1)]
        self._rest: list[NDArray[np.intp]] = [np.flatnonzero(folds != k) for k in range(folds.max() + 1)]
        self._shown: dict[tuple[str, int], _Shown] = {}
        self._links: dict[tuple[bool, str, str, int], list[tuple[FloatArray, FloatArray]]] = {}
        self._arrived: OrderedDict[tuple[bool, tuple[str, ...], int], FloatArray] = OrderedDict()

    def error(self, route: Sequence[str], *, noise: bool = True) -> FloatArray:
        """Error of every scored frame ``(N,)`` [arm lengths of the last body], its action held out of every link.

        Where robots are led in several ways, the frames of the one come before those of the next; see ``actions``.

        Raises:
            RouteError: an unknown body, fewer than two, or two in a row without a common arm.
            EmbodimentError: a body that cannot imitate the plan at all.
        """
        names = self._check(route)
        return np.concatenate([self._error(names, noise, way) for way in range(len(self._ways))])

    def _error(self, names: tuple[str, ...], noise: bool, way: int) -> FloatArray:
        last = self.bodies[names[-1]]
        shown = self._show(names[-1], way)
        wanted = shown.noisy if noise else shown.clean
        gap = _landmarks(last, self._carry(names, noise, way)) - _landmarks(last, wanted)
        mean: FloatArray = np.linalg.norm(gap, axis=-1).mean(axis=(1, 2))
        return mean

    def score(self, route: Sequence[str]) -> Score:
        """What is to be expected of a route; errors as ``error``."""
        names = self._check(route)
        clean, noisy = self.error(names, noise=False), self.error(names)
        S = float((clean <= TOLERANCE).mean())
        C = float(np.minimum(1.0, TOLERANCE / np.maximum(clean, 1e-9)).mean())
        alpha = min(1.0, float(np.minimum(1.0, TOLERANCE / np.maximum(noisy, 1e-9)).mean()) / C)
        relative = float(noisy.mean())
        reach = self.bodies[names[-1]].reach
        per_action = self._per_action(noisy)
        spread = float(per_action.std(ddof=1) / np.sqrt(len(per_action)))
        D = 1.0 - (C - S) / (1.0 - S) if S < 1.0 else 0.0
        return Score(relative * reach, spread * reach, relative, S, D, C, alpha, alpha * C)

    def margin(self, one: Sequence[str], other: Sequence[str]) -> tuple[float, float]:
        """By how much ``one`` is expected to be better than ``other``, and the standard error of that over actions.

        Both in arm lengths of their last bodies. A margin below its standard error is a tie.
        """
        gap = self.error(other) - self.error(one)
        per_action = self._per_action(gap)
        return float(gap.mean()), float(per_action.std(ddof=1) / np.sqrt(len(per_action)))

    def _show(self, name: str, way: int) -> _Shown:
        """What would be seen of a body that is led in one of the ways, made when it is first needed.

        Raises:
            EmbodimentError: it cannot imitate the plan at all.
        """
        body = self.bodies[name]
        way = way if body.kind == "robot" else 0  # people are not led
        if (name, way) not in self._shown:
            clips = imitation_of(body, self.plan, self._ways[way])
            sides = tuple(body.sides)
            clean = np.concatenate(
                [
                    np.stack([clip[side][rows] for side in sides], axis=1)
                    for clip, rows in zip(clips, self._keep, strict=True)
                ]
            )
            moved = float(_landmarks(body, clean).std(axis=0).mean())
            if moved < _LEAST_MOVEMENT:
                raise EmbodimentError(
                    f"{name!r} cannot imitate the planned motion at all: its elbows and wrists move by {moved:.3f} of "
                    "its arm's length. Check its joint limits and speeds, or plan a motion that it can follow"
                )
            # Seeded by the name, so that a body shows the same whoever else rehearses.
            rng = np.random.default_rng([self.seed, zlib.crc32(name.encode())])
            self._shown[name, way] = _Shown(sides, clean, _blurred(body, clean, self._sigma(name), rng))
        return self._shown[name, way]

    def _sigma(self, name: str) -> float:
        body = self.bodies[name]
        sensor = self._sensor.get(name, DEPTH_CAMERA if body.kind == "human" else 0.0)
        return float(np.hypot(sensor / body.reach, self._imprecision.get(name, IMPRECISION[body.kind])))

    def _check(self, route: Sequence[str]) -> tuple[str, ...]:
        names = tuple(route)
        if len(names) < 2:
            raise RouteError(f"a route needs two bodies, got {names}")
        for name in names:
            if name not in self.bodies:
                raise RouteError(f"{name!r} does not rehearse here; {nearest_name(name, self.bodies)}")
        for a, b in zip(names[:-1], names[1:], strict=True):
            if not set(self.bodies[a].sides) & set(self.bodies[b].sides):
                raise RouteError(
                    f"{a!r} and {b!r} have no arm on the same side, so the link between them cannot be judged"
                )
        return names

    def _carry(self, names: tuple[str, ...], noise: bool, way: int) -> FloatArray:
        """Limb directions ``(N, sides, 2, 3)`` that arrive at the last body; what is common to routes is done once."""
        if len(names) == 1:
            shown = self._show(names[0], way)
            return shown.noisy if noise else shown.clean
        key = (noise, names, way)
        if key in self._arrived:
            self._arrived.move_to_end(key)
            return self._arrived[key]
        source, target = names[-2:]
        before, sides = self._carry(names[:-1], noise, way), self.bodies[target].sides
        codes = _codes(self.bodies[source], before, self.bodies[source].sides)
        arrived = np.empty((len(before), len(sides), 2, 3))
        common = [side for side in sides if side in self.bodies[source].sides]
        for (model, constant), rows in zip(self._link(noise, source, target, way), self._rows, strict=True):
            for place, side in enumerate(sides):
                if side in common:
                    code = codes[rows, self.bodies[source].sides.index(side)] @ model[1:] + model[0]
                else:  # nothing of this arm arrives; the best guess is its mean
                    code = np.repeat(constant[place][None], len(rows), axis=0)
                arrived[rows, place] = _unit(code[:, -6:].reshape(-1, 2, 3)) * _MIRROR[SIDES.index(side)]
        self._arrived[key] = arrived
        while len(self._arrived) > _KEPT_PREFIXES:
            self._arrived.popitem(last=False)
        return arrived

    def _link(self, noise: bool, a: str, b: str, way: int) -> list[tuple[FloatArray, FloatArray]]:
        """Per fold the ridge from codes of ``a`` to codes of ``b``, and the mean code of each arm of ``b``."""
        key = (noise, a, b, way)
        if key not in self._links:
            ends = []
            for name in (a, b):
                shown = self._show(name, way)
                ends.append(_codes(self.bodies[name], shown.noisy if noise else shown.clean, shown.sides))
            sides = self.bodies[a].sides, self.bodies[b].sides
            common = [side for side in sides[0] if side in sides[1]]
            x, y = (codes[:, [own.index(side) for side in common]] for codes, own in zip(ends, sides, strict=True))
            self._links[key] = [
                (
                    _ridge(x[rows].reshape(-1, x.shape[-1]), y[rows].reshape(-1, y.shape[-1])),
                    ends[1][rows].mean(axis=0),
                )
                for rows in self._rest
            ]
        return self._links[key]

    def _per_action(self, values: FloatArray) -> FloatArray:
        return np.array([values[self.actions == name].mean() for name in np.unique(self.actions)])


def _ways(retargeter: str | Retargeter) -> tuple[Retargeter | None, ...]:
    if callable(retargeter):
        return (retargeter,)
    if retargeter not in RETARGETERS:
        raise OptionError(f"no retargeter {retargeter!r}; {nearest_name(str(retargeter), RETARGETERS)}")
    return RETARGETERS[retargeter]


def _checked(given: Mapping[str, float] | None, bodies: Mapping[str, Embodiment], what: str) -> dict[str, float]:
    for name, value in (given or {}).items():
        if name not in bodies:
            raise OptionError(f"{what}: {name!r} does not rehearse here; {nearest_name(name, bodies)}")
        if not (np.isfinite(value) and value >= 0.0):
            raise OptionError(f"{what} of {name!r} must be finite and not negative, got {value}")
    return dict(given or {})


def _landmarks(body: Embodiment, directions: FloatArray) -> FloatArray:
    """Elbow and wrist from the shoulder over the arm's length: ``(N, arms, 2 points, 3)``."""
    share = body.arm_lengths / body.reach
    elbow = directions[:, :, 0] * share[:, 0, None]
    return np.stack([elbow, elbow + directions[:, :, 1] * share[:, 1, None]], axis=2)


def _codes(body: Embodiment, directions: FloatArray, sides: Sequence[str]) -> FloatArray:
    """Arm codes as the mappings': positions and directions of a human (12), directions of a robot (6); left arms."""
    mirrored = directions * np.stack([_MIRROR[SIDES.index(side)] for side in sides])[None, :, None]
    parts = [_landmarks(body, mirrored)] if body.kind == "human" else []
    return np.concatenate([part.reshape(*directions.shape[:2], 6) for part in (*parts, mirrored)], axis=-1)


def _blurred(body: Embodiment, directions: FloatArray, sigma: float, rng: np.random.Generator) -> FloatArray:
    """Directions as a sensor with noise ``sigma`` [arm lengths] would show them; a shoulder is seen half as noisy."""
    points = _landmarks(body, directions)
    shoulder = 0.5 * sigma * rng.standard_normal(points[:, :, 0].shape)
    elbow = points[:, :, 0] + sigma * rng.standard_normal(shoulder.shape) - shoulder
    wrist = points[:, :, 1] + sigma * rng.standard_normal(shoulder.shape) - shoulder
    return _unit(np.stack([elbow, wrist - elbow], axis=2))


def _ridge(x: FloatArray, y: FloatArray) -> FloatArray:
    """Ridge regression on standardised columns: ``(1 + D, E)``, the offset first."""
    mean, spread = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-3)
    z = (x - mean) / spread
    normal = z.T @ z + _RIDGE * len(z) * np.eye(z.shape[1])
    slope = np.linalg.solve(normal, z.T @ (y - y.mean(axis=0))) / spread[:, None]
    return np.concatenate([(y.mean(axis=0) - mean @ slope)[None], slope])


def _unit(vectors: FloatArray) -> FloatArray:
    scaled: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    return scaled
