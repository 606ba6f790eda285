"""How one body performs an action: proportions, style and lag, the camera that watches a human, a robot's limits."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from syda_gym.embodiments.embodiment import Embodiment, FloatArray, Side
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MotionError
from syda_gym.motions.synthetic.actions import REST, limb_directions
from syda_gym.motions.synthetic.range_of_motion import within_range

__all__ = ["Performable", "Performer", "Score"]

_LIMIT_MARGIN = 2e-3  # rad; room for rounding when angles are stored
_SPEED_SHARE = 0.9  # of a joint's top speed


class Performable(Protocol):
    """Anything that says where limbs point over time."""

    @property
    def seconds(self) -> float:
        """Duration."""

    def directions(self, times: FloatArray, side: Side) -> FloatArray:
        """Upper-arm and forearm unit directions ``(N, 2, 3)`` at ``times`` in body axes."""


@dataclass(frozen=True, eq=False)
class Score:
    """What everybody performs together: key poses of both arms over time.

    Attributes:
        times: ``(K,)`` [s], increasing.
        left: K key poses of the left arm.
        right: K key poses of the right arm.
        seconds: duration.
    """

    times: FloatArray
    left: FloatArray
    right: FloatArray
    seconds: float

    def directions(self, times: FloatArray, side: Side) -> FloatArray:
        """Upper-arm and forearm unit directions ``(N, 2, 3)`` at ``times`` in body axes."""
        keys = limb_directions(self.left if side == "left" else self.right)
        path = PchipInterpolator(self.times, keys, axis=0)
        values = path(np.clip(times, self.times[0], self.times[-1]))
        return _unit(values * (1.0, 1.0 if side == "left" else -1.0, 1.0))


@dataclass(frozen=True, eq=False)
class _Style:
    """What stays the same in everything that one body does."""

    amplitude: float
    swivel: FloatArray
    bias: FloatArray
    smoothness: float
    lag: float
    wander: float


def _style(body: Embodiment, rng: np.random.Generator) -> _Style:
    human = body.kind == "human"
    return _Style(
        amplitude=float(rng.uniform(0.90, 1.06)),
        swivel=np.deg2rad(rng.normal(0.0, 9.0 if human else 3.0, len(body.sides))),
        # Humans lean their arms forward or back by 10 to 20 degrees in recordings; robots stand straight.
        bias=np.deg2rad(rng.normal((0.0, 9.0, 0.0), (3.0, 5.0, 3.0))) if human else np.zeros(3),
        smoothness=float(rng.uniform(0.035, 0.09)),
        lag=float(rng.normal(0.0, 0.04)),
        wander=float(np.deg2rad(rng.uniform(2.5, 4.5) if human else 1.0)),
    )


class Performer:
    """One body, with its habits, ready to perform any score.

    Args:
        body: who performs; a human with any sides, or a robot that ``LimbIK`` can solve.
        seed: of the habits; two performers of one body and seed are equal.
        noise: factor on the camera's noise and dropouts (humans only); 0 is a perfect camera.
        variety: factor on style, lag and imprecision; 0 lets all bodies point their limbs alike.

    Raises:
        MotionError: the body is neither a human nor a robot.
    """

    def __init__(self, body: Embodiment, seed: int, noise: float = 1.0, variety: float = 1.0) -> None:
        if not isinstance(body, HumanSkeleton | Robot):
            raise MotionError(f"cannot perform as {body!r}; expected a HumanSkeleton or a Robot")
        self.body = body
        self.seed = seed
        self.noise = noise
        self.variety = variety
        self.style = _style(body, self._rng("style"))

    def directions(self, score: Performable, label: str, fps: float) -> FloatArray:
        """Limb directions ``(N, arms, 2, 3)`` that this body means to show, its habits included.

        Arguments as ``perform``. A robot may not reach them.
        """
        return self._directions(score, fps, self._rng("take", label))

    def _rng(self, *labels: str | int) -> np.random.Generator:
        words = [label if isinstance(label, int) else zlib.crc32(label.encode()) for label in labels]
        return np.random.default_rng([self.seed, zlib.crc32(self.body.name.encode()), *words])

    def perform(self, score: Performable, label: str, fps: float) -> tuple[FloatArray, NDArray[np.bool_] | None]:
        """Performs a score.

        Args:
            score: what to do.
            label: names the recording; chance depends on it, on the body and on the seed, on nothing else.
            fps: frames per second.

        Returns:
            Frames ``(N, F)`` and, for a human, which values a camera dropout has held ``(N, F)``.
        """
        rng = self._rng("take", label)
        directions = self._directions(score, fps, rng)
        if isinstance(self.body, Robot):
            return self._robot_frames(self.body, directions, fps), None
        return self._human_frames(self.body, directions, fps, rng)

    def _directions(self, score: Performable, fps: float, rng: np.random.Generator) -> FloatArray:
        """Limb directions ``(N, arms, 2, 3)`` as this body does them."""
        style, variety = self.style, self.variety
        times = np.arange(round(score.seconds * fps)) / fps
        lag = np.clip(style.lag + rng.normal(0.0, 0.055), -0.17, 0.17)
        warp = rng.uniform(-0.05, 0.05) * np.sin(2.0 * np.pi * (times / score.seconds + rng.uniform()))
        heard = times - variety * (lag + warp)
        amplitude = 1.0 + variety * (style.amplitude + rng.normal(0.0, 0.03) - 1.0)
        turn = Rotation.from_rotvec(variety * style.bias)
        arms = []
        for index, side in enumerate(self.body.sides):
            path = score.directions(heard, side)
            rest = limb_directions([REST])[0] * (1.0, 1.0 if side == "left" else -1.0, 1.0)
            path = _unit(rest + amplitude * (path - rest))
            path = _swivelled(path, variety * float(style.swivel[index]) * (1.0 if side == "left" else -1.0))
            path = turn.apply(path.reshape(-1, 3)).reshape(path.shape)
            path = _unit(path + variety * style.wander * _drift(rng, path.shape, fps))
            path = _unit(gaussian_filter1d(path, style.smoothness * fps, axis=0, mode="nearest"))
            if isinstance(self.body, HumanSkeleton) and self.body.joint_limits:
                path = within_range(path, self.body.joint_limits, side)
                path = _unit(gaussian_filter1d(path, style.smoothness * fps, axis=0, mode="nearest"))
            arms.append(path)
        return np.stack(arms, axis=1)

    def _human_frames(
        self, body: HumanSkeleton, directions: FloatArray, fps: float, rng: np.random.Generator
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        points = np.zeros((len(directions), len(body.sides), 3, 3))
        standing = body.arm_points(body.standing())[0]
        # Shoulders sway with the trunk and rise with a lifted arm (the shoulder girdle follows the humerus).
        sway = 0.008 * _drift(rng, (len(directions), 1, 3), fps)
        lift = np.clip(directions[:, :, 0, 2] + 0.5, 0.0, None)[..., None] * (0.0, 0.0, 0.06 * body.reach)
        points[:, :, 0] = standing[:, 0] + sway + lift
        points[:, :, 1] = points[:, :, 0] + body.upper_arm * directions[:, :, 0]
        points[:, :, 2] = points[:, :, 1] + body.forearm * directions[:, :, 1]
        seen, held = _camera(points, fps, rng, self.noise)
        return body.frames_from_points(seen), np.repeat(held, 3, axis=-1).reshape(len(points), -1)

    def _robot_frames(self, robot: Robot, directions: FloatArray, fps: float) -> FloatArray:
        """Angles within limits; smoothed as little as the speed limits demand."""
        wanted = LimbIK(robot).solve(directions)
        for width in (0.02, 0.04, 0.06, 0.09, 0.13, 0.18, 0.25, 0.35, 0.5):
            frames = _inside(robot, gaussian_filter1d(wanted, width * fps, axis=0, mode="nearest"))
            speed = np.abs(np.diff(frames, axis=0)) * fps
            if (speed <= _SPEED_SHARE * robot.speed).all():
                return frames
        raise MotionError(f"robot {robot.name!r} is too slow for the synthetic motions; lower `tempo`")


def _inside(robot: Robot, frames: FloatArray) -> FloatArray:
    clamped = robot.clamp(frames)
    lower, upper = robot.limits_at(clamped)
    margin = np.minimum(_LIMIT_MARGIN, 0.25 * (upper - lower))
    return np.clip(clamped, lower + margin, upper - margin)


def _camera(
    points: FloatArray, fps: float, rng: np.random.Generator, noise: float
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """A depth camera in front of the human: correlated noise, stronger in depth, and dropouts that hold the last value.

    Returns the seen points ``(N, arms, 3, 3)`` and which of them are held ``(N, arms, 3)``.
    """
    count = len(points)
    sigma = noise * 0.009 * np.array([1.3, 0.8, 0.9])  # m; x is the depth of a camera that faces the human
    sigma = sigma * np.array([0.5, 0.9, 1.0])[:, None]  # shoulders are tracked better than hands
    keep = 0.6 ** (30.0 / fps)
    white = rng.standard_normal(points.shape) * np.sqrt(1.0 - keep**2)
    error = np.empty_like(points)
    error[0] = white[0] / np.sqrt(1.0 - keep**2)
    for t in range(1, count):
        error[t] = keep * error[t - 1] + white[t]
    seen = points + sigma * error
    held = np.zeros(points.shape[:3], dtype=bool)
    # Elbows and wrists are lost for 3 to 10 frames of 30 per second, on average once in eight seconds each.
    starts = rng.random((count, points.shape[1], 2)) < noise * 0.125 / fps
    lengths = rng.integers(3, 11, starts.shape)
    for t, arm, point in np.argwhere(starts):
        if t == 0:
            continue
        stop = min(count, t + max(1, round(float(lengths[t, arm, point]) * fps / 30.0)))
        seen[t:stop, arm, point + 1] = seen[t - 1, arm, point + 1]
        held[t:stop, arm, point + 1] = True
    return seen, held


def _drift(rng: np.random.Generator, shape: tuple[int, ...], fps: float) -> FloatArray:
    """Slow random wander (about half a second), unit variance, along the first axis."""
    width = 0.35 * fps
    pad = int(4 * width)
    white = rng.standard_normal((shape[0] + 2 * pad, *shape[1:]))
    smooth = gaussian_filter1d(white, width, axis=0, mode="constant")[pad : pad + shape[0]]
    result: FloatArray = smooth * np.sqrt(2.0 * width * np.sqrt(np.pi))
    return result


def _swivelled(path: FloatArray, angle: float) -> FloatArray:
    """Turns elbow and forearm about the line from shoulder to wrist."""
    line = _unit(path.sum(axis=1))
    turn = Rotation.from_rotvec(angle * line)
    return np.stack([turn.apply(path[:, 0]), turn.apply(path[:, 1])], axis=1)


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result
