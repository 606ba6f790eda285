"""Environments can be looked at and recorded."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from syda_gym.envs.plots import tracking_figure
from syda_gym.envs.rendering import RecordVideo
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.envs.vector import SydaTeleopVectorEnv
from syda_gym.errors import OptionError, SydaError

CAMERA = {"width": 96, "height": 72}


def test_pictures_follow_the_robot_and_do_not_disturb_it(cheap):
    seen, blind = (SydaTeleopEnv(render_mode=mode, camera=CAMERA, **cheap) for mode in ("rgb_array", None))
    with pytest.raises(SydaError, match="reset"):
        seen.render()
    seen.reset(seed=0)
    blind.reset(seed=0)
    first = seen.render()
    for _ in range(40):
        seen.render()
        one, two = seen.step(np.ones(10)), blind.step(np.ones(10))
        assert (one[0] == two[0]).all()
    assert first.shape == (72, 96, 3)
    assert (seen.render() != first).any()
    seen.close()


def test_a_list_collects_pictures_since_the_last_call(cheap):
    env = SydaTeleopEnv(render_mode="rgb_array_list", camera=CAMERA, **cheap)
    env.reset(seed=0)
    env.step(np.zeros(10))
    assert len(env.render()) == 2
    env.step(np.zeros(10))
    assert len(env.render()) == 1
    env.close()


def test_without_a_render_mode_a_warning_tells_how(cheap):
    env = SydaTeleopEnv(**cheap)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="rgb_array"):
        assert env.render() is None


def test_every_robot_of_a_vector_has_its_picture(cheap):
    env = SydaTeleopVectorEnv(2, render_mode="rgb_array", physics="servo", camera=CAMERA, **cheap)
    env.reset(seed=0, options={"motion": [0, 3]})
    for _ in range(25):
        env.step(np.zeros((2, 10)))
    one, two = env.render()
    assert (one != two).any()
    env.close()


def test_episodes_are_recorded_without_moviepy(cheap, tmp_path):
    import imageio_ffmpeg

    env = gym.make("SydaTeleop-v0", render_mode="rgb_array", physics="servo", camera=CAMERA, **cheap)
    env = RecordVideo(env, tmp_path, episode_trigger=lambda episode: episode != 1)
    for _ in range(3):
        env.reset(seed=0, options={"motion": 0, "frame": 80})
        done, steps = False, 0
        while not done:
            *_, terminated, truncated, _ = env.step(np.zeros(10))
            done, steps = terminated or truncated, steps + 1
    env.close()
    assert [path.name for path in env.videos] == ["teleop-episode-0.mp4", "teleop-episode-2.mp4"]
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(env.videos[0]))
    assert count == steps + 1
    assert seconds == pytest.approx((steps + 1) / 30, abs=0.05)
    with pytest.raises(OptionError, match="render_mode='rgb_array'"):
        RecordVideo(SydaTeleopEnv(**cheap), tmp_path)


def test_tracking_is_plotted_joint_by_joint(cheap):
    env = SydaTeleopEnv(physics="servo", **cheap)
    _, info = env.reset(seed=0)
    infos = [info]
    for _ in range(30):
        infos.append(env.step(np.zeros(10))[4])
    figure = tracking_figure(env.robot, infos, env.dt)
    plots = {axes.get_title(loc="left"): axes for axes in figure.axes}
    assert set(env.robot.joint_names) < set(plots)
    lines = {line.get_label(): line for line in plots["LShoulderPitch"].get_lines()}
    np.testing.assert_allclose(lines["reference"].get_ydata(), np.degrees([i["reference"][0] for i in infos]))
    assert len(lines["robot"].get_xdata()) == 31
    with pytest.raises(OptionError, match="no step"):
        tracking_figure(env.robot, [], env.dt)
