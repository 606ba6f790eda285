"""Disturbances: what a live link does to a motion, each part seeded and off by default.

The preset ``teleop`` is the standard suite at 30 Hz: cells ``lag``, ``noise``, ``latency``, ``noise+latency`` and
``full``, each at the levels ``train`` (a range, drawn anew in every episode), ``test`` and ``harsh``. Write it
``"teleop:CELL:LEVEL"``; what is left out becomes ``full`` and ``train``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, nearest_name
from syda_gym.simulation.backend import MotorConditions

__all__ = ["CELLS", "LEVELS", "PRESETS", "Disturbances", "Drawn", "deliver", "freeze_elbow_yaw", "see"]

Range = float | tuple[float, float]

LEVELS = ("train", "test", "harsh")

CELLS: dict[str, tuple[str, ...]] = {
    "lag": (),
    "noise": ("noise", "outliers", "dropout"),
    "latency": ("latency", "latency_jitter", "loss"),
    "noise+latency": ("noise", "outliers", "dropout", "latency", "latency_jitter", "loss"),
    "full": (
        "noise", "outliers", "dropout", "latency", "latency_jitter", "loss", "motor_gain", "motor_speed", "payload",
    ),
}  # fmt: skip
"""Cells of the suite ``teleop`` and the disturbances in them. ``lag`` has none but the motors' own."""

PRESETS: dict[str, tuple[str, ...]] = {
    "skeleton_noise": ("noise", "outliers"),
    "dropout": ("dropout",),
    "link": ("latency", "latency_jitter"),
    "packet_loss": ("loss",),
    "weak_motors": ("motor_gain", "motor_speed"),
    "payload": ("payload",),
    "friction": ("friction",),
    "wrong_scale": ("operator_scale",),
    "dynamics": ("motor_gain", "motor_speed", "payload", "friction", "changes"),
}
"""Single disturbances, written ``"NAME:LEVEL"``. ``dynamics`` draws a robot for every episode and changes it within."""

_FRAME = 1.0 / 30.0  # s; the suite counts latency in frames at 30 Hz

_VALUES: dict[str, tuple[Range, Range, Range]] = {
    "noise": ((0.004, 0.020), 0.0125, 0.025),
    "outliers": ((0.0, 0.02), 0.01, 0.03),
    "dropout": ((0.0, 0.04), 0.02, 0.06),
    "latency": ((1.0 * _FRAME, 4.5 * _FRAME), 3.0 * _FRAME, 5.0 * _FRAME),
    "latency_jitter": ((0.0, 1.5 * _FRAME), 1.0 * _FRAME, 2.0 * _FRAME),
    "loss": ((0.0, 0.06), 0.03, 0.10),
    "motor_gain": ((0.70, 1.0), 0.80, 0.65),
    "motor_speed": ((0.70, 1.0), 0.80, 0.65),
    "payload": ((0.0, 0.5), 0.3, 0.6),
    "friction": ((0.0, 0.3), 0.2, 0.5),
    "operator_scale": ((0.85, 1.15), 1.10, 1.20),
}

_DYNAMICS: dict[str, tuple[Range, Range, Range]] = {
    "motor_gain": ((0.65, 1.0), (0.65, 1.0), (0.5, 1.0)),
    "motor_speed": ((0.65, 1.0), (0.65, 1.0), (0.5, 1.0)),
    "payload": ((0.0, 0.6), (0.0, 0.6), (0.0, 0.9)),
    "friction": ((0.0, 0.3), (0.0, 0.3), (0.0, 0.5)),
    "changes": ((0.2, 1.0), 0.5, 1.0),
}
"""In ``dynamics`` nothing is known beforehand, so that every level is a range; ``harsh`` goes beyond the others."""

_ALLOWED: dict[str, tuple[float, float]] = {
    "noise": (0.0, 0.5),
    "noise_correlation": (0.0, 0.999),
    "noise_depth": (0.0, 10.0),
    "noise_lateral": (0.0, 10.0),
    "outliers": (0.0, 1.0),
    "outlier_size": (0.0, 2.0),
    "dropout": (0.0, 1.0),
    "latency": (0.0, 2.0),
    "latency_jitter": (0.0, 1.0),
    "loss": (0.0, 0.99),
    "motor_gain": (0.05, 1.5),
    "motor_speed": (0.05, 1.5),
    "payload": (0.0, 5.0),
    "friction": (0.0, 0.95),
    "operator_scale": (0.3, 3.0),
    "freeze_elbow_yaw": (0.0, 1.0),
    "changes": (0.0, 20.0),
}

