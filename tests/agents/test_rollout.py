"""Streams are what the environment plays, and agents are played fairly in it."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.interface import Interface
from syda_gym.agents.rollout import evaluate, mean_of
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import Past, join, play_streams, read_stream
from syda_gym.envs.fleet import EpisodeWish, Fleet
from syda_gym.envs.spaces import action_from_command
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.errors import AgentError


@pytest.mark.parametrize(
    ("disturbances", "reference", "seen"),
    [
        ("teleop:full:train", "mapped", {}),
        ("teleop:full:test", "paired", {"preview": 2, "history": 3}),
        (None, "paired", {"preview": 3}),
        (None, "mapped", {"history": 2}),
    ],
)
def test_recorded_streams_are_what_the_environment_plays_bit_for_bit(tiny_options, disturbances, reference, seen):
    options = TeleopOptions(
        **{**tiny_options, "disturbances": disturbances, "reference": reference, "action_mode": "position", **seen}
    )
    ground, count = Ground(options), 3
    streams = ground.record(count, seed=5)
    fleet = Fleet(options, count)
    rngs = [np.random.default_rng([5, i]) for i in range(count)]
    fleet.reset(range(count), rngs, [EpisodeWish(clip=i) for i in range(count)])
    q = play_streams(BaseAlone(ground.interface), streams, ground.rates)
    seen, past = fleet.observe(), Past(ground.interface, count)
    past.begin(np.arange(count), streams.base[:, 0])
    for k in range(int(streams.lengths.min())):
        assert np.array_equal(fleet.base, streams.base[:, k])
        angles, speeds = (seen[:, fleet.layout[name]].astype(float) for name in ("q", "qd"))
        reading = read_stream(ground.interface, streams, k, angles, speeds, past.rows)
        past.add(streams.base[:, k], angles)
        for name, part in fleet.layout.items():
            if name != "previous_action":
                assert np.allclose(seen[:, part], reading.observation[:, part], atol=1e-5), name
        fleet.step(action_from_command(options, ground.interface.robot, fleet.base, fleet.base))
        assert np.allclose(fleet.info()["q"], q[:, k], atol=1e-9)  # actions are normalised, which rounds
        assert np.array_equal(fleet.info()["reference"], streams.reference[:, k])
        seen = fleet.observe()


def test_the_interface_of_an_environment_is_that_of_its_ground(tiny_options, ground):
    import gymnasium

    import syda_gym  # noqa: F401  (registers the environment)

    env = gymnasium.make("SydaTeleop-v0", **tiny_options)
    Interface.of(env).check(ground.interface.spec(), "ground")
    env.close()
    with pytest.raises(AgentError, match="not an environment that agents can act in"):
        Interface.of(gymnasium.make("CartPole-v1"))


def test_evaluation_meets_every_agent_with_the_same_disturbances_and_the_lead_helps(tiny_options, ground):
    options = {**tiny_options, "disturbances": "teleop:lag:test", "reference": "mapped"}
    lag = Ground(options)
    agents = {
        "base": BaseAlone(lag.interface),
        "again": BaseAlone(lag.interface),
        "lead": make_rival("lead", lag.interface),
    }
    results = evaluate({**options, "physics": "bullet"}, agents, clips=[0, 2], seed=1)
    assert [r.motion for r in results["base"]] == [r.motion for r in results["lead"]]
    assert results["base"][0].figures == results["again"][0].figures
    assert mean_of(results["lead"]).landmark_mm < 0.35 * mean_of(results["base"]).landmark_mm
    assert len(results["lead"][0].q) == len(results["lead"][0].reference)


def test_bullet_and_servo_agree_on_an_agent(tiny_options, ground):
    agents = {"kalman": make_rival("kalman", ground.interface, strength=0.5)}
    tiny_options = {**tiny_options, "disturbances": None, "reference": "mapped"}
    found = [
        mean_of(evaluate({**tiny_options, "physics": physics}, agents, clips=[1], seed=2)["kalman"])
        for physics in ("bullet", "servo")
    ]
    assert abs(found[0].landmark_mm - found[1].landmark_mm) < 2.0


def test_wrong_agents_are_refused(tiny_options, interface):
    with pytest.raises(AgentError, match="expected an Agent"):
        evaluate(tiny_options, {"mine": object()}, clips=[0])
    with pytest.raises(AgentError, match="made for another observation"):
        evaluate(tiny_options, {"mine": BaseAlone(interface)}, clips=[0])


def test_streams_join_and_select(ground):
    one, two = ground.record(2, seed=1), ground.record(1, clips=[3], seed=2)
    both = join([one, two])
    assert len(both) == 3
    assert both.rows([2]).names == two.names
    assert np.array_equal(both.rows([2]).base[:, : two.base.shape[1]], two.base)
    with pytest.raises(AgentError, match="nothing to record"):
        ground.record(0)
