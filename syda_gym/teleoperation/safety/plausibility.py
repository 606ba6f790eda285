"""Plausibility: whether what a tracker says could be the calibrated person, a moment after the frame before."""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.teleoperation.calibration import Calibration

__all__ = ["Plausibility", "Verdict"]

# What a person can do: at once (m or rad, with the noise of a tracker), and per second from then on.
_PLACE = (0.25, 3.0)
_HEADING = (0.8, 6.0)
_ELBOW = (0.20, 5.0)
_WRIST = (0.30, 9.0)

_SIZE = 0.2  # share by which limbs and shoulders together may differ from the calibrated ones, averaged
_SIZE_TIME = 0.4  # s of that average
_TURNED_OVER = 2.2  # rad; both upper arms turned further within one frame: not raised but turned over
_BACK = (0.30, 0.8)  # m and rad; how near to where it was lost a person must be to be the same one
_BACK_FOR = 0.5  # s for which
_FROZEN = 1.0  # s of the very same numbers
_SWAPPED_TRUST = 0.5
_FROZEN_TRUST = 0.3
_BACKWARD_TRUST = 0.25
_REACH_BACK = (0.80, 0.95)  # cosines to straight backward of both upper arms, of one
_HANGS = 0.7  # cosine to straight down from which an upper arm counts as hanging
_BENT = 0.5  # sine of an elbow's flexion from which its direction counts
_BENDS_BACK = 0.7  # cosine
_BACKWARD = (0.7, 3.0)  # s of evidence from which one doubts, and up to which it is kept

Point = tuple[float, float, float]


class Verdict(NamedTuple):
    """What to do with a frame.

    Attributes:
        frame: ``(F,)`` to follow, perhaps with left and right exchanged; ``None`` to drop it.
        trust: speed factor in [0, 1].
        reason: empty, or what is odd.
        lost: whether the calibrated person is lost; somebody must stand still, or the person come back.
        thawed: whether a picture that had stood still moves again.
    """

    frame: FloatArray | None
    trust: float = 1.0
    reason: str = ""
    lost: bool = False
    thawed: bool = False


class _Pose(NamedTuple):
    """A frame in metres, body axes: the shoulders' middle, heading, joints relative to the middle, size."""

    middle: Point
    heading: float
    elbows: tuple[Point, ...]
    wrists: tuple[Point, ...]
    uppers: tuple[Point, ...]
    size: float


class _Room(NamedTuple):
    """How far something may go: a burst that refills at a rate, as in a token bucket."""

    burst: float
    rate: float
    left: float

    def allows(self, moved: float, quiet: float) -> bool:
        return moved <= self.left + self.rate * quiet

    def take(self, moved: float, quiet: float) -> _Room:
        """What is left after a movement."""
        return _Room(self.burst, self.rate, min(self.burst, self.left + self.rate * quiet - moved))


def _room(limits: tuple[float, float]) -> _Room:
    return _Room(*limits, limits[0])


