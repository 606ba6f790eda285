"""`syda-gym transferability` and `syda-gym route`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syda_gym.cli.main import app
from syda_gym.errors import RouteError

runner = CliRunner()


def run(*arguments: str) -> str:
    result = runner.invoke(app, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_transferability_prints_every_term_as_json() -> None:
    links = json.loads(run("transferability", "adult", "pepper", "--definition", "paper", "--json"))
    assert [(link["source"], link["target"]) for link in links] == [("adult", "pepper"), ("pepper", "adult")]
    assert links[0]["T"] == pytest.approx(0.2358, abs=5e-4)
    assert set(links[0]) >= {"S", "D", "L", "alpha", "C", "coverage", "T", "noise_floor", "spread", "tolerance"}


def test_transferability_prints_a_table() -> None:
    assert "adult > kid" in run("transferability", "adult", "kid", "--definition", "paper")


def test_route_prints_the_best_one_first_and_draws_it(tmp_path: Path) -> None:
    picture = tmp_path / "graph.png"
    pairs = ("--pair", "adult:kid", "--pair", "kid:pepper", "--pair", "adult:pepper")
    text = run("route", "--operator", "adult", "--robot", "pepper", *pairs, "--definition", "paper", "--json",
               "--suggest", "--picture", str(picture))  # fmt: skip
    found = json.loads(text)
    assert [route["bodies"] for route in found["routes"]] == [["adult", "pepper"], ["adult", "kid", "pepper"]]
    assert found["suggestions"] == []
    assert len(found["spanning"]) == 2
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_bad_pairs_are_told() -> None:
    wrong = runner.invoke(app, ["route", "--operator", "adult", "--robot", "pepper", "--pair", "adult-kid"])
    assert wrong.exit_code == 2
    assert "adult:kid" in wrong.output
    with pytest.raises(RouteError, match="pepper"):
        run("route", "--operator", "adult", "--robot", "pepper", "--pair", "adult:kid")
