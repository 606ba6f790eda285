"""Episodes: figures that can be computed by hand, the same seed the same bits, and the demo end to end."""

from __future__ import annotations

import json

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import landmark_error
from syda_gym.errors import OptionError, StorageError
from syda_gym.evaluation.chains import Links
from syda_gym.evaluation.demo.run import base_alone, run_demo
from syda_gym.evaluation.episodes import figures_of, latency, make_env, play, play_all


@pytest.fixture(scope="module")
def mapping(small_motions):
    held_out = small_motions.takes[0].action
    links = Links(small_motions, "ridge", groups=[(held_out,)])
    return links.chain(("adult", "kid", "pepper"), (held_out,)), held_out


@pytest.fixture
def env(mapping, small_motions):
    made = make_env(mapping[0], small_motions, [mapping[1]], physics="servo")
    yield made
    made.close()


def test_figures_follow_from_the_recording(env, mapping):
    recording = play(env, base_alone(env), 0, seed=3)
    figures = figures_of(recording, env.robot, mapping[0])
    assert recording.route == ("adult", "kid", "pepper")
    errors = landmark_error(env.robot, recording.q, recording.reference)
    assert np.allclose(errors, recording.landmark_error)
    assert figures.landmark_error == pytest.approx(errors.mean())
    assert figures.joint_error == pytest.approx(np.abs(recording.q - recording.reference).mean())
    # The base command is the mapping of what the operator was seen to do; observations are float32.
    assert np.allclose(recording.base, mapping[0](recording.operator), atol=2e-3)
    assert figures.mapping_error == pytest.approx(
        landmark_error(env.robot, recording.base, recording.reference).mean(), abs=1e-9
    )
    assert figures.success == (figures.landmark_error <= 0.036)  # the family's
    assert figures.frames == len(recording) == len(recording.reward)
    assert figures.limit_violations == env.robot.violations(mapping[0].raw(recording.operator), 1e-6).mean()


def test_speed_violations_count_commands_beyond_the_limit(env, mapping):
    from dataclasses import replace

    recording = play(env, base_alone(env), 0)
    still = replace(recording, command=np.repeat(recording.command[:1], len(recording), axis=0))
    assert figures_of(still, env.robot, mapping[0]).speed_violations == 0.0
    jump = still.command.copy()
    jump[5:, 0] += env.robot.speed[0] / recording.fps * 1.01
    counted = figures_of(replace(still, command=jump), env.robot, mapping[0]).speed_violations
    assert counted == pytest.approx(1.0 / ((len(recording) - 1) * jump.shape[1]))


def test_the_same_seed_gives_the_same_bits_whatever_was_played_before(mapping, small_motions):
    options = {"physics": "servo", "disturbances": "teleop:full:test"}
    first = make_env(mapping[0], small_motions, [mapping[1]], **options)
    second = make_env(mapping[0], small_motions, [mapping[1]], **options)
    everything = list(play_all(first, base_alone(first), seed=7))
    again = list(play_all(second, base_alone(second), seed=7))
    assert len(everything) == len(first.clip_names)
    for one, other in zip(everything, again, strict=True):
        assert np.array_equal(one.q, other.q)
    other = next(iter(play_all(second, base_alone(second), seed=8)))
    assert not np.array_equal(other.q, everything[0].q)


def test_a_chain_that_ends_in_a_human_has_no_episodes(small_motions):
    chain = Links(small_motions, "ridge").chain(("pepper", "adult"))
    with pytest.raises(OptionError, match="need a robot"):
        make_env(chain, small_motions)


def test_latency_is_a_positive_time(env, mapping):
    recording = play(env, base_alone(env), 0)
    assert 1e-6 < latency(mapping[0], None, recording.operator) < 1.0


@pytest.fixture(scope="module")
def three_actions(small_motions):
    from dataclasses import replace

    kept = sorted({take.action for take in small_motions.takes})[:3]
    return replace(small_motions, takes=tuple(take for take in small_motions.takes if take.action in kept))