class Plausibility:
    """Judges each frame by the last one that was believed.

    A hand or an elbow that jumps is dropped; if it stays there, it is believed as soon as an arm could have got there.
    What concerns the whole person is not believed with time: who jumps by a metre, turns faster than people
    do, turns over, or changes size, is lost, until the person is back where it was, or somebody stands still with
    hanging arms and is calibrated. A frame whose left and right are exchanged is exchanged back if that makes it fit.

    Args:
        calibration: of the person, measured.
    """

    def __init__(self, calibration: Calibration) -> None:
        self.calibration = calibration
        self._matrix = calibration.metres
        self._two = len(calibration.lengths) == 2
        self._size = calibration.size
        self._believed: _Pose | None = None
        self._previous: _Pose | None = None
        self._quiet = 0.0  # s since the last believed frame
        self._ratio = 1.0
        self._place, self._heading = _room(_PLACE), _room(_HEADING)
        self._elbow, self._wrist = _room(_ELBOW), _room(_WRIST)
        self._lost = ""
        self._back = 0.0  # s for which a lost person has been back
        self._bits = b""
        self._same = 0.0
        self._backward = 0.0

    def twin(self) -> Plausibility:
        """A copy; judging with it changes nothing of this one."""
        return copy.copy(self)

    def judge(self, frame: FloatArray, passed: float) -> Verdict:
        """Judges one frame.

        Args:
            frame: ``(F,)`` of the source, finite.
            passed: time since the frame before [s].
        """
        passed = min(max(passed, 0.0), 60.0)
        self._quiet += passed
        thawed = self._thaw(frame, passed)
        pose = self._pose(frame)
        before, self._previous = self._previous, pose
        share = 1.0 - math.exp(-passed / _SIZE_TIME)
        self._ratio += share * (pose.size / self._size - self._ratio)
        if self._lost:
            return self._wait(frame, pose, before, passed)
        odd = self._whole(pose)
        if odd and self._two and self._believed is not None:
            exchanged = _exchange(frame)
            other = self._pose(exchanged)
            if not self._whole(other) and not self._limbs(other):
                self._believe(other)
                return Verdict(exchanged, _SWAPPED_TRUST, "left and right are swapped", thawed=thawed)
        if odd:
            self._lost, self._back = odd, 0.0
            return Verdict(None, reason=odd, lost=True)
        odd = self._limbs(pose)
        if odd:
            return Verdict(None, reason=odd)
        self._believe(pose)
        return self._slowed(frame, pose, passed, thawed)

    def _slowed(self, frame: FloatArray, pose: _Pose, passed: float, thawed: bool) -> Verdict:
        backward = self._bends_backward(pose, passed)
        if backward == 2:
            return Verdict(None, reason="arms reach backward as no shoulder can; right --axes?")
        if backward == 1:
            return Verdict(frame, _BACKWARD_TRUST, "elbows bend backward; right --axes?", thawed=thawed)
        if self._same >= _FROZEN:
            return Verdict(frame, _FROZEN_TRUST, "the picture stands still")
        return Verdict(frame, thawed=thawed)

    def _thaw(self, frame: FloatArray, passed: float) -> bool:
        bits = frame.tobytes()
        if bits == self._bits:
            self._same += passed
            return False
        thawed = self._same >= _FROZEN
        self._bits, self._same = bits, 0.0
        return thawed

    def _wait(self, frame: FloatArray, pose: _Pose, before: _Pose | None, passed: float) -> Verdict:
        """A person who was lost is found where it was lost, after a moment of moving as people do."""
        last = self._believed
        near = last is None or (
            math.dist(pose.middle, last.middle) <= _BACK[0]
            and _turn(pose.heading, last.heading) <= _BACK[1]
            and not _turned_over(pose, last)
        )
        steady = before is None or (
            math.dist(pose.middle, before.middle) <= _PLACE[0] + _PLACE[1] * passed
            and _turn(pose.heading, before.heading) <= _HEADING[0] + _HEADING[1] * passed
            and not _turned_over(pose, before)
        )
        sized = abs(self._ratio - 1.0) <= _SIZE and abs(pose.size / self._size - 1.0) <= 1.5 * _SIZE
        self._back = self._back + passed if near and steady and sized else 0.0
        if self._back < _BACK_FOR:
            return Verdict(None, reason=self._lost, lost=True)
        self._lost, self._believed = "", None
        self._believe(pose)
        return Verdict(frame, thawed=True)

    def _whole(self, pose: _Pose) -> str:
        """What is odd about the whole person; empty if nothing is."""
        if abs(self._ratio - 1.0) > _SIZE:
            return "another size than the calibrated person"
        last = self._believed
        if last is None:
            return ""
        if not self._place.allows(math.dist(pose.middle, last.middle), self._quiet):
            return "jumped to another place"
        if self._two and not self._heading.allows(_turn(pose.heading, last.heading), self._quiet):
            return "turned faster than a person can"
        if self._quiet < 0.1 and _turned_over(pose, last):
            return "turned over"
        return ""

    def _limbs(self, pose: _Pose) -> str:
        """What is odd about a limb; empty if nothing is."""
        last = self._believed
        if last is None:
            return ""
        if not self._elbow.allows(_farthest(pose.elbows, last.elbows), self._quiet):
            return "an elbow jumped"
        if not self._wrist.allows(_farthest(pose.wrists, last.wrists), self._quiet):
            return "a hand jumped"
        return ""

    def _believe(self, pose: _Pose) -> None:
        last, quiet = self._believed, self._quiet
        if last is not None:
            self._place = self._place.take(math.dist(pose.middle, last.middle), quiet)
            self._heading = self._heading.take(_turn(pose.heading, last.heading), quiet)
            self._elbow = self._elbow.take(_farthest(pose.elbows, last.elbows), quiet)
            self._wrist = self._wrist.take(_farthest(pose.wrists, last.wrists), quiet)
        self._believed, self._quiet = pose, 0.0

    def _bends_backward(self, pose: _Pose, passed: float) -> int:
        """0 for arms that a person can have, 1 for a doubt that has lasted, 2 for what no shoulder can do."""
        if not self._two:
            return 0
        forward = (math.cos(pose.heading), math.sin(pose.heading), 0.0)
        reach = [-_dot(upper, forward) for upper in pose.uppers]
        if min(reach) > _REACH_BACK[0] or max(reach) > _REACH_BACK[1]:
            return 2
        evidence = 0
        for elbow, wrist, upper in zip(pose.elbows, pose.wrists, pose.uppers, strict=True):
            fore = _unit(_minus(wrist, elbow))
            along = _dot(fore, upper)
            bend = (fore[0] - along * upper[0], fore[1] - along * upper[1], fore[2] - along * upper[2])
            sine = math.sqrt(_dot(bend, bend))
            if upper[2] < -_HANGS and sine > _BENT and along > -0.2:
                toward = _dot(bend, forward) / sine
                evidence += (toward < -_BENDS_BACK) - (toward > 0.0)
        self._backward = min(max(self._backward + passed * evidence, 0.0), _BACKWARD[1])
        return int(self._backward > _BACKWARD[0])

    def _pose(self, frame: FloatArray) -> _Pose:
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._matrix
        values = frame.tolist()
        points: list[Point] = []
        for at in range(0, len(values), 3):
            x, y, z = values[at : at + 3]
            points.append((x * xx + y * xy + z * xz, x * yx + y * yy + z * yz, x * zx + y * zy + z * zz))
        shoulders = points[::3]
        size = sum(math.dist(points[at], points[at + 1]) for at in range(len(points) - 1) if at % 3 != 2)
        heading, middle = 0.0, shoulders[0]
        if self._two:
            left, right = shoulders
            middle = (0.5 * (left[0] + right[0]), 0.5 * (left[1] + right[1]), 0.5 * (left[2] + right[2]))
            line = _minus(left, right)
            heading = math.atan2(-line[0], line[1])
            size += math.sqrt(_dot(line, line))
        elbows = tuple(_minus(point, middle) for point in points[1::3])
        wrists = tuple(_minus(point, middle) for point in points[2::3])
        uppers = tuple(_unit(_minus(points[at + 1], points[at])) for at in range(0, len(points), 3))
        return _Pose(middle, heading, elbows, wrists, uppers, size)


def _exchange(frame: FloatArray) -> FloatArray:
    """The frame with left and right exchanged."""
    exchanged = frame.copy()
    exchanged[:9], exchanged[9:] = frame[9:], frame[:9]
    return exchanged


def _turned_over(pose: _Pose, other: _Pose) -> bool:
    limit = math.cos(_TURNED_OVER)
    return all(_dot(one, two) < limit for one, two in zip(pose.uppers, other.uppers, strict=True))


def _farthest(points: tuple[Point, ...], others: tuple[Point, ...]) -> float:
    return max(map(math.dist, points, others))


def _turn(one: float, other: float) -> float:
    return abs((one - other + math.pi) % (2.0 * math.pi) - math.pi)


def _minus(one: Point, other: Point) -> Point:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]


def _dot(one: Point, other: Point) -> float:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def _unit(vector: Point) -> Point:
    length = math.sqrt(_dot(vector, vector)) or 1.0
    return vector[0] / length, vector[1] / length, vector[2] / length