_SHARES = 16
"""Random numbers drawn for an episode: as many as in the first release, so that its seeds give the same episodes."""

_LONGEST_DROPOUT = 10
_WARM_UP = 24


@dataclass(frozen=True)
class Disturbances:
    """What goes wrong between operator and robot; a pair of numbers is a range that each episode draws from.

    Attributes:
        noise: standard deviation of the noise on every landmark's coordinates [m], first-order autoregressive.
        noise_correlation: of the noise from one frame to the next.
        noise_depth: factor on the noise along the operator's forward axis, where a depth camera stands.
        noise_lateral: factor on the noise to the sides.
        outliers: chance of a jump per landmark and frame.
        outlier_size: length of a jump [m], in a random direction.
        dropout: chance per frame that one landmark is lost for 3 to 10 frames; it is held where it was.
        latency: of the link [s].
        latency_jitter: latency varies uniformly by plus or minus this [s]; the newest packet wins.
        loss: chance that a packet never arrives.
        motor_gain: factor on the motors' position gain.
        motor_speed: factor on the joints' top speed.
        payload: mass in each hand [kg].
        friction: share of the motors' effort that friction eats up.
        operator_scale: factor on the operator's landmark coordinates, as if calibrated for another person.
        freeze_elbow_yaw: where the sine of the elbow's angle is below this, the joint that turns the elbow keeps its
            last command, because a straight arm does not say where its elbow points; 0 switches it off.
        changes: how many times a second, on average, the motors, the payload or the friction are drawn anew within the
            episode, from their ranges; see ``envs.task.dynamics``.

    Raises:
        OptionError: a value outside its range, or a range upside down.
    """

    noise: Range = 0.0
    noise_correlation: Range = 0.6
    noise_depth: Range = 1.3
    noise_lateral: Range = 0.8
    outliers: Range = 0.0
    outlier_size: Range = 0.08
    dropout: Range = 0.0
    latency: Range = 0.0
    latency_jitter: Range = 0.0
    loss: Range = 0.0
    motor_gain: Range = 1.0
    motor_speed: Range = 1.0
    payload: Range = 0.0
    friction: Range = 0.0
    operator_scale: Range = 1.0
    freeze_elbow_yaw: float = 0.15
    changes: Range = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            low, high = _ALLOWED[field.name]
            for value in _ends(getattr(self, field.name), field.name):
                if not low <= value <= high:
                    raise OptionError(f"disturbance {field.name!r} must lie between {low} and {high}, got {value}")
            first, last = _ends(getattr(self, field.name), field.name)
            if first > last:
                raise OptionError(f"disturbance {field.name!r}: the range ({first}, {last}) is upside down")

    @classmethod
    def preset(cls, cell: str = "full", level: str = "train") -> Disturbances:
        """A cell of the suite, or a single disturbance, at a level.

        Raises:
            OptionError: unknown cell or level.
        """
        known = {**CELLS, **PRESETS}
        if cell not in known:
            raise OptionError(f"unknown disturbances {cell!r}; {nearest_name(cell, known)}")
        if level not in LEVELS:
            raise OptionError(f"unknown level {level!r}; {nearest_name(level, LEVELS)}")
        table = _DYNAMICS if cell == "dynamics" else _VALUES
        values: dict[str, Any] = {name: table[name][LEVELS.index(level)] for name in known[cell]}
        return cls(**values)

    @classmethod
    def resolve(cls, value: str | Disturbances | Mapping[str, Any] | None) -> Disturbances | None:
        """Accepts disturbances, a preset's name, a mapping of values, or ``None``.

        Raises:
            OptionError: unknown preset or unknown disturbance.
        """
        if value is None or isinstance(value, Disturbances):
            return value
        if isinstance(value, Mapping):
            for name in value:
                if name not in _ALLOWED:
                    raise OptionError(f"unknown disturbance {name!r}; {nearest_name(str(name), _ALLOWED)}")
            return cls(**value)
        if not isinstance(value, str):
            raise OptionError(f"disturbances must be a preset, a dict or Disturbances, got {type(value).__name__}")
        name, *rest = value.split(":")
        if name == "teleop":
            cell, level = (*rest, *("full", "train")[len(rest) :])[:2]
            extra = rest[2:]
        else:
            cell, level, extra = name, (rest or ["train"])[0], rest[1:]
            if cell not in PRESETS:
                raise OptionError(f"unknown disturbances {value!r}; {nearest_name(cell, ['teleop', *PRESETS])}")
        if extra:
            raise OptionError(f"disturbances {value!r}: write 'teleop:CELL:LEVEL' or 'NAME:LEVEL'")
        return cls.preset(cell, level)

    @property
    def watches_landmarks(self) -> bool:
        """Whether the operator's landmarks themselves are disturbed."""
        return any(_ends(getattr(self, name), name)[1] > 0.0 for name in ("noise", "outliers", "dropout"))

    def check_operator(self, operator: Embodiment) -> None:
        """Refuses skeleton noise on an operator that has joint angles instead of landmarks.

        Raises:
            OptionError: the operator is a robot.
        """
        scaled = _ends(self.operator_scale, "operator_scale") != (1.0, 1.0)
        if (self.watches_landmarks or scaled) and not isinstance(operator, HumanSkeleton):
            raise OptionError(
                f"operator {operator.name!r} is a {operator.kind}; noise, outliers, dropout and operator_scale "
                "disturb a human's skeleton; use 'latency' or a human operator"
            )

    def draw(self, rng: np.random.Generator) -> Drawn:
        """The values of one episode; the draws do not depend on which disturbances are on."""
        low, high = self._bounds
        shares = rng.random(_SHARES)
        seed = int(shares[-1] * 2**53)
        last = float(np.random.default_rng(seed).random()) if high[-1] > low[-1] else 0.0
        values: list[Any] = (low + np.append(shares, last) * (high - low)).tolist()
        return replace(Drawn(*values), seed_of_changes=seed + 1)

    @cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end of every range, in the order of ``Drawn``."""
        low, high = np.array([_ends(getattr(self, field.name), field.name) for field in fields(self)]).T
        return low, high

    def at_share(self, name: str, share: float) -> float:
        """The value of a disturbance at a share in [0, 1) of its range."""
        low, high = _ends(getattr(self, name), name)
        return low + share * (high - low)


@dataclass(frozen=True)
class Drawn:
    """Disturbances of one episode, all numbers; units as in ``Disturbances``."""

    noise: float
    noise_correlation: float
    noise_depth: float
    noise_lateral: float
    outliers: float
    outlier_size: float
    dropout: float
    latency: float
    latency_jitter: float
    loss: float
    motor_gain: float
    motor_speed: float
    payload: float
    friction: float
    operator_scale: float
    freeze_elbow_yaw: float
    changes: float = 0.0
    seed_of_changes: int = 0

    @property
    def motors(self) -> MotorConditions:
        """What the robot feels of it when the episode begins."""
        return MotorConditions(self.motor_gain, self.motor_speed, self.payload, self.friction)


def see(drawn: Drawn, operator: Embodiment, frames: FloatArray, rng: np.random.Generator) -> FloatArray:
    """What the camera makes of the operator.

    Args:
        drawn: disturbances of the episode.
        operator: who moves.
        frames: true frames ``(N, F)`` in time order.
        rng: random numbers; as many are drawn whatever is on.

    Returns:
        ``(N, F)``.
    """
    if not isinstance(operator, HumanSkeleton):
        return frames
    count, arms = len(frames), len(operator.sides)
    fresh = rng.standard_normal((count, arms, 2, 3))
    jumps = rng.random((count, arms, 2))
    directions = rng.standard_normal((count, arms, 2, 3))
    lost = rng.random((count, 3))
    points = operator.arm_points(frames)
    landmarks = points[:, :, 1:]
    noise = _correlated(fresh, drawn.noise_correlation)
    landmarks = landmarks + noise * (drawn.noise * np.array([drawn.noise_depth, drawn.noise_lateral, 1.0]))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    landmarks = landmarks + directions * (drawn.outlier_size * (jumps < drawn.outliers))[..., None]
    points[:, :, 1:] = _held(landmarks.reshape(count, -1, 3), lost, drawn.dropout).reshape(landmarks.shape)
    return operator.frames_from_points(points * drawn.operator_scale)


def deliver(drawn: Drawn, first: int, last: int, start: int, dt: float, rng: np.random.Generator) -> NDArray[np.intp]:
    """Which packet is the newest one at hand at each step; packet ``i`` is recorded at step ``i``.

    Args:
        drawn: disturbances of the episode.
        first: number of the first packet that is sent, not after ``start``.
        last: number of the last one.
        start: first step of the episode.
        dt: control step [s].
        rng: random numbers.

    Returns:
        ``(last - start + 1,)`` packet numbers, never falling.
    """
    packets = np.arange(first, last + 1)
    late = drawn.latency + drawn.latency_jitter * rng.uniform(-1.0, 1.0, len(packets))
    gone = rng.random(len(packets)) < drawn.loss
    # A hair less than the exact quotient, so that a latency of whole steps does not cost one more by rounding.
    arrival = packets + np.ceil(np.maximum(late, 0.0) / dt - 1e-9).astype(np.intp)
    gone[0], arrival[0] = False, first  # the stream has been running before the episode
    newest = np.full(last - first + 1, first, dtype=np.intp)
    heard = ~gone & (arrival <= last)
    np.maximum.at(newest, arrival[heard] - first, packets[heard])
    return np.asarray(np.maximum.accumulate(newest)[start - first :])


def warm_up(drawn: Drawn, dt: float) -> int:
    """Packets before the episode that may still matter when it begins."""
    # At least a fixed number, so that all cells of the suite draw the same noise from the same seed.
    return max(int(np.ceil((drawn.latency + drawn.latency_jitter) / dt)) + _LONGEST_DROPOUT, _WARM_UP)


def freeze_elbow_yaw(robot: Robot, q: FloatArray, threshold: float) -> FloatArray:
    """Holds the joint that turns the elbow while the arm is nearly straight.

    Args:
        robot: whose commands.
        q: joint angles ``(N, n)`` [rad] in time order.
        threshold: on the sine of the elbow's angle, counted from where the arm is straightest.

    Returns:
        ``(N, n)``.
    """
    if threshold <= 0.0:
        return q
    result = q.copy()
    for arm, columns in enumerate(robot.arm_slices):
        if columns.stop - columns.start < 4:
            continue  # no joint for the swivel of the elbow
        yaw, elbow = columns.start + 2, columns.start + 3
        bent = np.abs(np.sin(q[:, elbow] - _straight_elbows(robot)[arm])) >= threshold
        bent[0] = True
        result[:, yaw] = q[_last_true(bent), yaw]
    return robot.clamp(result)


@lru_cache(maxsize=16)
def _straight_elbows(robot: Robot) -> tuple[float, ...]:
    """Angle of each arm's fourth joint, the elbow, at which the arm reaches farthest [rad]."""
    angles = []
    for arm, columns in enumerate(robot.arm_slices):
        elbow = min(columns.start + 3, columns.stop - 1)
        q = np.repeat(np.clip(0.0, robot.lower, robot.upper)[None], 721, axis=0)
        q[:, elbow] = np.linspace(robot.lower[elbow], robot.upper[elbow], 721)
        points = robot.arm_points(q)[:, arm]
        reach = np.linalg.norm(points[:, 2] - points[:, 0], axis=1)
        angles.append(float(q[np.argmax(reach), elbow]))
    return tuple(angles)


