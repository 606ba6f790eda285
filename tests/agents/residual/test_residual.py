"""Residual policies: what they start as, what bounds them, and that training is repeatable and resumable."""

from __future__ import annotations

import json

import numpy as np
import pytest

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.learned.policy import ResidualPolicy
from syda_gym.agents.learned.views import Views
from syda_gym.agents.residual.config import ResidualConfig, preset_names
from syda_gym.agents.residual.costs import CostWeights
from syda_gym.agents.residual.env import ResidualVecEnv
from syda_gym.agents.residual.residual_training import train_residual
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import play_streams
from syda_gym.errors import AgentError, OptionError, StorageError

TINY = ResidualConfig(
    steps=1024, robots=8, rollout=32, batch=64, epochs=2, legs=2, episodes=4, validation_episodes=2, hidden=(16,)
)


def random_policy(interface, base, seed=0, size=3.0, **settings):
    rng = np.random.default_rng(seed)
    policy = ResidualPolicy.untrained(interface, base, hidden=(16,), **settings)
    policy.weights = {
        name: rng.normal(0, size, value.shape).astype(np.float32) for name, value in policy.weights.items()
    }
    features = policy.views.size
    return ResidualPolicy(
        interface, base, weights=policy.weights, mean=np.zeros(features), std=np.ones(features), **settings
    )


def test_an_untrained_policy_is_its_base_bit_for_bit(ground):
    streams = ground.record(4, seed=3)
    for name in ("base", "kalman", "one_euro_lead"):
        base = make_rival(name, ground.interface)
        alone = play_streams(base, streams, ground.rates)
        policy = ResidualPolicy.untrained(ground.interface, make_rival(name, ground.interface))
        assert np.array_equal(play_streams(policy, streams, ground.rates), alone), name


def test_the_worst_policy_stays_within_joint_limits_speed_limits_and_its_bound(ground):
    streams = ground.record(6, seed=4)
    interface = ground.interface
    policy = random_policy(interface, BaseAlone(interface), scale=0.5, smoothing=0.3)
    q = play_streams(policy, streams, ground.rates)
    robot = interface.robot
    flat = q.reshape(-1, interface.n)
    assert (flat >= robot.lower - 1e-9).all()
    assert (flat <= robot.upper + 1e-9).all()
    assert (np.abs(np.diff(q, axis=1)) <= robot.speed * interface.dt + 1e-9).all()
    assert np.abs(policy._correction).max() <= 1.0
    assert np.abs(policy._correction).max() > 0.2  # it does try


def test_the_correction_is_low_passed(ground):
    interface = ground.interface
    policy = random_policy(interface, BaseAlone(interface), size=30.0, smoothing=0.6)
    policy.reset(1)
    reading = interface.read(np.random.default_rng(0).normal(0, 0.1, (1, interface.size)))
    previous = np.zeros((1, interface.n))
    for _ in range(10):
        policy.act_on(reading)
        assert np.abs(policy._correction - previous).max() <= 0.8 + 1e-12
        previous = policy._correction.copy()


@pytest.mark.parametrize("each_arm", [False, True])
@pytest.mark.parametrize("seen", [{}, {"preview": 2, "history": 2}])
def test_the_training_environment_plays_a_policy_as_the_agent_itself_does(tiny_options, seen, each_arm):
    ground = Ground({**tiny_options, **seen})
    streams = ground.record(3, seed=5)
    interface = ground.interface
    for name in ("base", "kalman"):
        policy = random_policy(interface, make_rival(name, interface), size=0.03, smoothing=0.5, each_arm=each_arm)
        expected = play_streams(policy, streams, ground.rates)
        env = ResidualVecEnv(
            make_rival(name, interface), streams, ground.rates,
            count=3, scale=policy.scale, smoothing=policy.smoothing, weights=TINY.cost, each_arm=each_arm,
        )  # fmt: skip
        env._begin_all()
        env._episode = np.arange(3)
        env._start(np.arange(3), np.zeros(3, dtype=np.intp))
        features = env._observe()
        for t in range(50):  # rounding to float32 grows in a closed loop
            features, _, _, _ = env.step(policy.answer(features.astype(np.float64)))
            assert np.allclose(env.world.pose[:3, : interface.n], expected[:, t], atol=1e-3), (
                name,
                t,
            )  # float32 observations


