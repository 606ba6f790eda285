"""Who plays in the demo, and with what words it ends."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError
from syda_gym.evaluation.demo.baselines import MeanPose
from syda_gym.evaluation.demo.cast import FRAIL, cast_of, with_frail
from syda_gym.motions.loading import load_motions
from syda_gym.motions.synthetic.generator import generate


def test_the_cast_of_the_embedded_motions() -> None:
    motions = with_frail(load_motions("embedded"))
    pepper = motions.bodies["pepper"]
    assert isinstance(pepper, Robot)
    cast = cast_of(motions, pepper)
    assert cast.operator == "tall"
    assert cast.between == ("adult", "nao", FRAIL, "left_only")
    assert cast.routes[0] == ("tall", "adult", "pepper")
    for take in motions.takes[:5]:
        assert len(take.frames[FRAIL]) == len(take.frames["adult"])


def test_motions_of_others_keep_their_people() -> None:
    motions = generate(("kid", "pepper"), actions=("wave_high", "clap_high"), variants=1)
    assert with_frail(motions) is motions
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
