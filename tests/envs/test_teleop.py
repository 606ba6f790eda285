"""The single environment keeps Gymnasium's contract and its own promises."""

from __future__ import annotations

import copy
import hashlib
import pickle
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import syda_gym
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.errors import MappingError, OptionError, RouteError, SydaError

STEPS = 500
"""Over this many steps and the resets between them, bits are compared."""


def make(cheap, **changes):
    return SydaTeleopEnv(**{**cheap, **changes})


def play(env, seed, steps, scale=1.0):
    """Observations, rewards and infos of a seeded run that restarts at every end."""
    rng = np.random.default_rng(99)
    trace = [env.reset(seed=seed)]
    for _ in range(steps):
        action = (scale * rng.uniform(-1, 1, env.action_space.shape)).astype(np.float32)
        result = env.step(np.clip(action, env.action_space.low, env.action_space.high))
        trace.append(result)
        if result[2] or result[3]:
            trace.append(env.reset())
    return trace


def flat(value):
    """Everything in a trace as bytes."""
    if isinstance(value, dict):
        return b"".join(key.encode() + flat(item) for key, item in value.items())
    if isinstance(value, list | tuple):
        return b"".join(flat(item) for item in value)
    if isinstance(value, str):
        return value.encode()
    return np.asarray(value).tobytes()


