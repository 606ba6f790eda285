"""AdaptiveLead: a lead that measures how far the motors really go, and brakes in time."""

from __future__ import annotations

from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent, limited
from syda_gym.agents.interface import Interface, Reading
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError
from syda_gym.simulation.servo import servo_constants

__all__ = ["AdaptiveLead"]

_PRIOR = 1e-4  # rad^2; the nominal share counts as much as one step that asks one joint for a hundredth of a radian
_MOST = 1.2  # of the nominal share
_TRUSTED = 0.5  # of the largest step that the joint's top speed allows


class AdaptiveLead(Agent):
    """Undoes the motors' lag with the share that they were seen to cover, not with the nominal one.

    A joint covers ``a (T - q)`` of the way to its target ``T`` in one step. Least squares over all joints and the past
    steps, with exponential forgetting, estimate ``a``; then ``T = q + way / a`` as in ``Lead``. (Recursive least
    squares: Åström, Wittenmark, *Adaptive Control*, 1995, chapter 2.) Weak motors that carry something cannot slow down
    at will: a lead that aims at the command at full speed overshoots it. So ``way``, what is left to the command, is
    cut to what a joint can cover in one step and still come to rest at the command with the deceleration ``braking``
    times that of the free arm (``scripts/fit_servo.py``).

    Where a joint cannot keep up, as in a jump of the command, the others of its arm wait for it, so that the arm goes
    straight for its goal as it does without a lead: joints that arrive one after the other lead a hand astray.

    It must be the topmost of its stack, since it takes what it asks for as what was asked of the motors.

    Args:
        interface: robot, rate, motors and observation layout.
        base: the agent below.
        strength: share of the lead, 0 to 1.5; above 1 for motors that are slower than their share says.
        memory: share of the past that is kept from one step to the next, 0 to below 1.
        least: the smallest share that is believed, in shares of the nominal one.
        braking: share of the free arm's acceleration that is counted on for slowing down; 0 counts on any.
        together: share of its top speed that a joint is counted on to have where the others wait for it; 0 waits for
            none. Above 1 only where the joint is far behind.

    Raises:
        AgentError: a setting out of range.
    """

    name = "adaptive_lead"

    def __init__(
        self,
        interface: Interface,
        base: Agent,
        *,
        strength: float = 1.0,
        memory: float = 0.9,
        least: float = 0.6,
        braking: float = 0.6,
        together: float = 1.25,
    ) -> None:
        super().__init__(interface, base)
        for name, value, low, high in (
            ("strength", strength, 0.0, 1.5), ("memory", memory, 0.0, 0.999), ("least", least, 0.1, 1.0),
            ("braking", braking, 0.0, 10.0), ("together", together, 0.0, 10.0),
        ):  # fmt: skip
            if not low <= value <= high:
                raise AgentError(f"{self.name}: {name} must lie between {low:g} and {high:g}, got {value}")
        self.strength, self.memory = float(strength), float(memory)
        self.least, self.braking, self.together = float(least), float(braking), float(together)
        robot = interface.robot
        self._farthest = robot.speed * interface.dt / interface.alpha
        acceleration = servo_constants(robot.name, robot.joint_names).acceleration
        self._slowing = braking * acceleration * interface.dt**2  # rad a step, every step

    def reset(self, count: int, seed: int | None = None) -> None:
        """Forgets what was measured."""
        super().reset(count, seed)
        self._asked, self._from = np.zeros((count, self.interface.n)), np.zeros((count, self.interface.n))
        self._moved, self._meant = np.zeros(count), np.zeros(count)

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """``q + (1 + strength (1 / a - 1)) way`` with the share ``a`` that was measured."""
        q, share = reading.q, self._share(reading.q)
        way = self._braked(command - q)
        wanted = q + self._in_step((1.0 + self.strength * (1.0 / share - 1.0))[:, None] * way)
        self._from, self._asked = q, limited(self.interface, wanted, command, q)
        return wanted

    def _share(self, q: FloatArray) -> FloatArray:
        """What the motors cover of their way in one step, ``(B,)``, after a look at what they covered in the last."""
        fresh, nominal = self._fresh, self.interface.alpha
        way = np.where(fresh[:, None], 0.0, self._asked - self._from)
        gone = np.where(fresh[:, None], 0.0, q - self._from)
        # A joint that was asked for more than its motor may have had to give tells nothing about its share.
        way = np.where(np.abs(way) < _TRUSTED * self._farthest, way, 0.0)
        kept = np.where(fresh, 0.0, self.memory)
        self._moved = kept * self._moved + np.sum(gone * way, axis=1)
        self._meant = kept * self._meant + np.sum(way * way, axis=1)
        share = (_PRIOR * nominal + self._moved) / (_PRIOR + self._meant)
        return np.asarray(np.clip(share, self.least * nominal, min(_MOST * nominal, 1.0)))

    def _braked(self, way: FloatArray) -> FloatArray:
        """The part of the way ``(B, n)`` that may be covered in one step, so that the rest suffices for braking."""
        if not self.braking:
            return way
        half = 0.5 * self._slowing
        # A step of v, and each later one shorter by ``slowing``, cover v^2 / (2 slowing) + v / 2 in all.
        most = np.sqrt(half**2 + 2.0 * self._slowing * np.abs(way)) - half
        return np.asarray(np.sign(way) * np.minimum(np.abs(way), most))

    def _in_step(self, reach: FloatArray) -> FloatArray:
        """How far ``(B, n)`` the joints of each arm are asked to go, all by the share that the slowest can manage."""
        if not self.together:
            return reach
        result = reach.copy()
        for arm in self.interface.robot.arm_slices:
            far = np.abs(reach[:, arm]) / (self.together * self._farthest[arm])
            result[:, arm] /= np.maximum(far.max(axis=1, initial=0.0), 1.0)[:, None]
        return result

    @property
    def settings(self) -> dict[str, Any]:
        """``strength``, ``memory``, ``least``, ``braking`` and ``together``."""
        return {name: getattr(self, name) for name in ("strength", "memory", "least", "braking", "together")}
