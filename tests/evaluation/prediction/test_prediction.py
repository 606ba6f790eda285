"""The validation study on three bodies of the embedded motions."""

from __future__ import annotations

import json

import numpy as np
import pytest

from syda_gym.errors import MotionError, OptionError
from syda_gym.evaluation.prediction.picture import prediction_png
from syda_gym.evaluation.prediction.study import validate
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions
from syda_gym.routes.measured import measure_bodies


@pytest.fixture(scope="module")
def few() -> Motions:
    whole = load_motions("embedded")
    takes = [take for take in whole.takes if take.action.startswith(("reach", "wave"))]
    return Motions(whole.name, tuple(takes), whole.bodies, whole.families, synthetic=True)


def test_every_route_is_scored_on_actions_that_no_link_has_seen(few: Motions) -> None:
    options = {"bodies": ("adult", "kid", "tall"), "method": "syda", "folds": 2, "samples": 2**12, "resamples": 20}
    study = validate(few, **options)
    assert len(study.routes) == 6 + 6
    assert {route.hops for route in study.routes} == {1, 2}
    assert all(0.0 < route.error < 1.0 for route in study.routes)
    for route in study.routes:
        reach = few.bodies[route.bodies[-1]].reach
        assert route.metres == pytest.approx(route.error * reach)
        links = [study.links[step].T for step in zip(route.bodies[:-1], route.bodies[1:], strict=True)]
        assert route.predicted["T"] == pytest.approx(np.prod(links))
        assert route.predicted["hops"] == -route.hops
        assert -0.5 < route.predicted["dry_run"] < 0.0
    again = validate(few, **options)
    assert json.dumps(again.as_dict()) == json.dumps(study.as_dict())
    picture = prediction_png(study, ("T", "measured"))
    assert picture.startswith(b"\x89PNG")
    with pytest.raises(OptionError, match="did you mean 'measured'"):
        prediction_png(study, ("measure",))
    direct, around = (
        next(r for r in study.routes if r.bodies == b) for b in (("adult", "tall"), ("adult", "kid", "tall"))
    )
    assert direct.predicted["training_error"] > around.predicted["training_error"]


def test_one_armed_bodies_are_scored_on_the_arm_that_all_share(few: Motions) -> None:
    study = validate(few, bodies=("adult", "kid", "left_only"), folds=2, max_hops=1, samples=2**12, resamples=20)
    errors = {route.bodies: route.error for route in study.routes}
    assert errors["left_only", "adult"] < 0.3  # the right arm, which nobody could know, does not count


def test_scores_without_the_lost_arm_are_told_apart(few: Motions) -> None:
    study = validate(
        few, bodies=("adult", "kid", "tall", "left_only"), folds=2, max_hops=2, samples=2**12, resamples=20
    )
    assert study.scores[0].all.count == 12 + 24
    assert study.full_scores[0].all.count == 6 + 6
    assert {score.name for score in study.full_scores} == {score.name for score in study.scores}


def test_measured_bodies_predict_the_pairs_that_they_come_from(few: Motions) -> None:
    pairs = [("adult", "kid"), ("kid", "tall"), ("adult", "tall")]
    bodies = measure_bodies(few, pairs)
    assert set(bodies.leading) == {"adult", "kid", "tall"}
    assert 0.02 < bodies.error(("adult", "kid")) < 0.3
    assert bodies.error(("adult", "tall", "kid")) > bodies.error(("adult", "kid"))


def test_bad_options(few: Motions) -> None:
    with pytest.raises(OptionError, match="folds"):
        validate(few, bodies=("adult", "kid", "tall"), folds=99)
    with pytest.raises(OptionError, match="max_hops"):
        validate(few, bodies=("adult", "kid", "tall"), max_hops=0)
    with pytest.raises(MotionError, match="three bodies"):
        validate(few, bodies=("adult", "kid"))
    with pytest.raises(MotionError, match="ghost"):
        validate(few, bodies=("adult", "kid", "ghost"))
