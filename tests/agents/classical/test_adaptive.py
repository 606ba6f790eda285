"""The adaptive lead finds out how weak the motors are, brakes in time, and is the plain lead where nothing is odd."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.classical.adaptive import AdaptiveLead
from syda_gym.agents.classical.rivals import Lead, make_rival
from syda_gym.agents.stacks import build_stack, stack_spec
from syda_gym.agents.streams.streams import Streams, play_streams, score_streams
from syda_gym.errors import AgentError
from syda_gym.simulation.backend import MotorConditions
from syda_gym.simulation.motor_plan import MotorPlan


@pytest.fixture
def waving(interface) -> Streams:
    """A smooth motion of all joints, well within the limits."""
    robot, steps = interface.robot, 90
    middle, half = 0.5 * (robot.lower + robot.upper), 0.5 * (robot.upper - robot.lower)
    phase = np.arange(steps)[:, None] * 0.12 + np.arange(interface.n)
    reference = robot.clamp(middle + 0.25 * half * np.sin(phase))[None]
    return Streams(reference, np.zeros((1, steps)), reference, np.array([steps]))


def weak(streams: Streams, **conditions: float) -> Streams:
    return replace(streams, motors=(MotorPlan((MotorConditions(**conditions),)),) * len(streams))


def test_weak_motors_are_found_out_within_a_second(interface, waving, rates):
    tired = weak(waving, gain=0.65)
    lead, adaptive = Lead(interface, BaseAlone(interface)), AdaptiveLead(interface, BaseAlone(interface))
    errors = [np.abs(play_streams(a, tired, rates) - tired.reference)[0, 30:].mean() for a in (lead, adaptive)]
    assert errors[1] < 0.3 * errors[0]
    share = float(adaptive._moved[0] / adaptive._meant[0])
    true = 1.0 - (1.0 - 0.65 * rates.motor_gain) ** rates.substeps
    assert share == pytest.approx(true, rel=0.02)


def test_it_follows_a_change_within_the_episode(interface, waving, rates):
    plan = MotorPlan((MotorConditions(), MotorConditions(gain=0.6)), (0, 45))
    adaptive = AdaptiveLead(interface, BaseAlone(interface), memory=0.8)
    play_streams(adaptive, replace(waving, motors=(plan,)), rates)
    true = 1.0 - (1.0 - 0.6 * rates.motor_gain) ** rates.substeps
    assert float(adaptive._moved[0] / adaptive._meant[0]) == pytest.approx(true, rel=0.05)


def test_with_nominal_motors_it_is_the_lead(interface, waving, rates):
    plain = score_streams(Lead(interface, BaseAlone(interface)), waving, rates)
    adaptive = score_streams(AdaptiveLead(interface, BaseAlone(interface)), waving, rates)
    assert adaptive.objective == pytest.approx(plain.objective, rel=0.05)


def test_a_loaded_arm_that_brakes_in_time_overshoots_less(interface, rates):
    robot = interface.robot
    target = robot.rest.copy()
    joint = list(robot.joint_names).index("LShoulderRoll")
    target[joint] = robot.upper[joint] - 0.6
    steps = np.repeat(target[None], 40, axis=0)
    steps[:5, joint] = target[joint] - 0.8
    stream = Streams(steps[None], np.zeros((1, 40)), steps[None], np.array([40]))
    loaded = weak(stream, payload=0.6, friction=0.3)
    peaks = []
    for braking in (0.0, 0.2):
        agent = AdaptiveLead(interface, BaseAlone(interface), least=1.0, braking=braking)
        peaks.append(play_streams(agent, loaded, rates)[0, :, joint].max() - target[joint])
    assert peaks[0] > 0.1
    assert peaks[1] < 0.6 * peaks[0]


def test_after_a_jump_the_joints_of_an_arm_arrive_together(interface, rates):
    robot, steps = interface.robot, 30
    target = robot.rest.copy()
    pitch, roll = (list(robot.joint_names).index(name) for name in ("LShoulderPitch", "LShoulderRoll"))
    far, near = target[pitch] - 1.2, target[roll] + 0.4
    path = np.repeat(target[None], steps, axis=0)
    path[3:, pitch], path[3:, roll] = far, near
    stream = Streams(path[None], np.zeros((1, steps)), path[None], np.array([steps]))
    ahead = []
    for together in (0.0, 1.0):
        q = play_streams(AdaptiveLead(interface, BaseAlone(interface), together=together), stream, rates)[0]
        done = (q - target)[:, [pitch, roll]] / np.array([far - target[pitch], near - target[roll]])
        ahead.append(np.abs(done[:, 0] - done[:, 1]).max())
    assert ahead[0] > 0.2, "without waiting the joint with the shorter way is there first"
    assert ahead[1] < 0.5 * ahead[0]


def test_it_is_a_rival_by_name_is_stored_and_refuses_nonsense(interface):
    agent = make_rival("adaptive_lead", interface, memory=0.7, least=0.8, braking=0.5)
    assert agent.stack == ("base", "adaptive_lead")
    again = build_stack(interface, stack_spec(agent))
    assert again.settings == agent.settings
    for name, value in (("memory", 1.0), ("least", 0.0), ("braking", -1.0), ("strength", 2.0), ("together", -1.0)):
        with pytest.raises(AgentError, match=f"{name} must lie between"):
            make_rival("adaptive_lead", interface, **{name: value})


def test_a_lead_may_be_stronger_than_the_nominal_one_but_not_more_than_twice(interface):
    assert make_rival("lead", interface, strength=1.4).settings == {"strength": 1.4}
    with pytest.raises(AgentError, match="between 0 and 2"):
        make_rival("lead", interface, strength=2.1)
