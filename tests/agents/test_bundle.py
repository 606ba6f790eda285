"""Bundles: what is stored comes back, and what does not belong is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.bundle import load_agent, read_card, save_agent
from syda_gym.agents.classical.rivals import Lead, make_rival
from syda_gym.agents.learned.predictor import Predictor
from syda_gym.agents.learned.tcn import TcnShape
from syda_gym.agents.stacks import build_stack, stack_spec
from syda_gym.agents.streams.streams import play_streams
from syda_gym.embodiments import catalog
from syda_gym.errors import AgentError, StorageError
from tests.agents.residual.test_residual import random_policy


def deep_stack(interface):
    """A learned agent on a learned agent on filters."""
    n = interface.n
    rng = np.random.default_rng(0)
    shapes = TcnShape(4 * n + 1, 8, n).shapes()
    weights = {name: rng.normal(0, 0.1, size).astype(np.float32) for name, size in shapes.items()}
    kalman = make_rival("kalman", interface, process=7.0).base
    predictor = Predictor(interface, kalman, weights=weights, channels=8)
    return random_policy(interface, Lead(interface, predictor, strength=0.8), size=0.05)


@pytest.fixture
def stored(ground, tmp_path):
    agent = deep_stack(ground.interface)
    save_agent(agent, tmp_path / "deep", mapping={"method": "ridge"}, training={"seed": 3}, figures={"J": 1.5})
    return agent, tmp_path / "deep"


def test_a_loaded_agent_acts_bit_for_bit_as_the_stored_one(stored, ground):
    agent, path = stored
    loaded = load_agent(path, ground.interface)
    streams = ground.record(3, seed=8)
    assert loaded.stack == ("base", "kalman", "predictor", "lead", "residual")
    assert np.array_equal(play_streams(loaded, streams, ground.rates), play_streams(agent, streams, ground.rates))


def test_the_card_says_where_the_agent_comes_from(stored):
    card = read_card(stored[1].with_suffix(".json"))
    assert card["mapping"] == {"method": "ridge"}
    assert card["training"] == {"seed": 3}
    assert "numpy" in card["versions"]
    assert card["interface"]["robot"]["name"] == "pepper"


def test_an_agent_for_another_robot_layout_or_rate_is_refused(stored, ground):
    _, path = stored
    with pytest.raises(AgentError, match="made for robot 'pepper'"):
        load_agent(path, replace(ground.interface, robot=catalog.get("nao")))
    with pytest.raises(AgentError, match="dt="):
        load_agent(path, replace(ground.interface, dt=1 / 60))
    layout = dict(ground.interface.layout) | {"operator": slice(0, 12)}
    with pytest.raises(AgentError, match="'operator'"):
        load_agent(path, replace(ground.interface, layout=layout))


def test_damaged_and_foreign_files_are_refused(stored, ground):
    _, path = stored
    card_path, weights = path.with_suffix(".json"), path.with_suffix(".safetensors")
    card = json.loads(card_path.read_text())
    good = weights.read_bytes()
    weights.write_bytes(good[: len(good) // 2])
    with pytest.raises(StorageError, match="corrupt"):
        load_agent(path, ground.interface)
    weights.write_bytes(good[:-4] + b"\0\0\0\0")
    with pytest.raises(StorageError, match="do not belong together"):
        load_agent(path, ground.interface)
    weights.unlink()
    with pytest.raises(StorageError, match="side by side"):
        load_agent(path, ground.interface)
    weights.write_bytes(good)
    card_path.write_text(json.dumps({**card, "format": 99}))
    with pytest.raises(StorageError, match="format 99"):
        load_agent(path, ground.interface)
    card_path.write_text(json.dumps({**card, "stack": [{"agent": "bas"}]}))
    with pytest.raises(AgentError, match="did you mean 'base'"):
        load_agent(path, ground.interface)
    card_path.write_text("{")
    with pytest.raises(StorageError, match="not valid JSON"):
        load_agent(path, ground.interface)


@pytest.mark.parametrize(
    "change",
    [
        {"stack": [None]},
        {"stack": [{"agent": "base", "settings": 1.5}]},
        {"interface": {"robot": "pepper"}},
    ],
)
def test_a_card_with_values_of_other_kinds_is_refused(stored, ground, change):
    path = stored[1].with_suffix(".json")
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(StorageError, match=r"deep\.json is damaged"):
        load_agent(path, ground.interface)


def test_an_interrupted_write_leaves_the_earlier_bundle_intact(stored, ground, monkeypatch):
    _, path = stored
    before = {suffix: path.with_suffix(suffix).read_bytes() for suffix in (".json", ".safetensors")}

    def broken(*args, **kwargs):
        raise OSError("disk full")

    monkeypatch.setattr("safetensors.numpy.save_file", broken)
    with pytest.raises(StorageError, match="disk full"):
        save_agent(make_rival("lead", ground.interface), path)
    assert {suffix: path.with_suffix(suffix).read_bytes() for suffix in before} == before
    assert sorted(p.name for p in path.parent.iterdir()) == ["deep.json", "deep.safetensors"]


def test_stacks_are_plain_data(ground):
    agent = make_rival("one_euro_lead", ground.interface, beta=3.0)
    spec = json.loads(json.dumps(stack_spec(agent)))
    assert stack_spec(build_stack(ground.interface, spec)) == spec
    with pytest.raises(AgentError, match="begins with 'base'"):
        build_stack(ground.interface, spec[1:])
    with pytest.raises(AgentError, match="belong to no agent"):
        build_stack(ground.interface, [{"agent": "base"}], {"0.mean": np.zeros(3)})
    with pytest.raises(AgentError, match="empty"):
        build_stack(ground.interface, [])


def test_base_alone_survives_without_weights(ground, tmp_path):
    save_agent(BaseAlone(ground.interface), tmp_path / "base")
    assert load_agent(tmp_path / "base.json", ground.interface).stack == ("base",)
