"""The registered ids: checked by Gymnasium and Stable-Baselines3, with limits and thresholds, single and vectorised."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import yaml
from gymnasium.utils.env_checker import check_env

import syda_gym
from syda_gym.envs.family import FAMILY, MAX_STEPS
from syda_gym.envs.task.options import SUCCESS_ERRORS
from syda_gym.files import asset

ROOT = Path(__file__).resolve().parents[2]
IDS = [member.id for member in FAMILY]


@pytest.mark.parametrize("name", IDS)
def test_every_id_is_clean_and_has_limit_and_threshold(name):
    spec = gym.spec(name)
    assert spec.max_episode_steps == MAX_STEPS
    assert spec.reward_threshold is not None
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        env = gym.make(name)
        check_env(env.unwrapped, skip_render_check=True)
    member = next(member for member in FAMILY if member.id == name)
    longest = max(clip.length for clip in env.unwrapped._fleet.repertoire.clips)
    assert 100 < longest < MAX_STEPS
    observation, _ = env.reset(seed=2)
    env.close()
    many = gym.make_vec(name, num_envs=2)
    observations, _ = many.reset(seed=2)
    assert np.array_equal(observations[0], observation)
    assert many.spec.reward_threshold == spec.reward_threshold == member.reward_threshold
    _, rewards, *_ = many.step(np.zeros((2, 10), np.float32))
    assert np.isfinite(rewards).all()
    many.close()


def test_options_of_an_id_may_be_changed():
    env = gym.make("SydaTeleopNoise-v0", disturbances="teleop:noise:harsh", physics="servo")
    assert env.unwrapped.options.disturbances == "teleop:noise:harsh"
    assert env.unwrapped.options.reference == "mapped"


def test_the_measured_numbers_are_those_of_the_rule():
    results = json.loads((ROOT / "docs" / "results" / "leaderboard.json").read_text())["thresholds"]
    for member in FAMILY:
        found = results[member.id]
        default = SUCCESS_ERRORS["mapped" if member.options.get("reference") == "mapped" else "paired"]
        assert member.reward_threshold == found["reward_threshold"]
        assert member.reward_threshold == pytest.approx(max(found["returns"].values()), abs=0.06)
        assert member.options.get("success_error", default) == found["success_error"]


def test_hyper_parameters_are_shipped_for_every_id():
    for algorithm in ("ppo", "sac"):
        content = yaml.safe_load(asset("rl_zoo3", f"{algorithm}.yml").read_text())
        assert sorted(content) == sorted(IDS)
        assert all(float(entry["n_timesteps"]) > 0 and entry["gamma"] == 0.5 for entry in content.values())


@pytest.mark.parametrize("reference", ["mapped", "paired"])
def test_success_tells_agents_apart(reference):
    """On the first takes of training actions the base succeeds about half of the time, random actions hardly ever.

    The lead takes the motors' lag away, all that keeps the base from the mapped reference; beside the mapping's
    own error against the recorded motion it hardly shows.
    """
    shares = {}
    families = syda_gym.load_motions("embedded").families
    seen = sorted(action for action, family in families.items() if family not in ("cross", "clap", "signal"))
    env = gym.make("SydaTeleop-v0", physics="servo", action_mode="position", actions=seen[::3], reference=reference)
    env = env.unwrapped
    gain = 1.0 - (1.0 - env.motor_gain) ** env.substeps
    rng = np.random.default_rng(0)
    for name in ("base", "lead", "random", "zero"):
        succeeded = []
        for clip in [env.clip_actions.index(action) for action in seen[::3]]:
            _, info = env.reset(seed=clip, options={"motion": clip})
            done = False
            while not done:
                base = info["base"]
                command = {
                    "base": base,
                    "lead": info["q"] + (base - info["q"]) / gain,
                    "random": base + 0.25 * rng.uniform(-1.0, 1.0, 10),
                    "zero": None,
                }[name]
                action = np.zeros(10) if command is None else env.action_from_command(command)
                _, _, terminated, truncated, info = env.step(action)
                done = terminated or truncated
            succeeded.append(info["is_success"])
        shares[name] = np.mean(succeeded)
    assert 0.3 < shares["base"] < 0.75
    assert shares["lead"] >= (0.95 if reference == "mapped" else shares["base"])
    assert shares["random"] < 0.5 * shares["base"]
    assert shares["zero"] == 0.0
