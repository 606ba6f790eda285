"""Exports: every agent as a graph equals the agent, in onnxruntime, over time."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from syda_gym.agents.bundle import save_agent
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.deployment.export import agent_parity, card_path, export_onnx, runner_parity
from syda_gym.agents.deployment.numpy_runner import Runner, find_mapping
from syda_gym.agents.deployment.onnx_runners import OnnxAgent, OnnxRunner
from syda_gym.agents.stacks import stack_spec
from syda_gym.agents.streams.streams import play_streams, read_stream
from syda_gym.errors import AgentError, MissingExtraError, StorageError
from syda_gym.files import asset, read_json
from tests.agents.residual.test_residual import random_policy
from tests.agents.test_bundle import deep_stack

pytest.importorskip("onnxruntime", reason="SKIPPED LOUDLY: the extra 'export' is not installed")


def observations(agent, ground, steps=60):
    """What an agent sees in its own episodes, ``(T, B, size)``."""
    streams = ground.record(3, seed=9)
    q = play_streams(agent, streams, ground.rates)
    before = np.concatenate([streams.base[:, :1], q], axis=1)
    still = np.zeros_like(before[:, 0])
    return np.stack([read_stream(ground.interface, streams, t, before[:, t], still).observation for t in range(steps)])


@pytest.mark.parametrize(
    "name", ["base", "lead", "ema_lead", "one_euro", "one_euro_lead", "kalman", "deep", "each arm"]
)
def test_a_graph_commands_what_its_agent_commands(name, ground, tmp_path):
    if name == "each arm":
        agent = random_policy(ground.interface, make_rival("kalman", ground.interface), size=0.3, each_arm=True)
    else:
        agent = deep_stack(ground.interface) if name == "deep" else make_rival(name, ground.interface)
    exported = OnnxAgent(export_onnx(agent, tmp_path / "agent.onnx"))
    assert agent_parity(agent, exported, observations(agent, ground)) < 1e-9
    assert exported.about["interface"]["robot"]["name"] == "pepper"


def test_a_graph_takes_any_number_of_robots_and_forgets_on_reset(ground, tmp_path):
    agent = make_rival("kalman", ground.interface)
    exported = OnnxAgent(export_onnx(agent, tmp_path / "agent.onnx"))
    seen = observations(agent, ground, steps=20)
    first = agent_parity(agent, exported, seen)
    assert agent_parity(agent, exported, seen) == first
    assert agent_parity(agent, exported, seen[:, :1]) < 1e-9


def test_the_limits_of_a_graph_are_those_of_the_robot_everywhere(ground, tmp_path):
    interface = ground.interface
    agent = make_rival("lead", interface)
    exported = OnnxAgent(export_onnx(agent, tmp_path / "agent.onnx"))
    rng = np.random.default_rng(0)
    count = 300
    q = interface.robot.clamp(rng.uniform(interface.robot.lower, interface.robot.upper, (count, interface.n)))
    seen = np.zeros((1, count, interface.size))
    seen[0, :, interface.layout["q"]] = q
    seen[0, :, interface.layout["base_error"]] = rng.normal(0, 0.5, q.shape)
    assert agent_parity(agent, exported, seen) < 1e-9


@pytest.fixture(scope="module")
def whole(ground, tmp_path_factory):
    """Agent, mapping and their graph: a stack with every kind of memory, a mapping that is cheap to write."""
    from syda_gym.mappings.fitting.fit import fit

    agent = deep_stack(ground.interface)
    mapping = fit(ground.repertoire.pilot.motions.pair("adult", "pepper"), "syda", "paper", epochs=2)
    return agent, mapping, export_onnx(agent, tmp_path_factory.mktemp("whole") / "agent.onnx", mapping)


def test_mapping_and_agent_are_one_graph_that_equals_the_runner_over_a_clip(ground, whole):
    agent, mapping, path = whole
    exported = OnnxRunner(path)
    entry = ground.repertoire.clips[0]
    frames = ground.repertoire.operator_rows[entry.first : entry.first + entry.length]
    ages = np.random.default_rng(0).integers(0, 4, len(frames)) * ground.interface.dt
    runner = Runner(agent, mapping)
    assert runner_parity(runner, exported, frames, ages) < 1e-9
    jumping = frames[np.random.default_rng(1).permutation(len(frames))]  # faster than the joints can follow
    assert runner_parity(runner, exported, jumping) < 1e-9


def test_the_card_says_what_goes_in_and_out(ground, whole):
    agent, _, path = whole
    card = read_json(card_path(path))
    assert card == OnnxRunner(path).about
    inputs = {port["name"]: port for port in card["inputs"]}
    assert list(inputs) == ["frame", "q", "qd", "age", "state", "fresh"]
    assert inputs["frame"]["shape"] == ["robots", 18]
    assert inputs["frame"]["unit"] == "m"
    assert inputs["frame"]["columns"][0] == "LShoulder.x"
    assert inputs["q"]["columns"] == list(ground.interface.robot.joint_names)
    assert [port["name"] for port in card["outputs"]] == ["command", "base", "next_state"]
    assert card["mapping"]["route"] == ["adult", "pepper"]
    assert card["stack"] == stack_spec(agent)
    with pytest.raises(StorageError, match="use OnnxRunner"):
        OnnxAgent(path)


def test_what_cannot_be_exported_says_so(ground, tmp_path):
    with pytest.raises(AgentError, match="'projection' cannot be exported"):
        export_onnx(make_rival("projection", ground.interface), tmp_path / "agent.onnx")
    assert not list(tmp_path.iterdir())


def test_missing_extra_missing_file_and_foreign_file(ground, tmp_path, monkeypatch):
    with pytest.raises(StorageError, match="export an agent first"):
        OnnxAgent(tmp_path / "none.onnx")
    (tmp_path / "bad.onnx").write_bytes(b"no graph")
    with pytest.raises(StorageError, match="no agent exported"):
        OnnxRunner(tmp_path / "bad.onnx")
    path = export_onnx(make_rival("lead", ground.interface), tmp_path / "good.onnx")
    with pytest.raises(StorageError, match="use OnnxAgent"):
        OnnxRunner(path)
    exported = OnnxAgent(path)
    exported.reset(1)
    with pytest.raises(AgentError, match="expected observation"):
        exported.act(np.zeros((2, 5)))
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(MissingExtraError, match="export"):
        export_onnx(make_rival("lead", ground.interface), tmp_path / "x.onnx")
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(MissingExtraError, match="export"):
        OnnxAgent(path)


def test_the_numpy_runner_equals_the_agent_with_its_mapping_and_needs_no_torch(ground, tmp_path):
    from syda_gym.mappings.storage import save_mapping

    agent = make_rival("kalman", ground.interface, process=20.0)
    save_agent(agent, tmp_path / "agent")
    mapping = ground.repertoire.pilot.mapping(("adult", "pepper"))
    save_mapping(mapping, tmp_path / "mapping")
    frames = ground.repertoire.operator_rows[:40:4]  # four times as fast, so that the speed limits matter
    base = mapping.sequence(frames, 1.0 / ground.interface.dt)
    runner = Runner.load(tmp_path / "agent")  # finds the mapping beside it
    runner.reset()
    agent.reset(1)
    q = mapping(frames[0])
    for frame, wanted in zip(frames, base, strict=True):
        observation = np.zeros((1, ground.interface.size))
        observation[0, ground.interface.layout["q"]] = q
        observation[0, ground.interface.layout["base_error"]] = wanted - q
        observation[0, ground.interface.layout["operator"]] = frame
        assert np.allclose(runner.step(frame, q, age=0.0), agent.act(observation)[0], atol=1e-9)
    code = (
        "import sys; sys.modules['torch'] = None; import numpy as np\n"
        "from syda_gym.agents.deployment.numpy_runner import Runner\n"
        f"for path in ({str(tmp_path / 'agent')!r}, 'adult-pepper-full'):\n"
        "    r = Runner.load(path); r.reset(); q = r.mapping.target.rest\n"
        "    for _ in range(3): q = r.step(r.mapping.source.standing(), q)\n"
        "assert np.isfinite(q).all(); print(sys.modules['torch'])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "None"


def test_the_mapping_of_a_bundle_is_found_or_asked_for(ground, tmp_path):
    assert find_mapping(asset("agents", "adult-kid-pepper-full")).route == ("adult", "kid", "pepper")
    save_agent(make_rival("lead", ground.interface), tmp_path / "agent", mapping={"route": ["adult", "pepper"]})
    with pytest.raises(AgentError, match="name the stored one"):
        find_mapping(tmp_path / "agent")


def test_the_numpy_runner_refuses_what_does_not_fit(ground, tmp_path):
    from syda_gym.mappings.fitting.fit import fit
    from syda_gym.mappings.storage import save_mapping

    save_agent(make_rival("lead", ground.interface), tmp_path / "agent")
    pair = ground.repertoire.pilot.motions.pair("pepper", "adult")
    save_mapping(fit(pair, method="ridge"), tmp_path / "back")
    with pytest.raises(AgentError, match="maps onto 'adult'"):
        Runner.load(tmp_path / "agent", tmp_path / "back")
