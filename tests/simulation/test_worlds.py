"""Both backends move the robot as the motor law says, and agree with each other."""

from __future__ import annotations

import os
import pickle

import numpy as np
import pybullet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.motions.synthetic.generator import generate
from syda_gym.simulation import MotorConditions, Rates, make_world
from syda_gym.simulation.landmark_kinematics import LandmarkKinematics
from syda_gym.simulation.world import World

PEPPER = catalog.get("pepper")
RATES = [Rates(30, 240), Rates(30, 60)]


@pytest.fixture
def worlds():
    """Makes worlds and closes them."""
    made = []

    def make(robot=PEPPER, rates=RATES[0], **options):
        made.append(make_world(robot, rates, **options))
        return made[-1]

    yield make
    for world in made:
        world.close()


def follow(world, commands, start=None):
    world.reset(np.arange(world.count), np.repeat((commands[0] if start is None else start)[None], world.count, axis=0))
    rows = []
    for command in commands:
        world.advance(np.repeat(command[None], world.count, axis=0))
        rows.append(np.hstack([world.pose, world.qd]))
    return np.array(rows)


@given(st.integers(1, 120), st.integers(1, 40))
def test_rates_agree_with_each_other(control, multiple):
    rates = Rates(control, control * multiple)
    assert rates.substeps == multiple
    assert rates.dt == pytest.approx(rates.substeps * rates.physics_dt)
    assert 0.0 < rates.motor_gain < 1.0
    # The time constant of the closed loop does not depend on the physics rate.
    assert rates.lag_share == pytest.approx(1 - 0.9 ** (240 / control))


@pytest.mark.parametrize(
    ("control", "physics"), [(30, 100), (30, 20), (0, 240), (30, np.nan), (True, 240), ("30", 240)]
)
def test_rates_that_clash_are_refused(control, physics):
    with pytest.raises(OptionError, match=r"multiple|between|number"):
        Rates(control, physics)


@pytest.mark.parametrize("name", ["pepper", "nao"])
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 5))
def test_the_fast_kinematics_are_the_robot_s(name, seed, count):
    robot = catalog.get(name)
    q = np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, len(robot.lower)))
    fast = LandmarkKinematics(robot)(np.ascontiguousarray(q.T)).T.reshape(count, -1, 3)
    np.testing.assert_allclose(fast, robot.landmarks(q), atol=1e-12)


@pytest.mark.parametrize("name", ["pepper", "nao"])
@pytest.mark.parametrize("physics", ["bullet", "servo"])
def test_landmarks_are_those_of_the_robot_in_its_torso_frame(worlds, name, physics):
    robot = catalog.get(name)
    world = worlds(robot, physics=physics)
    rng = np.random.default_rng(0)
    n = len(robot.lower)
    for _ in range(5):
        target = robot.clamp(rng.uniform(robot.lower, robot.upper, n))[0]
        follow(world, np.repeat(target[None], 30, axis=0), robot.rest)
        expected = robot.landmarks(world.pose[:, :n])[0].ravel()
        np.testing.assert_allclose(world.pose[0, n:], expected, atol=2e-4)
        np.testing.assert_allclose(world.pose[0, :n], target, atol=2e-2)


@pytest.mark.parametrize("rates", RATES, ids=str)
def test_the_servo_model_stays_within_a_tenth_of_a_degree_of_bullet(worlds, rates):
    """Mean over motions that scripts/fit_servo.py did not see."""
    motions = generate(
        ("pepper",), seed=77, actions=("bow_courtly", "bow_open", "circle_front", "circle_table"), variants=1
    )
    bullet, servo = worlds(rates=rates), worlds(rates=rates, physics="servo")
    errors = [
        np.abs(follow(bullet, take.frames["pepper"]) - follow(servo, take.frames["pepper"]))[:, 0, :10]
        for take in motions.takes
    ]
    assert np.degrees(np.concatenate(errors).mean()) < 0.1


@pytest.mark.parametrize("physics", ["bullet", "servo"])
def test_joints_do_not_outrun_their_speed_limits(worlds, physics):
    world = worlds(physics=physics)
    for joint in range(10):
        start, target = PEPPER.rest.copy(), PEPPER.rest.copy()
        start[joint], target[joint] = PEPPER.lower[joint], PEPPER.upper[joint]
        speeds = np.abs(follow(world, np.repeat(target[None], 30, axis=0), start)[:, 0, -10:])
        assert speeds[:, joint].max() <= 1.02 * PEPPER.speed[joint]
    world.set_conditions(0, MotorConditions(speed=0.5))
    speeds = np.abs(follow(world, np.repeat(target[None], 30, axis=0), start)[:, 0, -10:])
    assert 0.4 * PEPPER.speed[9] < speeds[:, 9].max() <= 0.51 * PEPPER.speed[9]


