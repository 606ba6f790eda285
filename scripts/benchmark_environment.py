"""Measure the environment against its bars, as ratios, in one run on one core.

Run it from anywhere: ``python scripts/benchmark_environment.py [--out FILE.json] [--quick]``. Every figure is a
median. Times are CPU times of the measuring thread, so that other work on the machine disturbs them less. Only the
share of raw physics compares wall-clock times: those of the bare ``stepSimulation`` (or ``mj_step``) calls with the
very steps around them, because a machine's speed changes from one moment to the next.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import gymnasium
import numpy as np

from syda_gym.files import write_json, write_text

OPTIONS: dict[str, Any] = {"route": ("adult", "pepper")}
RATES = {"240 Hz, 8 substeps": 240.0, "60 Hz, 2 substeps": 60.0}
STEPS = 60
MARKER = "<!-- numbers: docs/results/environment.json -->"
BARS: dict[str, Any] = {
    "single": {"240 Hz, 8 substeps": 0.95, "60 Hz, 2 substeps": 0.85},
    "sixteen": {"240 Hz, 8 substeps": 0.90, "60 Hz, 2 substeps": 0.90},
    "whole_body_240_hz": 1.8,
    "servo_1024_times_raw": 400,
    "disturbed": 3,
    "reset_ms": 0.1,
    "frame_ms": 5,
    "memory_mb": 60,
}


def cpu(function: Callable[[], object]) -> float:
    """CPU seconds of one call."""
    start = time.thread_time()
    function()
    return time.thread_time() - start


class Stopwatch:
    """Calls a function and adds up the seconds that it takes."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._spent = 0.0

    def __call__(self, *args: Any, **options: Any) -> Any:
        """The function itself."""
        start = time.perf_counter()
        result = self._function(*args, **options)
        self._spent += time.perf_counter() - start
        return result

    def take(self) -> float:
        """Seconds since the last look."""
        spent, self._spent = self._spent, 0.0
        return spent


def timed_steps(step: Callable[[], object], watch: Stopwatch, steps: int) -> tuple[list[float], list[float]]:
    """Seconds of physics and of everything, step by step."""
    raw, whole = [], []
    for _ in range(steps):
        watch.take()
        start = time.perf_counter()
        step()
        whole.append(time.perf_counter() - start)
        raw.append(watch.take())
    return raw, whole


def shares_of(raws: list[float], wholes: list[float]) -> dict[str, float]:
    """The medians that are reported."""
    return {
        "share_of_raw": statistics.median(raw / whole for raw, whole in zip(raws, wholes, strict=True)),
        "raw_us": 1e6 * statistics.median(raws),
        "step_us": 1e6 * statistics.median(wholes),
    }


def commands_of(env: Any, steps: int) -> list[np.ndarray]:
    """Base commands of the first steps of every robot's clip, ``(B, n)`` each."""
    fleet = env.unwrapped._fleet
    return [fleet._scripts.base_of_all(np.full(fleet.count, step))[:, : fleet._n] for step in range(steps)]


def raw_steps(env: Any, commands: list[np.ndarray]) -> list[float]:
    """CPU seconds in ``stepSimulation`` alone, per control step, while the world of ``env`` follows the commands."""
    import pybullet

    world = env.unwrapped._fleet.world
    substeps, clients, spent = world.rates.substeps, world._clients, []
    for command in commands:
        for puppet, targets in zip(world._puppets, command.tolist(), strict=True):
            puppet.command(targets)
        start = time.thread_time()
        for client in clients:
            for _ in range(substeps):
                pybullet.stepSimulation(client)
        spent.append(time.thread_time() - start)
    return spent


def against_raw(count: int, physics_hz: float, repeats: int) -> dict[str, float]:
    """Share of the environment's time that is physics, for one environment or many robots in one world."""
    if count == 1:
        env: Any = gymnasium.make("SydaTeleop-v0", physics_hz=physics_hz, **OPTIONS)
        action = np.zeros(10, dtype=np.float32)
    else:
        env = gymnasium.make_vec("SydaTeleop-v0", num_envs=count, physics_hz=physics_hz, **OPTIONS)
        action = np.zeros((count, 10), dtype=np.float32)
    env.reset(seed=0)
    env.step(action)
    world = env.unwrapped._fleet.world
    watch = world._simulate = Stopwatch(world._simulate)
    raws, wholes = [], []
    for repeat in range(repeats):
        env.reset(seed=repeat)
        raw, whole = timed_steps(lambda: env.step(action), watch, STEPS)
        raws += raw
        wholes += whole
    env.close()
    return shares_of(raws, wholes)


