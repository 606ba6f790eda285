"""Detour: another way to a pose that is free, for a robot that has slid into a corner."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Sequence

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.teleoperation.safety.limiter import CommandLimiter

__all__ = ["Detour"]

_STEP = 0.05  # rad; how far apart the looked-at poses of a line are
_LOOKS = 60  # poses that are looked at in one step of the loop, about a millisecond


class Detour:
    """Looks for straight lines in joint space, one after the other, that lead to a pose.

    Tried in this order: straight there; one arm after the other; over rest; each arm over rest while the other waits;
    straight to a corner of the way that the robot came, or back along that way, and from there straight on; back along
    it and over rest. Whatever was free when the robot set out is found, because where it set out from is one of the
    corners.

    The search is spread over steps of the loop by a count of poses, not by time, so that a journal decides alike.

    Args:
        limiter: whose limits hold.
        collision: what must not touch.
        start: where the robot stands ``(n,)`` [rad].
        goal: where to go ``(n,)`` [rad].
        rest: ``(n,)`` [rad].
        trail: corners of the way that the robot came, the oldest first.

    Attributes:
        goal: where to go ``(n,)`` [rad].
        found: the poses to pass in turn, ending at the goal; ``None`` until there is such a way.
        over: whether the search has ended.
    """

    def __init__(
        self,
        limiter: CommandLimiter,
        collision: SelfCollision,
        start: FloatArray,
        goal: FloatArray,
        rest: FloatArray,
        trail: Sequence[FloatArray],
    ) -> None:
        self.goal = goal
        self.found: list[FloatArray] | None = None
        self.over = False
        self._limiter = limiter
        self._collision = collision
        self._start = start
        self._rest = rest
        self._trail = list(trail)
        self._known: dict[tuple[bytes, bytes], bool] = {}
        self._search = self._run()

    def work(self) -> None:
        """Looks at some more poses."""
        for _ in range(_LOOKS):
            if next(self._search, None) is None:
                self.over = True
                return

    def _run(self) -> Generator[bool]:
        for pose in (self.goal,):
            yield True
            if not self._allowed(pose):
                return
        for way in self._ways():
            free = True
            for start, end in zip([self._start, *way], way, strict=False):
                free = yield from self._line(start, end)
                if not free:
                    break
            if free:
                self.found = way
                return

    def _ways(self) -> Iterator[list[FloatArray]]:
        start, goal, rest = self._start, self.goal, self._rest
        arms = self._limiter.robot.arm_slices
        yield [goal]
        if len(arms) == 2:
            for arm in arms:
                yield [_with(start, goal, arm), goal]
        yield [rest, goal]
        if len(arms) == 2:
            for arm, other in (arms, arms[::-1]):
                yield [_with(start, rest, arm), _with(goal, rest, arm), goal]
                yield [_with(start, rest, arm), _with(start, goal, arm), goal]
                yield [_with(start, rest, arm), rest, _with(rest, goal, other), goal]
        back: list[FloatArray] = []
        for corner in reversed(self._trail):
            back.append(corner)
            yield [corner, goal]  # without the corners between, at which the robot would stop
            yield [*back, goal]
        for count in range(1, len(back) + 1, 4):
            yield [*back[:count], rest, goal]

    def _line(self, start: FloatArray, end: FloatArray) -> Generator[bool, None, bool]:
        key = start.tobytes(), end.tobytes()
        if key not in self._known:
            count = math.ceil(float(np.abs(end - start).max()) / _STEP)
            self._known[key] = True
            for index in range(count, 0, -1):
                yield True
                if not self._allowed(start + (end - start) * (index / count)):
                    self._known[key] = False
                    break
        return self._known[key]

    def _allowed(self, pose: FloatArray) -> bool:
        return self._limiter.allows(pose) and not self._collision.touches(pose)


def _with(pose: FloatArray, other: FloatArray, part: slice) -> FloatArray:
    """A pose, one arm of it as in another."""
    result = pose.copy()
    result[part] = other[part]
    return result
