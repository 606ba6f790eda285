"""One route for all clips, or one for each: the comparison takes the episodes that were played."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments.parametric import parametric_human
from syda_gym.evaluation.benchmark import BenchmarkConfig, Results, choice, run_benchmark
from syda_gym.evaluation.benchmark.choice import choice_table, route_choices
from syda_gym.evaluation.benchmark.report import write_benchmark_report
from syda_gym.motions.synthetic.generator import generate
from syda_gym.routes.piloting.per_motion import routes_for_clips
from syda_gym.routes.piloting.pilot import Pilot

QUICK = {
    "routes": ["adult>pepper", "adult>kid>pepper", "adult>kid"],
    "methods": ["ridge"],
    "folds": 2,
    "physics": "servo",
}
ROUTES = ("adult>pepper", "adult>kid>pepper")


@pytest.fixture(scope="module")
def computed(small_motions, tmp_path_factory):
    folder = tmp_path_factory.mktemp("choice")
    return folder, run_benchmark(BenchmarkConfig.of(QUICK), folder, motions=small_motions)


def handmade(motions, errors):
    """Rows of both routes with given errors ``(routes, clips)``."""
    clips = motions.pair("adult", "pepper").clips()
    rows = [
        {"kind": "episodes", "route": route, "method": "syda", "agent": "base", "disturbance": "none", "seed": seed,
         "motion": clip.name, "action": clip.source.action, "landmark_error": error + (0.001 if seed else -0.001)}
        for route, own in zip(ROUTES, errors, strict=True)
        for clip, error in zip(clips, own, strict=True)
        for seed in (0, 1)
    ]  # fmt: skip
    return Results(tuple(rows), {})


def test_it_chooses_as_the_environment_and_takes_the_episodes_of_the_chosen_routes(computed, small_motions) -> None:
    _, results = computed
    found = route_choices(results, small_motions)
    assert [(one.ends, one.method, one.routes) for one in found.choices] == [("adult>pepper", "ridge", 2)]
    (one,) = found.choices
    pilot = Pilot(small_motions, "adult", "pepper", mapping="ridge")
    planned = pilot.plan("per_motion")
    assert one.fixed == planned[0].name
    pair = small_motions.pair("adult", "pepper")
    taken = pilot.for_clips(planned, [clip.source.frames for clip in pair.clips()], pair.fps)
    errors = {(row["route"], row["motion"]): row["landmark_error"] for row in results.rows}
    mine = [errors[planned[k].name, clip.name] for k, clip in zip(taken, pair.clips(), strict=True)]
    assert one.per_motion.value == pytest.approx(np.mean(mine))
    assert one.error.value == pytest.approx(np.mean([errors[one.fixed, clip.name] for clip in pair.clips()]))
    assert one.changed == sum(k > 0 for k in taken)
    assert one.least.value <= min(one.per_motion.value, one.best_error.value)


def test_a_better_choice_for_each_clip_is_called_better(small_motions, monkeypatch) -> None:
    count = len(small_motions.pair("adult", "pepper").clips())
    errors = np.full((2, count), 0.10)
    errors[1, ::2] = 0.05
    errors[1, 1::2] = 0.15

    def knowing(bodies, ranked, clips, fps, *, seed=0):
        other = 1 if ranked[0] == ("adult", "pepper") else 0
        return [int((other == 1) == (k % 2 == 0)) for k in range(len(clips))]

    monkeypatch.setattr(choice, "routes_for_clips", knowing)
    (one,) = route_choices(handmade(small_motions, errors), small_motions).choices
    assert one.per_motion.value == pytest.approx(one.least.value)
    assert one.verdict == "better"
    expected = (count + 1) // 2 if one.fixed == ROUTES[0] else count // 2
    assert one.changed == one.gained == expected
    monkeypatch.setattr(choice, "routes_for_clips", lambda *args, **kwargs: [0] * count)
    (one,) = route_choices(handmade(small_motions, errors), small_motions).choices
    assert (one.changed, one.verdict) == (0, "no difference shown")
    assert choice_table(route_choices(handmade(small_motions, errors), small_motions)).rows[0][0] == "adult>pepper"


def test_ends_that_cannot_be_planned_are_named(small_motions) -> None:
    motions = generate(("left_only", "adult", "pepper"), seed=1, actions=("wave_high", "clap_high"), variants=1, fps=10)
    rows = [
        {"kind": "episodes", "route": route, "method": "ridge", "agent": "base", "disturbance": "none",
         "motion": "wave_high-01", "action": "wave_high", "landmark_error": 0.1}
        for route in ("left_only>pepper", "left_only>adult>pepper")
    ]  # fmt: skip
    found = route_choices(Results(tuple(rows), {}), motions)
    assert found.choices == ()
    assert "left_only>pepper" in found.skipped[0]
    assert "two arms" in found.skipped[0]


def test_the_example_is_read() -> None:
    config = BenchmarkConfig.read(Path(__file__).resolve().parents[3] / "examples" / "route_choice.yaml")
    assert {(route[0], route[-1]) for route in config.routes} == {("tall", "pepper")}
    assert len(config.routes) == 4


def test_the_page_holds_the_table(computed, small_motions, tmp_path) -> None:
    _, results = computed
    page = write_benchmark_report(results, small_motions, tmp_path).read_text()
    assert "One route for all, or one for each clip" in page
    found = route_choices(results, small_motions).as_list()
    assert json.loads(json.dumps(found, allow_nan=False))[0]["fixed"] in ROUTES


def test_a_body_that_cannot_follow_a_clip_is_left_for_it() -> None:
    bound = parametric_human("bound", mobility=0.2)
    motions = generate(("adult", bound, "kid", "pepper"), seed=2, actions=("reach_high_front", "wave_high"), variants=1)
    routes = [("adult", "bound", "pepper"), ("adult", "kid", "pepper")]
    clips = motions.pair("adult", "pepper").clips()
    taken = routes_for_clips(motions.bodies, routes, [clip.source.frames for clip in clips], 30.0)
    assert taken == [1] * len(clips)
