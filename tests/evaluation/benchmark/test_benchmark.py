"""The benchmark: configuration, cells, resume, workers that agree, failures that do not stop the rest."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from syda_gym.errors import MappingError, OptionError, RouteError, StorageError
from syda_gym.evaluation import cell_files
from syda_gym.evaluation.benchmark import BenchmarkConfig, compare, execution, read_results, run_benchmark
from syda_gym.evaluation.benchmark import cells as cells_module
from syda_gym.evaluation.benchmark.cells import cells_of
from syda_gym.evaluation.benchmark.efficiency import efficiency_curve
from syda_gym.evaluation.benchmark.report import write_benchmark_report
from syda_gym.evaluation.benchmark.work import Worker, folds_of
from syda_gym.evaluation.chains import Links, all_routes, check_route
from syda_gym.evaluation.pools import InlinePool, Schedule
from syda_gym.mappings.fitting.fit import METHODS, fit
from syda_gym.motions import load_motions, save_motions

QUICK = {
    "routes": ["adult>pepper", "adult>kid>pepper", "adult>kid"],
    "methods": ["ridge", "nearest"],
    "folds": 2,
    "physics": "servo",
}


@pytest.fixture
def in_process(monkeypatch):
    """Computes cells in this process: as fast as can be, for tests of what surrounds the work."""
    opened = []

    def make(workers, opener, *arguments):
        opened.append(InlinePool(opener, *arguments))
        return opened[-1]

    monkeypatch.setattr(execution, "make_pool", make)
    return opened


@pytest.fixture(scope="module")
def computed(small_motions, tmp_path_factory):
    """A finished benchmark in a process of its own."""
    folder = tmp_path_factory.mktemp("bench")
    results = run_benchmark(BenchmarkConfig.of(QUICK), folder, motions=small_motions)
    return folder, results


# --- configuration ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("agnets: [base]", OptionError, "did you mean 'agents'"),
        ("methods: [sida]", OptionError, "did you mean 'syda'"),
        ("methods: ['syda:papr']", OptionError, "did you mean 'paper'"),
        ("agents: [leed]", OptionError, "did you mean 'lead'"),
        ("agents: ['.']", OptionError, "unknown agent '.'"),
        (f"agents: [{'x' * 5000}]", OptionError, "unknown agent 'xxx"),
        ("motions: 2026-99-99", StorageError, "not valid YAML"),
        ("disturbances: ['teleop:ful']", OptionError, "full"),
        (
            "efficiency: {chain: adult>kid>pepper, new_body: adult, draws: 1000000000000}",
            OptionError,
            "efficiency.draws must be at most 1000",
        ),
        ("seeds: 1000000000000", OptionError, "at most 10000"),
        ("seeds: -1", OptionError, "list of whole numbers"),
        ("folds: 1", OptionError, "at least 2"),
        ("routes: [adult]", OptionError, "adult>kid>pepper"),
        ("physics: bulet", OptionError, "bullet"),
        ("baseline: direct", OptionError, "none of the methods"),
        ("efficiency: {chain: adult>pepper, new_body: adult}", OptionError, "intermediate"),
        ("efficiency: {chian: a}", OptionError, "did you mean 'chain'"),
        ("methods: [", StorageError, "not valid YAML"),
        ("- just a list", OptionError, "keys and values"),
    ],
)
def test_bad_yaml_is_named_with_the_nearest_match(tmp_path, text, error, words):
    file = tmp_path / "config.yaml"
    file.write_text(text)
    with pytest.raises(error, match=r"config\.yaml") as caught:
        BenchmarkConfig.read(file)
    assert words in str(caught.value)


def test_a_configuration_survives_writing_and_reading(tmp_path):
    import yaml

    config = BenchmarkConfig.of(
        {**QUICK, "seeds": 3, "efficiency": {"chain": "adult>kid>pepper", "new_body": "adult", "method": "ridge"}}
    )
    file = tmp_path / "config.yaml"
    file.write_text(yaml.safe_dump(config.as_dict()))
    assert BenchmarkConfig.read(file) == config
    assert config.seeds == (0, 1, 2)


def test_the_paper_benchmark_of_the_examples_is_read():
    file = Path(__file__).resolve().parents[3] / "examples" / "paper_benchmark.yaml"
    config = BenchmarkConfig.read(file)
    assert (len(config.routes), len(config.methods), len(config.seeds), config.folds) == (8, 4, 10, "loao")


def test_routes_follow_the_recorded_pairs(small_motions):
    routes = all_routes(small_motions, ["adult", "kid"], ["pepper"], 2)
    assert routes == [("adult", "pepper"), ("adult", "kid", "pepper"), ("kid", "pepper"), ("kid", "adult", "pepper")]
    assert all_routes(small_motions, ["adult"], ["pepper"], 1) == [("adult", "pepper")]
    with pytest.raises(RouteError, match="no body 'nao'"):
        check_route(small_motions, ("adult", "nao"))
    with pytest.raises(RouteError, match="different bodies"):
        check_route(small_motions, ("adult", "kid", "adult"))


def test_folds_hold_every_action_out_exactly_once(small_motions):
    groups = folds_of(small_motions, 2)
    actions = sorted({take.action for take in small_motions.takes})
    assert sorted(name for group in groups for name in group) == actions
    with pytest.raises(OptionError, match="cannot be held out"):
        folds_of(small_motions, 99)


def test_links_share_fits_and_never_see_what_is_held_out(small_motions):
    groups = folds_of(small_motions, 2)
    links = Links(small_motions, "ridge", groups=groups)
    mapping = links.link("adult", "pepper", groups[0])
    assert links.link("adult", "pepper", groups[0]) is mapping
    assert set(mapping.card.actions) == set(groups[1])
    assert links.count() == 2
    with pytest.raises(MappingError, match="nothing is left"):
        links.link("adult", "pepper", sum(groups, ()))


# --- cells and results -------------------------------------------------------------------------------------------


def test_cells_differ_in_their_keys_and_change_with_what_decides_the_numbers(small_motions):
    settings = {**QUICK, "methods": ["syda", "direct"], "seeds": 2}
    cells = cells_of(BenchmarkConfig.of(settings), small_motions)
    assert len(cells) == 3 * 2 * 2
    assert len({cell.key for cell in cells}) == len(cells)
    other = cells_of(BenchmarkConfig.of({**settings, "folds": 3}), small_motions)
    assert not {cell.key for cell in cells} & {cell.key for cell in other}


def test_where_nothing_depends_on_the_seed_only_the_first_one_is_computed(small_motions):
    config = BenchmarkConfig.of(
        {
            "routes": ["adult>pepper"],
            "methods": ["syda", "nearest"],
            "disturbances": ["none", "teleop:noise:test"],
            "seeds": [4, 5, 6],
            "folds": 2,
        }
    )
    found = {(cell.method, cell.disturbance, cell.seed) for cell in cells_of(config, small_motions)}
    noisy = {(method, "teleop:noise:test", seed) for method in ("syda", "nearest") for seed in (4, 5, 6)}
    assert found == noisy | {("syda", "none", 4), ("syda", "none", 5), ("syda", "none", 6), ("nearest", "none", 4)}


def test_a_method_without_seed_gives_the_same_numbers_with_any(small_motions):
    pair = small_motions.pair("adult", "pepper")
    for name, method in METHODS.items():
        if not method.seeded and name != "mink":  # an extra, and the procrustes rotation of `geometric`
            first, second = (fit(pair, name, seed=seed, confidence=False)(pair.source[:5]) for seed in (0, 7))
            assert np.array_equal(first, second), name


def test_a_schedule_keeps_batches_together_and_hands_out_everything_once(small_motions):
    cells = cells_of(BenchmarkConfig.of({**QUICK, "methods": ["syda", "direct"], "seeds": 3}), small_motions)
    schedule = Schedule(cells, 2, lambda cell: cell.batch)
    taken, last = [], [None, None]
    while True:
        worker = len(taken) % 2
        cell = schedule.next(worker)
        if cell is None:
            break
        taken.append(cell)
        last[worker] = cell.batch
    assert sorted(cell.key for cell in taken) == sorted(cell.key for cell in cells)
    first = [cell.batch for cell in taken[0:6:2]]
    assert len(set(first)) == 1


def test_every_figure_is_there_and_plausible(computed, small_motions):
    _, results = computed
    played = results.select(route="adult>pepper", method="ridge")
    assert {row["motion"] for row in played.rows} == {
        clip.name for clip in small_motions.pair("adult", "pepper").clips()
    }
    row = played.rows[0]
    assert 0.01 < row["landmark_error"] < 0.3
    assert row["landmark_error"] == pytest.approx(np.mean(row["landmarks"]))
    assert 0.0 <= row["speed_violations"] <= 1.0
    assert row["success"] in (0, 1)
    assert row["frames"] > 40  # 30 Hz
    mapped = results.select(route="adult>kid").rows[0]
    assert mapped["joint_error"] is None
    assert mapped["landmark_error"] == mapped["mapping_error"]
    found = played.estimate("landmark_error")
    assert found.low < found.value < found.high
    assert results.about["versions"]["numpy"]
    assert results.about["failures"] == []


def test_nothing_is_computed_twice_and_the_result_stays_byte_for_byte(computed, small_motions, in_process):
    folder, _ = computed
    before = {name: (folder / name).read_bytes() for name in ("results.csv", "benchmark.json")}
    run_benchmark(BenchmarkConfig.of(QUICK), folder, motions=small_motions)
    assert in_process == []  # no pool was opened at all
    assert before == {name: (folder / name).read_bytes() for name in before}


def test_a_lost_cell_is_computed_again_to_the_same_bytes(computed, small_motions, in_process):
    folder, _ = computed
    before = (folder / "results.csv").read_bytes()
    cells = sorted((folder / "cells").glob("*.json"))
    cells[0].unlink()
    cells[3].write_text("half a fi")
    (folder / "cells" / ".abc-def.json").write_text("{")  # what a killed process leaves
    run_benchmark(BenchmarkConfig.of(QUICK), folder, motions=small_motions)
    assert in_process[0].computed == 2
    assert (folder / "results.csv").read_bytes() == before
    assert not list((folder / "cells").glob(".*"))


def test_cells_of_other_versions_or_other_code_are_computed_again(
    computed, small_motions, tmp_path, in_process, monkeypatch
):
    folder = tmp_path / "copy"
    shutil.copytree(computed[0], folder)
    before = json.loads((folder / "benchmark.json").read_text())["versions"]
    assert len(before["code"]) == 16
    monkeypatch.setattr(cells_module, "made_by", lambda: "0123456789abcdef")  # as another version of anything would
    results = run_benchmark(BenchmarkConfig.of(QUICK), folder, motions=small_motions)
    assert in_process[0].computed == len(results.about["cells"]) == 6
    assert not set(results.about["cells"]) & {path.stem for path in (computed[0] / "cells").glob("*.json")}


@pytest.mark.parametrize("fault", ["swapped", "one figure changed", "emptied", "not JSON", "key of another"])
def test_damaged_and_swapped_cells_are_noticed_and_computed_again(computed, small_motions, tmp_path, in_process, fault):
    folder = tmp_path / "copy"
    shutil.copytree(computed[0], folder)
    wanted = (folder / "results.csv").read_bytes()
    first, second = sorted((folder / "cells").glob("*.json"))[:2]
    stored = json.loads(first.read_text())
    if fault == "swapped":
        content = first.read_bytes(), second.read_bytes()
        first.write_bytes(content[1])
        second.write_bytes(content[0])
    elif fault == "one figure changed":
        stored["content"]["rows"][0]["landmark_error"] += 0.01
        first.write_text(json.dumps(stored))
    elif fault == "key of another":
        first.write_text(json.dumps({**stored, "key": second.stem}))
    else:
        first.write_text("{}" if fault == "emptied" else "nothing")
    run_benchmark(BenchmarkConfig.of(QUICK), folder, motions=small_motions)
    assert in_process[0].computed == (2 if fault == "swapped" else 1)
    assert (folder / "results.csv").read_bytes() == wanted


def test_another_bundle_under_the_same_name_makes_other_cells(small_motions, tmp_path):
    from syda_gym.files import asset

    keys = []
    for name in ("adult-pepper-noise", "adult-pepper-full"):
        for suffix in (".json", ".safetensors"):
            shutil.copy(asset("agents", f"{name}{suffix}"), tmp_path / f"mine{suffix}")
        settings = {**QUICK, "routes": ["adult>pepper"], "agents": [str(tmp_path / "mine")]}
        keys.append({cell.key for cell in cells_of(BenchmarkConfig.of(settings), small_motions)})
    assert not keys[0] & keys[1]


RUN = """
import sys
from syda_gym.evaluation.benchmark import BenchmarkConfig, run_benchmark
from syda_gym.motions import load_motions
if __name__ == "__main__":
    run_benchmark(BenchmarkConfig.read(sys.argv[1]), sys.argv[2], workers=2, motions=load_motions(sys.argv[3]))