def against_whole_body(physics_hz: float, repeats: int) -> dict[str, float]:
    """Seconds of a control step with the whole body, in seconds of one without what stands still, in turns."""
    envs = [
        gymnasium.make("SydaTeleop-v0", physics_hz=physics_hz, whole_body=whole, **OPTIONS) for whole in (True, False)
    ]
    action, ratios = np.zeros(10, dtype=np.float32), []
    for repeat in range(repeats):
        spent = []
        for env in envs:
            env.reset(seed=repeat)
            spent.append(statistics.median(cpu(lambda env=env: env.step(action)) for _ in range(STEPS)))
        ratios.append(spent[0] / spent[1])
    apart = [np.array([env.step(action)[4]["q"] for _ in range(STEPS)]) for env in envs if env.reset(seed=0)]
    for env in envs:
        env.close()
    return {"times_faster": statistics.median(ratios), "apart_rad": float(np.abs(apart[0] - apart[1]).max())}


def servo_vector(count: int, repeats: int) -> dict[str, float]:
    """Control steps of the servo model, automatic resets included, beside those of raw Bullet physics at 240 Hz."""
    bullet: Any = gymnasium.make("SydaTeleop-v0", **OPTIONS)
    bullet.reset(seed=0)
    commands = commands_of(bullet, STEPS)
    env: Any = gymnasium.make_vec("SydaTeleop-v0", num_envs=count, physics="servo", start="uniform", **OPTIONS)
    env.reset(seed=0)
    actions = np.zeros((count, 10), dtype=np.float32)
    for _ in range(20):
        env.step(actions)
    times, ratios = [], []
    for _ in range(repeats):  # in turns, because a machine's speed changes
        step = statistics.median(cpu(lambda: env.step(actions)) for _ in range(20))
        bullet.reset(seed=0)
        ratios.append(count * statistics.median(raw_steps(bullet, commands[:20])) / step)
        times.append(step)
    env.close()
    bullet.close()
    step = statistics.median(times)
    return {"step_us": 1e6 * step, "steps_per_s": count / step, "times_raw": statistics.median(ratios)}


def disturbed_vector(count: int, repeats: int) -> dict[str, float]:
    """Seconds of a step of the servo model with disturbances, resets included, in seconds of one without, in turns."""
    made = [
        gymnasium.make_vec("SydaTeleop-v0", num_envs=count, physics="servo", start=start, disturbances=disturbances)
        for start in ("first", "uniform")
        for disturbances in (None, "teleop:full:train")
    ]
    actions = np.zeros((count, 10), dtype=np.float32)
    for env in made:
        env.reset(seed=0)
        for _ in range(180):  # until the robots are at different places of their clips
            env.step(actions)
    spent = np.array(
        [[cpu(lambda env=env: [env.step(actions) for _ in range(150)]) for env in made] for _ in range(repeats)]
    )
    for env in made:
        env.close()
    first, uniform = np.median(spent[:, 1] / spent[:, 0]), np.median(spent[:, 3] / spent[:, 2])
    return {"whole_clips": float(first), "uniform_starts": float(uniform)}


def with_workers(count: int, physics: str, workers: int, repeats: int) -> dict[str, float]:
    """Wall-clock time of a step in one process over that in several, in turns: above 1 the processes are faster."""
    made = [
        gymnasium.make_vec("SydaTeleop-v0", num_envs=count, physics=physics, workers=number, **OPTIONS)
        for number in (1, workers)
    ]
    actions, ratios, steps = np.zeros((count, 10), dtype=np.float32), [], []
    for env in made:
        env.reset(seed=0)
        env.step(actions)
    for _ in range(repeats):
        spent = []
        for env in made:
            start = time.perf_counter()
            for _ in range(40):
                env.step(actions)
            spent.append((time.perf_counter() - start) / 40)
        ratios.append(spent[0] / spent[1])
        steps.append(count / spent[1])
    for env in made:
        env.close()
    return {"workers": workers, "times_faster": statistics.median(ratios), "steps_per_s": statistics.median(steps)}


def reset_time() -> float:
    """Seconds of a soft reset of one Bullet environment."""
    env: Any = gymnasium.make("SydaTeleop-v0", **OPTIONS)
    env.reset(seed=0)
    times = [cpu(lambda: [env.reset() for _ in range(50)]) / 50 for _ in range(21)]
    env.close()
    return statistics.median(times)


def frame_time(width: int, height: int) -> float:
    """Seconds of one picture with ghost, operator and error colours."""
    env: Any = gymnasium.make(
        "SydaTeleop-v0", render_mode="rgb_array", camera={"width": width, "height": height}, **OPTIONS
    )
    env.reset(seed=0)
    env.render()
    times = []
    for _ in range(40):
        env.step(np.zeros(10))
        times.append(cpu(env.render))
    env.close()
    return statistics.median(times)


