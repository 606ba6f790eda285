"""The route for the clip that is about to be played, and what ranks routes in the environment."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import syda_gym
from syda_gym.embodiments import catalog
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.parametric import parametric_human
from syda_gym.errors import OptionError
from syda_gym.motions.clip import Motions
from syda_gym.motions.synthetic.generator import generate
from syda_gym.routes.piloting.per_motion import routes_for_clips
from syda_gym.routes.piloting.pilot import Pilot


@pytest.fixture(scope="module")
def motions() -> Motions:
    return generate(
        ("adult", "kid", "pepper"), seed=4, actions=("wave_high", "reach_high_front", "clap_high"), variants=1
    )


def moving(body: HumanSkeleton, lift: float) -> np.ndarray:
    """Three seconds at 30 Hz: both upper arms sweep by ``lift`` [rad], forearms straight."""
    angle = lift * (0.5 - 0.5 * np.cos(np.linspace(0.0, 4.0 * np.pi, 90)))
    way = np.stack([np.sin(angle), np.zeros(90), -np.cos(angle)], axis=-1)
    points = np.repeat(body.arm_points(body.standing()), 90, axis=0)
    for arm in range(2):
        points[:, arm, 1] = points[:, arm, 0] + body.upper_arm * way
        points[:, arm, 2] = points[:, arm, 1] + body.forearm * way
    return body.frames_from_points(points)


def test_a_clip_leaves_the_route_whose_body_cannot_follow_it() -> None:
    bound = parametric_human("bound", mobility=0.2)
    bodies = {"adult": catalog.get("adult"), "bound": bound, "kid": catalog.get("kid"), "pepper": catalog.get("pepper")}
    routes = [("adult", "bound", "pepper"), ("adult", "kid", "pepper")]
    adult = catalog.get("adult")
    assert isinstance(adult, HumanSkeleton)
    high = moving(adult, 2.6)
    assert routes_for_clips(bodies, routes, [high], 30.0) == [1]
    assert routes_for_clips(bodies, routes[::-1], [high], 30.0) == [0]


def test_the_same_route_twice_is_a_tie_and_keeps_the_first(motions: Motions) -> None:
    bodies = dict(motions.bodies)
    clip = motions.clips("adult")[0]
    routes = [("adult", "pepper"), ("adult", "pepper")]
    assert routes_for_clips(bodies, routes, [clip.frames], clip.fps) == [0]
    with pytest.raises(OptionError, match="at least one route"):
        routes_for_clips(bodies, [], [clip.frames], clip.fps)


def test_the_environment_takes_the_route_of_the_clip(motions: Motions) -> None:
    env = gym.make("SydaTeleop-v0", motions=motions, mapping="ridge", route="per_motion", physics="servo")
    repertoire = env.unwrapped._fleet.repertoire  # type: ignore[attr-defined]
    assert len(repertoire.routes) == 2
    repertoire.clip_routes[:] = [1] * len(repertoire.clips)
    _, info = env.reset(seed=0)
    assert info["route"] == repertoire.routes[1].name
    repertoire.clip_routes[:] = [0] * len(repertoire.clips)
    _, info = env.reset(seed=0)
    assert info["route"] == repertoire.routes[0].name
    env.close()


def test_predictors_of_the_environment(motions: Motions) -> None:
    ends = motions, "adult", "pepper"
    by_hops = Pilot(*ends, mapping="ridge", predictor="hops").plan("auto")
    assert by_hops[0].bodies == ("adult", "pepper")
    measured = Pilot(*ends, mapping="ridge", predictor="measured").plan("sample")
    assert {route.bodies for route in measured} == {("adult", "pepper"), ("adult", "kid", "pepper")}
    with pytest.raises(OptionError, match="drop predictor='hops'"):
        Pilot(*ends, mapping="ridge", predictor="hops").plan("per_motion")
    with pytest.raises(OptionError, match="unknown predictor"):
        gym.make("SydaTeleop-v0", motions=motions, predictor="luck")
    with pytest.raises(OptionError, match="measured"):
        Pilot(*ends, mapping=_given(motions), predictor="measured")._measured()


def _given(motions: Motions) -> syda_gym.Mapping:
    return syda_gym.fit(motions.pair("adult", "pepper"), method="ridge")
