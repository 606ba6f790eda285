"""The test bed: recordings within limits by another procedure, every piece kept, scores that can fail."""

from __future__ import annotations

import json

import numpy as np
import pytest

from syda_gym.errors import OptionError
from syda_gym.evaluation.pools import InlinePool
from syda_gym.evaluation.prediction.bed import TestBed, bed_bodies
from syda_gym.evaluation.prediction.bed_scores import score
from syda_gym.evaluation.prediction.bed_study import bed_jobs, study_bed
from syda_gym.evaluation.prediction.bed_work import BedJob, BedSettings, _faster, open_bed
from syda_gym.motions.loading import load_motions
from syda_gym.routes.dry_run.imitation import imitate
from syda_gym.routes.dry_run.plan import FPS, plan_from_motions


@pytest.fixture(scope="module")
def bed() -> TestBed:
    plan = plan_from_motions(load_motions("embedded"), "adult", most=6)
    return TestBed(bed_bodies(("adult", "stiff"), ("pepper", "nao")), plan)


def test_robots_are_recorded_within_limits_and_speeds(bed: TestBed) -> None:
    session = bed.session(0)
    for name in ("pepper", "nao"):
        robot = bed.bodies[name]
        for take in session.takes:
            q = take.frames[name]
            assert not robot.violations(q).any()
            assert (np.abs(np.diff(q, axis=0)) * FPS <= np.minimum(robot.speed, 20.0) + 1e-6).all()


def test_sessions_differ_and_the_same_one_is_the_same_bits(bed: TestBed) -> None:
    first, again, other = bed.session(0), bed.session(0), bed.session(1)
    for name in bed.bodies:
        assert np.array_equal(first.takes[0].frames[name], again.takes[0].frames[name])
        assert not np.array_equal(first.takes[0].frames[name], other.takes[0].frames[name])


def test_the_recorder_is_not_the_predictor_s_solver(bed: TestBed) -> None:
    recorded = bed.session(0)
    pepper = bed.bodies["pepper"]
    limbs = np.diff(pepper.arm_points(recorded.takes[0].frames["pepper"])[:, 0], axis=1)
    limbs /= np.linalg.norm(limbs, axis=-1, keepdims=True)
    foreseen = imitate(pepper, bed.plan)[0]["left"]
    apart = np.linalg.norm(limbs - foreseen, axis=-1).mean()
    assert 0.05 < apart < 0.8  # the same motion, another procedure


def test_everything_is_scored_and_finished_pieces_are_taken_again(bed: TestBed, tmp_path) -> None:
    settings = BedSettings(bed, folds=2, method="geometric", preset="fixed")
    pool = InlinePool(open_bed, settings)
    kept = ["planned motion", "without joint speeds", "limbs pointed with lag", "led by positions"]
    found = study_bed(settings, tmp_path, sessions=2, dry_runs=kept, pool=pool, resamples=20)
    assert pool.computed == len(bed_jobs(2, kept)) == 8
    assert (found["pairs"], found["chains"]) == (12, 24)
    for name in (*kept, "T general", "hops", "measured", "coverage"):
        scores = found["scores"][name]
        assert -1.0 <= scores["pairs"]["value"] <= 1.0
        assert scores["regret"]["value"] >= 0.0
    assert found["scores"]["hops"]["pairs"]["value"] == 0.0
    assert set(found["without_one_body"]["planned motion"]) == set(bed.bodies)
    again = InlinePool(open_bed, settings)
    second = study_bed(settings, tmp_path, sessions=2, dry_runs=kept, pool=again, resamples=20)
    assert json.dumps(second) == json.dumps(found)  # as text, because no number equals itself where none is known
    assert again.computed == 0
    assert settings.key(BedJob("session", "0")) != BedSettings(bed, folds=2).key(BedJob("session", "0"))
    with pytest.raises(OptionError, match="at least 2"):
        study_bed(settings, tmp_path, sessions=1)


def test_scores_know_right_from_wrong() -> None:
    error = np.array([0.1, 0.3, 0.2, 0.5])
    assert score(-error, error) == pytest.approx(1.0)
    assert score(error, error) == pytest.approx(-1.0)
    assert score(np.ones(4), error) == 0.0


def test_a_faster_plan_is_the_same_motion_in_less_time(bed: TestBed) -> None:
    fast = _faster(bed.plan, 2.0)
    assert abs(len(fast.clips[0]) - len(bed.plan.clips[0]) / 2) <= 1
    assert np.allclose(fast.clips[0][3], bed.plan.clips[0][6])
