"""What a person looks like: a face in front, a closed torso, hands beyond the wrists, feet that point forward."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.figure import bones, figure_points
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.look import OPERATOR, PERSON, hex_of, rgb

ADULT = catalog.get("adult")
ONE_ARMED = HumanSkeleton("one", height=1.7, upper_arm=0.29, forearm=0.28, shoulders=0.3, sides=("right",))


@pytest.mark.parametrize("human", [ADULT, ONE_ARMED], ids=["two arms", "one arm"])
def test_every_bone_joins_points_that_are_there_and_wears_a_known_colour(human: HumanSkeleton) -> None:
    points = figure_points(human, human.standing())
    for bone in bones(human):
        assert {bone.start, bone.end} <= set(points)
        assert bone.colour in PERSON
        assert bone.radius > 0.0


def test_front_can_be_told_from_back() -> None:
    points = {name: rows[0] for name, rows in figure_points(ADULT, ADULT.standing()).items()}
    for before, behind in (
        ("Nose", "Head"),
        ("LEye", "Head"),
        ("Head", "Hair"),
        ("Breast", "Middle"),
        ("LToe", "LFoot"),
    ):
        assert points[before][0] > points[behind][0]


def test_the_palm_goes_on_where_the_forearm_points() -> None:
    points = {name: rows[0] for name, rows in figure_points(ADULT, ADULT.standing()).items()}
    forearm, palm = points["LHand"] - points["LElbow"], points["LPalm"] - points["LHand"]
    assert forearm @ palm / np.linalg.norm(forearm) / np.linalg.norm(palm) == pytest.approx(1.0)


def test_the_torso_is_closed_from_neck_to_hips() -> None:
    """Every height between collar and hips lies within the radius of a bone that crosses the body."""
    points = {name: rows[0] for name, rows in figure_points(ADULT, ADULT.standing()).items()}
    across = [bone for bone in bones(ADULT) if bone.start[1:] == bone.end[1:] and bone.start != bone.end]
    for height in np.linspace(points["LHip"][2], points["LCollar"][2], 50):
        nearest = min(abs(points[bone.start][2] - height) - 0.9 * bone.radius * ADULT.height for bone in across)
        assert nearest < 0.0


def test_only_arms_move_with_arms() -> None:
    moving = {bone.start[1:] for bone in bones(ADULT) if bone.moves}
    assert moving == {"Shoulder", "Elbow", "Hand"}


def test_the_shirt_is_the_operators_colour() -> None:
    np.testing.assert_allclose(PERSON["shirt"], rgb(OPERATOR), atol=0.01)
    assert hex_of(rgb(OPERATOR)) == OPERATOR
