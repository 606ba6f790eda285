"""TeleoperationLoop: calibrate, map, filter, limit, check self-collision; one tick in, one decision out."""

from __future__ import annotations

import copy
import math

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError, SydaError, TeleoperationError, nearest_name
from syda_gym.mappings.mapping import Mapping
from syda_gym.teleoperation.calibration import Calibration, Calibrator
from syda_gym.teleoperation.guarded import GuardedMapping
from syda_gym.teleoperation.incoming.frame_clock import FrameClock
from syda_gym.teleoperation.safety.homing import WayHome
from syda_gym.teleoperation.safety.limiter import CommandLimiter
from syda_gym.teleoperation.safety.one_euro import OneEuroFilter
from syda_gym.teleoperation.safety.self_collision import SelfCollision
from syda_gym.teleoperation.safety.trust import ConfidencePolicy
from syda_gym.teleoperation.safety.watchdog import Watch, Watchdog
from syda_gym.teleoperation.tick import CONTROLS, Decision, LoopSettings, State, Tick

__all__ = ["TeleoperationLoop"]

_GENTLE = 0.2  # speed factor at the beginning of a soft start
_ARRIVED = 1e-3  # rad
_SHORTEST = 1e-3  # s; frames that arrive together are taken to be so far apart


class TeleoperationLoop:
    """Turns a stream of operator frames into commands that a robot can always execute.

    Whatever comes in, every command lies within the joint limits (coupled ones included), no joint moves faster than
    its speed limit between two commands, and no command touches the robot's own body where the one before did not. The
    loop knows no network, no clock and no randomness: the same ticks give the same decisions, bit for bit.

    Args:
        mapping: from the operator's body to a robot; a chain will do.
        settings: see ``LoopSettings``.
        start: joint angles that the robot has now ``(n,)`` [rad]; its rest pose if not given.
        confidence: overrides the thresholds of the settings.

    Attributes:
        robot: the mapping's target.
        state: what the loop is doing.
        calibration: the operator's, once there is one.
        notices: what a person should know: no error bound, no collision shapes, centimetres for metres.

    Raises:
        TeleoperationError: the mapping does not end at a robot.
        OptionError: a setting is out of range.
    """

    def __init__(
        self,
        mapping: Mapping,
        settings: LoopSettings | None = None,
        start: FloatArray | None = None,
        confidence: ConfidencePolicy | None = None,
    ) -> None:
        self.settings = settings or LoopSettings()
        self.mapping = mapping
        self._guarded = GuardedMapping(mapping)
        self.robot = self._guarded.robot
        self._policy = confidence or _policy(self.settings, self.robot.reach)
        self._limiter = CommandLimiter(self.robot, self.settings.speed)
        self._collision = (
            SelfCollision(self.robot, self.settings.self_collision) if self.settings.self_collision >= 0.0 else None
        )
        self._watchdog = Watchdog(self.settings.silence, self.settings.hold)
        self._filter = OneEuroFilter(self.settings.cutoff, self.settings.beta) if self.settings.cutoff > 0.0 else None
        self._calibrator = Calibrator(mapping.source, self.settings.calibration, self.settings.axes)
        self.calibration: Calibration | None = None
        self.notices = list(self._guarded.notices)
        if self._collision is not None and self._collision.why:
            self.notices.append(self._collision.why)
        self._command = self._limiter.start(self.robot.rest if start is None else self.robot.check(start)[0])
        self._target = self._command.copy()
        self._last: float | None = None
        self._frame: FloatArray | None = None
        self._standing = FrameClock()  # of the frames that the calibration takes
        self._targets = FrameClock()  # of those that moved the target
        self._trust = 0.0
        self._following_since = 0.0
        self._home = WayHome(self.robot.rest, self.settings.ease * self._limiter.speed, self._collision)
        self._held_back = False
        self._ease_asked = False
        self.state = State.CALIBRATING

    @property
    def command(self) -> FloatArray:
        """The last command ``(n,)`` [rad]."""
        return self._command.copy()

    @property
    def calibration_message(self) -> str:
        """Why the operator is not calibrated yet; empty if nothing was refused."""
        return self._calibrator.message

    def step(self, tick: Tick) -> Decision:
        """Decides on the next command.

        Args:
            tick: time, and a frame or requests if there are any.

        Raises:
            TeleoperationError: the clock went back, or an unknown request.
        """
        dt = self._advance(tick.now)
        for control in tick.controls:
            self._request(control, tick.now)
        reasons: list[str] = []
        bound, used = float("nan"), False
        if tick.frame is not None and self.state not in (State.STOPPED, State.PAUSED):
            bound, used = self._take(tick, reasons)
        factor = self._choose(tick.now, reasons)
        if factor > 0.0:
            self._move(dt, factor, reasons)
        return Decision(tick.now, self.state, self._command.copy(), bound, factor, tuple(reasons), used)

    def rehearse(self) -> None:
        """Goes through a step with the last frame once more and changes nothing.

        What a processor has just done it does several times faster than what it did a thirtieth of a second ago.
        """
        if self._frame is None or self.calibration is None or self._last is None:
            return
        twin = copy.copy(self)
        # Whatever a step changes must be the twin's own; the rest is never written to.
        twin._watchdog, twin._guarded = copy.copy(self._watchdog), copy.copy(self._guarded)
        twin._filter, twin._targets = copy.copy(self._filter), copy.copy(self._targets)
        twin._home = WayHome(self.robot.rest, self.settings.ease * self._limiter.speed, self._collision)
        twin.step(Tick(self._last + 1.0 / self.settings.rate, self._frame))

    def settle(self) -> None:
        """Work that can wait until the command is out; without it the next steps take longer and decide the same."""
        if self._collision is not None:
            self._collision.measure(self._command)

    def _advance(self, now: float) -> float:
        """Time that the step may use: what really passed, but no more than 1.5 periods after a pause."""
        if not math.isfinite(now) or (self._last is not None and now < self._last):
            raise TeleoperationError(f"the loop's clock went from {self._last} to {now}; use a monotonic clock")
        passed = 0.0 if self._last is None else now - self._last
        self._last = now
        return min(passed, 1.5 / self.settings.rate)

    def _request(self, control: str, now: float) -> None:
        if control not in CONTROLS:
            raise OptionError(f"unknown control {control!r}; {nearest_name(control, CONTROLS)}")
        if control == "stop":
            self.state = State.STOPPED
        elif self.state is State.STOPPED:
            if control == "release":  # nothing else ends an emergency stop
                self._enter_pause()
        elif control == "pause":
            self._enter_pause()
        elif control == "resume" and (self.state is State.PAUSED or self._ease_asked):
            self._ease_asked = False
            self._watchdog.wake(now)
            self.state = State.HOLDING if self.calibration else State.CALIBRATING
        elif control == "calibrate":
            self.calibration = None
            self._calibrator = Calibrator(self.mapping.source, self.settings.calibration, self.settings.axes)
            self.state = State.CALIBRATING
        elif control == "rest":
            self._ease_asked = True
            self._home.begin(self._command, now)

    def _enter_pause(self) -> None:
        self.state = State.PAUSED
        self._home.end()

    def _take(self, tick: Tick, reasons: list[str]) -> tuple[float, bool]:
        """Calibrates with the frame or maps it; returns the error bound and whether the target moved."""
        frame = tick.frame
        assert frame is not None  # the caller looked; for the type checker
        if frame.shape != (self.mapping.source.n_features,) or not math.isfinite(sum(frame.tolist())):
            reasons.append("frame: wrong shape or not finite")
            return float("nan"), False
        if self.calibration is None:
            self._calibrate(tick, frame, reasons)
            if self.calibration is None:
                return float("nan"), False
        self._frame = frame
        odd = self.calibration.implausible(frame)
        if odd:
            reasons.append(f"frame: {odd}")
            return float("nan"), False
        passed, anew = self._passed(tick)
        try:
            mapped = self._guarded(self.calibration.apply(frame), passed)
        except (SydaError, ArithmeticError, ValueError) as error:  # a robot in motion must survive any mapping
            reasons.append(f"mapping: {' '.join(str(error).split())[:200] or type(error).__name__}")
            return float("nan"), False
        trust = self._policy.factor(mapped.bound if self._guarded.bounded else 0.0, tick.tracking)
        if trust == 0.0:
            reasons.append("confidence: held")
            self._trust = 0.0
            return mapped.bound, False
        if trust < 1.0:
            reasons.append("confidence: slowed")
        if mapped.unfamiliar:
            reasons.append("unfamiliar: slowed")
            trust = min(trust, self.settings.unfamiliar)
        self._trust = trust
        self._aim(mapped.angles, tick, passed, anew)
        return mapped.bound, True

    def _calibrate(self, tick: Tick, frame: FloatArray, reasons: list[str]) -> None:
        self._standing.advance(tick.now, tick.sent)
        self.calibration = self._calibrator.add(self._standing.time, frame)
        if self.calibration is None:
            reasons.append("calibrating")
        else:
            self.notices.extend(self.calibration.notices)
            if self.state is State.CALIBRATING:
                self.state = State.HOLDING

    def _passed(self, tick: Tick) -> tuple[float, bool]:
        """Time since the frame before [s], and whether that one is not the operator's past any more."""
        passed = self._targets.advance(tick.now, tick.sent)
        anew = self._watchdog.verdict(tick.now) is not Watch.FOLLOW or not 0.0 <= passed < 1.0
        if anew:
            self._guarded.reset()
        return max(passed, _SHORTEST), anew

    def _aim(self, angles: FloatArray, tick: Tick, passed: float, anew: bool) -> None:
        """Filters the mapped angles into the target and feeds the watchdog."""
        self._watchdog.feed(tick.now)
        if self._filter is None:
            self._target = angles
            return
        if anew:
            self._filter.reset(angles)
        self._target = self._filter(angles, passed)

    def _choose(self, now: float, reasons: list[str]) -> float:
        """Moves the state on; returns the speed factor, 0 to stand still."""
        if self.state in (State.STOPPED, State.PAUSED):
            return 0.0
        if self._ease_asked:
            return self._on_the_way_home(now)
        if self.calibration is None and self.state is State.CALIBRATING:
            return 0.0
        verdict = self._watchdog.verdict(now)
        if verdict is Watch.FOLLOW and self._trust > 0.0:
            if self.state is not State.FOLLOWING:
                self.state, self._following_since = State.FOLLOWING, now
                self._home.end()
            self._home.remember(self._command)
            return self._trust * self._soft_start(now)
        if verdict is not Watch.EASE:
            self.state = State.HOLDING
            if verdict is Watch.HOLD:
                reasons.append("watchdog: no good frame")
            return 0.0
        return self._on_the_way_home(now)

    def _on_the_way_home(self, now: float) -> float:
        self._target = self._home.target(self._command, now, not self._held_back)
        arrived = float(np.max(np.abs(self._command - self.robot.rest))) < _ARRIVED
        self.state = State.RESTING if arrived else State.EASING
        return self.settings.ease

    def _soft_start(self, now: float) -> float:
        if self.settings.soft_start <= 0.0:
            return 1.0
        return min(1.0, _GENTLE + (1.0 - _GENTLE) * (now - self._following_since) / self.settings.soft_start)

    def _move(self, dt: float, factor: float, reasons: list[str]) -> None:
        wanted = self._limiter.move(self._command, self._target, dt, factor)
        self._held_back = False
        if self._collision is not None:
            allowed = self._collision.allowed(self._command, wanted)
            if allowed is not wanted:
                self._held_back = True
                reasons.append("self-collision: held back")
                wanted = allowed if self._limiter.allows(allowed) else self._command
        self._command = wanted


def _policy(settings: LoopSettings, reach: float) -> ConfidencePolicy:
    default = ConfidencePolicy.for_reach(reach)
    return ConfidencePolicy(
        slow=default.slow if settings.bound_slow is None else settings.bound_slow,
        hold=default.hold if settings.bound_hold is None else settings.bound_hold,
    )