def test_no_correction_earns_nothing_and_a_shadow_of_the_reference_earns(ground):
    streams = ground.record(4, seed=6)
    interface = ground.interface
    env = ResidualVecEnv(
        BaseAlone(interface), streams, ground.rates,
        count=4, scale=0.25, smoothing=0.0, weights=TINY.cost,
    )  # fmt: skip
    env.reset()
    whole = np.zeros(4, dtype=bool)  # robots whose episode began at its beginning
    for _ in range(200):
        _, reward, done, _ = env.step(np.zeros((4, interface.n)))
        assert np.allclose(reward[whole], 0.0, atol=1e-9)
        whole |= done
    assert whole.all()
    earned = 0.0
    for _ in range(100):
        reference = streams.reference[env._episode, env._step]
        _, reward, _, _ = env.step(np.clip((reference - env._below) / 0.25, -1, 1))
        earned += reward.mean()
    assert earned > 0.0


@pytest.mark.parametrize("cost", [TINY.cost, CostWeights(jitter=3.0, contact=5.0)])
def test_each_arm_is_paid_for_what_it_does_and_both_together_for_what_the_robot_does(ground, cost):
    streams, interface = ground.record(4, seed=6), ground.interface
    whole, arms = (
        ResidualVecEnv(
            make_rival("kalman", interface), streams, ground.rates,
            count=4, scale=0.25, smoothing=0.3, weights=cost, each_arm=each_arm,
        )
        for each_arm in (False, True)
    )  # fmt: skip
    assert (whole.num_envs, arms.num_envs) == (4, 8)
    for env in (whole, arms):  # at the beginning of their episodes, where robot and shadow are one
        env._begin_all()
        env._episode = np.arange(4)
        env._start(np.arange(4), np.zeros(4, dtype=np.intp))
        env._observe()
    rng = np.random.default_rng(2)
    for _ in range(12):
        answers = rng.uniform(-1, 1, (8, interface.n // 2))
        answers[4:6] = 0.0  # the right arms of the first two robots do what the base does
        _, paid, _, _ = whole.step(arms.views.join(answers))
        _, paid_arms, _, _ = arms.step(answers)
        assert np.allclose(paid_arms.reshape(2, 4).mean(axis=0), paid, atol=1e-5)
        if not cost.contact:
            assert np.allclose(paid_arms[4:6], 0.0, atol=1e-6)
            assert (np.abs(paid_arms[:2]) > 1e-4).all()


def test_no_feature_saturates_once_the_policy_corrects(ground):
    """Under the base alone the spread of the corrections is 0; a tenth of one used to be off the scale."""
    trained = train_residual(ground, ResidualConfig.of({**TINY.as_dict(), "legs": 1, "steps": 256}), seed=0)
    n = ground.interface.n
    std, mean = trained.agent.std, trained.agent.mean
    assert (std >= 0.05).all()
    for correction in (0.1, 0.9):
        assert (np.abs((correction - mean[-n:]) / std[-n:]) < 2.0).all()


def test_the_best_policy_is_chosen_by_the_runs_own_cost(ground):
    smooth = ResidualConfig.of({**TINY.as_dict(), "cost": {"joints": 0.0, "jitter": 1000.0}})
    trained = train_residual(ground, smooth, seed=0)
    costs = [leg.policy.landmark_mm + 1000.0 * leg.policy.jitter for leg in trained.history]
    assert trained.best == int(np.argmin(costs))
    assert trained.gained == (min(costs) < costs[0])


def test_same_seed_same_weights_bit_for_bit(ground):
    one, two, other = (train_residual(ground, TINY, seed=seed) for seed in (3, 3, 4))
    assert one.history == two.history
    assert _equal(one.agent, two.agent)
    assert (
        not np.array_equal(
            play_streams(one.agent, ground.record(1, seed=1), ground.rates),
            play_streams(other.agent, ground.record(1, seed=1), ground.rates),
        )
        or one.best == other.best == 0
    )


def test_a_resumed_training_equals_an_uninterrupted_one_bit_for_bit(ground, tmp_path):
    from syda_gym.agents.residual.checkpoint import load_checkpoint

    config = ResidualConfig.of({**TINY.as_dict(), "legs": 3, "steps": 1536, "each_arm": True})
    whole = train_residual(ground, config, seed=1, folder=tmp_path / "whole")

    class StopError(Exception):
        pass

    def stop(share: float) -> None:
        if share > 0.4:
            raise StopError

    with pytest.raises(StopError):
        train_residual(ground, config, seed=1, folder=tmp_path / "cut", progress=stop)
    resumed = train_residual(ground, config, seed=1, folder=tmp_path / "cut", resume=True)
    assert resumed.history == whole.history
    assert resumed.best == whole.best
    assert [leg.steps for leg in whole.history] == [0, 512, 1024, 1536]  # of robots, not of arms
    assert _equal(resumed.agent, whole.agent)
    first, second = (load_checkpoint(tmp_path / name / "checkpoint.safetensors") for name in ("whole", "cut"))
    assert first[1] == second[1]
    assert all((first[0][name] == second[0][name]).all() for name in first[0])


def test_training_leaves_the_callers_random_numbers_alone(ground):
    np.random.seed(5)  # noqa: NPY002 (this is the global state that must not move)
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    train_residual(ground, ResidualConfig.of({**TINY.as_dict(), "legs": 1, "steps": 256}), seed=0)
    assert np.array_equal(np.random.get_state()[1], before)  # noqa: NPY002


@pytest.mark.parametrize("algorithm", ["sac", "tqc"])
def test_the_off_policy_algorithms_start_as_the_base_and_train(ground, algorithm):
    pytest.importorskip("sb3_contrib")
    values = {**TINY.as_dict(), "algorithm": algorithm, "steps": 160, "legs": 1, "batch": 16, "epochs": 1}
    trained = train_residual(ground, ResidualConfig.of({**values, "learning_starts": 64}), seed=0)
    assert trained.history[0].policy == trained.history[0].base
    assert trained.history[1].policy != trained.history[1].base


def test_resume_refuses_another_training_and_a_broken_checkpoint(ground, tmp_path):
    one = ResidualConfig.of({**TINY.as_dict(), "legs": 1, "steps": 256})
    with pytest.raises(StorageError, match="no checkpoint"):
        train_residual(ground, one, folder=tmp_path, resume=True)
    train_residual(ground, one, seed=0, folder=tmp_path)
    with pytest.raises(StorageError, match="seed was 0, is 1"):
        train_residual(ground, one, seed=1, folder=tmp_path, resume=True)
    path = tmp_path / "checkpoint.safetensors"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(StorageError, match="corrupt"):
        train_residual(ground, one, seed=0, folder=tmp_path, resume=True)


def test_a_failed_write_leaves_the_earlier_checkpoint_intact(ground, tmp_path, monkeypatch):
    config = ResidualConfig.of({**TINY.as_dict(), "legs": 1, "steps": 256})
    train_residual(ground, config, seed=0, folder=tmp_path)
    before = (tmp_path / "checkpoint.safetensors").read_bytes()

    def broken(*args, **kwargs):
        raise OSError("disk full")

    monkeypatch.setattr("safetensors.torch.save_file", broken)
    with pytest.raises(StorageError, match="disk full"):
        train_residual(ground, config, seed=0, folder=tmp_path)
    assert (tmp_path / "checkpoint.safetensors").read_bytes() == before
    assert not list(tmp_path.glob(".checkpoint*"))


def test_presets_are_complete_and_configurations_survive_json():
    assert {"short", "teleop", "undisturbed"} <= set(preset_names())
    for name in preset_names():
        config = ResidualConfig.preset(name)
        assert ResidualConfig.of(json.loads(json.dumps(config.as_dict()))) == config
    assert ResidualConfig.preset("short", steps=99).steps == 99


def test_bad_hyper_parameters_say_what_is_allowed():
    with pytest.raises(OptionError, match="did you mean 'steps'"):
        ResidualConfig.of({"step": 3})
    with pytest.raises(OptionError, match="unknown algorithm"):
        ResidualConfig(algorithm="dqn")
    with pytest.raises(OptionError, match="gamma must lie between"):
        ResidualConfig(gamma=1.5)
    with pytest.raises(OptionError, match="unknown preset"):
        ResidualConfig.preset("shorter")


def test_a_missing_extra_names_itself(ground, monkeypatch):
    import sys

    from syda_gym.errors import MissingExtraError

    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    config = ResidualConfig.of({**TINY.as_dict(), "algorithm": "tqc"})
    with pytest.raises(MissingExtraError, match=r"syda-gym\[train\]"):
        train_residual(ground, config)


def test_wrong_weights_are_refused(interface):
    features = Views(interface, False).size
    with pytest.raises(AgentError, match=r"layers\.0\.weight"):
        ResidualPolicy(interface, BaseAlone(interface), weights={}, mean=np.zeros(features), std=np.ones(features))
    policy = ResidualPolicy.untrained(interface, BaseAlone(interface))
    with pytest.raises(AgentError, match="mean and a std"):
        ResidualPolicy(interface, policy.base, weights=policy.weights, mean=np.zeros(3), std=np.ones(3))


def _equal(one: ResidualPolicy, two: ResidualPolicy) -> bool:
    return all(np.array_equal(one.weights[name], two.weights[name]) for name in one.weights)
