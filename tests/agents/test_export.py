"""Exports: every agent as a graph equals the agent, in onnxruntime, over time."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from syda_gym.agents.bundle import save_agent
from syda_gym.agents.classical import make_rival
from syda_gym.agents.export import OnnxRunner, export_onnx, parity
from syda_gym.agents.runner import Runner
from syda_gym.agents.streams import play_streams, read_stream
from syda_gym.errors import AgentError, MissingExtraError, StorageError
from tests.agents.test_bundle import deep_stack

pytest.importorskip("onnxruntime", reason="SKIPPED LOUDLY: the extra 'export' is not installed")


def observations(agent, ground, steps=60):
    """What an agent sees in its own episodes, ``(T, B, size)``."""
    streams = ground.record(3, seed=9)
    q = play_streams(agent, streams, ground.rates)
    before = np.concatenate([streams.base[:, :1], q], axis=1)
    still = np.zeros_like(before[:, 0])
    return np.stack([read_stream(ground.interface, streams, t, before[:, t], still).observation for t in range(steps)])


@pytest.mark.parametrize("name", ["base", "lead", "ema_lead", "one_euro", "one_euro_lead", "kalman", "deep"])
def test_a_graph_commands_what_its_agent_commands(name, ground, tmp_path):
    agent = deep_stack(ground.interface) if name == "deep" else make_rival(name, ground.interface)
    runner = OnnxRunner(export_onnx(agent, tmp_path / "agent.onnx"))
    assert parity(agent, runner, observations(agent, ground)) < 1e-4
    assert runner.about["robot"]["name"] == "pepper"


def test_a_graph_takes_any_number_of_robots_and_forgets_on_reset(ground, tmp_path):
    agent = make_rival("kalman", ground.interface)
    runner = OnnxRunner(export_onnx(agent, tmp_path / "agent.onnx"))
    seen = observations(agent, ground, steps=20)
    first = parity(agent, runner, seen)
    assert parity(agent, runner, seen) == first
    assert parity(agent, runner, seen[:, :1]) < 1e-4


def test_the_limits_of_a_graph_are_those_of_the_robot_everywhere(ground, tmp_path):
    interface = ground.interface
    agent = make_rival("lead", interface)
    runner = OnnxRunner(export_onnx(agent, tmp_path / "agent.onnx"))
    rng = np.random.default_rng(0)
    count = 300
    q = interface.robot.clamp(rng.uniform(interface.robot.lower, interface.robot.upper, (count, interface.n)))
    seen = np.zeros((1, count, interface.size))
    seen[0, :, interface.layout["q"]] = q
    seen[0, :, interface.layout["base_error"]] = rng.normal(0, 0.5, q.shape)
    assert parity(agent, runner, seen) < 1e-5


def test_what_cannot_be_exported_says_so(ground, tmp_path):
    with pytest.raises(AgentError, match="'projection' cannot be exported"):
        export_onnx(make_rival("projection", ground.interface), tmp_path / "agent.onnx")
    assert not list(tmp_path.iterdir())


def test_missing_extra_missing_file_and_foreign_file(ground, tmp_path, monkeypatch):
    with pytest.raises(StorageError, match="export an agent first"):
        OnnxRunner(tmp_path / "none.onnx")
    (tmp_path / "bad.onnx").write_bytes(b"no graph")
    with pytest.raises(StorageError, match="no agent exported"):
        OnnxRunner(tmp_path / "bad.onnx")
    path = export_onnx(make_rival("lead", ground.interface), tmp_path / "good.onnx")
    runner = OnnxRunner(path)
    runner.reset(1)
    with pytest.raises(AgentError, match="expected observations"):
        runner.act(np.zeros((2, 5)))
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(MissingExtraError, match="export"):
        export_onnx(make_rival("lead", ground.interface), tmp_path / "x.onnx")
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(MissingExtraError, match="export"):
        OnnxRunner(path)


def test_the_numpy_runner_equals_the_agent_with_its_mapping_and_needs_no_torch(ground, tmp_path):
    from syda_gym.mappings.storage import save_mapping

    agent = make_rival("kalman", ground.interface, process=20.0)
    save_agent(agent, tmp_path / "agent")
    mapping = ground.repertoire.pilot.mapping(("adult", "pepper"))
    save_mapping(mapping, tmp_path / "mapping")
    frames = ground.repertoire.operator_rows[:10]
    runner = Runner.load(tmp_path / "agent", tmp_path / "mapping")
    runner.reset()
    agent.reset(1)
    q = mapping(frames[0])
    for frame in frames:
        observation = np.zeros((1, ground.interface.size))
        observation[0, ground.interface.layout["q"]] = q
        observation[0, ground.interface.layout["base_error"]] = mapping(frame) - q
        observation[0, ground.interface.layout["operator"]] = frame
        assert np.allclose(runner.step(frame, q, age=0.0), agent.act(observation)[0], atol=1e-12)
    code = (
        "import sys; from syda_gym.agents.runner import Runner; "
        f"r = Runner.load({str(tmp_path / 'agent')!r}, {str(tmp_path / 'mapping')!r}); r.reset(); "
        "print('torch' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"


def test_the_numpy_runner_refuses_what_does_not_fit(ground, tmp_path):
    from syda_gym.mappings.fitting import fit
    from syda_gym.mappings.storage import save_mapping

    save_agent(make_rival("lead", ground.interface), tmp_path / "agent")
    pair = ground.repertoire.pilot.motions.pair("pepper", "adult")
    save_mapping(fit(pair, method="ridge"), tmp_path / "back")
    with pytest.raises(AgentError, match="maps onto 'adult'"):
        Runner.load(tmp_path / "agent", tmp_path / "back")
