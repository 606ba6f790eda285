"""Robots in several processes go where they go in one, and no process is left behind."""

from __future__ import annotations

import copy
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from syda_gym.envs.sb3 import TeleopVecEnv
from syda_gym.envs.vector import SydaTeleopVectorEnv
from syda_gym.errors import OptionError, SydaError

COUNT = 5
FAST = {"physics": "servo"}


def same(one, two):
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for key in one:
            same(one[key], two[key])
    elif isinstance(one, tuple):
        for left, right in zip(one, two, strict=True):
            same(left, right)
    else:
        left, right = np.asarray(one), np.asarray(two)
        assert left.dtype == right.dtype
        if left.dtype == object:
            assert all(np.array_equal(a, b) for a, b in zip(left, right, strict=True))
        else:
            assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f")


@pytest.mark.parametrize(
    ("mode", "changes"),
    [
        ("same_step", {"disturbances": "teleop:full:train", "start": "uniform", "preview": 1, "history": 2, **FAST}),
        ("next_step", {"start": "failures", "terminate_error": 0.08, "route": "sample", **FAST}),
        ("disabled", {"self_collision": True, "reward": {"contacts": 0.1}, "max_episode_steps": 20}),
    ],
    ids=lambda value: str(value)[:40],
)
def test_two_processes_give_the_bits_of_one(cheap, mode, changes):
    options = {**cheap, **changes, "autoreset_mode": mode}
    one, two = (SydaTeleopVectorEnv(COUNT, workers=workers, **options) for workers in (1, 2))
    try:
        same(one.reset(seed=3), two.reset(seed=3))
        rng, ends = np.random.default_rng(0), 0
        for _ in range(45 if mode == "disabled" else 200):
            actions = rng.uniform(-1, 1, (COUNT, 10)).astype(np.float32)
            left, right = one.step(actions), two.step(actions)
            same(left, right)
            done = left[2] | left[3]
            ends += int(done.sum())
            if mode == "disabled" and done.any():
                mask = {"reset_mask": done}
                same(one.reset(options=mask), two.reset(options=mask))
        assert ends > COUNT
        wish = {"motion": [0, 1, 2, 3, 0], "frame": 4, "route": ("adult", "kid", "pepper")}
        same(one.reset(seed=[4, None, 5, 6, None], options=wish), two.reset(seed=[4, None, 5, 6, None], options=wish))
        commands = one.action_from_command(np.zeros((COUNT, 10)))
        assert np.array_equal(commands, two.action_from_command(np.zeros((COUNT, 10))))
    finally:
        one.close()
        two.close()


def test_what_was_handed_out_stays_and_pictures_are_the_same(cheap):
    options = {**cheap, **FAST, "render_mode": "rgb_array", "camera": {"width": 32, "height": 32}}
    one, two = (SydaTeleopVectorEnv(3, workers=workers, **options) for workers in (1, 2))
    try:
        for env in (one, two):
            observations, infos = env.reset(seed=0)
            kept = observations.copy(), infos["q"].copy(), infos["motion"].copy()
            env.step(np.ones((3, 10), np.float32))
            env.reset(options={"reset_mask": np.array([True, False, False])})
            assert all(
                np.array_equal(a, b) for a, b in zip(kept, (observations, infos["q"], infos["motion"]), strict=True)
            )
        for left, right in zip(one.render(), two.render(), strict=True):
            assert np.array_equal(left, right)
    finally:
        one.close()
        two.close()


def test_processes_end_with_the_environment_and_a_lost_one_is_told(cheap):
    env = SydaTeleopVectorEnv(2, workers=2, autoreset_mode="same_step", **cheap, **FAST)
    processes = [worker.process for worker in env._fleet._workers]
    adapter = TeleopVecEnv(env)
    adapter.reset()
    adapter.step(np.zeros((2, 10)))
    with pytest.raises(SydaError, match="workers=1"):
        copy.deepcopy(env)
    with pytest.raises(OptionError, match=r"shape \(2, 10\)"):
        env.step(np.zeros((3, 10)))
    os.kill(processes[1].pid, signal.SIGKILL)
    processes[1].join(10.0)
    with pytest.raises(SydaError, match="SIGKILL"):
        adapter.step(np.zeros((2, 10)))
    assert not any(process.is_alive() for process in processes)
    with pytest.raises(SydaError, match="make a new environment"):
        adapter.step(np.zeros((2, 10)))
    env.close()
    env.close()
    for bad in (0, 3, 1.5, True):
        with pytest.raises(OptionError, match="workers must be"):
            SydaTeleopVectorEnv(2, workers=bad, **cheap, **FAST)
    with pytest.raises(OptionError, match="did you mean 'robot'"):
        SydaTeleopVectorEnv(2, workers=2, robt="pepper")


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX knows them")
def test_a_killed_parent_leaves_nobody_behind(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(
        "import time\n"
        "from syda_gym.envs.vector import SydaTeleopVectorEnv\n"
        "if __name__ == '__main__':\n"
        "    env = SydaTeleopVectorEnv(2, workers=2, physics='servo', mapping='geometric', clips=[0],\n"
        "                              route=('adult', 'pepper'))\n"
        "    env.reset(seed=0)\n"
        "    print(*[worker.process.pid for worker in env._fleet._workers], flush=True)\n"
        "    time.sleep(600)\n"
    )
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    children = [int(word) for word in parent.stdout.readline().split()]
    assert len(children) == 2
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 20.0
    while any(map(is_running, children)):
        assert time.monotonic() < deadline, "a worker outlived its parent"
        time.sleep(0.05)


def is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{process}/stat") as file:  # nobody may have waited for it
        return file.read().rsplit(")", 1)[1].split()[0] != "Z"
