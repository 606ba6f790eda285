"""Many robots behave exactly like single ones."""

from __future__ import annotations

import pickle

import gymnasium as gym
import numpy as np
import pytest

from syda_gym.envs.sb3 import TeleopVecEnv
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.envs.vector import SydaTeleopVectorEnv
from syda_gym.errors import OptionError, SydaError

COUNT = 3


def actions(steps, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (steps, COUNT, 10)).astype(np.float32)


@pytest.mark.parametrize(
    "changes",
    [
        {"start": "uniform"},
        {"physics": "servo", "start": "uniform", "preview": 2, "history": 2},
        {"disturbances": "teleop:full:train"},
        {"physics": "servo", "disturbances": "teleop:full:train", "action_mode": "position"},
        {"self_collision": True, "reward": {"contacts": 0.1, "limits": 0.1, "jitter": 3.0}, "route": "sample"},
        {"terminate_error": 0.08, "physics_hz": 60},
    ],
    ids=str,
)
def test_robot_i_goes_where_a_single_environment_goes_bit_for_bit(cheap, changes):
    options = {**cheap, **changes}
    vector = gym.make_vec("SydaTeleop-v0", num_envs=COUNT, **options)
    singles = [SydaTeleopEnv(**options) for _ in range(COUNT)]
    observations, infos = vector.reset(seed=5)
    for index, env in enumerate(singles):
        observation, info = env.reset(seed=5 + index)
        assert (observation == observations[index]).all()
        compare(info, infos, index)
    done, ends = [False] * COUNT, 0
    for action in actions(170):
        observations, rewards, terminated, truncated, infos = vector.step(action)
        for index, env in enumerate(singles):
            if done[index]:
                (observation, info), reward, over, cut = env.reset(), 0.0, False, False
                ends += 1
            else:
                observation, reward, over, cut, info = env.step(action[index])
            done[index] = over or cut
            assert (observation == observations[index]).all()
            assert (reward, over, cut) == (rewards[index], terminated[index], truncated[index])
            compare(info, infos, index)
    assert ends >= COUNT, "no episode ended: the test shows too little"
    vector.close()


def compare(info, infos, index):
    for key, value in info.items():
        assert infos[f"_{key}"][index]
        if key == "reward_terms":
            assert {name: infos[key][name][index] for name in value} == value
        else:
            assert np.array_equal(value, infos[key][index]), key


def test_more_robots_than_one_client_holds(cheap):
    many = SydaTeleopVectorEnv(18, **cheap)
    few = SydaTeleopVectorEnv(2, **cheap)
    many.reset(seed=0)
    few.reset(seed=16)
    for _ in range(10):
        one, two = many.step(np.full((18, 10), 0.3)), few.step(np.full((2, 10), 0.3))
        assert (one[0][16:] == two[0]).all()


def test_autoreset_modes_tell_the_same_story(cheap):
    options = {**cheap, "physics": "servo"}
    after, same, manual = (
        SydaTeleopVectorEnv(COUNT, autoreset_mode=mode, **options) for mode in ("next_step", "same_step", "disabled")
    )
    for env in (after, same, manual):
        env.reset(seed=0, options={"motion": [0, 1, 2], "frame": [3, 0, 5]})
    moves = np.full((COUNT, 10), 0.2, dtype=np.float32)
    finished = np.zeros(COUNT, dtype=bool)
    while not finished.any():
        one, two, three = after.step(moves), same.step(moves), manual.step(moves)
        finished = three[3]
        assert (one[1] == two[1]).all()
        assert (one[1] == three[1]).all()
    index = int(np.flatnonzero(finished)[0])
    assert (two[4]["final_obs"][index] == one[0][index]).all()
    assert two[4]["final_info"]["motion"][index] == one[4]["motion"][index]
    with pytest.raises(SydaError, match="reset_mask"):
        manual.step(moves)
    fresh, _ = manual.reset(options={"reset_mask": finished})
    assert (fresh[index] == two[0][index]).all()
    restarted = after.step(moves)
    assert (restarted[0][index] == two[0][index]).all()
    assert restarted[1][index] == 0.0


def test_a_pickled_vector_goes_on(cheap):
    env = SydaTeleopVectorEnv(COUNT, start="uniform", **cheap)
    env.reset(seed=1)
    moves = actions(150)
    for action in moves[:70]:
        env.step(action)
    twin = pickle.loads(pickle.dumps(env))
    for action in moves[70:]:
        one, two = env.step(action), twin.step(action)
        assert (one[0] == two[0]).all()
        assert (one[1] == two[1]).all()


def test_bad_use_says_what_to_do(cheap):
    for bad in (0, -1, 1.5, True):
        with pytest.raises(OptionError, match="num_envs"):
            SydaTeleopVectorEnv(bad, **cheap)
    with pytest.raises(OptionError, match="same_step"):
        SydaTeleopVectorEnv(2, autoreset_mode="sometimes", **cheap)
    env = SydaTeleopVectorEnv(2, physics="servo", **cheap)
    with pytest.raises(SydaError, match="reset"):
        env.step(np.zeros((2, 10)))
    env.reset(seed=[3, None])
    with pytest.raises(OptionError, match=r"robot 1 for LShoulderPitch is nan"):
        env.step(np.array([np.zeros(10), np.full(10, np.nan)]))
    with pytest.raises(OptionError, match="one value or 2"):
        env.reset(options={"motion": [0, 1, 2]})
    with pytest.raises(OptionError, match="same_step"):
        TeleopVecEnv(env)


def test_failures_are_started_from_more_often(cheap):
    env = SydaTeleopVectorEnv(COUNT, physics="servo", start="failures", **cheap)
    sampler = env._fleet._starts
    sampler.learn(1, 0, 30, 0.5)
    for clip in (0, 2, 3):
        sampler.learn(clip, 0, 1000, 0.01)
    rng = np.random.default_rng(0)
    drawn = [sampler.draw(*rng.random(2)) for _ in range(500)]
    from_worst = np.mean([clip == 1 for clip, _ in drawn])
    assert from_worst > 0.5
    assert {clip for clip, _ in drawn} == {0, 1, 2, 3}
    assert sampler.weights().sum() == pytest.approx(1.0)


def test_stable_baselines_sees_returns_and_last_observations(cheap):
    env = TeleopVecEnv(SydaTeleopVectorEnv(COUNT, physics="servo", autoreset_mode="same_step", **cheap))
    env.seed(0)
    observations = env.reset()
    assert observations.shape == (COUNT, *env.observation_space.shape)
    total, infos = np.zeros(COUNT), [{}]
    for _ in range(400):
        observations, rewards, dones, infos = env.step(np.zeros((COUNT, 10)))
        total += rewards
        if dones.any():
            break
    index = int(np.flatnonzero(dones)[0])
    assert infos[index]["episode"]["r"] == pytest.approx(total[index])
    assert infos[index]["TimeLimit.truncated"]
    assert infos[index]["terminal_observation"].shape == observations[index].shape
    assert "is_success" in infos[index]
