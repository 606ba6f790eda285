"""The commands' functions, and the commands themselves as a user types them."""

from __future__ import annotations

from dataclasses import fields
from inspect import signature

import pytest
from typer.testing import CliRunner

from syda_gym.agents.deployment.numpy_runner import find_mapping
from syda_gym.agents.predictor.predictor_training import PredictorConfig
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.work import compare_agents, export_bundle, find_agent, shipped_agents, train_agent, tune_rivals
from syda_gym.cli.main import agents as cli_agents
from syda_gym.cli.main import app
from syda_gym.errors import AgentError

TINY = {"steps": 512, "robots": 8, "rollout": 32, "batch": 64, "epochs": 1, "legs": 1, "episodes": 4}


@pytest.fixture(scope="module")
def trained(tiny_options, tmp_path_factory):
    folder = tmp_path_factory.mktemp("agent")
    report = train_agent(tiny_options, folder, config=ResidualConfig(**TINY, validation_episodes=2), base="lead")
    return folder, report


def test_training_stores_a_bundle_with_logs_and_the_base_beside_the_policy(trained):
    folder, report = trained
    assert report.bundle.is_file()
    assert report.agent.stack == ("base", "lead", "residual")
    assert len(report.history) == 2
    assert report.history[0][1] == report.history[0][2]  # untrained equals what it stands on
    header = (folder / "progress.csv").read_text().splitlines()[0]
    assert "validation/policy_J" in header
    assert "validation/base_J" in header
    assert (folder / "checkpoint.safetensors").is_file()
    assert list(folder.glob("events.out.tfevents*"))


def test_a_bundle_is_found_compared_and_exported(trained, tiny_options, tmp_path):
    pytest.importorskip("onnxruntime")
    folder, _ = trained
    results = compare_agents({**tiny_options, "physics": "servo"}, [folder / "agent", "lead"], clips=[0])
    assert list(results) == ["base", str(folder / "agent"), "lead"]
    assert find_mapping(folder / "agent").route == ("adult", "pepper")
    assert export_bundle(folder / "agent", tmp_path / "agent.onnx") < 1e-6  # with the mapping and its kinematics
    assert (tmp_path / "agent.onnx.json").is_file()


def test_a_predictor_trains_by_the_same_function(tiny_options, tmp_path, monkeypatch):
    from syda_gym.agents.streams.ground import Ground

    record = Ground.record
    monkeypatch.setattr(Ground, "record", lambda self, episodes=None, **given: record(self, 4, **given))
    config = PredictorConfig(iterations=2, rounds=1, batch=4, channels=8)
    report = train_agent(tiny_options, tmp_path, config=config, base="base")
    assert report.agent.stack == ("base", "predictor", "lead")


def test_rivals_are_tuned_on_an_environment(tiny_options):
    options = {**tiny_options, "disturbances": None, "reference": "mapped"}
    tuned = tune_rivals(options, ["base", "lead"], episodes=2, budget=6)
    assert tuned["lead"].tuned.figures.objective < tuned["base"].tuned.figures.objective


def test_unknown_agents_and_shipped_ones(ground):
    with pytest.raises(AgentError, match="did you mean 'kalman'"):
        find_agent("kalmann", ground.interface)
    for name in shipped_agents():
        assert find_agent(name, ground.interface).stack[0] == "base"


def test_the_commands_say_what_they_did_and_errors_in_one_line(trained, tmp_path):
    folder, _ = trained
    runner = CliRunner()
    done = runner.invoke(app, ["export", str(folder / "agent"), "--out", str(tmp_path / "a.onnx"), "--agent-only"])
    assert done.exit_code == 0, done.output
    assert "largest difference" in done.output
    for command in ("train", "evaluate", "play", "export"):
        assert runner.invoke(app, [command, "--help"]).exit_code == 0
    wrong = runner.invoke(app, ["train", "--kind", "resdual"])
    assert "did you mean 'residual'" in wrong.output


@pytest.mark.parametrize("command", [cli_agents.train, cli_agents.evaluate, cli_agents.play])
def test_every_command_takes_the_options_of_a_scene(command):
    parameters = signature(command).parameters
    scene = {field.name: field.default for field in fields(cli_agents.Scene)}
    assert {name: parameters[name].default for name in scene} == scene
    assert "scene" not in parameters


def test_held_out_actions_are_kept_out_of_training_and_played_otherwise():
    scene = cli_agents.Scene(held_out=["wave_high"], route="adult>kid>pepper")
    assert scene.options()["actions"] == ("wave_high",)
    assert scene.options()["route"] == ("adult", "kid", "pepper")
    training = scene.options(training=True)
    assert training["held_out"] == ("wave_high",)
    assert "wave_high" not in training["actions"]
    assert len(training["actions"]) > 10
