"""The classical agents against answers that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.agents.agent import Agent, BaseAlone
from syda_gym.agents.classical.rivals import CONTACT_RIVALS, RIVALS, Ema, Kalman, Lead, OneEuro, make_rival
from syda_gym.agents.interface import Interface
from syda_gym.embodiments import catalog
from syda_gym.errors import AgentError

DT = 1 / 30
ALPHA = 1 - 0.9**8  # eight physics steps at 240 Hz, whatever the physics rate


def observe(base, q, age=0.0):
    base, q = np.broadcast_arrays(np.atleast_2d(base), np.atleast_2d(q))
    ages = np.broadcast_to(np.asarray(age, dtype=float), (len(q),))
    return np.concatenate([base - q, q, np.zeros_like(q), ages[:, None]], axis=1)


def small(interface, count, seed=0, scale=0.05):
    """Poses near rest, away from every limit."""
    rng = np.random.default_rng(seed)
    return interface.robot.rest + rng.uniform(-scale, scale, (count, interface.n))


def first_order(q, command):
    return q + ALPHA * (command - q)


def test_base_alone_passes_the_command_on_and_stays_within_limits(interface):
    agent = BaseAlone(interface)
    agent.reset(3)
    base = small(interface, 3)
    assert np.allclose(agent.act(observe(base, interface.robot.rest)), base, atol=1e-15)
    far = agent.act(observe(base + 9.0, np.tile(interface.robot.rest, (3, 1))))
    assert not interface.robot.violations(far).any()


def test_the_full_lead_arrives_in_one_step_on_a_first_order_motor(interface):
    agent = Lead(interface, BaseAlone(interface))
    agent.reset(4)
    q, base = small(interface, 4, 1), small(interface, 4, 2)
    assert np.allclose(first_order(q, agent.act(observe(base, q))), base, atol=1e-12)


def test_a_lead_of_strength_zero_is_the_base(interface):
    agent = Lead(interface, BaseAlone(interface), strength=0.0)
    agent.reset(1)
    base = small(interface, 1)
    assert np.allclose(agent.act(observe(base, interface.robot.rest)), base, atol=1e-15)


def test_ema_answers_a_step_with_the_known_geometric_curve(interface):
    agent = Ema(interface, BaseAlone(interface), rate=0.3)
    agent.reset(1)
    start = np.tile(interface.robot.rest, (1, 1))
    step = start + 0.02
    agent.act(observe(start, start))
    for k in range(1, 12):
        expected = start + 0.02 * (1 - 0.7**k)
        assert np.allclose(agent.act(observe(step, start)), expected, atol=1e-12)


def test_one_euro_without_speed_term_is_the_first_order_low_pass_of_its_cutoff(interface):
    agent = OneEuro(interface, BaseAlone(interface), min_cutoff=2.0, beta=0.0)
    agent.reset(1)
    start = interface.robot.rest[None]
    agent.act(observe(start, start))
    weight = 1 / (1 + 1 / (2 * np.pi * 2.0 * DT))
    for k in range(1, 8):
        expected = start + 0.02 * (1 - (1 - weight) ** k)
        assert np.allclose(agent.act(observe(start + 0.02, start)), expected, atol=1e-12)


def test_one_euro_lags_less_when_the_motion_is_fast(interface):
    def lag(beta):
        agent = OneEuro(interface, BaseAlone(interface), min_cutoff=1.0, beta=beta)
        agent.reset(1)
        rest = interface.robot.rest[None]
        for k in range(20):
            now = rest + 0.01 * k
            command = agent.act(observe(now, now))
        return float(np.abs(now - command).mean())

    assert lag(20.0) < 0.5 * lag(0.0)


def test_kalman_follows_constant_velocity_through_latency_without_error(interface):
    agent = Kalman(interface, BaseAlone(interface), process=50.0, noise=1e-3)
    agent.reset(2)
    rest = np.tile(interface.robot.rest, (2, 1))
    speed = np.array([[0.1], [-0.08]])  # slow enough that no joint meets its limit
    age = np.array([0.1, 0.1667])
    for k in range(40):
        now = k * DT
        command = agent.act(observe(rest + speed * (now - age)[:, None], rest + speed * now, age))
    truth = rest + speed * now
    assert np.abs(command - truth).max() < 1e-4
    assert np.abs(speed * age[:, None]).max() > 0.009  # what the held base command would have been off by


def test_kalman_reaches_the_stationary_gain_of_the_riccati_equation(interface):
    from scipy.linalg import solve_discrete_are

    process, noise = 5.0, 0.03
    agent = Kalman(interface, BaseAlone(interface), process=process, noise=noise)
    agent.reset(1)
    rest = interface.robot.rest[None]
    for _ in range(300):
        agent.act(observe(rest, rest, 0.0))
    transition = np.array([[1.0, DT], [0.0, 1.0]])
    q = process**2 * np.array([[DT**3 / 3, DT**2 / 2], [DT**2 / 2, DT]])
    h = np.array([[1.0, 0.0]])
    prior = solve_discrete_are(transition.T, h.T, q, np.array([[noise**2]]))
    posterior = prior - prior @ h.T @ h @ prior / (prior[0, 0] + noise**2)
    pp, pv, vv = agent._covariance[0]
    assert np.allclose([[pp, pv], [pv, vv]], posterior, rtol=1e-6)


def test_kalman_measures_a_repeated_packet_once(interface):
    def after(repeats):
        agent = Kalman(interface, BaseAlone(interface))
        agent.reset(1)
        rest = interface.robot.rest[None]
        agent.act(observe(rest, rest, 0.0))
        agent.act(observe(rest + 0.02, rest, 0.0))
        for k in range(repeats):
            agent.act(observe(rest + 0.02, rest, (k + 1) * DT))
        return agent._angle.copy(), agent._covariance.copy()

    for one, other in zip(after(0), after(3), strict=True):
        assert np.array_equal(one, other)


def test_many_robots_at_once_equal_each_robot_alone(interface):
    rng = np.random.default_rng(4)
    steps, count = 25, 5
    bases = interface.robot.rest + np.cumsum(rng.normal(0, 0.01, (steps, count, interface.n)), axis=0)
    ages = rng.integers(0, 4, (steps, count)) * DT
    q = np.tile(interface.robot.rest, (count, 1))
    for name in RIVALS:
        together = make_rival(name, interface)
        together.reset(count)
        joint = [together.act(observe(bases[t], q, ages[t])) for t in range(steps)]
        for robot in range(count):
            alone = make_rival(name, interface)
            alone.reset(1)
            for t in range(steps):
                single = alone.act(observe(bases[t, robot], q[robot], ages[t, robot]))
                assert np.array_equal(single[0], joint[t][robot]), name


def test_restart_forgets_only_the_named_robots(interface):
    for name in RIVALS:
        agent, new = make_rival(name, interface), make_rival(name, interface)
        agent.reset(2)
        new.reset(2)
        q = np.tile(interface.robot.rest, (2, 1))
        for k in range(6):
            agent.act(observe(q + 0.01 * k, q))
        agent.restart(np.array([True, False]))
        first, second = agent.act(observe(q - 0.03, q)), new.act(observe(q - 0.03, q))
        assert np.array_equal(first[0], second[0]), name
        if name not in ("base", "lead", *CONTACT_RIVALS):  # those that remember something
            assert not np.allclose(first[1], second[1]), name


def test_no_agent_leaves_joint_limits_or_asks_for_more_than_the_speed_limit(interface):
    rng = np.random.default_rng(8)
    robot = interface.robot
    q = rng.uniform(robot.lower, robot.upper, (200, interface.n))
    q = robot.clamp(q)
    near = robot.clamp(q + rng.normal(0, 0.05, q.shape))
    for name in RIVALS:
        agent = make_rival(name, interface)
        agent.reset(200)
        command = agent.act(observe(near, q, 0.1))
        assert not robot.violations(command).any(), name
        asked = ALPHA * np.abs(command - q) / DT
        allowed = np.maximum(robot.speed, ALPHA * np.abs(near - q) / DT)
        assert (asked <= allowed + 1e-9).all(), name


def test_wrong_use_says_what_to_do(interface):
    agent = make_rival("lead", interface)
    with pytest.raises(AgentError, match="call reset first"):
        agent.act(observe(interface.robot.rest, interface.robot.rest))
    agent.reset(1)
    with pytest.raises(AgentError, match=r"expected observations \(B, 31\)"):
        agent.act(np.zeros((1, 7)))
    bad = observe(interface.robot.rest, interface.robot.rest)
    bad[0, 12] = np.nan
    with pytest.raises(AgentError, match="'q'"):
        agent.act(bad)
    with pytest.raises(AgentError, match="did you mean 'kalman'"):
        make_rival("kalmann", interface)
    with pytest.raises(AgentError, match="takes the settings strength"):
        make_rival("lead", interface, speed=3)
    with pytest.raises(AgentError, match="strength must lie between"):
        make_rival("lead", interface, strength=2.5)


def test_an_interface_of_another_robot_layout_or_rate_is_refused(interface):
    spec = interface.spec()
    interface.check(spec, "agent")
    other = Interface(catalog.get("nao"), interface.layout, interface.size, DT, ALPHA)
    with pytest.raises(AgentError, match="made for robot 'pepper'"):
        other.check(spec, "agent")
    moved = dict(interface.layout) | {"qd": slice(0, 10)}
    with pytest.raises(AgentError, match="'qd'"):
        Interface(interface.robot, moved, interface.size, DT, ALPHA).check(spec, "agent")
    with pytest.raises(AgentError, match="dt="):
        Interface(interface.robot, interface.layout, interface.size, 1 / 60, ALPHA).check(spec, "agent")


def test_the_stack_is_named_from_the_bottom_up(interface):
    agent: Agent = make_rival("kalman", interface)
    assert agent.stack == ("base", "kalman", "lead")