def test_the_body_below_the_torso_stands_still(worlds):
    world = worlds(whole_body=True)
    rng = np.random.default_rng(0)
    commands = PEPPER.clamp(rng.uniform(PEPPER.lower, PEPPER.upper, (60, 10)))
    follow(world, commands)
    torso = world._puppets[0]
    link = next(
        index
        for index in range(pybullet.getNumJoints(torso._body, physicsClientId=torso._client))
        if pybullet.getJointInfo(torso._body, index, physicsClientId=torso._client)[12] == b"torso"
    )
    state = pybullet.getLinkState(torso._body, link, computeForwardKinematics=1, physicsClientId=torso._client)
    np.testing.assert_allclose(state[4], 0.0, atol=2e-4)


@pytest.mark.parametrize("self_collision", [False, True])
def test_a_reset_leaves_no_trace(worlds, self_collision):
    world = worlds(self_collision=self_collision)
    rng = np.random.default_rng(1)
    wild = PEPPER.clamp(rng.uniform(PEPPER.lower, PEPPER.upper, (40, 10)))
    first = follow(world, wild)
    follow(world, wild[::-1].copy())
    assert (follow(world, wild) == first).all()


def test_a_robot_moves_the_same_alone_and_among_others(worlds):
    alone, many = worlds(), worlds(count=5)
    rng = np.random.default_rng(2)
    commands = PEPPER.clamp(rng.uniform(PEPPER.lower, PEPPER.upper, (30, 10)))
    one = follow(alone, commands)[:, 0]
    several = follow(many, commands)
    for index in range(5):
        assert (several[:, index] == one).all()


def test_links_touch_only_with_self_collision(worlds):
    free, solid = worlds(), worlds(self_collision=True)
    rng = np.random.default_rng(3)
    touches, apart = 0, 0.0
    for _ in range(40):
        command = PEPPER.clamp(rng.uniform(PEPPER.lower, PEPPER.upper, 10))
        for _ in range(6):
            free.advance(command)
            solid.advance(command)
            assert free.contacts[0] == 0
            touches += int(solid.contacts[0])
            apart = max(apart, float(np.abs(solid.pose - free.pose).max()))
    assert touches > 0
    assert apart > 0.02


def test_one_robot_steps_alike_by_list_and_by_array(worlds):
    for physics in ("bullet", "servo"):
        world = worlds(physics=physics)
        command = PEPPER.rest + 0.2
        world.reset(np.array([0]), PEPPER.rest[None])
        row = world.advance_one(command.tolist())
        world.reset(np.array([0]), PEPPER.rest[None])
        world.advance(command[None])
        assert row == np.hstack([world.pose[0], world.qd[0]]).tolist()


def test_what_stands_still_may_be_left_out_and_the_arms_move_alike(worlds):
    import time

    motion = generate(("pepper",), seed=3, families=("wave",), variants=1).takes[0].frames["pepper"][:60]
    found, spent = [], []
    for whole in (True, False):
        world = worlds(whole_body=whole)
        for conditions in (MotorConditions(), MotorConditions(payload=0.5)):
            world.set_conditions(0, conditions)
            found.append(follow(world, motion)[:, 0])
        start = time.thread_time()
        for _ in range(30):
            world.advance(motion[:1])
        spent.append(time.thread_time() - start)
    nominal, loaded = np.abs(found[0] - found[2]), np.abs(found[1] - found[3])
    n = len(PEPPER.joint_names)
    assert nominal[:, :n].max() < 2e-3  # rad
    assert np.abs(nominal[:, n:-n]).max() < 1e-3  # m
    assert loaded[:, :n].max() < 2e-2
    assert np.abs(found[0] - found[1]).max() > 1e-4  # the payload is felt
    assert spent[1] < 0.8 * spent[0]


def test_worlds_refuse_what_they_cannot_do(tmp_path):
    with pytest.raises(OptionError, match="at least one robot"):
        World(PEPPER, RATES[0], 0)
    with pytest.raises(OptionError, match="no contacts"):
        make_world(PEPPER, RATES[0], physics="servo", self_collision=True)
    with pytest.raises(OptionError, match="bullet"):
        make_world(PEPPER, RATES[0], physics="mujoco")
    world = World(PEPPER, RATES[0])
    with pytest.raises(TypeError, match="pickle"):
        pickle.dumps(world)
    world.close()
    world.close()


def test_a_failed_start_leaves_no_client_behind(monkeypatch):
    def broken(*_, **__):
        raise EmbodimentError("broken on purpose")

    monkeypatch.setattr("syda_gym.simulation.world._Puppet.__init__", broken)
    before = clients()
    with pytest.raises(EmbodimentError, match="on purpose"):
        World(PEPPER, RATES[0])
    assert clients() == before


def clients():
    return sum(bool(pybullet.isConnected(client)) for client in range(64))


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="reads memory from /proc")
def test_worlds_and_resets_do_not_eat_memory():
    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * 4096 / 2**20

    World(PEPPER, RATES[1]).close()
    world = World(PEPPER, RATES[1])
    q = PEPPER.rest[None]
    for _ in range(200):
        world.reset(np.array([0]), q)
    before = resident()
    for _ in range(3000):
        world.reset(np.array([0]), q)
    world.close()
    for _ in range(12):
        World(PEPPER, RATES[1]).close()
    assert resident() - before < 8.0
