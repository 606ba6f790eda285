"""Motion: from where the robot is towards a target, so that it can always stop before it would do harm."""

from __future__ import annotations

import copy
import math
from collections import deque
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.simulation.collision.slide import slide
from syda_gym.teleoperation.safety.detour import Detour
from syda_gym.teleoperation.safety.limiter import CommandLimiter
from syda_gym.teleoperation.safety.pace import Pace, braking_speed
from syda_gym.teleoperation.safety.punctuality import GENTLE

__all__ = ["Motion", "Moved"]

_STANDING = 1e-9  # rad/s
_GENTLE = 0.005  # rad; a way to a standstill that is no longer is known rather than foreseen
_DAMPING = 8.0  # 1/s; share of a pair's distance by which it may shrink in a second
_NEAR = 0.08  # m; pairs further apart do not take part in sliding
_SAME_GOAL = 0.2  # rad; a target that moves less is the same one, with noise
_PROGRESS = 0.02  # rad
_PATIENCE = 0.3  # s without progress after which a held back robot looks for another way
_AGAIN = 1.0  # s until it looks once more
_NOTICEABLE = 0.9  # share of the speed limits
_ARRIVED = 0.03  # rad; nearer than that, no detour is worth it
_CORNER = 0.15  # rad between two remembered poses
_CORNERS = 60


class Moved(NamedTuple):
    """What a step did: whether the robot was held back by its own body, and whether it is on a detour."""

    held_back: bool = False
    detour: bool = False


