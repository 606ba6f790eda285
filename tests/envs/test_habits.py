"""What other libraries expect of an environment: limits, keywords, partial resets, options of each robot, close."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import syda_gym  # noqa: F401 (registers the environment)
from syda_gym.envs.sb3 import TeleopVecEnv
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.errors import OptionError, SydaError, UnknownOptionError

SERVO = {"physics": "servo"}


def vector(count: int = 3, **options):
    return gym.make_vec("SydaTeleop-v0", num_envs=count, **SERVO, **options)


def test_a_limit_cuts_the_vector_environment_where_the_wrapper_cuts_the_single_one():
    single = gym.make("SydaTeleop-v0", max_episode_steps=12, **SERVO)
    many = vector(2, max_episode_steps=12, autoreset_mode="same_step")
    single.reset(seed=3)
    many.reset(seed=3)
    for step in range(12):
        observation, reward, _, truncated, _ = single.step(np.full(10, 0.1, np.float32))
        _, rewards, _, cut, infos = many.step(np.full((2, 10), 0.1, np.float32))
        assert reward == rewards[0]
        assert bool(truncated) == bool(cut[0]) == (step == 11)
    assert np.array_equal(infos["final_obs"][0], observation)
    assert vector(2, max_episode_steps=-1)._fleet._max_steps is None  # as Gymnasium's make has it
    for bad in (0, -2, 2.5, True):
        with pytest.raises(OptionError, match="max_episode_steps"):
            vector(2, max_episode_steps=bad)


def test_a_registered_limit_reaches_the_vector_environment():
    spec = gym.spec("SydaTeleop-v0")
    gym.register("Short-v0", spec.entry_point, vector_entry_point=spec.vector_entry_point, max_episode_steps=5)
    try:
        many = gym.make_vec("Short-v0", num_envs=2, **SERVO)
        many.reset(seed=0)
        cut = [bool(many.step(np.zeros((2, 10), np.float32))[3].all()) for _ in range(5)]
    finally:
        del gym.registry["Short-v0"]
    assert cut == [False] * 4 + [True]


@pytest.mark.parametrize("make", [SydaTeleopEnv, vector, lambda **o: gym.make("SydaTeleop-v0", **o)])
def test_unknown_options_are_type_errors_in_pythons_words(make):
    with pytest.raises(TypeError, match="got an unexpected keyword argument 'robt'") as caught:
        make(robt="pepper")
    assert isinstance(caught.value, UnknownOptionError)
    assert isinstance(caught.value, OptionError)
    assert "did you mean 'robot'" in str(caught.value)


def test_masks_of_a_partial_reset_mark_those_that_were_reset():
    many = vector(autoreset_mode="disabled")
    _, infos = many.reset(seed=0)
    assert infos["_motion"].all()
    many.step(np.zeros((3, 10), np.float32))
    mask = np.array([True, False, True])
    observations, infos = many.reset(options={"reset_mask": mask})
    assert observations.dtype == np.float32
    masks = {key: value for key, value in infos.items() if key.startswith("_")}
    masks |= {key: value for key, value in infos["reward_terms"].items() if key.startswith("_")}
    assert len(masks) > 20
    assert all(value.dtype == bool and np.array_equal(value, mask) for value in masks.values())
    assert many.step(np.zeros((3, 10), np.float32))[4]["_motion"].all()


def test_each_robot_of_the_sb3_adapter_takes_its_own_options_once():
    adapter = TeleopVecEnv(vector(autoreset_mode="same_step"))
    names = adapter.env.clip_names
    adapter.seed(0)
    adapter.set_options([{"motion": names[4], "frame": 3}, {}, {"motion": names[2]}])
    adapter.reset()
    clips, frames = adapter.env._fleet.clip.tolist(), adapter.env._fleet._k.tolist()
    assert (clips[0], frames[0], clips[2]) == (4, 3, 2)
    adapter.set_options({"motion": names[1]})  # the same for all
    adapter.reset()
    assert adapter.env._fleet.clip.tolist() == [1, 1, 1]
    adapter.seed(0)
    adapter.reset()
    assert adapter.env._fleet.clip.tolist() != [1, 1, 1]


@pytest.mark.parametrize("physics", ["servo", "bullet"])
def test_a_closed_environment_says_so(physics):
    single = SydaTeleopEnv(physics=physics)
    many = gym.make_vec("SydaTeleop-v0", num_envs=2, physics=physics, autoreset_mode="same_step")
    adapter = TeleopVecEnv(many)
    for env, action in ((single, np.zeros(10)), (many, np.zeros((2, 10)))):
        env.reset(seed=0)
        env.close()
        env.close()
        with pytest.raises(SydaError, match="step was called after close"):
            env.step(action)
        with pytest.raises(SydaError, match="reset was called after close"):
            env.reset(seed=0)
    with pytest.raises(SydaError, match="step was called after close"):
        adapter.step(np.zeros((2, 10)))
    with pytest.raises(SydaError, match="reset was called after close"):
        adapter.reset()


def test_a_disturbed_reset_does_not_look_for_the_mapping_again(monkeypatch):
    from syda_gym.motions.clip import Motions

    many = vector(disturbances="teleop:full:train")
    many.reset(seed=0)
    monkeypatch.setattr(Motions, "pair", lambda *_: pytest.fail("the pair was built and hashed again"))
    many.reset(seed=1)
