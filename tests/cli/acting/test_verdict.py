"""What `train` says at its end: compared with the best of the others, loud if nothing was gained."""

from __future__ import annotations

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import pytest

from syda_gym.agents.figures import Figures
from syda_gym.agents.residual.costs import CostWeights
from syda_gym.agents.training import Comparison
from syda_gym.cli.acting.agents import _print_verdict


def said(capsys: pytest.CaptureFixture[str], best: int, **landmark_mm: float) -> str:
    figures = {
        name: Figures(**{field.name: value if field.name == "landmark_mm" else 0.0 for field in fields(Figures)})
        for name, value in landmark_mm.items()
    }
    report: Any = SimpleNamespace(best=best, comparison=Comparison(figures, CostWeights()))
    _print_verdict(report)
    return " ".join(capsys.readouterr().out.split())


def test_a_gain_is_one_over_the_best_of_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    text = said(capsys, 2, base=20.0, lead=10.0, predictor=8.0, residual=6.0)
    assert "25.0 % less than the best of the others (predictor" in text


def test_who_is_beaten_is_told_what_is_better(capsys: pytest.CaptureFixture[str]) -> None:
    assert "'lead' is better without training" in said(capsys, 2, base=20.0, lead=10.0, residual=12.0)


@pytest.mark.parametrize("best", [0, 2])
def test_nobody_on_the_stack_is_sent_to_the_stack(capsys: pytest.CaptureFixture[str], best: int) -> None:
    text = said(capsys, best, base=20.0, lead=10.0, predictor=8.0, residual=12.0)
    assert "--base stack" not in text
    assert "another --seed" in text
    assert "--base stack" in said(capsys, best, base=20.0, lead=10.0, residual=12.0)


def test_nothing_gained_is_loud(capsys: pytest.CaptureFixture[str]) -> None:
    text = said(capsys, 0, base=20.0, lead=10.0, residual=20.0)
    assert text.startswith("nothing was gained: the base is kept; try")
    assert "`lead`" in text