class Motion:
    """Moves a robot's command towards targets within every limit that it has.

    Joint limits, coupled limits, joint speeds and accelerations (and jerks, if wanted) hold, and no pair of links comes
    nearer than the margin. A step is taken only if the robot could come to a standstill after it within the same limits
    and without touching itself; the way to that standstill is what remains if nothing better is found in the next step.

    A step that would touch slides along the body; where that ends in a corner although the target is free, a detour of
    straight lines is looked for and followed.

    Args:
        limiter: position, coupled and speed limits.
        collision: what must not touch; ``None`` if nothing is checked.
        period: of the loop [s].
        acceleration: greatest ``(n,)`` [rad/s^2].
        jerk: greatest ``(n,)`` [rad/s^3]; ``None`` if there is no limit.
        start: where the robot is ``(n,)`` [rad].
    """

    def __init__(
        self,
        limiter: CommandLimiter,
        collision: SelfCollision | None,
        period: float,
        acceleration: FloatArray,
        jerk: FloatArray | None,
        start: FloatArray,
    ) -> None:
        self.command = limiter.start(start)
        self._limiter = limiter
        self._collision = collision if collision is not None and collision.available else None
        self._most = GENTLE * acceleration  # the rest is for commands that leave late
        self._bounds = limiter.bounds(self._most, jerk)
        self._pace = Pace(period, len(start))
        self._now = 0.0
        self._target: FloatArray | None = None  # of the step before
        self._drift = np.zeros(len(start))  # the target's velocity
        self._last_drift = np.zeros(len(start))
        self._step = np.zeros(len(start))  # from the last command to this one
        self._goal: FloatArray | None = None
        self._best = math.inf
        self._best_at = 0.0
        self._was_held = False
        self._search: Detour | None = None
        self._searching = False
        self._next_search = 0.0
        self._way: list[FloatArray] = []
        self._way_goal = self.command
        self._in_line = False  # whether the way to a standstill that is known to be free is a straight line
        self._trail: deque[FloatArray] = deque(maxlen=_CORNERS)
        self._overlaps: dict[int, float] = {}
        self.place(self.command)
        self._intend(self.command, 1.0, period)  # compiled now rather than on the way
        self._ahead(self._drift)

    @property
    def standing(self) -> bool:
        """Whether the robot stands still by its commands."""
        return float(np.abs(self._pace.velocity).max()) < _STANDING

    @property
    def slowed(self) -> bool:
        """Whether a joint goes as fast as it may because commands leave late, and could go faster otherwise."""
        if self._pace.idle:
            return False
        harmless = self._most / GENTLE * self._pace.punctuality.seconds
        held = (harmless < _NOTICEABLE * self._limiter.speed) & (np.abs(self._step) > 0.99 * harmless * self._pace.dt)
        return bool(held.any())

    def place(self, pose: FloatArray) -> None:
        """The robot is at ``pose`` ``(n,)`` [rad] and does not move."""
        self.command = self._limiter.start(pose)
        self._pace.rest()
        self._forget()
        self._trail.clear()
        self._overlaps = {} if self._collision is None else self._collision.overlaps(self.command)

    def begin(self, now: float, left: float | None, leaving: float | None = None) -> None:
        """A step begins at ``now`` [s]; the last command left between ``leaving`` and ``left`` [s], if known."""
        self._now = now
        self._pace.begin(now, left, leaving)

    def freeze(self) -> None:
        """Stands still at once, whatever the acceleration: an emergency stop."""
        self._pace.end(self._now, np.zeros(len(self.command)))
        self._pace.rest()
        self._forget()

    def brake(self) -> None:
        """Comes to a standstill as fast as the acceleration allows, on a way that is known to be free."""
        self._forget()
        if not self._pace.idle:
            self._go(self._braked())
        self._pace.end(self._now, np.zeros(len(self.command)) if self._pace.idle else self._step)

    def follow(self, target: FloatArray, factor: float) -> Moved:
        """Moves towards ``target`` ``(n,)`` [rad] at ``factor`` of the speed limits at most."""
        if self._pace.idle:
            self._pace.end(self._now, np.zeros(len(self.command)))
            return Moved()
        self._watch(target)
        moved = self._detour(factor) if self._way or self._searching else None
        if moved is None:
            moved = self._straight(target, factor)
        self._was_held = self._was_held or moved.held_back
        self._pace.end(self._now, self._step)
        self._remember()
        return moved

    def twin(self) -> Motion:
        """A copy whose steps change nothing of this one; it does not look for detours."""
        twin = copy.copy(self)
        twin._pace, twin._trail = self._pace.twin(), self._trail.copy()
        twin._search, twin._searching, twin._next_search, twin._way = None, False, math.inf, list(self._way)
        return twin

    def _straight(self, target: FloatArray, factor: float) -> Moved:
        low, high, wanted = self._intend(target, factor, self._pace.dt)
        if not wanted.any():
            self._step = np.zeros(len(target))
            return Moved()
        if self._try(wanted):
            return Moved()
        coupled = np.clip(self._coupled(wanted, low, high), low, high)
        if coupled.any() and self._try(coupled):
            return Moved()
        braked = self._braked()
        if self._collision is not None:
            slid = self._slide(wanted, low, high)
            if slid is not None and self._try(slid):
                return Moved(True)
            if slid is not None and self._try(0.5 * (slid + braked)):
                return Moved(True)
        for share in (0.5, 0.2):
            if self._try(braked + share * (coupled - braked)):
                return Moved(True)
        self._go(braked)
        return Moved(True)

    def _intend(self, target: FloatArray, factor: float, dt: float) -> FloatArray:
        """Least, greatest and wanted velocity ``(3, n)`` [rad/s], see ``intention``."""
        pace = self._pace
        state = np.array(
            (self.command, pace.velocity, pace.acceleration, self._drift, *pace.tempering(self._most)),
        )
        found: FloatArray = _call("intention", self._bounds, state, target, dt, pace.change, factor)
        return found

    def _ahead(self, velocity: FloatArray) -> tuple[FloatArray, bool]:
        """Poses ``(1 + k, n)`` after a step and on the way to a standstill, and whether limits allow them."""
        found: tuple[FloatArray, bool] = _call("ahead", self._bounds, self.command, velocity, self._pace.dt)
        return found

    def _braked(self) -> FloatArray:
        """The velocity of the first step to a standstill."""
        return self._pace.slowed(self._most, alike=self._in_line)

    def _try(self, velocity: FloatArray) -> bool:
        """Takes a step if it and the way to a standstill after it are within limits and free."""
        poses, allowed = self._ahead(velocity)
        if not allowed or (self._collision is not None and not self._free(poses)):
            return False
        self._arrive(poses[0].copy())
        self._in_line = False
        return True

    def _free(self, poses: FloatArray) -> bool:
        check = self._collision
        assert check is not None  # the caller looked; for the type checker
        suspects = check.suspects(self.command, poses[0], poses[-1])
        if suspects == []:
            return True
        if self._overlaps:
            return self._comes_apart(poses[0])
        if _apart(poses[0], poses[-1]) > _GENTLE:
            if check.free(poses, suspects, reserve=True):
                return True
            # Where the robot stands nearer than the reserve already, the margin alone counts.
            if check.free(self.command[None], suspects, reserve=True):
                return False
        return check.free(poses, suspects)

    def _comes_apart(self, end: FloatArray) -> bool:
        """For a robot that was put where it touches: whether nothing comes nearer and nothing else touches."""
        assert self._collision is not None
        now = self._collision.overlaps(end)
        return all(pair in self._overlaps and now[pair] >= self._overlaps[pair] - 1e-6 for pair in now)

    def _slide(self, wanted: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray | None:
        check = self._collision
        assert check is not None
        distances, gradients = check.near(self.command, _NEAR)
        if not len(distances):
            return None
        left = distances - check.margin - 1.5e-3
        damping = min(_DAMPING, 0.5 / self._pace.dt)
        slowest = -damping * np.maximum(left, 0.0)
        inside = left < 0.0
        slowest[inside] = np.minimum(-damping * left[inside], 0.05)  # what is too near comes apart
        return slide(wanted, low, high, gradients, slowest)

    def _coupled(self, velocity: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        """The velocity, changed so that limits that depend on other joints hold."""
        slack = np.maximum(np.abs(low), np.abs(high)) * self._pace.dt
        return (self._limiter.couple(self.command, self._end(velocity), slack) - self.command) / self._pace.dt

    def _end(self, velocity: FloatArray) -> FloatArray:
        end = self.command + velocity * self._pace.dt
        return np.minimum(np.maximum(end, self._limiter.lower), self._limiter.upper)

    def _go(self, velocity: FloatArray) -> None:
        end = self._end(velocity)
        if not self._settle(end):  # the way there was looked at here and there: between, an edge of a coupled limit
            end = self._limiter.couple(self.command, end, self._limiter.speed * self._pace.dt)
        self._arrive(end if self._settle(end) else self.command)

    def _settle(self, pose: FloatArray) -> bool:
        """Whether limits allow a pose, which is freed from rounding in place."""
        return bool(_call("settle", self._bounds, pose[None], 0))

    def _arrive(self, end: FloatArray) -> None:
        self._step = end - self.command
        self.command = end
        if self._overlaps and self._step.any():
            assert self._collision is not None
            self._overlaps = self._collision.overlaps(end)

    def _watch(self, target: FloatArray) -> None:
        """Notices how the target moves, and when the robot gets no nearer to it."""
        if self._target is not None and self._pace.dt > 0.0:
            self._drift, self._last_drift = _call(
                "drifted", self._bounds, target, self._target, self._last_drift, self._pace.dt
            )
        else:
            self._drift = self._last_drift = np.zeros(len(target))
        self._target = target
        if self._goal is None or _apart(target, self._goal) > _SAME_GOAL:
            self._goal, self._best, self._search, self._next_search = target, math.inf, None, self._now
            self._searching = False
            self._trail.append(self.command)
        if self._way and _apart(target, self._way_goal) > _SAME_GOAL:
            self._way = []
        distance = _apart(target, self.command)
        if distance < self._best - _PROGRESS or distance < _ARRIVED:
            self._best, self._best_at, self._was_held = min(distance, self._best), self._now, False
        elif self._was_held and self._now - self._best_at > _PATIENCE and self._now >= self._next_search:
            self._searching = self._collision is not None and not self._way

    def _detour(self, factor: float) -> Moved | None:
        """Looks for a way while standing still, or follows it; ``None`` if there is nothing of the kind to do."""
        if self._searching:
            self._look()
            return Moved(True, True)
        while self._way and float(np.abs(self._way[0] - self.command).max()) < 1e-9:
            self._way.pop(0)
        if not self._way:
            return None
        return self._along(self._way[0], factor)

    def _look(self) -> None:
        """Comes to a standstill and looks for a way from there."""
        self._go(self._braked())
        if not self.standing or self._step.any():
            return
        assert self._collision is not None
        assert self._goal is not None
        if self._search is None:
            rest = self._limiter.robot.rest
            self._search = Detour(self._limiter, self._collision, self.command, self._goal, rest, self._trail)
        self._search.work()
        if self._search.over:
            self._way, self._way_goal = list(self._search.found or ()), self._search.goal
            self._search, self._searching = None, False
            self._next_search = self._now + _AGAIN
            self._best_at = self._now

    def _along(self, corner: FloatArray, factor: float) -> Moved | None:
        """One step along a straight line, all joints together."""
        way = corner - self.command
        length = float(np.abs(way).max())
        unit = way / length
        low, high, _ = self._intend(corner, factor, self._pace.dt)
        moving = np.abs(unit) > 1e-12
        ends = np.stack([low[moving] / unit[moving], high[moving] / unit[moving]])
        slow, fast = float(ends.min(axis=0).max()), float(ends.max(axis=0).min())
        most = float((self._most[moving] / np.abs(unit[moving])).min())
        wanted = min(float(braking_speed(np.array(length), np.array(most), self._pace.dt)), length / self._pace.dt)
        speed = min(max(wanted, slow), fast)
        velocity = unit * speed
        end = corner.copy() if speed * self._pace.dt >= length * (1.0 - 1e-12) else self._end(velocity)
        off = self._pace.velocity - unit * float(self._pace.velocity @ unit / (unit @ unit))
        free = self._collision is None or self._collision.free(end[None], self._collision.suspects(self.command, end))
        if slow > fast or float(np.abs(off).max()) > 1e-6 or not free or not self._settle(end):
            self._go(self._braked())
            if self.standing:
                self._way = []
            return Moved(True, True)
        self._arrive(end)
        self._in_line = True
        return Moved(False, True)

    def _remember(self) -> None:
        if self._collision is None or self._way:
            return
        if not self._trail or _apart(self.command, self._trail[-1]) > _CORNER:
            self._trail.append(self.command)

    def _forget(self) -> None:
        """The target is not the last one any more."""
        self._target = self._goal = self._search = None
        self._way, self._best, self._was_held, self._searching = [], math.inf, False, False
        self._next_search = self._now


def _apart(pose: FloatArray, other: FloatArray) -> float:
    """The greatest distance of their joints [rad]."""
    return float(_call("apart", pose, other))


@lru_cache(maxsize=1)
def _arithmetic() -> tuple[Any, Any]:
    """The compiled part; numba is imported where something moves, not before."""
    from syda_gym.embodiments.limb_ik.compiling import first_call
    from syda_gym.teleoperation.safety import stepping

    return first_call, stepping


def _call(name: str, *arguments: Any) -> Any:
    call, stepping = _arithmetic()
    return call(getattr(stepping, name), *arguments)
