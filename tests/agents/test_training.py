"""The default stack: what stands in it, what it is compared with, and that its settings are those of the cell."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.agents.classical.rivals import RIVALS
from syda_gym.agents.classical.tuned import cell_of, tuned_rival, tuned_settings
from syda_gym.agents.figures import Figures
from syda_gym.agents.predictor.predictor_training import PredictorConfig
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.residual.costs import CostWeights
from syda_gym.agents.residual.residual_training import train_residual
from syda_gym.agents.stacks import stack_arrays
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.training import Comparison, train_stack
from syda_gym.agents.work import default_config, find_agent
from syda_gym.envs.task.disturbances import CELLS, Disturbances
from syda_gym.errors import OptionError

TINY = ResidualConfig(
    base="stack", steps=512, robots=8, rollout=32, batch=64, epochs=1, legs=1, episodes=4, validation_episodes=2
)
NETWORK = PredictorConfig(iterations=2, rounds=1, batch=4, channels=8)


def test_the_stack_is_kalman_predictor_residual_and_stands_beside_the_others(ground, tmp_path):
    found = train_stack(ground, TINY, predictor=NETWORK, seed=0, folder=tmp_path)
    assert found.trained.agent.stack == ("base", "kalman", "predictor", "lead", "residual")
    assert list(found.agents) == ["base", "lead", "kalman", "predictor", "residual"]
    assert list(found.comparison.figures) == list(found.agents)
    assert found.comparison.figures["predictor"] == found.trained.history[0].base
    assert found.comparison.figures["residual"] == found.trained.history[found.trained.best].policy
    process = found.agents["kalman"].base.process
    assert process == tuned_settings("kalman", "teleop:full")["process"]
    below = (tmp_path / "below.safetensors").read_bytes()
    again = train_stack(ground, TINY, predictor=NETWORK, seed=0, folder=tmp_path, resume=True)
    assert again.trained.history == found.trained.history
    assert (tmp_path / "below.safetensors").read_bytes() == below
    one, two = stack_arrays(found.trained.agent), stack_arrays(again.trained.agent)
    assert all(np.array_equal(one[name], two[name]) for name in one)


def test_a_named_base_is_shown_once(ground):
    config = ResidualConfig.of({**TINY.as_dict(), "base": "base"})
    assert list(train_stack(ground, config, seed=0).agents) == ["base", "lead", "kalman", "residual"]
    euro = find_agent("one_euro", ground.interface, "teleop")
    assert list(train_stack(ground, config, base=euro, seed=0).agents) == [
        "base",
        "lead",
        "kalman",
        "one_euro",
        "residual",
    ]


def test_validation_actions_are_not_trained_on(ground):
    parts = ground.parts()
    actions = {part: {ground.repertoire.clips[clip].action for clip in clips} for part, clips in parts.items()}
    assert not actions["train"] & actions["validation"]
    assert actions["train"] | actions["validation"] == {clip.action for clip in ground.repertoire.clips}
    names = set(ground.record_part("validation", 2, seed=0).names)
    assert names <= {ground.repertoire.clips[clip].name for clip in parts["validation"]}


def test_one_action_is_both_trained_on_and_judged(tiny_options):
    ground = Ground({**tiny_options, "actions": ["wave_high"]})
    assert ground.parts()["train"] == ground.parts()["validation"] == list(range(ground.clips))


def test_the_verdict_compares_with_the_best_of_the_others_by_the_runs_own_cost():
    figures = {"base": Figures(10.0, 0.0, 1.0), "lead": Figures(8.0, 0.0, 3.0), "residual": Figures(9.0, 0.0, 1.5)}
    assert Comparison(figures, CostWeights()).gained
    assert Comparison(figures, CostWeights()).best_other == "base"
    assert Comparison(figures, CostWeights(jitter=0.1)).best_other == "lead"
    assert not Comparison(figures, CostWeights(jitter=0.1)).gained
    assert not Comparison(figures, CostWeights(jitter=10.0)).gained


@pytest.mark.parametrize(
    ("disturbances", "cell"),
    [
        (None, "lag"),
        *((f"teleop:{cell}:harsh", cell) for cell in CELLS),
        ("dropout:test", "noise"),
        ("link:test", "latency"),
        ("payload", "lag"),
        ({"noise": 0.01, "latency": (0.0, 0.1)}, "noise+latency"),
        (Disturbances(noise=0.01, latency=0.1, motor_gain=0.8), "full"),
    ],
)
def test_disturbances_have_the_cell_they_are_most_like(disturbances, cell):
    assert cell_of(disturbances) == cell


def test_every_cell_has_settings_that_its_rivals_take(interface):
    for cell in CELLS:
        for name in RIVALS:
            tuned_rival(name, interface, f"teleop:{cell}:train")
        assert set(tuned_settings("kalman", f"teleop:{cell}")) == {"process", "horizon", "strength"}


def test_the_default_configuration_follows_the_disturbances():
    assert default_config({"disturbances": None}) == ResidualConfig.preset("undisturbed")
    assert default_config({"disturbances": "teleop:noise:test"}) == ResidualConfig.preset("teleop")
    assert ResidualConfig.preset("undisturbed").base == ResidualConfig.preset("teleop").base == "stack"


def test_a_policy_alone_cannot_stand_on_a_stack_that_is_not_there(ground):
    with pytest.raises(OptionError, match="train_stack"):
        train_residual(ground, TINY)
