"""A reset gives the bits of a fresh world, whatever touched whatever before."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.simulation.rates import Rates
from syda_gym.simulation.world import World


def played(world: World, seed: int) -> tuple[np.ndarray, int]:
    """Thrown about at random, so that arms hit each other and the body; returns the states and steps in contact."""
    robot, rng = world.robot, np.random.default_rng(seed)
    world.reset_one(robot.rest.tolist())
    states, touching = [], 0
    for step in range(45):
        if step % 15 == 0:
            goal = robot.lower + rng.random(len(robot.lower)) * (robot.upper - robot.lower)
        states.append(world.advance_one(goal.tolist()))
        touching += int(world.contacts[0] > 0)
    return np.array(states), touching


def test_contacts_of_earlier_episodes_leave_no_trace_in_the_bits():
    pepper, rates = catalog.get("pepper"), Rates(30.0, 240.0)
    used = World(pepper, rates, self_collision=True)
    touched = 0
    for seed in range(8):
        _, before = played(used, 100 + seed)
        again, during = played(used, seed)
        fresh = World(pepper, rates, self_collision=True)
        expected, _ = played(fresh, seed)
        fresh.close()
        assert np.array_equal(again, expected), f"episode {seed} remembers the one before it"
        touched += min(before, during)
    used.close()
    assert touched > 8  # otherwise this test shows nothing