def memory() -> dict[str, float]:
    """Megabytes, each measured in a fresh process that has imported everything and made one environment before."""
    code = """
import gc, json, sys
import gymnasium, numpy as np, torch, stable_baselines3, pybullet, syda_gym
def resident():
    gc.collect()
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 2**20
options = {"route": ("adult", "pepper")}
kind = sys.argv[1]
if kind == "one":
    syda_gym.load_motions().pair("adult", "pepper")
    gymnasium.make("SydaTeleop-v0", physics="servo", **options).close()
    before = resident()
    env = gymnasium.make("SydaTeleop-v0", **options)
    env.reset(seed=0)
    for _ in range(50):
        env.step(np.zeros(10))
elif kind == "resets":
    env = gymnasium.make("SydaTeleop-v0", **options)
    env.reset(seed=0)
    for _ in range(1000):
        env.reset()
    before = resident()
    for _ in range(10000):
        env.reset()
else:
    def once():
        env = gymnasium.make("SydaTeleop-v0", clips=[0, 1], **options)
        env.reset(seed=0)
        env.step(np.zeros(10))
        env.close()
    for _ in range(20):
        once()
    before = resident()
    for _ in range(200):
        once()
print(json.dumps(resident() - before))
"""
    if not os.path.exists("/proc/self/statm"):
        return {}
    result = {}
    for kind, label in (("one", "one_environment"), ("resets", "10000_resets"), ("makes", "200_make_close")):
        done = subprocess.run([sys.executable, "-c", code, kind], capture_output=True, text=True, check=True)
        result[label] = float(done.stdout.strip().splitlines()[-1])
    return result


def humanoid() -> dict[str, float] | str:
    """Gymnasium's Humanoid-v5 against its own bare ``mj_step`` calls; why not, where it cannot be made."""
    try:
        import mujoco

        env: Any = gymnasium.make("Humanoid-v5")
    except Exception as error:  # not installed, or versions that do not fit each other: a peer may be left out
        return f"{type(error).__name__}: {error}".splitlines()[0]
    action = np.zeros(env.action_space.shape, dtype=np.float32)
    resets, raws, wholes = [], [], []
    with mock.patch.object(mujoco, "mj_step", Stopwatch(mujoco.mj_step)) as watch:
        for repeat in range(15):
            resets.append(cpu(lambda repeat=repeat: env.reset(seed=repeat)))  # type: ignore[misc]
            raw, whole = timed_steps(lambda: env.step(action), watch, 20)
            raws += raw
            wholes += whole
    env.close()
    return {**shares_of(raws, wholes), "reset_ms": 1e3 * statistics.median(resets)}


def panda() -> dict[str, float] | str:
    """panda-gym's PandaReach-v3 against its own bare ``stepSimulation`` calls; why not, where it cannot be made."""
    try:
        import panda_gym  # noqa: F401

        env: Any = gymnasium.make("PandaReach-v3")
    except Exception as error:  # not installed, or versions that do not fit each other: a peer may be left out
        return f"{type(error).__name__}: {error}".splitlines()[0]
    env.reset(seed=0)
    action = np.zeros(env.action_space.shape, dtype=np.float32)
    simulation = env.unwrapped.sim
    watch = simulation.step = Stopwatch(simulation.step)
    resets, raws, wholes = [], [], []
    for _ in range(15):
        resets.append(cpu(env.reset))
        raw, whole = timed_steps(lambda: env.step(action), watch, 20)
        raws += raw
        wholes += whole
    env.close()
    return {**shares_of(raws, wholes), "reset_ms": 1e3 * statistics.median(resets)}