def _correlated(fresh: FloatArray, correlation: float) -> FloatArray:
    """First-order autoregressive noise of unit variance along the first axis."""
    noise = fresh * float(np.sqrt(1.0 - correlation**2))
    noise[0], before = fresh[0], np.empty_like(fresh[0])
    for index in range(1, len(noise)):
        np.multiply(noise[index - 1], correlation, out=before)
        noise[index] += before
    return noise


def _held(landmarks: FloatArray, lost: FloatArray, chance: float) -> FloatArray:
    """Holds landmarks ``(N, L, 3)`` through dropouts; ``lost`` ``(N, 3)`` decides start, landmark and length."""
    result = landmarks.copy()
    points = landmarks.shape[1]
    for start in np.flatnonzero(lost[:, 0] < chance).tolist():
        if start == 0:
            continue
        point = min(int(lost[start, 1] * points), points - 1)
        length = 3 + min(int(lost[start, 2] * (_LONGEST_DROPOUT - 2)), _LONGEST_DROPOUT - 3)
        result[start : start + length, point] = result[start - 1, point]
    return result


def _last_true(marks: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Index of the last true mark up to each place."""
    return np.maximum.accumulate(np.where(marks, np.arange(len(marks)), 0))


def _ends(value: Any, name: str) -> tuple[float, float]:
    pair = (value, value) if np.ndim(value) == 0 else tuple(value)
    good = len(pair) == 2 and all(isinstance(v, int | float | np.number) and np.isfinite(v) for v in pair)
    if not good or isinstance(value, bool):
        raise OptionError(f"disturbance {name!r} must be a number or a pair (low, high), got {value!r}")
    return float(pair[0]), float(pair[1])