def test_made_by_id_it_passes_the_checker_without_a_warning(cheap):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gym.make("SydaTeleop-v0", render_mode="rgb_array", **cheap)
        check_env(env.unwrapped)
        env.close()
        both = gym.make("syda_gym:SydaTeleop-v0", physics="servo", **cheap)
        check_env(both.unwrapped, skip_render_check=True)


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.fixed_dictionaries(
        {
            "robot": st.sampled_from(["pepper", "nao"]),
            "physics": st.sampled_from(["bullet", "servo"]),
            "action_mode": st.sampled_from(["residual", "position"]),
            "reference": st.sampled_from(["paired", "mapped"]),
            "preview": st.integers(0, 4),
            "history": st.integers(0, 3),
            "physics_hz": st.sampled_from([60, 120, 240]),
            "start": st.sampled_from(["first", "uniform", "failures"]),
            "disturbances": st.sampled_from(
                [None, "teleop", "teleop:noise:harsh", "teleop:latency:test", "payload:harsh"]
            ),
            "terminate_error": st.sampled_from([None, 0.05]),
            "reward": st.sampled_from([None, {"limits": 0.1, "jitter": 1.0, "contacts": 0.5}]),
        }
    )
)
def test_any_combination_of_options_passes_the_checker(cheap, options):
    options["route"] = ("adult", options["robot"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = make(cheap, **options)
        check_env(env, skip_render_check=True)
        observation, first = env.reset(seed=1)
        assert observation in env.observation_space
        for _ in range(12):
            observation, reward, _, _, info = env.step(env.action_space.sample())
            assert observation in env.observation_space
            assert list(info) == list(first)
            assert reward == pytest.approx(sum(info["reward_terms"].values()))
        env.close()


@pytest.mark.parametrize("self_collision", [False, True])
def test_two_environments_with_one_seed_are_equal_bit_for_bit(cheap, self_collision):
    one, two = (make(cheap, self_collision=self_collision, start="uniform") for _ in range(2))
    play(two, 7, 60)  # a past of its own must not matter
    first, second = play(one, 3, STEPS), play(two, 3, STEPS)
    assert flat(first) == flat(second)
    if self_collision:
        assert any(step[-1]["contacts"] for step in first), "nothing touched: the test shows nothing"


def test_another_process_gives_the_same_bits(cheap):
    code = (
        "import hashlib\n"
        "from tests.envs.test_teleop import flat, make, play\n"
        "from syda_gym.motions.synthetic.generator import generate\n"
        "actions = ('wave_high', 'reach_high_front')\n"
        "m = generate(('adult', 'kid', 'pepper', 'nao'), seed=4, actions=actions, variants=2)\n"
        "cheap = {'motions': m, 'mapping': 'geometric', 'preset': 'fixed', 'route': ('adult', 'pepper')}\n"
        f"print(hashlib.sha256(flat(play(make(cheap, disturbances='teleop'), 5, {STEPS}))).hexdigest())\n"
    )
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    mine = hashlib.sha256(flat(play(make(cheap, disturbances="teleop"), 5, STEPS))).hexdigest()
    assert other.stdout.split()[-1] == mine


@pytest.mark.parametrize(
    "changes",
    [{}, {"self_collision": True}, {"physics": "servo"}, {"disturbances": "teleop:full:test", "history": 2}],
    ids=str,
)
def test_a_pickled_environment_goes_on_with_the_same_bits(cheap, changes):
    env = make(cheap, start="uniform", physics_hz=60, **changes)
    play(env, 2, 33)
    twin = pickle.loads(pickle.dumps(env))
    third = copy.deepcopy(env)
    rng = np.random.default_rng(0)
    done = False
    for _ in range(STEPS):
        action = rng.uniform(-1, 1, 10).astype(np.float32)
        results = [e.reset() if done else e.step(action) for e in (env, twin, third)]
        assert flat(results[0]) == flat(results[1]) == flat(results[2])
        done = len(results[0]) == 5 and (results[0][2] or results[0][3])


def test_zero_correction_is_the_base_command_and_position_mode_agrees(cheap):
    residual, position = make(cheap), make(cheap, action_mode="position")
    residual.reset(seed=0, options={"motion": 1})
    position.reset(seed=0, options={"motion": 1})
    for _ in range(40):
        command = position.action_from_command(position._fleet.present_base)
        one, two = residual.step(np.zeros(10)), position.step(command)
        np.testing.assert_allclose(one[4]["q"], two[4]["q"], atol=1e-6)
        assert one[4]["limit_hits"] == 0
    command = residual._fleet.present_base + 0.1
    action = residual.action_from_command(command)
    before = residual.step(action.astype(np.float64))[4]["command"]
    np.testing.assert_allclose(before, residual.robot.clamp(command)[0], atol=1e-9)


def test_the_observation_is_what_the_layout_says(cheap):
    env = make(cheap, preview=2, history=2)
    layout, n = env.layout, 10
    observation, info = env.reset(seed=0, options={"motion": 0})
    trail = [info]
    for _ in range(5):
        observation, *_, info = env.step(env.action_space.sample())
        trail.append(info)
    q, base = observation[layout["q"]], observation[layout["base_error"]].reshape(3, n) + observation[layout["q"]]
    np.testing.assert_allclose(q, info["q"], atol=1e-6)
    np.testing.assert_allclose(base[0], info["base"], atol=1e-6)
    following = env.step(np.zeros(n))[4]["base"]
    np.testing.assert_allclose(base[1], following, atol=1e-6)
    past_q = observation[layout["q_history"]].reshape(2, n) + q
    np.testing.assert_allclose(past_q, [trail[-2]["q"], trail[-3]["q"]], atol=1e-6)
    past_base = observation[layout["base_history"]].reshape(2, n) + q
    np.testing.assert_allclose(past_base, [trail[-2]["base"], trail[-3]["base"]], atol=1e-6)
    frame = env.operator.check(env._fleet.repertoire.operator_rows)[5]
    np.testing.assert_allclose(observation[layout["operator"]], frame, atol=1e-6)


@pytest.mark.parametrize("disturbances", [None, "teleop:full:harsh"])
def test_base_commands_and_mapped_references_obey_the_speed_limits(hasty, disturbances):
    env = make(hasty, reference="mapped", preview=2, physics="servo", disturbances=disturbances)
    repertoire, most = env._fleet.repertoire, env.robot.speed * env.dt + 1e-9
    for number, clip in enumerate(repertoire.clips):
        observation, info = env.reset(seed=number, options={"motion": number})
        base, references, done = [info["base"]], [info["reference"]], False
        while not done:
            ahead = observation[env.layout["base_error"]].reshape(3, 10) + observation[env.layout["q"]]
            assert (np.abs(np.diff(ahead, axis=0)) <= most + 1e-6).all()
            observation, _, _, done, info = env.step(np.zeros(10))
            base.append(info["base"])
            references.append(info["reference"])
            if disturbances is None:
                np.testing.assert_allclose(ahead[1], info["base"], atol=1e-6)
        assert (np.abs(np.diff(base, axis=0)) <= most).all()
        assert (np.abs(np.diff(references, axis=0)) <= most).all()
        # Frame by frame, without a solver that keeps time, the operator is too fast for the robot.
        alone = repertoire.pilot.mapping(repertoire.routes[0].bodies)(repertoire.operator_rows[clip.rows])
        assert (np.abs(np.diff(alone, axis=0)) > most).any(), "nothing was too fast: the test shows nothing"
        assert (base[0] == repertoire.mapped_rows(0)[clip.first]).all() == (disturbances is None)


def test_frames_that_motors_can_follow_are_left_as_the_mapping_has_them(cheap):
    env = make(cheap, reference="mapped", physics="servo")
    repertoire, most = env._fleet.repertoire, env.robot.speed * env.dt
    for number, clip in enumerate(repertoire.clips):
        mapped = repertoire.mapped_rows(0)[clip.rows]
        bases = [env.reset(options={"motion": number})[1]["base"]]
        bases += [env.step(np.zeros(10))[4]["base"] for _ in range(clip.length)]
        same = (bases == mapped).all(axis=1)
        fast = (np.abs(np.diff(mapped, axis=0)) > most).any(axis=1)
        first = int(np.argmax(fast)) if fast.any() else clip.length
        assert same[: first + 1].all()
        assert same.mean() > 0.5


def test_errors_and_reward_are_those_of_the_robot_against_its_reference(cheap):
    env = make(cheap)
    env.reset(seed=0)
    for _ in range(20):
        _, reward, _, _, info = env.step(np.zeros(10))
    clip = env._fleet.repertoire.clips[env.clip_names.index(info["motion"])]
    take = next(t for t in cheap["motions"].takes if t.recording == clip.name)
    np.testing.assert_allclose(info["reference"], take.frames["pepper"][info["frame"]], atol=1e-12)
    landmarks = syda_gym.landmark_error(env.robot, info["q"], info["reference"])[0]
    np.testing.assert_allclose(info["landmark_error"], landmarks, atol=1e-4)
    squared = float(np.sum((info["q"] - info["reference"]) ** 2))
    expected = 0.5 * np.exp(-2 * squared) + 0.5 * np.exp(-10 * info["landmark_error"].mean())
    assert reward == pytest.approx(expected, abs=1e-9)


def test_an_episode_ends_with_its_clip_and_says_whether_it_succeeded(cheap):
    env = make(cheap)
    for motion in (0, env.clip_names[1]):
        _, info = env.reset(options={"motion": motion})
        errors, truncated = [], False
        while not truncated:
            assert not info["is_success"]
            _, _, terminated, truncated, info = env.step(np.zeros(10))
            errors.append(info["landmark_error"].mean())
            assert not terminated
        length = env._fleet.repertoire.clips[env.clip_names.index(info["motion"])].length
        assert len(errors) == length
        assert info["is_success"] == (np.mean(errors) <= 0.036)
    strict = make(cheap, terminate_error=0.005)
    strict.reset(seed=0)
    results = [strict.step(np.ones(10)) for _ in range(3)]
    assert any(result[2] for result in results)
    assert not any(result[4]["is_success"] for result in results)


def test_reset_options_choose_motion_frame_and_route(cheap, motions):
    env = make(cheap)
    _, info = env.reset(options={"clip": 2, "frame": 11, "route": ("adult", "kid", "pepper")})
    assert (info["motion"], info["frame"], info["route"]) == (env.clip_names[2], 11, "adult>kid>pepper")
    assert 0.0 < info["transferability"] < 1.0
    for bad in ({"motion": "nope"}, {"motion": 99}, {"frame": -1}, {"frame": 10_000}, {"speed": 1}, {"frame": 1.5}):
        with pytest.raises(OptionError):
            env.reset(options=bad)
    with pytest.raises(RouteError, match="no mapping leads from or to 'tall'"):
        env.reset(options={"route": ("adult", "tall", "pepper")})


def test_routes_are_chosen_and_drawn_by_transferability(cheap):
    env = make(cheap, route="sample")
    assert set(env.routes) == {("adult", "pepper"), ("adult", "kid", "pepper")}
    seen = {env.reset(seed=seed)[1]["route"] for seed in range(20)}
    assert seen == {"adult>pepper", "adult>kid>pepper"}
    trusts = [route.transferability for route in env._fleet.repertoire.routes]
    assert trusts == sorted(trusts, reverse=True)
    assert trusts[0] == syda_gym.best_route("adult", "pepper", fitted=env._fleet.repertoire.pilot.fitted).T
    assert make(cheap, route="auto").routes[0] == env.routes[0]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_actions_that_are_not_finite_raise_and_break_nothing(cheap, bad):
    env = make(cheap)
    env.reset(seed=0)
    action = np.zeros(10)
    action[3] = bad
    with pytest.raises(OptionError, match="LElbowRoll"):
        env.step(action)
    with pytest.raises(OptionError, match="shape"):
        env.step(np.zeros(9))
    fresh = make(cheap)
    fresh.reset(seed=0)
    assert flat(env.step(np.zeros(10))) == flat(fresh.step(np.zeros(10)))


def test_extreme_actions_keep_the_robot_within_bounds(cheap):
    env = make(cheap, action_mode="position", self_collision=True)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(150):
        observation, reward, _, truncated, info = env.step(rng.choice([-1e9, 1e9], 10))
        assert observation in env.observation_space
        assert np.isfinite(reward)
        assert np.isfinite(info["q"]).all()
        if truncated:
            env.reset()


def test_the_docstring_is_the_table_of_the_default_layout(cheap):
    env = make(cheap)
    text = " ".join(SydaTeleopEnv.__doc__.split())
    for row in env.layout.table().splitlines():
        assert row in text
    for name in TeleopOptions.__dataclass_fields__:
        assert f"``{name}``" in text, f"option {name} is not documented"
    for index, joint in enumerate(env.robot.joint_names):
        assert f"| {index} | {joint} | -1 to 1 | 1 |" in text


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"physics_hz": 100}, OptionError, "whole multiple"),
        ({"control_hz": 0}, OptionError, "between"),
        ({"physics": "mujoco"}, OptionError, "bullet"),
        ({"action_mode": "torque"}, OptionError, "residual"),
        ({"robot": "peper"}, SydaError, "pepper"),
        ({"robot": "adult"}, SydaError, "robot"),
        ({"operator": "nobody"}, SydaError, "adult"),
        ({"mapping": "magic"}, OptionError, "syda"),
        ({"route": ("kid", "pepper")}, RouteError, "adult"),
        ({"route": "best"}, RouteError, "auto"),
        ({"held_out": ("jump",)}, OptionError, "unknown action"),
        ({"clips": ["nope"]}, OptionError, "no clip"),
        ({"clips": []}, OptionError, "nothing to play"),
        ({"actions": ["jump"]}, OptionError, "unknown action"),
        ({"preview": -1}, OptionError, "whole number"),
        ({"residual_scale": 0}, OptionError, "number"),
        ({"reward": {"joint": 1}}, OptionError, "joints"),
        ({"reward": {"joints": -1}}, OptionError, "negative"),
        ({"disturbances": "teleop:lag:brutal"}, OptionError, "harsh"),
        ({"camera": {"wide": 3}}, OptionError, "width"),
        ({"render_mode": "ascii"}, OptionError, "rgb_array"),
        ({"self_collision": True, "physics": "servo"}, OptionError, "no contacts"),
        ({"residual_scal": 0.1}, OptionError, "residual_scale"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_bad_options_say_what_is_allowed(cheap, changes, error, message):
    with pytest.raises(error, match=message):
        make(cheap, **changes)


def test_a_mapping_or_a_folder_of_mappings_can_be_given(cheap, motions, tmp_path):
    fitted = {ends: syda_gym.fit(motions.pair(*ends), method="ridge") for ends in (("adult", "kid"), ("kid", "pepper"))}
    chain = fitted["adult", "kid"] >> fitted["kid", "pepper"]
    given = make(cheap, mapping=chain, route="auto", preset=None)
    assert given.routes == (("adult", "kid", "pepper"),)
    for (a, b), mapping in fitted.items():
        syda_gym.save_mapping(mapping, tmp_path / f"{a}-{b}")
    stored = make(cheap, mapping=tmp_path, route=("adult", "kid", "pepper"))
    np.testing.assert_allclose(stored.reset(seed=0)[0], given.reset(seed=0)[0], atol=1e-6)
    with pytest.raises(MappingError, match="'adult' to 'pepper'"):
        make(cheap, mapping=fitted["kid", "pepper"], route="auto")
    with pytest.raises(RouteError, match="no mapping for the link adult>pepper"):
        make(cheap, mapping=tmp_path, route=("adult", "pepper"))


def test_mappings_never_see_actions_that_are_held_out(cheap):
    env = make(cheap, mapping="ridge", preset=None, held_out=("wave_high",))
    card = env._fleet.repertoire.pilot.mapping(("adult", "pepper")).card
    assert card.actions == ["reach_high_front"]


def test_step_before_reset_says_so(cheap):
    with pytest.raises(SydaError, match="reset"):
        make(cheap).step(np.zeros(10))


def test_close_may_be_repeated(cheap):
    env = make(cheap)
    env.reset(seed=0)
    env.close()
    env.close()
