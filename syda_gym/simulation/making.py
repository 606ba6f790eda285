"""make_world: the one door to all physics, so that callers name none of them."""

from __future__ import annotations

from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, nearest_name
from syda_gym.simulation.backend import BACKENDS, Backend
from syda_gym.simulation.rates import Rates

__all__ = ["make_world"]


def make_world(
    robot: Robot,
    rates: Rates,
    *,
    count: int = 1,
    physics: str = "bullet",
    self_collision: bool = False,
    whole_body: bool = False,
) -> Backend:
    """Builds a world.

    Args:
        robot: the kind of robot.
        rates: control and physics rate.
        count: number of robots.
        physics: one of ``BACKENDS``.
        self_collision: whether a robot's links collide with each other (``bullet`` only).
        whole_body: whether head, legs and wheels are simulated, too (``bullet`` only; see ``World``).

    Raises:
        OptionError: unknown physics, or self-collision asked of a physics without contacts.
    """
    if physics not in BACKENDS:
        raise OptionError(f"unknown physics {physics!r}; {nearest_name(str(physics), BACKENDS)}")
    if physics == "servo":
        if self_collision:
            raise OptionError("physics='servo' knows no contacts; use physics='bullet' or self_collision=False")
        from syda_gym.simulation.servo import ServoWorld

        return ServoWorld(robot, rates, count)
    from syda_gym.simulation.world import World

    return World(robot, rates, count, self_collision=self_collision, whole_body=whole_body)
