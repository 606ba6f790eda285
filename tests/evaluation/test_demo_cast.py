"""Who plays in the demo, and with what words it ends."""

from __future__ import annotations

import json

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError
from syda_gym.evaluation.demo.baselines import MeanPose
from syda_gym.evaluation.demo.cast import FRAIL, SLOW, cast_of, traits, with_guests
from syda_gym.evaluation.demo.known import without_unknown
from syda_gym.motions.loading import load_motions
from syda_gym.motions.synthetic.generator import generate
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.rehearsal import Rehearsal


def test_the_cast_of_the_embedded_motions() -> None:
    motions = with_guests(load_motions("embedded"))
    pepper = motions.bodies["pepper"]
    assert isinstance(pepper, Robot)
    cast = cast_of(motions, pepper)
    assert cast.operator == "tall"
    assert cast.between == ("adult", SLOW, FRAIL, "left_only")
    assert cast.routes[0] == ("tall", "adult", "pepper")
    for take in motions.takes[:5]:
        assert len(take.frames[FRAIL]) == len(take.frames[SLOW]) == len(take.frames["adult"])


def test_the_slow_robot_is_slow_in_its_frames_and_in_the_dry_run() -> None:
    motions = with_guests(load_motions("embedded"))
    slow, nao = motions.bodies[SLOW], motions.bodies["nao"]
    assert isinstance(slow, Robot)
    assert isinstance(nao, Robot)
    lag = []
    for take in motions.takes[:8]:
        steps = np.abs(np.diff(take.frames[SLOW], axis=0)) * take.fps
        assert (steps <= slow.speed * (1.0 + 1e-9)).all()
        lag.append(np.abs(take.frames[SLOW] - take.frames["nao"]).max())
    assert max(lag) > 0.5
    bodies = {name: motions.bodies[name] for name in ("tall", "adult", "pepper", "nao", SLOW, FRAIL, "left_only")}
    together = Rehearsal(bodies, default_plan())
    error = {name: together.score(("tall", name, "pepper")).error for name in bodies if name not in ("tall", "pepper")}
    assert min(error[SLOW], error[FRAIL], error["left_only"]) > 1.3 * max(error["adult"], error["nao"])
    assert traits(SLOW) == "slow_nao (a slow robot)"
    assert traits("adult") == "adult"


def test_a_figure_that_is_no_number_is_left_out_with_a_reason() -> None:
    kept = without_unknown([{"bound": float("nan"), "reward": 1.0, "motion": "a"}, {"bound": 0.1, "reward": 2.0}])
    assert kept["episodes"] == [{"reward": 1.0, "motion": "a"}, {"bound": 0.1, "reward": 2.0}]
    assert kept["left_out"] == {"bound": "the mapping promises no error bound"}
    assert json.loads(json.dumps(kept, allow_nan=False)) == kept
    assert "left_out" not in without_unknown([{"bound": 0.1}])


def test_motions_of_others_keep_their_people() -> None:
    motions = generate(("kid", "pepper"), actions=("wave_high", "clap_high"), variants=1)
    assert with_guests(motions) is motions
    pepper = motions.bodies["pepper"]
    assert isinstance(pepper, Robot)
    cast = cast_of(motions, pepper)
    assert (cast.operator, cast.between, cast.routes) == ("kid", (), (("kid", "pepper"),))


def test_the_mean_pose_answers_everything_alike() -> None:
    adult, pepper = catalog.get("adult"), catalog.get("pepper")
    assert isinstance(pepper, Robot)
    mapping = MeanPose(adult, pepper, pepper.rest)
    frames = np.zeros((3, adult.n_features))
    assert np.array_equal(mapping(frames), np.repeat(pepper.clamp(pepper.rest), 3, axis=0))
    with pytest.raises(MappingError, match="no inverse"):
        mapping.inverse()
