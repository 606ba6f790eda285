"""Views of a residual policy: each arm looks like a left one, and what it answers reaches its own joints."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.interface import Interface
from syda_gym.agents.learned.policy import ResidualPolicy
from syda_gym.agents.learned.views import Views, mirror_of
from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot, select_sides
from syda_gym.envs.task.observation import teleop_layout
from syda_gym.errors import AgentError


def pepper(preview=2, history=1) -> Interface:
    robot = catalog.get("pepper")
    layout = teleop_layout(catalog.get("adult"), robot, preview=preview, history=history)
    return Interface(robot, dict(layout), layout.size, 1 / 30, 0.2)


def reading(interface, rng, mirrored_of=None):
    """A plausible observation, or the mirror image of one."""
    robot, layout = interface.robot, interface.layout
    observation = rng.normal(0.0, 0.2, (3, interface.size))
    observation[:, layout["q"]] = robot.rest + rng.normal(0.0, 0.1, (3, interface.n))
    if mirrored_of is not None:
        observation = mirrored_of.copy()
        for name, part in layout.items():
            if name not in ("operator", "packet_age"):
                rows = observation[:, part].reshape(-1, interface.n)
                observation[:, part] = robot.mirror(rows).reshape(3, -1)
    return observation


def test_the_mirror_of_a_robot_is_its_own():
    robot = catalog.get("pepper")
    order, signs = mirror_of(robot)
    q = np.random.default_rng(0).normal(size=(4, len(robot.joint_names)))
    assert np.array_equal(q[:, order] * signs, robot.mirror(q))


def test_a_mirrored_robot_gets_the_mirrored_correction():
    interface, rng = pepper(), np.random.default_rng(1)
    policy = ResidualPolicy.untrained(interface, BaseAlone(interface), hidden=(8,), each_arm=True)
    weights = {name: rng.normal(0, 0.5, w.shape).astype(np.float32) for name, w in policy.weights.items()}
    size = policy.views.size
    policy = ResidualPolicy(
        interface, policy.base, weights=weights, mean=rng.normal(0, 0.1, size), std=np.ones(size), each_arm=True
    )
    seen = reading(interface, rng)
    corrections = []
    for observation in (seen, reading(interface, rng, mirrored_of=seen)):
        policy.reset(3)
        command = interface.read(observation).base
        policy.improve(command, interface.read(observation))
        policy._fresh[:] = False
        policy.improve(command, interface.read(observation))  # with a correction that is not zero any more
        corrections.append(policy._correction.copy())
    assert np.abs(corrections[0]).max() > 0.05
    assert np.allclose(interface.robot.mirror(corrections[0]), corrections[1])
    left, right = np.split(corrections[0], 2, axis=1)
    assert not np.allclose(left, right)


def test_the_operator_is_left_out_and_the_age_of_the_packet_stays_as_it_is():
    interface, rng = pepper(preview=0, history=0), np.random.default_rng(2)
    views = Views(interface, True)
    assert views.size == 3 * interface.n + 1 + 2 * interface.n
    observation = reading(interface, rng)
    read = interface.read(observation)
    seen = views.see(read.base, np.zeros_like(read.q), read)
    assert seen.shape == (6, views.size)
    assert np.array_equal(seen[:3, 3 * interface.n], read.age)
    assert np.array_equal(seen[3:, 3 * interface.n], read.age)
    assert np.array_equal(seen[3:, interface.n : 2 * interface.n], interface.robot.mirror(read.q))


def test_one_arm_has_no_mirror_and_says_so():
    robot = Robot(select_sides(catalog.get("pepper"), ["left"]))
    layout = teleop_layout(catalog.get("adult"), robot, preview=0, history=0)
    interface = Interface(robot, dict(layout), layout.size, 1 / 30, 0.2)
    assert mirror_of(robot) is None
    with pytest.raises(AgentError, match="no mirror images"):
        Views(interface, True)
    assert Views(interface, False).outputs == interface.n
