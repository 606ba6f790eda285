"""Calibration: two seconds of standing tell unit, scale, origin and heading of whoever is in front of the camera."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import KINECT_AXES, HumanSkeleton
from syda_gym.errors import OptionError, TeleoperationError, nearest_name

__all__ = ["AXES", "Calibration", "Calibrator", "calibrate"]

AXES: dict[str, FloatArray] = {
    "kinect": KINECT_AXES,
    "ros": np.eye(3),
    "camera": np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    "unity": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
}
"""Rotations from a source's axes to body axes (x forward, y left, z up): ``kinect`` = x to the subject's right, y up,
z backward (the paper's); ``ros`` = x forward, y left, z up; ``camera`` = x to the right of the picture, y down, z away
from a camera that the subject faces; ``unity`` = x to the subject's right, y up, z forward, which is left-handed. The
heading is measured, so a turn about the vertical does not matter."""

_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_ARM = (0.22, 1.2)  # m; shoulder to wrist of a small child and of a very tall adult
_MIN_FRAMES = 10
_STILL = 0.04  # m; a depth camera's noise on a person who stands still is 0.5 to 2 cm
_SPREAD = 0.15  # limb lengths of one person vary less than this share in a usable recording
_ASYMMETRY = 0.3
_HANGING = (50.0, 70.0)  # degrees from straight down for upper arm and forearm
_LEVEL = 25.0  # degrees of tilt of the line through the shoulders
_PLAUSIBLE = (0.5, 1.7)  # limb lengths against their calibrated ones, later on


@dataclass(frozen=True, eq=False)
class Calibration:
    """How a source's frames become frames of the body that a mapping knows.

    Attributes:
        body: the mapping's source.
        unit: the source's unit, ``"m"``, ``"cm"`` or ``"mm"``.
        scale: nominal reach of ``body`` over the measured one.
        origin: median midpoint of the shoulders ``(3,)``, source axes and unit.
        yaw: heading of the person about the vertical [rad]; 0 is looking along the source's forward axis.
        lengths: measured limb lengths ``(arms, 2)`` [source unit].
        width: measured distance of the shoulders [source unit], 0 with one arm.
        axes: name in ``AXES``.
        notices: what a person should know, for example that the source sends centimetres.
    """

    body: Embodiment
    unit: str = "m"
    scale: float = 1.0
    origin: FloatArray = field(default_factory=lambda: np.zeros(3))
    yaw: float = 0.0
    lengths: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    width: float = 0.0
    axes: str = "kinect"
    notices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if isinstance(self.body, HumanSkeleton):
            turn = _about_vertical(-self.yaw) @ AXES[self.axes]
            matrix = (self.body.axes.T @ turn).T * (self.scale * _UNITS[self.unit])
            standing = self.body.standing().reshape(-1, 3)
            object.__setattr__(self, "_matrix", matrix.tolist())
            object.__setattr__(self, "_middle", standing[::3].mean(axis=0).tolist())

    @property
    def measured(self) -> bool:
        """Whether a person was measured, rather than a source trusted."""
        return len(self.lengths) > 0

    @property
    def size(self) -> float:
        """All limbs and the shoulders together [m]."""
        return (float(self.lengths.sum()) + self.width) * _UNITS[self.unit]

    @property
    def metres(self) -> list[list[float]]:
        """Rotation and unit ``(3, 3)`` that turn a point of the source into metres in body axes; the heading stays."""
        matrix: list[list[float]] = (AXES[self.axes] * _UNITS[self.unit]).tolist()
        return matrix

    def apply(self, frame: FloatArray) -> FloatArray:
        """One frame ``(F,)`` of the source as a frame ``(F,)`` of ``body``.

        The midpoint of the shoulders (the shoulder of a one-armed body) is put where the body stands, so that walking
        about does not move the robot.
        """
        if not isinstance(self.body, HumanSkeleton):
            return frame
        # Plain floats: for six points numpy would spend its time on calling.
        values = frame.tolist()
        (ax, ay, az), (bx, by, bz) = values[0:3], values[9:12] if len(values) == 18 else values[0:3]
        mx, my, mz = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz)
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._matrix  # type: ignore[attr-defined]
        px, py, pz = self._middle  # type: ignore[attr-defined]
        result: list[float] = []
        for at in range(0, len(values), 3):
            x, y, z = values[at] - mx, values[at + 1] - my, values[at + 2] - mz
            result += (x * xx + y * yx + z * zx + px, x * xy + y * yy + z * zy + py, x * xz + y * yz + z * zz + pz)
        return np.array(result)

    def implausible(self, frame: FloatArray) -> str:
        """Empty, or which limb of the frame ``(F,)`` has a length that the calibrated person does not have."""
        if not len(self.lengths):
            return ""
        values = frame.tolist()
        points = [values[at : at + 3] for at in range(0, len(values), 3)]
        for arm, (upper, fore) in enumerate(self.lengths.tolist()):
            shoulder, elbow, wrist = points[3 * arm : 3 * arm + 3]
            for name, ratio in (
                ("upper arm", math.dist(shoulder, elbow) / upper),
                ("forearm", math.dist(elbow, wrist) / fore),
            ):
                if not _PLAUSIBLE[0] <= ratio <= _PLAUSIBLE[1]:
                    return f"{self.body.sides[arm]} {name} is {ratio:.2f} times its calibrated length"
        return ""

    def summary(self) -> dict[str, Any]:
        """Numbers for the screen and the journal."""
        return {
            "unit": self.unit,
            "scale": self.scale,
            "origin": self.origin.tolist(),
            "yaw": self.yaw,
            "axes": self.axes,
            "notices": list(self.notices),
        }


def calibrate(body: Embodiment, frames: ArrayLike, axes: str = "kinect") -> Calibration:
    """Measures a person who stands still with hanging arms.

    Args:
        body: the mapping's source. A robot's frames need no calibration and get the identity.
        frames: ``(N, F)`` of the source, at least ten, two seconds or so.
        axes: the source's axes, one of ``AXES``.

    Raises:
        OptionError: unknown axes.
        TeleoperationError: too few frames, not finite, moving, not standing, or no human arm in any unit; the message
            says what was seen and what to do.
    """
    if axes not in AXES:
        raise OptionError(f"unknown axes {axes!r}; {nearest_name(axes, AXES)}")
    if not isinstance(body, HumanSkeleton):
        return Calibration(body)
    array = np.asarray(frames, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != body.n_features or len(array) < _MIN_FRAMES:
        raise TeleoperationError(
            f"calibration needs at least {_MIN_FRAMES} frames of {body.n_features} numbers, got shape {array.shape}"
        )
    if not np.isfinite(array).all():
        raise TeleoperationError("calibration: a frame holds values that are not finite; check the source")
    points = array.reshape(len(array), -1, 3, 3) @ AXES[axes].T
    lengths = np.linalg.norm(np.diff(points, axis=2), axis=-1)  # (N, arms, 2)
    typical = np.median(lengths, axis=0)
    unit, notices = _find_unit(float(typical.sum(axis=1).mean()))
    metres = points * _UNITS[unit]
    _require_still(metres)
    _require_consistent(lengths, typical, body)
    _require_standing(metres, body)
    yaw = _heading(metres)
    if yaw is None:
        notices.append("one arm only: the heading cannot be measured; stand along the source's forward axis")
    reach = float(typical.sum(axis=1).mean()) * _UNITS[unit]
    shoulders = array.reshape(len(array), -1, 3, 3)[:, :, 0].mean(axis=1)
    return Calibration(
        body=body,
        unit=unit,
        scale=body.reach / reach,
        origin=np.median(shoulders, axis=0),
        yaw=yaw or 0.0,
        lengths=typical,
        width=_width(points),
        axes=axes,
        notices=tuple(notices),
    )


class Calibrator:
    """Collects a sliding window of frames until it passes as standing.

    Args:
        body: the mapping's source.
        seconds: length of the window [s]; 0 trusts the source to be calibrated already.
        axes: the source's axes.

    Attributes:
        message: why the latest window was refused, empty before.
    """

    def __init__(self, body: Embodiment, seconds: float = 2.0, axes: str = "kinect") -> None:
        if axes not in AXES:
            raise OptionError(f"unknown axes {axes!r}; {nearest_name(axes, AXES)}")
        if not 0.0 <= seconds <= 60.0:
            raise OptionError(f"calibration must take between 0 and 60 s, got {seconds}")
        self.body = body
        self.seconds = seconds
        self.axes = axes
        self.message = ""
        self._window: deque[tuple[float, FloatArray]] = deque(maxlen=20_000)
        self._next_try = -np.inf

    def add(self, now: float, frame: FloatArray) -> Calibration | None:
        """Takes one frame ``(F,)`` of the stream's time ``now`` [s]; returns the calibration once there is one."""
        if not isinstance(self.body, HumanSkeleton) or self.seconds == 0.0:
            return Calibration(self.body, axes=self.axes)
        if self._window and now - self._window[-1][0] > 0.5 * self.seconds:
            self._window.clear()  # a gap: whoever stood there before may have moved
        self._window.append((now, frame))
        # Keep the last frame before the window so that the window always spans the full time.
        while len(self._window) > 1 and now - self._window[1][0] >= self.seconds:
            self._window.popleft()
        if now - self._window[0][0] < self.seconds or now < self._next_try:
            return None
        self._next_try = now + 0.1 * self.seconds
        try:
            return calibrate(self.body, np.array([kept for _, kept in self._window]), self.axes)
        except TeleoperationError as error:
            self.message = str(error)
            return None


def _find_unit(arm: float) -> tuple[str, list[str]]:
    for unit, factor in _UNITS.items():
        if _ARM[0] <= arm * factor <= _ARM[1]:
            if unit == "m":
                return unit, []
            return unit, [f"the source sends {unit}, not metres: an arm measures {arm:.4g}; scaled by {factor:g}"]
    raise TeleoperationError(
        f"calibration: an arm measures {arm:.4g} from shoulder to wrist, which is no human arm in m, cm or mm; check "
        "the source's unit and joints"
    )


def _require_still(points: FloatArray) -> None:
    spread = np.sqrt(np.sum(np.var(points, axis=0), axis=-1))
    quarter = max(1, len(points) // 4)
    drift = np.linalg.norm(points[-quarter:].mean(axis=0) - points[:quarter].mean(axis=0), axis=-1)
    worst = max(float(spread.max()), 0.5 * float(drift.max()))
    if worst > _STILL:
        raise TeleoperationError(
            f"calibration: moving by {100 * worst:.1f} cm; stand still with hanging arms (up to {100 * _STILL:.0f} cm)"
        )


def _require_consistent(lengths: FloatArray, typical: FloatArray, body: HumanSkeleton) -> None:
    deviation = np.median(np.abs(lengths - typical), axis=0) / typical
    if float(deviation.max()) > _SPREAD:
        raise TeleoperationError(
            f"calibration: limb lengths vary by {100 * float(deviation.max()):.0f} % within the window; the "
            "tracking is not usable, move into the light or nearer"
        )
    if len(body.sides) == 2:
        ratio = typical[0] / typical[1]
        if float(np.abs(np.log(ratio)).max()) > np.log1p(_ASYMMETRY):
            raise TeleoperationError(
                f"calibration: left and right limbs differ by factors {np.round(ratio, 2).tolist()} (upper arm, "
                "forearm); one arm is not tracked, turn to face the camera"
            )


def _require_standing(points: FloatArray, body: HumanSkeleton) -> None:
    steps = np.median(np.diff(points, axis=2), axis=0)
    limbs = steps / np.linalg.norm(steps, axis=-1, keepdims=True)
    if float(limbs[:, :, 2].min()) < 0.5:
        mean = limbs.mean(axis=(0, 1))
        axis = int(np.argmax(np.abs(mean)))
        if (axis != 2 and abs(mean[axis]) > 0.9) or (axis == 2 and mean[2] > 0.9):
            raise TeleoperationError(
                f"calibration: all limbs point along {'-+'[int(mean[axis] > 0)]}{'xyz'[axis]} of the body axes, not "
                f"down; the source's axes differ from those named, choose one of {', '.join(AXES)}"
            )
    angles = np.degrees(np.arccos(np.clip(-limbs[:, :, 2], -1.0, 1.0)))
    for arm, side in enumerate(body.sides):
        for limb, name in enumerate(("upper arm", "forearm")):
            if angles[arm, limb] > _HANGING[limb]:
                raise TeleoperationError(
                    f"calibration: the {side} {name} is {angles[arm, limb]:.0f} degrees away from hanging down (up to "
                    f"{_HANGING[limb]:.0f}); let the arms hang"
                )


def _heading(points: FloatArray) -> float | None:
    """Yaw [rad] from the line through the shoulders, ``None`` with one arm."""
    if points.shape[1] != 2:
        return None
    line = np.median(points[:, 0, 0] - points[:, 1, 0], axis=0)
    across = float(np.hypot(line[0], line[1]))
    if across < 0.05 or abs(np.degrees(np.arctan2(line[2], across))) > _LEVEL:
        raise TeleoperationError(
            f"calibration: the shoulders are {100 * across:.0f} cm apart and {100 * abs(float(line[2])):.0f} cm "
            "different in height; stand upright and face the camera"
        )
    return float(np.arctan2(-line[0], line[1]))


def _width(points: FloatArray) -> float:
    """Distance of the shoulders, 0 with one arm."""
    if points.shape[1] != 2:
        return 0.0
    return float(np.median(np.linalg.norm(points[:, 0, 0] - points[:, 1, 0], axis=-1)))


def _about_vertical(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
