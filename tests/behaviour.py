"""Samples of what the package computes, by name, so that moving code about can be shown to change no bit of it.

    python -m tests.behaviour --write      records today's values in tests/behaviour.json

Only public entry points are used here, since they are what survives a move. A change that means to change numbers
records them anew, and its commit says which and why.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch

import syda_gym

RECORDED = Path(__file__).with_name("behaviour.json")
METHODS = (
    ("syda", "paper"),
    ("syda", "general"),
    ("syda", "synergies"),
    ("direct", None),
    ("ridge", None),
    ("kernel_ridge", None),
    ("nearest", None),
    ("geometric", None),
)


def machine() -> str:
    """What last bits may depend on: versions, threads, and the processor whose kernels numpy and torch pick."""
    cpu = Path("/proc/cpuinfo")
    flags = (
        next((line for line in cpu.read_text().splitlines() if line.startswith("flags")), "") if cpu.is_file() else ""
    )
    words = (platform.machine(), flags, np.__version__, torch.__version__)
    return hashlib.sha256(repr(words).encode()).hexdigest()[:16]


def embedded_motions() -> list[np.ndarray]:
    """Every frame of the embedded motions."""
    motions = syda_gym.load_motions("embedded")
    return [take.frames[body] for take in motions.takes for body in sorted(take.frames)]


def fitted(method: str, preset: str | None) -> Callable[[], list[np.ndarray]]:
    """Held-out frames through a mapping fitted on four actions, and back where it can."""

    def outputs() -> list[np.ndarray]:
        torch.set_num_threads(1)
        pair = syda_gym.load_motions("embedded", fps=5).pair("adult", "pepper")
        actions = sorted(set(pair.actions))
        train = pair.without_actions(actions[4:])
        test = pair.without_actions(actions[:40])
        mapping = syda_gym.fit(train, method=method, preset=preset, seed=0)
        found = [mapping(test.source)]
        with contextlib.suppress(syda_gym.SydaError):
            found.append(mapping.inverse()(test.target))
        return found

    return outputs


def episode(**options: Any) -> Callable[[], list[np.ndarray]]:
    """Observations and rewards of 120 steps under seeded actions."""

    def trajectory() -> list[np.ndarray]:
        env = gym.make("SydaTeleop-v0", **options)
        rng = np.random.default_rng(5)
        seen = [env.reset(seed=3)[0]]
        rewards = []
        for _ in range(120):
            low, high = env.action_space.low, env.action_space.high
            observation, reward, terminated, truncated, _ = env.step(
                rng.uniform(0.3 * low, 0.3 * high).astype(np.float32)
            )
            seen.append(observation)
            rewards.append(reward)
            if terminated or truncated:
                seen.append(env.reset(seed=4)[0])
        env.close()
        return [np.array(seen), np.array(rewards)]

    return trajectory


def fleet() -> list[np.ndarray]:
    """Sixteen disturbed robots of the servo model in one vector environment."""
    envs = gym.make_vec("SydaTeleop-v0", num_envs=16, physics="servo", disturbances="teleop", history=3)
    rng = np.random.default_rng(6)
    seen = [envs.reset(seed=3)[0]]
    for _ in range(60):
        observation, reward, *_ = envs.step(rng.uniform(-0.1, 0.1, envs.action_space.shape).astype(np.float32))
        seen += [observation, reward]
    envs.close()
    return seen


def agents() -> list[np.ndarray]:
    """Every shipped agent of one route on the same recorded streams: the commands that it gives."""
    from syda_gym.agents.bundle import load_agent
    from syda_gym.agents.streams.ground import Ground
    from syda_gym.agents.streams.streams import play_streams
    from syda_gym.files import asset

    ground = Ground({"disturbances": "teleop", "clips": [0, 7, 20], "route": ("adult", "pepper")})
    streams = ground.record(3, seed=8)
    paths = sorted(asset("agents").glob("adult-pepper-*.json"))
    return [np.asarray(play_streams(load_agent(path, ground.interface), streams, ground.rates)) for path in paths]


def transferabilities() -> list[np.ndarray]:
    """The paper's pairs, in both definitions."""
    pairs = (("adult", "pepper"), ("kid", "pepper"), ("pepper", "kid"), ("pepper", "adult"))
    found = [
        [syda_gym.transferability(a, b, definition=definition).T for a, b in pairs]
        for definition in ("paper", "general")
    ]
    return [np.array(found)]


SAMPLES: dict[str, Callable[[], list[np.ndarray]]] = {
    "embedded motions": embedded_motions,
    **{f"mapping {method}:{preset or 'default'}": fitted(method, preset) for method, preset in METHODS},
    "environment bullet": episode(),
    "environment bullet disturbed": episode(disturbances="teleop", start="uniform", preview=2),
    "environment bullet contacts": episode(self_collision=True, route=("adult", "kid", "pepper")),
    "environment servo position": episode(physics="servo", action_mode="position", reference="mapped"),
    "environment vector servo": fleet,
    "shipped agents": agents,
    "transferability": transferabilities,
}


def digest(arrays: list[np.ndarray]) -> dict[str, Any]:
    """A hash of every bit, and sums that stay comparable where the last bits differ."""
    hashed = hashlib.sha256()
    for array in arrays:
        hashed.update(repr((array.shape, str(array.dtype))).encode())
        hashed.update(np.ascontiguousarray(array).tobytes())
    flat = np.concatenate([np.asarray(array, dtype=np.float64).ravel() for array in arrays])
    return {
        "sha256": hashed.hexdigest(),
        "count": int(flat.size),
        "mean": float(flat.mean()),
    }


def main() -> None:
    """Records today's values, of all samples or of those named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("names", nargs="*", metavar="NAME")
    given = parser.parse_args()
    recorded = json.loads(RECORDED.read_text()) if RECORDED.is_file() else {"machine": machine(), "samples": {}}
    for name in given.names or SAMPLES:
        found = digest(SAMPLES[name]())
        same = recorded["samples"].get(name) == found
        print(f"{'same' if same else 'CHANGED'}  {name}  {found['sha256'][:12]}", flush=True)
        recorded["samples"][name] = found
    if given.write:
        RECORDED.write_text(json.dumps({**recorded, "machine": machine()}, indent=1) + "\n")


if __name__ == "__main__":
    main()
