"""The leaderboard: what is trained on is not judged, one rule makes the thresholds, cells know what they are of."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from syda_gym.envs.family import FAMILY
from syda_gym.errors import OptionError


@pytest.fixture(scope="module")
def script():
    path = Path(__file__).resolve().parents[2] / "scripts" / "build_leaderboard.py"
    spec = importlib.util.spec_from_file_location("build_leaderboard", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def cell(errors, returns):
    figures = {"J": 20.0, "landmark_mm": 10.0, "jitter": 2.0, "contact_steps": 0.0}
    episodes = [
        {"action": f"a{i}", "return": r, "error_m": e, **figures}
        for i, (e, r) in enumerate(zip(errors, returns, strict=True))
    ]
    return {"episodes": episodes, "curve": [[10, 1.0], [20, 2.0]], "cpu_seconds": 1.0}


def test_what_is_judged_is_not_trained_on(script):
    seen, unseen = set(script.actions(True)), set(script.actions(False))
    assert len(unseen) == 10
    assert not seen & unseen
    assert {"clap_high", "cross_low", "salute"} <= unseen


def test_thresholds_are_the_median_error_of_the_base_and_the_best_return_of_the_formulas(script):
    rows = {"base": [cell([0.01, 0.03, 0.02], [90.0, 80.0, 70.0])], "lead": [cell([0.0] * 3, [100.0, 85.0, 85.0])]}
    told = script.thresholds({"SydaTeleopNoise-v0": rows})["SydaTeleopNoise-v0"]
    assert told["success_error"] == 0.02
    assert told["reward_threshold"] == 90.0
    assert told["best"] == "lead"


def test_the_page_has_every_row_with_its_interval_and_marks_the_best(script):
    noise = FAMILY[1]
    assert noise.options["success_error"] > 0.001
    good = cell([0.001, 0.001, 1.0], [120.0, 110.0, 100.0])
    for episode in good["episodes"]:
        episode["J"] = 5.0
    found = {noise.id: {"base": [cell([0.2] * 3, [90.0, 80.0, 70.0])], "ppo": [good, good]}}
    table = script.summary(found)
    assert table[noise.id]["ppo"]["success"][0] == pytest.approx(2 / 3, abs=1e-3)
    assert table[noise.id]["base"]["success"] == [0.0, 0.0, 0.0]
    assert table[noise.id]["ppo"]["curve"] == [[10.0, 1.0], [20.0, 2.0]]
    low, high = table[noise.id]["base"]["return"][1:]
    assert low < 80.0 < high
    page = script.page({"table": table, "thresholds": {}})
    assert f"## `{noise.id}`" in page
    assert "| base | 1 | 20.0 (20.0 to 20.0) |" in page
    assert "**PPO from scratch**" in page


def test_a_cell_is_known_by_everything_that_decides_it(script):
    noise, full = FAMILY[1], FAMILY[3]
    keys = [
        script.key_of(member, row, seed, played)
        for member in (noise, full)
        for row in ("base", "predictor", "ppo", "sac")
        for seed in (0, 1)
        for played in (["a"], ["b"])
    ]
    assert len(set(keys)) == len(keys)
    assert script.key_of(noise, "ppo", 0, ["a"]) == keys[8]


def test_a_short_training_is_judged_like_every_agent(script, monkeypatch):
    settings = {**script.settings_of("ppo", FAMILY[1]), "n_envs": 4, "n_timesteps": 256, "batch_size": 64}
    monkeypatch.setattr(script, "settings_of", lambda *_: dict(settings))
    monkeypatch.setattr(script, "actions", lambda seen: ["salute"] if not seen else ["pour"])
    script.environment.cache_clear()
    learnt = script.compute(FAMILY[1], "ppo", 0, False)
    base = script.compute(FAMILY[1], "base", 0, False)
    script.environment.cache_clear()
    assert [episode["action"] for episode in learnt["episodes"]] == ["salute"]
    # An untrained policy corrects next to nothing, under the same disturbances.
    assert learnt["episodes"][0]["landmark_mm"] == pytest.approx(base["episodes"][0]["landmark_mm"], rel=0.3)
    assert np.isfinite(base["episodes"][0]["return"])


def test_an_id_without_a_bundle_has_no_such_row(script):
    with pytest.raises(OptionError):
        script.environment(0, "sideways", False)
    assert script.compute(FAMILY[5], "predictor", 0, False) is None
