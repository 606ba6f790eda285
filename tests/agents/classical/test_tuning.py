"""Tuning and the objective."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.agents.classical.tuning import tune
from syda_gym.agents.figures import Figures, episode_figures, mean_figures
from syda_gym.embodiments import catalog
from syda_gym.errors import AgentError


def test_tune_finds_the_minimum_of_a_known_objective(interface):
    target = {"process": 40.0, "horizon": 0.2, "strength": 0.7}

    def score(agent):
        kalman = agent.base
        found = {"process": kalman.process, "horizon": kalman.horizon, "strength": agent.strength}
        distance = (
            np.log10(found["process"] / target["process"]) ** 2
            + 10 * (found["horizon"] - target["horizon"]) ** 2
            + (found["strength"] - target["strength"]) ** 2
        )
        return Figures(distance, 0.0, 0.0)

    best = tune("kalman", interface, score, budget=64, seed=3)
    assert best.figures.objective < 0.02
    assert tune("kalman", interface, score, budget=64, seed=3) == best
    assert best.build(interface).base.process == best.settings["process"]
    assert tune("kalman", interface, score, budget=8, seed=3).figures.objective > best.figures.objective


def test_a_rival_without_settings_is_played_once(interface):
    played = []

    def score(agent):
        played.append(agent)
        return Figures(1.0, 0.0, 0.0)

    assert tune("base", interface, score, budget=16).tried == 1
    assert len(played) == 1


def test_bad_requests(interface):
    with pytest.raises(AgentError, match="did you mean 'one_euro'"):
        tune("one_eur", interface, lambda agent: Figures(0, 0, 0))
    with pytest.raises(AgentError, match="budget"):
        tune("lead", interface, lambda agent: Figures(0, 0, 0), budget=0)


def test_the_figures_of_a_constant_offset_and_of_noise_are_the_known_ones():
    robot = catalog.get("pepper")
    n = len(robot.joint_names)
    reference = np.tile(robot.rest, (50, 1))
    moved = reference.copy()
    moved[:, 0] += 0.01
    figures = episode_figures(robot, moved, reference)
    assert figures.joint_mrad == pytest.approx(10.0 / n)
    assert figures.jitter == pytest.approx(0.0, abs=1e-9)
    assert 0 < figures.landmark_mm < 5
    assert pytest.approx(figures.landmark_mm + 0.05 * figures.joint_mrad) == figures.objective
    wave = reference.copy()
    wave[1::2, 0] += 0.01  # alternating by d: third difference is 8 d
    moved_by = np.linalg.norm(robot.landmarks(wave[1]) - robot.landmarks(wave[0]), axis=-1).mean()
    assert episode_figures(robot, wave, reference).jitter == pytest.approx(4e3 * moved_by, rel=1e-6)


def test_means_and_their_errors():
    assert mean_figures([Figures(1, 2, 3), Figures(3, 4, 5)]) == Figures(2.0, 3.0, 4.0)
    with pytest.raises(AgentError, match="no episodes"):
        mean_figures([])
    robot = catalog.get("pepper")
    with pytest.raises(AgentError, match="T >= 4"):
        episode_figures(robot, np.zeros((3, 10)), np.zeros((3, 10)))
