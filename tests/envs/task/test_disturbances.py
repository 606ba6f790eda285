"""Disturbances have the sizes that their names promise, and nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.envs.task.disturbances import CELLS, LEVELS, Disturbances, deliver, freeze_elbow_yaw, see
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.errors import OptionError

ADULT = catalog.get("adult")


def still(count):
    return np.repeat(ADULT.standing()[None], count, axis=0)


def seen(count=4000, seed=0, **values):
    drawn = Disturbances(**values).draw(np.random.default_rng(seed))
    frames = still(count)
    return ADULT.landmarks(see(drawn, ADULT, frames, np.random.default_rng(seed))) - ADULT.landmarks(frames)


def test_noise_has_the_wanted_spread_axes_and_memory():
    noise = seen(noise=0.0125)
    np.testing.assert_allclose(noise.std(axis=(0, 1)), 0.0125 * np.array([1.3, 0.8, 1.0]), rtol=0.08)
    flat = noise[:, 0, 0]
    assert np.corrcoef(flat[:-1], flat[1:])[0, 1] == pytest.approx(0.6, abs=0.05)


def test_outliers_jump_by_eight_centimetres_at_their_rate():
    jumps = np.linalg.norm(seen(outliers=0.03), axis=-1)
    np.testing.assert_allclose(jumps[jumps > 1e-9], 0.08, rtol=1e-6)
    assert (jumps > 1e-9).mean() == pytest.approx(0.03, abs=0.006)


def test_dropouts_hold_one_landmark_for_three_to_ten_frames():
    drawn = Disturbances(dropout=0.02).draw(np.random.default_rng(0))
    points = np.zeros((3000, 2, 3, 3))
    points[..., 0] = np.arange(3000)[:, None, None]
    result = ADULT.landmarks(see(drawn, ADULT, ADULT.frames_from_points(points), np.random.default_rng(1)))[..., 0]
    held = np.diff(result, axis=0) == 0.0
    assert 0.02 < held.mean() < 0.045  # 0.02 starts x 6.5 frames / 4 landmarks = 0.033
    lengths = []
    for column in held.T:
        edges = np.flatnonzero(np.diff(np.r_[0, column, 0]))
        lengths += list(edges[1::2] - edges[::2])
    assert min(lengths) == 3
    assert np.percentile(lengths, 90) <= 11  # two dropouts may follow each other


@settings(max_examples=40, deadline=None)
@given(
    st.floats(0, 0.3), st.floats(0, 0.1), st.floats(0, 0.6), st.integers(0, 30), st.integers(0, 40), st.integers(0, 9)
)
def test_packets_never_come_early_nor_run_backwards(latency, jitter, loss, before, start, seed):
    drawn = Disturbances(latency=latency, latency_jitter=jitter, loss=loss).draw(np.random.default_rng(seed))
    newest = deliver(drawn, start - before, start + 50, start, 1 / 30, np.random.default_rng(seed))
    steps = np.arange(start, start + 51)
    assert len(newest) == 51
    assert (np.diff(newest) >= 0).all()
    assert (newest <= steps).all()
    earliest = max(latency - jitter, 0.0)
    came = newest > start - before  # the first packet of the stream is always there
    assert ((steps - newest)[came] / 30 >= earliest - 1e-6).all()


def test_a_latency_of_three_frames_is_three_frames_old():
    drawn = Disturbances(latency=0.1).draw(np.random.default_rng(0))
    newest = deliver(drawn, -20, 30, 0, 1 / 30, np.random.default_rng(0))
    assert (np.arange(31) - newest == 3).all()


def test_the_suite_has_its_cells_and_levels():
    assert tuple(CELLS) == ("lag", "noise", "latency", "noise+latency", "full")
    full = [Disturbances.preset("full", level) for level in LEVELS]
    assert [d.noise for d in full] == [(0.004, 0.020), 0.0125, 0.025]
    assert [d.outliers for d in full] == [(0.0, 0.02), 0.01, 0.03]
    assert [d.dropout for d in full] == [(0.0, 0.04), 0.02, 0.06]
    assert [np.round(np.multiply(d.latency, 30), 6).tolist() for d in full] == [[1.0, 4.5], 3.0, 5.0]
    assert [np.round(np.multiply(d.latency_jitter, 30), 6).tolist() for d in full] == [[0.0, 1.5], 1.0, 2.0]
    assert [d.loss for d in full] == [(0.0, 0.06), 0.03, 0.10]
    assert [d.motor_gain for d in full] == [d.motor_speed for d in full] == [(0.70, 1.0), 0.80, 0.65]
    assert [d.payload for d in full] == [(0.0, 0.5), 0.3, 0.6]
    assert Disturbances.resolve("teleop") == full[0]
    assert Disturbances.resolve("teleop:lag:test") == Disturbances()


@pytest.mark.parametrize(
    "bad",
    ["telop", "teleop:loud", "teleop:full:max", "noise", "teleop:full:test:x", {"nois": 1}, {"noise": -1}, {"loss": 2},
     {"noise": (0.02, 0.01)}, {"noise": "much"}, {"noise": np.nan}, 7],
    ids=str,
)  # fmt: skip
def test_what_is_no_disturbance_is_refused(bad):
    with pytest.raises(OptionError):
        Disturbances.resolve(bad)


def test_the_elbow_keeps_its_turn_while_the_arm_is_straight():
    robot = catalog.get("pepper")
    q = np.repeat(robot.rest[None], 6, axis=0)
    q[:, 2] = np.linspace(-1.0, 1.0, 6)
    q[2:5, 3] = -0.01  # straight
    frozen = freeze_elbow_yaw(robot, q, 0.15)
    np.testing.assert_allclose(frozen[:, 2], [q[0, 2], q[1, 2], q[1, 2], q[1, 2], q[1, 2], q[5, 2]])
    assert (np.delete(frozen, 2, axis=1) == np.delete(q, 2, axis=1)).all()
    assert (freeze_elbow_yaw(robot, q, 0.0) == q).all()


def play(env, seed, steps=40):
    observation, info = env.reset(seed=seed, options={"motion": 0})
    trace = [(observation, info)]
    for _ in range(steps):
        observation, _, _, _, info = env.step(np.zeros(10))
        trace.append((observation, info))
    return trace


def test_the_age_of_packets_is_seen_and_the_reference_is_undisturbed(cheap):
    options = {**cheap, "physics": "servo", "reference": "mapped"}
    clean, late = SydaTeleopEnv(**options), SydaTeleopEnv(**options, disturbances={"latency": 0.1})
    one, two = play(clean, 0), play(late, 0)
    column = late.layout["packet_age"].start
    assert [o[column] for o, _ in two] == pytest.approx([0.1] * 41)
    assert [info["packet_age"] for _, info in two] == pytest.approx([0.1] * 41)
    assert [o[column] for o, _ in one] == [0.0] * 41
    for step in range(41):
        np.testing.assert_allclose(two[step][1]["reference"], one[step][1]["reference"], atol=0.2)
    for step in range(5, 40):  # bent arms: the same operator, three frames later
        np.testing.assert_array_equal(two[step][0][late.layout["operator"]], one[step - 3][0][clean.layout["operator"]])


def test_the_same_seed_gives_the_same_stream_whatever_the_actions_and_the_cell(cheap):
    options = {**cheap, "physics": "servo"}
    noise, both = (SydaTeleopEnv(**options, disturbances=f"teleop:{cell}:test") for cell in ("noise", "full"))
    shown = noise.layout["operator"]
    noise.reset(seed=4, options={"motion": 0})
    both.reset(seed=4, options={"motion": 0})
    first = [noise.step(np.zeros(10))[0][shown] for _ in range(30)]
    second = [both.step(np.ones(10)) for _ in range(30)]
    checked = 0
    for observation, *_, info in second:
        frame = info["frame"] + 1 - round(float(observation[both.layout["packet_age"]][0]) * 30)
        if 1 <= frame <= 30:
            checked += 1
            np.testing.assert_array_equal(observation[shown], first[frame - 1])
    assert checked > 10


def test_weak_motors_and_payload_cost_tracking_and_are_taken_back(cheap):
    env = SydaTeleopEnv(**cheap, disturbances={"motor_gain": 0.3, "motor_speed": 0.3, "payload": 2.0, "friction": 0.6})
    free = SydaTeleopEnv(**cheap, disturbances={})
    errors = [np.mean([i["joint_error"] ** 2 for _, i in play(e, 0, 60)]) for e in (free, env)]
    assert errors[1] > 1.5 * errors[0]
    world = env._fleet.world
    from syda_gym.simulation.backend import MotorConditions

    world.set_conditions(0, MotorConditions())
    again = [i["q"] for _, i in play(free, 0, 10)]
    world.reset(np.array([0]), free.reset(seed=0, options={"motion": 0})[1]["q"][None])
    rows = []
    for step in range(10):
        command = play(free, 0, step + 1)[-1][1]["command"]
        world.advance(command[None])
        rows.append(world.pose[0, :10].copy())
    np.testing.assert_array_equal(rows, again[1:])


def test_a_robot_as_operator_has_no_skeleton_to_disturb(cheap):
    options = {**cheap, "operator": "nao", "route": ("nao", "pepper")}
    with pytest.raises(OptionError, match="skeleton"):
        SydaTeleopEnv(**options, disturbances="teleop:noise:test")
    env = SydaTeleopEnv(**options, disturbances="teleop:latency:test", physics="servo")
    assert env.reset(seed=0)[0].shape == env.observation_space.shape
