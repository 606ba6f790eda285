"""What a user may write, and what is said to everything else."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import typer

from syda_gym.cli import checks
from syda_gym.cli.names import CELLS, LEVELS, METHODS, SINGLE_DISTURBANCES
from syda_gym.cli.options import ends_of, mapping_of, pairs_of, route_of
from syda_gym.envs.task.disturbances import Disturbances
from syda_gym.errors import OptionError


def test_lists_are_repeatable_and_comma_separated():
    check = checks.several(("a", "b", "c"), "letter")
    assert check(["a,b", "c", "a"]) == ["a", "b", "c"]
    assert check(["a, b", ""]) == ["a", "b"]
    assert check(None) == []
    with pytest.raises(typer.BadParameter, match="unknown letter 'x'"):
        check(["a,x"])


@pytest.mark.parametrize("text", ["adult,kid,pepper", "adult>kid>pepper", " adult , kid>pepper"])
def test_a_route_is_written_with_commas_or_arrows(text):
    assert checks.route(text) == "adult,kid,pepper"
    assert route_of(checks.route(text)) == ("adult", "kid", "pepper")


def test_routes_that_are_none():
    for text in ("adult", "adult,,pepper", ">pepper"):
        with pytest.raises(typer.BadParameter, match="adult,kid,pepper"):
            checks.route(text)
    assert route_of(checks.route("auto")) == "auto"


def test_operator_and_robot_are_the_ends_of_the_route_unless_named():
    assert ends_of(None, None) == ("adult", "pepper")
    assert ends_of(None, None, "kid,adult,nao") == ("kid", "nao")
    assert ends_of("tall", None, "auto") == ("tall", "pepper")


def test_pairs():
    assert pairs_of(checks.pairs(["adult:kid,kid:pepper", "adult:nao"])) == [
        ("adult", "kid"),
        ("kid", "pepper"),
        ("adult", "nao"),
    ]
    for text in ("adult-kid", "adult:kid:nao", "adult:"):
        with pytest.raises(typer.BadParameter, match="adult:kid"):
            checks.pairs([text])


@pytest.mark.parametrize(
    ("low", "high", "open_low", "value", "fine"),
    [
        (0, 1, False, 0, True), (0, 1, True, 0, False), (0, 1, True, 1, True), (0, 1, False, 1.1, False),
        (0, math.inf, True, 5, True), (0, math.inf, False, math.inf, False), (0, 1, False, math.nan, False),
    ],
)  # fmt: skip
def test_ranges(low, high, open_low, value, fine):
    check = checks.between(low, high, "s", open_low=open_low)
    if fine:
        assert check(value) == value
        return
    with pytest.raises(typer.BadParameter, match=r"must be (above|at least) 0.* s, got"):
        check(value)


def test_physics_rates_are_multiples_of_the_control_rate():
    check = checks.multiple(30.0, 30.0, 10_000.0, "Hz")
    assert check(240.0) == 240.0
    with pytest.raises(typer.BadParameter, match="nearest: 90 or 120"):
        check(100.0)


def test_methods_with_presets():
    for method, presets in METHODS.items():
        assert checks.methods(method) == method
        for preset in presets:
            assert mapping_of(checks.methods(f"{method}:{preset}"), None, None) == (method, preset)
            assert mapping_of(method, preset, None) == (method, preset)
    assert checks.methods(["syda:paper,ridge", "nearest"]) == ["syda:paper", "ridge", "nearest"]
    assert mapping_of(None, None, None) == ("syda", None)
    with pytest.raises(typer.BadParameter, match="did you mean 'syda'"):
        checks.methods("sida")
    with pytest.raises(typer.BadParameter, match="did you mean 'general'"):
        checks.methods("syda:genral")
    with pytest.raises(typer.BadParameter, match="two presets"):
        mapping_of("syda:paper", "general", None)
    with pytest.raises(typer.BadParameter, match="has no preset 'fixed'"):
        mapping_of("syda", "fixed", None)


def test_a_stored_mapping_excludes_a_method(tmp_path: Path):
    assert mapping_of(None, None, tmp_path) == (str(tmp_path), None)
    with pytest.raises(typer.BadParameter, match="leave --method"):
        mapping_of("syda", None, tmp_path)
    with pytest.raises(typer.BadParameter, match="did you mean 'syda'"):
        mapping_of(None, None, Path("sida"))


@pytest.mark.parametrize(
    "text",
    [
        "none", "teleop", *SINGLE_DISTURBANCES,
        *(f"teleop:{cell}:{level}" for cell in CELLS for level in LEVELS),
        *(f"{name}:{level}" for name in SINGLE_DISTURBANCES for level in LEVELS),
        "", "full", "teleop:nois", "teleop:noise:tst", "teleop:noise:test:x", "none:test", "link:tst", "link:test:x",
    ],
)  # fmt: skip
def test_disturbances_are_those_that_the_environment_takes(text):
    try:
        Disturbances.resolve(None if text == "none" else text)
        known = True
    except OptionError:
        known = False
    if known:
        assert checks.disturbances(text) == text
    else:
        with pytest.raises(typer.BadParameter):
            checks.disturbances(text)


def test_a_cell_without_its_suite_is_understood():
    with pytest.raises(typer.BadParameter, match="did you mean 'teleop:full:test'"):
        checks.disturbances("full:test")


def test_files_end_as_they_must(tmp_path: Path):
    check = checks.ending(".jsonl", ".jsonl.gz")
    assert check(tmp_path / "a.jsonl.gz") == tmp_path / "a.jsonl.gz"
    with pytest.raises(typer.BadParameter, match=r"must end in \.jsonl or \.jsonl\.gz"):
        check(tmp_path / "a.json")
    assert checks.npz_or_folder(tmp_path / "set") == tmp_path / "set"
    with pytest.raises(typer.BadParameter, match=r"\.npz"):
        checks.npz_or_folder(tmp_path / "a.bvh")
    (tmp_path / "file").touch()
    with pytest.raises(typer.BadParameter, match="is a file"):
        checks.folder(tmp_path / "file")


def test_agents_are_names_or_bundles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.json").touch()
    assert checks.agents(["kalman", "mine", "runs/other", "adult-pepper-full"])
    with pytest.raises(typer.BadParameter, match="did you mean 'kalman'"):
        checks.agents("kalmann")
    assert checks.bundle("adult-pepper-lag") == "adult-pepper-lag"
    with pytest.raises(typer.BadParameter, match="'kalman' has no file"):
        checks.bundle("kalman")
