"""What the tests of agents share: an interface without an environment, and streams made from embedded motions."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.agents.interface import Interface
from syda_gym.agents.streams.streams import Streams
from syda_gym.embodiments import catalog
from syda_gym.motions.synthetic.generator import generate
from syda_gym.simulation.rates import Rates


@pytest.fixture(scope="session")
def rates() -> Rates:
    return Rates(30.0, 60.0)


@pytest.fixture(scope="session")
def interface(rates) -> Interface:
    robot = catalog.get("pepper")
    n = len(robot.joint_names)
    layout = {
        "base_error": slice(0, n),
        "q": slice(n, 2 * n),
        "qd": slice(2 * n, 3 * n),
        "packet_age": slice(3 * n, 3 * n + 1),
    }
    return Interface(robot, layout, 3 * n + 1, rates.dt, rates.lag_share)


def make_streams(variants: int, *, noise: float, latency: int, seed: int, actions=("wave", "reach")) -> Streams:
    """Clips of Pepper as references; the base command is a noisy, late copy."""
    motions = generate(("pepper",), seed=seed, families=actions, variants=variants)
    clips = [take.frames["pepper"] for take in motions.takes]
    steps = max(len(clip) for clip in clips)
    reference = np.stack([np.concatenate([c, np.repeat(c[-1:], steps - len(c), axis=0)]) for c in clips])
    rng = np.random.default_rng(seed)
    error = np.zeros(reference.shape)
    for t in range(1, steps):
        error[:, t] = 0.6 * error[:, t - 1] + 0.8 * rng.normal(0.0, noise, error[:, t].shape)
    late = np.concatenate([np.repeat(reference[:, :1], latency, axis=1), reference], axis=1)[:, :steps]
    age = np.broadcast_to(np.minimum(np.arange(steps), latency) / 30.0, reference.shape[:2]).copy()
    return Streams(late + error, age, reference, np.array([len(c) for c in clips]))


@pytest.fixture(scope="session")
def noisy_streams() -> tuple[Streams, Streams]:
    return make_streams(3, noise=0.04, latency=0, seed=1), make_streams(1, noise=0.04, latency=0, seed=2)


@pytest.fixture(scope="session")
def tiny_options():
    """Options of a cheap environment: few clips, a mapping that is fitted in a moment."""
    motions = generate(("adult", "pepper"), seed=4, actions=("wave_high", "reach_high_front"), variants=2)
    return {
        "motions": motions,
        "mapping": "ridge",
        "route": ("adult", "pepper"),
        "physics": "servo",
        "physics_hz": 60.0,
        "disturbances": "teleop:full:train",
    }


@pytest.fixture(scope="session")
def ground(tiny_options):
    from syda_gym.agents.streams.ground import Ground

    return Ground(tiny_options)
