"""Graphs of mappings: every kind equals the mapping itself, frame by frame, also where limits forbid the pose."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from syda_gym.agents.graphs.arithmetic import angle_of, cosine, wrapped
from syda_gym.agents.graphs.limits import robot_clamp
from syda_gym.agents.graphs.mapping import MappingGraph
from syda_gym.embodiments import catalog
from syda_gym.errors import AgentError
from syda_gym.files import asset
from syda_gym.mappings.fitting.fit import fit
from syda_gym.mappings.storage import load_mapping
from syda_gym.mappings.stream import FrameStream
from syda_gym.motions.synthetic.generator import generate

KINDS = {
    "general": ("syda", "general", {"confidence": False}),
    "synergies": ("syda", "synergies", {"epochs": 2, "confidence": False}),
    "accurate": ("syda", "accurate", {"confidence": False}),
    "interpolation": ("syda", "interpolation", {"epochs": 2, "confidence": False}),
    "paper": ("syda", "paper", {"epochs": 2}),
    "direct": ("direct", "general", {"epochs": 2, "confidence": False}),
    "direct paper": ("direct", "paper", {"epochs": 2}),
    "ridge": ("ridge", "general", {"confidence": False}),
    "kernel ridge": ("kernel_ridge", "general", {"confidence": False}),
    "nearest": ("nearest", "general", {"confidence": False, "neighbours": 3}),
    "geometric": ("geometric", "procrustes", {"confidence": False}),
}


@pytest.fixture(scope="module")
def motions():
    return generate(("adult", "kid", "pepper"), seed=4, actions=("wave_high", "cross_chest", "reach_high_front"))


def worst(mapping, frames) -> float:
    """Largest difference between graph and mapping, over sequences of five frames that the graph takes side by side."""
    clips = frames.reshape(-1, 5, frames.shape[1])
    expected = []
    for clip in clips:
        stream = FrameStream(mapping, 10.0)
        expected.append([stream(frame) for frame in clip])
    graph = MappingGraph(mapping, 0.1)
    state, found = torch.zeros(len(clips), graph.state_size, dtype=torch.float64), []
    for index in range(5):
        fresh = torch.full((len(clips), 1), float(index == 0), dtype=torch.float64)
        mapped, state = graph(torch.as_tensor(clips[:, index]), state, fresh)
        found.append(mapped.numpy())
    return float(np.abs(np.stack(found, axis=1) - np.array(expected)).max())


def odd(frames, count=40, size=0.05):
    """Frames with noise that drives the arms into their limits and past each other."""
    rows = np.linspace(0, len(frames) - 1, count).astype(int)
    return frames[rows] + np.random.default_rng(0).normal(0.0, size, (count, frames.shape[1]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_graph_equals_its_mapping(kind, motions):
    method, preset, options = KINDS[kind]
    pair = motions.pair("adult", "pepper")
    assert worst(fit(pair, method, preset, **options), odd(pair.source)) < 1e-9


@pytest.mark.parametrize("route", ["adult-kid-pepper", "pepper-adult", "nao-pepper-nao-kid"])
def test_chains_and_ways_back_are_graphs_too(route):
    bodies = route.split("-")
    links = [load_mapping(asset("mappings", f"{a}-{b}")) for a, b in zip(bodies[:-1], bodies[1:], strict=True)]
    mapping = links[0]
    for link in links[1:]:
        mapping = mapping >> link
    body = mapping.source
    frames = np.repeat((body.standing() if body.kind == "human" else body.rest)[None], 40, axis=0)
    assert worst(mapping, odd(frames, size=0.15)) < 1e-9


def test_a_wide_pose_that_no_solution_reaches_takes_the_loop_and_agrees():
    mapping = load_mapping(asset("mappings", "adult-pepper"))
    frames = odd(np.repeat(mapping.source.standing()[None], 200, axis=0), count=200, size=0.3)
    assert worst(mapping, frames) < 1e-9


def test_what_has_no_graph_says_which_have(motions):
    pair = motions.pair("adult", "pepper")
    mapping = fit(pair, "ridge", confidence=False)

    class Strange(type(mapping.regressor)):
        kind = "strange"

    mapping.regressor.__class__ = Strange
    with pytest.raises(AgentError, match=r"'strange' model.*ridge, kernel_ridge"):
        MappingGraph(mapping, 0.1)

    class Other(type(mapping.target_coder)):
        kind = "other"

    mapping.target_coder.__class__ = Other
    mapping.regressor.__class__ = Strange.__bases__[0]
    with pytest.raises(AgentError, match=r"code 'other' of 'pepper'.*quaternions, human_arms"):
        MappingGraph(mapping, 0.1)


def test_angles_are_exact_everywhere():
    angles = np.concatenate([np.linspace(-np.pi, np.pi, 2001), [0.0, np.pi / 2, -np.pi / 2, np.pi]])
    y, x = 3.0 * np.sin(angles), 3.0 * np.cos(angles)
    found = angle_of(torch.as_tensor(y), torch.as_tensor(x)).numpy()
    assert np.abs(found - np.arctan2(y, x)).max() < 1e-15
    assert angle_of(torch.zeros(1, dtype=torch.float64), torch.zeros(1, dtype=torch.float64)).item() == 0.0
    assert np.abs(cosine(torch.as_tensor(angles)).numpy() - np.cos(angles)).max() < 1e-15
    turned = wrapped(torch.as_tensor(angles + 4.0 * np.pi), torch.zeros(1, dtype=torch.float64)).numpy()
    assert np.abs(np.exp(1j * turned) - np.exp(1j * angles)).max() < 1e-14
    assert np.abs(turned).max() <= np.pi + 1e-12


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_limits_are_those_of_the_robot_coupled_ones_included(name):
    robot = catalog.get(name)
    rng = np.random.default_rng(0)
    poses = rng.uniform(robot.lower - 0.5, robot.upper + 0.5, (500, len(robot.lower)))
    assert np.abs(robot_clamp(robot)(torch.as_tensor(poses)).numpy() - robot.clamp(poses)).max() < 1e-14