def measure(quick: bool) -> dict[str, Any]:
    """Everything."""
    repeats = 5 if quick else 25
    result: dict[str, Any] = {
        "bars": BARS,
        "machine": {
            "load": os.getloadavg()[0],
            "cores": os.cpu_count(),
            "python": platform.python_version(),
            "numpy": np.__version__,
            "gymnasium": gymnasium.__version__,
        },
        "single": {label: against_raw(1, hz, repeats) for label, hz in RATES.items()},
        "sixteen": {label: against_raw(16, hz, max(3, repeats // 3)) for label, hz in RATES.items()},
        "whole_body": {label: against_whole_body(hz, max(3, repeats // 3)) for label, hz in RATES.items()},
        "servo": {str(count): servo_vector(count, repeats) for count in (1, 32, 128, 1024)},
        "disturbed": disturbed_vector(64, 5),
        "workers": {
            f"{count} {physics}": with_workers(count, physics, max(2, os.cpu_count() or 1), max(3, repeats // 5))
            for count, physics in ((16, "bullet"), (32, "bullet"), (1024, "servo"))
        },
        "reset_ms": 1e3 * reset_time(),
        "frame_ms": {"320x240": 1e3 * frame_time(320, 240), "640x480": 1e3 * frame_time(640, 480)},
        "peers": {"Humanoid-v5": humanoid(), "PandaReach-v3": panda()},
    }
    result["servo_times_raw"] = {count: values["times_raw"] for count, values in result["servo"].items()}
    if not quick:
        result["memory_mb"] = memory()
    return result


def table(result: dict[str, Any]) -> str:
    """The figures as a Markdown table with their bars."""
    rows = [("what", "measured", "bar")]
    for label in RATES:
        one, many = (f"{BARS[kind][label]:.2f}" for kind in ("single", "sixteen"))
        rows.append(
            (f"one environment, {label}: share of raw physics", f"{result['single'][label]['share_of_raw']:.3f}", one)
        )
        rows.append(
            (f"16 robots, {label}: share of raw physics", f"{result['sixteen'][label]['share_of_raw']:.3f}", many)
        )
    for label, values in result["whole_body"].items():
        bar = f"{BARS['whole_body_240_hz']}" if label.startswith("240") else ""
        rows.append((f"{label}: times faster than with the whole body", f"{values['times_faster']:.2f}", bar))
        rows.append((f"{label}: arms apart from those of the whole body [rad]", f"{values['apart_rad']:.5f}", ""))
    for count, ratio in sorted(result["servo_times_raw"].items(), key=lambda row: int(row[0])):
        bar = f"{BARS['servo_1024_times_raw']}" if count == "1024" else ""
        rows.append((f"servo model, {count} robots: times raw physics at 240 Hz", f"{ratio:.0f}", bar))
    for label, name in (("whole clips", "whole_clips"), ("uniform starts", "uniform_starts")):
        ratio = f"{result['disturbed'][name]:.1f}"
        what = f"servo model, 64 robots, {label}: cost of a step with disturbances, without is 1"
        rows.append((what, ratio, f"{BARS['disturbed']}"))
    for label, values in result["workers"].items():
        what = f"{label.replace(' ', ' robots, ')}, workers={values['workers']}: times faster than in one process"
        rows.append((what, f"{values['times_faster']:.2f}", ""))
    rows.append(("reset [ms]", f"{result['reset_ms']:.3f}", f"{BARS['reset_ms']}"))
    rows.append(("picture 320x240 [ms]", f"{result['frame_ms']['320x240']:.2f}", f"{BARS['frame_ms']}"))
    rows.append(("picture 640x480 [ms]", f"{result['frame_ms']['640x480']:.2f}", ""))
    memories = {"one_environment": f"{BARS['memory_mb']}", "10000_resets": "0", "200_make_close": "0"}
    for label, bar in memories.items():
        if label in result.get("memory_mb", {}):
            rows.append((f"memory, {label.replace('_', ' ')} [MB]", f"{result['memory_mb'][label]:.1f}", bar))
    for peer, values in result["peers"].items():
        if isinstance(values, dict):
            rows.append((f"{peer}: share of its raw physics", f"{values['share_of_raw']:.3f}", ""))
            rows.append((f"{peer}: reset [ms]", f"{values['reset_ms']:.3f}", ""))
        else:
            rows.append((peer, values, ""))
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    missed = [what for what, measured, bar in rows[1:] if bar and _missed(what, float(measured), float(bar))]
    said = f"Missed: {'; '.join(missed)}." if missed else "No bar is missed."
    return "\n".join([lines[0], "|---|---|---|", *lines[1:], "", said])


def _missed(what: str, measured: float, bar: float) -> bool:
    """Whether a figure is on the wrong side of its bar; of times, costs and memory less is better."""
    less = what.startswith(("reset", "picture", "memory")) or "cost of a step" in what
    return measured > bar if less else measured < bar


def write_page(page: Path, content: str) -> None:
    """Puts table and verdict where the page has those of the run before."""
    text = page.read_text(encoding="utf-8")
    pattern = re.escape(MARKER) + r"\n\n(?:\|[^\n]*\n)+\n[^\n]*\n"
    text, count = re.subn(pattern, lambda _: f"{MARKER}\n\n{content}\n", text)
    if count != 1:
        raise SystemExit(f"{page}: expected one table with its verdict below {MARKER!r}, found {count}")
    write_text(page, text)


def main() -> None:
    """Measures, prints the table, writes the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", help="JSON file for all figures")
    parser.add_argument("--page", type=Path, help="Markdown page whose table is replaced")
    parser.add_argument("--quick", action="store_true", help="few repeats, no memory measurements")
    arguments = parser.parse_args()
    result = measure(arguments.quick)
    content = table(result)
    print(content)
    if arguments.page:
        write_page(arguments.page, content)
    if arguments.out:
        write_json(arguments.out, result)
    else:
        print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