"""


def test_a_killed_run_goes_on_to_the_same_bytes_and_leaves_no_process_behind(tmp_path, in_process, small_motions):
    """The cheap version of ``scripts/check_benchmark.py kills``."""
    settings = {
        "routes": ["adult>pepper", "adult>kid"],
        "methods": ["ridge", "geometric"],
        "folds": 2,
        "physics": "servo",
        "fit": {"ridge": {"confidence": False}, "geometric": {"confidence": False}},
    }
    (tmp_path / "config.yaml").write_text(json.dumps(settings))
    save_motions(small_motions, tmp_path / "small.npz")
    motions = load_motions(f"npz:{tmp_path / 'small.npz'}")
    folder = tmp_path / "killed"
    arguments = [str(tmp_path / "config.yaml"), str(folder), f"npz:{tmp_path / 'small.npz'}"]
    process = subprocess.Popen([sys.executable, "-c", RUN, *arguments])
    deadline = time.monotonic() + 300.0  # a busy machine imports slowly
    try:
        while not list(folder.glob(f"cells/{16 * '?'}.json")) and process.poll() is None:
            assert time.monotonic() < deadline, "no cell was finished"
            time.sleep(0.01)
        workers = children_of(process.pid)
    finally:
        process.kill()
        process.wait()
    while any(map(is_running, workers)):
        assert time.monotonic() < deadline, "the killed run left processes behind"
        time.sleep(0.05)
    run_benchmark(BenchmarkConfig.of(settings), folder, motions=motions)
    assert sum(pool.computed for pool in in_process) < 4  # the first cell was not computed again
    run_benchmark(BenchmarkConfig.of(settings), tmp_path / "whole", motions=motions)
    for name in ("results.csv", "benchmark.json"):
        assert (folder / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def children_of(process):
    text = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process)], capture_output=True, text=True).stdout
    return [int(line) for line in text.split()]


def is_running(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_two_processes_give_the_same_bytes_as_one(computed, small_motions, tmp_path):
    folder, _ = computed
    run_benchmark(BenchmarkConfig.of(QUICK), tmp_path, workers=2, motions=small_motions)
    for name in ("results.csv", "benchmark.json"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_a_real_local_ray_gives_the_same_bytes(computed, small_motions, tmp_path):
    pytest.importorskip("ray", reason="no ray: pip install 'syda-gym[ray]'")
    folder, _ = computed
    run_benchmark(BenchmarkConfig.of(QUICK), tmp_path, workers="ray", motions=small_motions)
    for name in ("results.csv", "benchmark.json"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_a_failed_cell_is_reported_with_its_trace_and_the_rest_goes_on(
    small_motions, tmp_path, in_process, monkeypatch
):
    whole = Worker._episodes

    def broken(self, cell, shown, tell):
        if cell.method == "nearest" and len(cell.route) == 3:
            raise MappingError("no neighbours today")
        return whole(self, cell, shown, tell)

    monkeypatch.setattr(Worker, "_episodes", broken)
    results = run_benchmark(BenchmarkConfig.of(QUICK), tmp_path, motions=small_motions)
    assert [failure["cell"] for failure in results.about["failures"]] == [
        "adult>kid>pepper, nearest, base, none, seed 0"
    ]
    assert "no neighbours today" in results.about["failures"][0]["trace"]
    assert "Traceback" in results.about["failures"][0]["trace"]
    assert len(results.groups("route", "method")) == 5
    monkeypatch.setattr(Worker, "_episodes", whole)
    again = run_benchmark(BenchmarkConfig.of(QUICK), tmp_path, motions=small_motions)
    assert in_process[-1].computed == 1
    assert again.about["failures"] == []


def test_a_full_disk_loses_no_finished_cell(small_motions, tmp_path, in_process, monkeypatch):
    whole, written = cell_files.write_json, []

    def full(path, value):
        if len(written) == 2:
            raise StorageError(f"cannot write {path}: No space left on device")
        written.append(path)
        return whole(path, value)

    monkeypatch.setattr(cell_files, "write_json", full)
    with pytest.raises(StorageError, match="No space left"):
        run_benchmark(BenchmarkConfig.of(QUICK), tmp_path, motions=small_motions)
    monkeypatch.setattr(cell_files, "write_json", whole)
    run_benchmark(BenchmarkConfig.of(QUICK), tmp_path, motions=small_motions)
    assert in_process[-1].computed == 4


def test_other_versions_and_unwritable_folders_are_refused(computed, small_motions, tmp_path, in_process):
    folder, _ = computed
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    about = json.loads((copy / "benchmark.json").read_text())
    (copy / "benchmark.json").write_text(json.dumps({**about, "format": 99}))
    with pytest.raises(StorageError, match="format 99"):
        read_results(copy)
    cell = next((copy / "cells").glob("*.json"))
    cell.write_text(json.dumps({**json.loads(cell.read_text()), "format": 99}))
    before = cell.read_bytes()
    with pytest.raises(StorageError, match="format 99"):
        run_benchmark(BenchmarkConfig.of(QUICK), copy, motions=small_motions)
    assert cell.read_bytes() == before
    blocked = tmp_path / "blocked"
    blocked.write_text("")
    with pytest.raises(StorageError, match="choose another folder"):
        run_benchmark(BenchmarkConfig.of(QUICK), blocked, motions=small_motions)
    with pytest.raises(StorageError, match="no benchmark in"):
        read_results(tmp_path / "nothing")


def test_rows_survive_csv_and_parquet(computed, small_motions, tmp_path, in_process):
    folder, results = computed
    assert read_results(folder).rows == results.rows
    pytest.importorskip("pyarrow", reason="no pyarrow: pip install 'syda-gym[data]'")
    from syda_gym.evaluation.benchmark.results import write_results

    write_results(tmp_path, results, parquet=True)
    assert read_results(tmp_path).rows == results.rows
    damaged = tmp_path / "results.parquet"
    damaged.write_bytes(damaged.read_bytes()[:100])
    with pytest.raises(StorageError, match="not a readable Parquet"):
        read_results(tmp_path)


# --- what is made of them ----------------------------------------------------------------------------------------


def test_compare_gives_a_verdict_only_where_the_interval_leaves_out_zero(computed):
    _, results = computed
    ridge, nearest = results.select(method="ridge"), results.select(method="nearest")
    same = compare(ridge, ridge)
    assert all(one.verdict == "no difference shown" and one.difference.value == 0.0 for one in same)
    for one in compare(ridge, nearest):
        wanted = "no difference shown"
        if one.difference.high < 0:
            wanted = "better"
        elif one.difference.low > 0:
            wanted = "worse"
        assert one.verdict == wanted
        values = ridge.values("landmark_error") - nearest.values("landmark_error")
        if one.route == "all":
            assert one.difference.value == pytest.approx(values.mean())
    with pytest.raises(OptionError, match="no episode in common"):
        compare(ridge.select(route="adult>kid"), nearest.select(route="adult>pepper"))
    with pytest.raises(OptionError, match="no figure 'eror'"):
        compare(ridge, nearest, "eror")


def test_the_page_shows_every_combination(computed, small_motions, tmp_path):
    _, results = computed
    page = write_benchmark_report(results, small_motions, tmp_path).read_text()
    assert page.count("adult&gt;kid&gt;pepper") >= 2
    assert "ridge" in page
    assert "nearest minus ridge" in page
    assert '"chains":[{' in page


def test_the_efficiency_curve_knows_who_wins(small_motions, tmp_path, in_process):
    config = BenchmarkConfig.of(
        {
            "routes": ["adult>kid"],
            "methods": ["ridge"],
            "folds": 3,
            "efficiency": {
                "chain": "adult>kid>pepper", "new_body": "adult", "actions": [1, 3], "draws": 2, "method": "ridge",
            },
        }
    )  # fmt: skip
    results = run_benchmark(config, tmp_path, motions=small_motions)
    assert results.about["failures"] == []
    curve = efficiency_curve(results)
    assert curve is not None
    assert (curve.chain, curve.direct, curve.actions) == ("adult>kid>pepper", "adult>pepper", (1, 3))
    assert curve.paired[0].value > curve.paired[1].value  # more recordings help the direct pair
    assert all(math.isfinite(e.value) for e in (*curve.chained, *curve.difference))
    # By hand: mean over clips of the mean over draws.
    part = [row for row in results.rows if row["kind"] == "efficiency" and row["actions"] == 1]
    direct = [row["landmark_error"] for row in part if row["route"] == "adult>pepper"]
    assert curve.paired[0].value == pytest.approx(np.mean(direct))
    for count in (1, 3):
        advice = curve.advice(count)
        verdict = (
            "Chain" if count in curve.chain_wins() else "direct" if count in curve.direct_wins() else "No difference"
        )
        assert verdict in advice
    assert "at least one" in curve.advice(0)
