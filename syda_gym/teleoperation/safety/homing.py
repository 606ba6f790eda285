"""WayHome: straight to rest where that is free, else back along the way that the robot came."""

from __future__ import annotations

from collections import deque

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.teleoperation.safety.watchdog import Ease

__all__ = ["WayHome"]

_PATIENCE = 15  # commands without progress before the robot turns round
_TRAIL = 3600  # commands that are remembered, two minutes at 30 Hz
_RETRY = 10  # steps back between two looks for a straight way
_ARRIVED = 1e-4  # rad


class WayHome:
    """Leads to the rest pose.

    The straight way in joint space may run into the robot's own body, for example when the hands are behind a pedestal.
    The commands sent so far touched nothing; going back along them reaches a pose from which the straight way is free.

    Args:
        rest: where to go ``(n,)`` [rad].
        speed: joint speeds on the way ``(n,)`` [rad/s].
        check: of self-collision, ``None`` if nothing is checked.
    """

    def __init__(self, rest: FloatArray, speed: FloatArray, check: SelfCollision | None) -> None:
        self.rest = rest
        self._speed = speed
        self._check = check
        self._trail: deque[FloatArray] = deque(maxlen=_TRAIL)
        self._ease: Ease | None = None
        self._stuck = 0
        self._back = 0

    @property
    def begun(self) -> bool:
        """Whether the robot is on its way."""
        return self._ease is not None

    def remember(self, command: FloatArray) -> None:
        """Notes a command that was sent while following."""
        if self._check is not None and (not self._trail or self._trail[-1].tobytes() != command.tobytes()):
            self._trail.append(command)

    def begin(self, command: FloatArray, now: float) -> None:
        """Sets out from ``command`` ``(n,)`` at ``now`` [s]."""
        self._ease = Ease(command, self.rest, self._speed, now)
        self._stuck = self._back = 0

    def end(self) -> None:
        """Gives up the way; the robot follows again."""
        self._ease = None

    def target(self, command: FloatArray, now: float, moved: bool) -> FloatArray:
        """Where to go next.

        Args:
            command: where the robot is ``(n,)`` [rad].
            now: time [s].
            moved: whether the last step was not held back.
        """
        if self._ease is None:
            self.begin(command, now)
        if not self._back:
            self._stuck = 0 if moved else self._stuck + 1
            if self._stuck <= _PATIENCE or not self._trail:
                return self._straight(now)
            self._back = 1
        while self._trail and float(np.max(np.abs(command - self._trail[-1]))) < _ARRIVED:
            self._trail.pop()
            self._back += 1
        if not self._trail or self._back > _RETRY:
            self._back = 1
            if not self._trail or self._check is None or self._check.free_path(command, self.rest):
                self.begin(command, now)
                return self._straight(now)
        return self._trail[-1]

    def _straight(self, now: float) -> FloatArray:
        return self.rest if self._ease is None else self._ease.at(now)
