from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syda_gym.errors import MotionError, OptionError
from syda_gym.evaluation.paper.cells import CONTENDERS, CellTask
from syda_gym.evaluation.paper.few_shot import few_shot
from syda_gym.evaluation.paper.report import PRINTED, overview, tables, write_study
from syda_gym.evaluation.paper.results import Study
from syda_gym.evaluation.paper.study import reproduce
from syda_gym.evaluation.pools import InlinePool
from syda_gym.mappings import METHODS
from syda_gym.mappings.fitting.held_out import cross_validate
from syda_gym.motions import load_motions, save_motions
from syda_gym.motions.clip import PROTOCOLS, Motions

QUICK = ["ridge/general", "geometric/procrustes"]


@pytest.fixture(scope="module")
def spec(small_motions: Motions, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("motions") / "small.npz"
    save_motions(small_motions, path)
    return f"npz:{path}"


@pytest.fixture(scope="module")
def studied(spec: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path, list[str]]:
    out, seen = tmp_path_factory.mktemp("study"), []
    study = reproduce(spec, out, seeds=2, contenders=QUICK, workers=1, progress=lambda _, name: seen.append(name))
    return study, out, seen


def test_every_cell_is_there_with_its_protocol(studied):
    study, _, seen = studied
    assert set(study.cells) == {(c, p, h) for c in QUICK for p in PROTOCOLS for h in ("adult", "kid")}
    assert len(seen) == len(study.cells)
    for (_, protocol, _), cell in study.cells.items():
        assert len(cell.error) == (1 if protocol == "loao" else 2)
        assert 0.0 < np.mean(cell.error) < 0.3
        assert bool(cell.chain) == (protocol != "twin3")
        assert bool(cell.aligned) == (protocol == "loao")


def test_the_leaking_protocol_looks_better(studied):
    study, _, _ = studied
    leaky, honest = (study.cells["ridge/general", protocol, "adult"].error for protocol in ("rand3", "loao"))
    assert np.mean(leaky) < np.mean(honest)


def test_bounds_cover(studied):
    study, _, _ = studied
    cell = study.cells["ridge/general", "loao", "kid"]
    assert cell.covered is not None
    assert cell.covered > 0.7
    assert study.cells["geometric/procrustes", "loao", "kid"].covered is None


def test_the_tables_put_the_printed_figures_beside_ours(studied):
    study, out, _ = studied
    found = tables(study)
    assert [t.title[:7] for t in found[:4]] == ["Table 2", "Table 3", "Table 4", "Table 5"]
    printed = {row[0]: row[5] for row in found[0].rows}
    assert printed["H2-R1"] == "0.0691"
    # Transferability is computed, not copied: it must come out within the printed digits.
    for row in found[0].rows:
        ours, paper = row[4].split(" (")
        assert abs(float(ours) - float(paper.strip(")"))) < 6e-4
    with (out / "table3.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0][2:7] == ["R elbow", "R wrist", "L elbow", "L wrist", "average"]
    assert any(row[0] == "ridge/general" and row[1] == "LOAO" for row in rows)
    assert len(overview(study, "loao").rows) == len(QUICK)


def test_columns_of_the_chain_tables_follow_the_paper_s_order(studied):
    study, _, _ = studied
    cell = study.cells["ridge/general", "loao", "kid"]
    left_elbow, left_wrist, right_elbow, right_wrist = np.mean(cell.chain_joints, axis=0)
    row = next(row for row in tables(study)[1].rows if row[:2] == ["ridge/general", "LOAO"])
    expected = (right_elbow, right_wrist, left_elbow, left_wrist)
    assert [float(text.split(" ")[0]) for text in row[2:6]] == pytest.approx(expected, abs=6e-5)


def test_files_and_plots_are_written(studied):
    _, out, _ = studied
    for protocol in PROTOCOLS:
        assert (out / f"errors_{protocol}.png").read_bytes()[:4] == b"\x89PNG"
        assert (out / f"overview_{protocol}.csv").is_file()
    content = json.loads((out / "study.json").read_text())
    assert content["seeds"] == 2
    assert len(content["cells"]) == 12


def test_an_interrupted_study_goes_on(studied, spec):
    study, out, _ = studied
    lost = next((out / "cells").glob("ridge*loao-adult*"))
    lost.unlink()
    seen: list[str] = []
    again = reproduce(spec, out, seeds=2, contenders=QUICK, workers=1, progress=lambda _, name: seen.append(name))
    assert seen == ["ridge/general loao adult"]
    key = ("ridge/general", "loao", "adult")
    assert again.cells[key].error == study.cells[key].error


def test_a_study_that_is_killed_and_continued_writes_the_same_tables(spec, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "syda_gym.evaluation.paper.study.CONTENDERS", tuple(c for c in CONTENDERS if c.name == QUICK[0])
    )
    monkeypatch.setattr("syda_gym.evaluation.paper.study.make_pool", lambda _, *opener: InlinePool(*opener))
    arguments = {"seeds": 1, "protocols": ["loao"], "workers": 1}

    def killed(_: float, name: str) -> None:
        if name.endswith("kid"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(spec, tmp_path / "killed", progress=killed, **arguments)
    left = {path.name for path in (tmp_path / "killed" / "cells").iterdir()}
    assert 0 < len(left) < 6
    seen: list[str] = []
    reproduce(spec, tmp_path / "killed", progress=lambda _, name: seen.append(name), **arguments)
    assert len(seen) == 6 - len(left)
    reproduce(spec, tmp_path / "whole", **arguments)
    for name in ("table2", "overview_loao", "few_shot", "windows"):
        tables = [(tmp_path / run / f"{name}.csv").read_text() for run in ("killed", "whole")]
        assert tables[0] == tables[1]
        assert len(tables[0].splitlines()) > 1


def test_a_chain_needs_fewer_recordings_than_a_direct_pair(small_motions):
    rows = few_shot(small_motions, "adult", "kid", "pepper", draws=2, counts=(1, 3, 99))
    assert [row.count for row in rows] == [1, 3]
    assert rows[0].chain < rows[0].direct
    assert rows[0].direct > rows[1].direct
    # Three actions are as good as geometry or better, up to the noise of two draws on small made-up motions.
    assert rows[1].direct < 1.05 * rows[0].geometric
    with pytest.raises(OptionError, match="at least 1"):
        few_shot(small_motions, "adult", "kid", "pepper", draws=0)


def test_a_network_cell_runs_over_seeds(spec):
    from dataclasses import replace

    contender = replace(CONTENDERS[0], bounds=0)
    cell = CellTask(spec, contender, "rand3", "kid", 2).compute()
    assert isinstance(cell, dict)
    assert len(cell["error"]) == len(cell["error_back"]) == len(cell["chain"]) == 2
    assert cell["error"][0] != cell["error"][1]


def test_every_method_takes_part():
    assert {contender.method for contender in CONTENDERS} == set(METHODS)
    assert all(contender.preset in METHODS[contender.method].presets for contender in CONTENDERS)


def test_the_printed_averages_are_averages():
    for name in ("table3", "table4"):
        for values in PRINTED[name].values():
            means = [mean for mean, _ in values]
            assert np.mean(means[:4]) == pytest.approx(means[4], abs=6e-4)


def test_wrong_input_is_explained(spec, small_motions, tmp_path):
    with pytest.raises(OptionError, match="unknown contender"):
        reproduce(spec, contenders=["syda/papers"])
    with pytest.raises(OptionError, match="protocol"):
        reproduce(spec, protocols=["loo"])
    with pytest.raises(OptionError, match="at least 1"):
        reproduce(spec, seeds=0)
    takes = tuple(
        type(t)(t.recording, t.action, t.fps, {"adult": t.frames["adult"]}, t.mirrored) for t in small_motions.takes
    )
    save_motions(Motions("alone", takes, {"adult": small_motions.bodies["adult"]}), tmp_path / "alone.npz")
    with pytest.raises(MotionError, match="kid"):
        reproduce(f"npz:{tmp_path / 'alone.npz'}")


def test_the_real_recordings_give_the_known_figures(paper_dir):
    """Ridge needs no seed; these figures were measured when the study was written."""
    motions = load_motions(f"paper:{paper_dir}")
    for human, known in (("adult", 0.0529), ("kid", 0.0570)):
        result = cross_validate(motions.pair(human, "pepper"), "ridge", protocol="loao", confidence=False)
        assert result.means[0] == pytest.approx(known, abs=5e-4)
        assert result.means[0] > 0.042, "below the noise floor: something leaks"
        assert result.errors_back is not None
        assert result.means[0] < result.errors_back.mean()


def test_the_file_does_not_tell_in_which_order_the_parts_were_finished(studied, tmp_path):
    study = studied[0]
    assert len(study.cells) > 1
    turned = replace(study, cells=dict(reversed(study.cells.items())))
    one, other = (write_study(which, tmp_path / name, {}) for which, name in ((study, "one"), (turned, "other")))
    assert (one / "study.json").read_bytes() == (other / "study.json").read_bytes()