def _refuse(word: str) -> None:
    raise AssertionError(f"{word} is not JSON")


def test_the_demo_runs_end_to_end(three_actions, tmp_path):
    stages: list[str] = []
    result = run_demo(
        three_actions,
        tmp_path,
        residual=False,
        progress=lambda stage, done: stages.append(stage) if done == 1.0 else None,
        command="syda-gym demo",
    )
    assert list(dict.fromkeys(stages)) == ["load", "transferability", "fit", "play", "report"]
    assert [chain.name for chain in result.chains] == ["adult>kid>pepper"]
    assert result.chosen.bodies == ("adult", "kid", "pepper")
    assert result.direct is not None
    assert result.direct.name == "adult>pepper"
    assert [one.name for one in result.baselines] == ["unfitted", "ridge (adult>kid>pepper)", "mean pose"]
    mean_pose = result.baselines[-1].figure("mapping_error").value
    assert mean_pose > 1.5 * result.chains[0].figure("mapping_error").value
    assert result.expected[0].error == pytest.approx(result.chains[0].figure("mapping_error").value, rel=0.8)
    actions = {take.action for take in three_actions.takes}
    for chain in result.chains:
        assert {episode.action for episode in chain.episodes} == actions  # every action was left out once
        assert 0.01 < chain.figure("landmark_error").value < 0.3
    files = {"report.html", "results.json", "landmarks.svg", "joints.svg", "side_by_side.png", "chains.mp4"}
    assert files == {path.name for path in tmp_path.iterdir()}
    stored = json.loads((tmp_path / "results.json").read_text(), parse_constant=_refuse)
    assert stored["baselines"]["mean pose"]["left_out"]["bound"] == "the mapping promises no error bound"
    assert "bound" not in stored["baselines"]["mean pose"]["episodes"][0]
    assert (
        stored["chains"]["adult>kid>pepper"]["landmark_error"]["value"]
        == result.chains[0].figure("landmark_error").value
    )
    page = result.report.read_text()
    for word in (
        "adult &gt; kid &gt; pepper",
        "What this shows",
        "What to do next with your robot",
        "video/mp4",
        "syda-gym demo",
    ):
        assert word in page, word


def test_the_short_residual_begins_as_the_base_and_is_stored(three_actions, tmp_path):
    from syda_gym.agents.residual.config import ResidualConfig
    from syda_gym.evaluation.demo.residual import train_and_compare

    held_out = (three_actions.takes[0].action,)
    links = Links(three_actions, "ridge", groups=[held_out])
    config = ResidualConfig(
        base="stack", steps=512, robots=8, rollout=32, batch=128, legs=1, episodes=8, validation_episodes=4
    )
    result = train_and_compare(
        three_actions, ("adult", "pepper"), held_out, links=links, config=config, iterations=2, folder=tmp_path
    )
    assert result.untrained_is_base
    assert [agent.name for agent in result.agents] == ["base", "lead", "kalman", "predictor", "residual"]
    assert result.best_other().name != "residual"
    assert np.mean(result.best_other().costs) == min(np.mean(agent.costs) for agent in result.agents[:-1])
    base, lead = result.agent("base"), result.agent("lead")
    assert np.mean(lead.tracking) < np.mean(base.tracking)  # the lead undoes the motors' lag
    assert {episode.action for episode in base.episodes} == set(held_out)
    assert {path.name for path in tmp_path.iterdir()} == {"residual.json", "residual.safetensors"}
    card = json.loads((tmp_path / "residual.json").read_text())
    assert held_out[0] not in card["training"]["actions"]
    assert result.playback()[0].clip == base.recordings[0].motion
    assert len(result.table().rows) == 5


def test_the_demo_finds_bad_input_before_it_works(tmp_path, small_motions):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(StorageError, match="--out"):
        run_demo(small_motions, blocked)
    with pytest.raises(OptionError, match="did you mean 'pepper'"):
        run_demo(small_motions, tmp_path / "out", robot="peper")
