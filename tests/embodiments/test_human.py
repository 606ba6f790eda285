import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from syda_gym.embodiments import HumanSkeleton, catalog, landmark_error
from syda_gym.embodiments.human import BONES, SKELETON_JOINTS
from syda_gym.errors import EmbodimentError

FRAMES = arrays(np.float64, (3, 18), elements=st.floats(-3, 3))


def test_adult_and_kid_have_the_papers_eighteen_features():
    for name in ("adult", "kid"):
        body = catalog.get(name)
        assert body.n_features == 18
        assert body.kind == "human"
        assert body.landmark_names == ("left_elbow", "left_wrist", "right_elbow", "right_wrist")
    assert catalog.get("adult").reach == pytest.approx(0.581)
    assert catalog.get("kid").reach == pytest.approx(0.429)


def test_recording_axes_become_body_axes():
    adult = catalog.get("adult")
    frame = np.zeros(18)
    frame[3:6] = (-0.1, 0.2, -0.3)  # left elbow: to the subject's left, up, forward
    elbow = adult.landmarks(frame)[0, 0]
    np.testing.assert_allclose(elbow, (0.3, 0.1, 0.2))


@given(FRAMES)
def test_points_and_frames_are_inverse(frames):
    adult = catalog.get("adult")
    np.testing.assert_allclose(adult.frames_from_points(adult.arm_points(frames)), frames, atol=1e-12)


@given(FRAMES)
def test_mirroring_twice_changes_nothing_and_keeps_the_error_scale(frames):
    kid = catalog.get("kid")
    np.testing.assert_allclose(kid.mirror(kid.mirror(frames)), frames, atol=1e-12)
    assert landmark_error(kid, frames, kid.mirror(kid.mirror(frames))).max() < 1e-12


def test_standing_frame_has_the_nominal_lengths_and_hangs_down():
    for name in ("adult", "kid"):
        body = catalog.get(name)
        points = body.arm_points(body.standing())[0]
        np.testing.assert_allclose(np.linalg.norm(np.diff(points, axis=1), axis=-1), body.arm_lengths)
        assert (points[:, 2, 2] < points[:, 0, 2]).all()
        assert points[0, 0, 1] > 0 > points[1, 0, 1]


def test_the_completed_skeleton_has_fifteen_joints_and_stands_below_its_head():
    adult = catalog.get("adult")
    joints = adult.complete(adult.standing())
    assert set(joints) == set(SKELETON_JOINTS)
    assert {joint for bone in BONES for joint in bone} == set(SKELETON_JOINTS)
    assert np.allclose(joints["Head"], 0.0, atol=1e-9)  # the adult's origin is the head
    assert joints["LFoot"][0, 2] < -1.4


def test_one_armed_human_has_two_landmarks():
    body = HumanSkeleton("left", height=1.7, upper_arm=0.3, forearm=0.28, shoulders=0.3, sides=("left",))
    assert body.n_features == 9
    assert body.landmarks(body.standing()).shape == (1, 2, 3)
    assert len(body.complete(body.standing())) == 12


def test_spec_round_trip():
    for name in ("adult", "kid"):
        body = catalog.get(name)
        assert catalog.from_spec(body.spec()) == body


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"upper_arm": 0.0}, "positive length"),
        ({"forearm": float("nan")}, "positive length"),
        ({"height": 175.0}, "centimetres"),
        ({"origin": "knee"}, "origin"),
        ({"axes": np.ones((3, 3))}, "rotation"),
        ({"sides": ("right", "left")}, "sides"),
    ],
)
def test_bad_humans_are_refused(change, message):
    good = {"height": 1.7, "upper_arm": 0.3, "forearm": 0.28, "shoulders": 0.3}
    with pytest.raises(EmbodimentError, match=message):
        HumanSkeleton("x", **{**good, **change})


def test_bad_frames_are_refused_with_the_feature_named():
    adult = catalog.get("adult")
    with pytest.raises(EmbodimentError, match="expected shape"):
        adult.landmarks(np.zeros((2, 17)))
    frames = np.zeros((2, 18))
    frames[1, 4] = np.nan
    with pytest.raises(EmbodimentError, match=r"frame 1, feature 'LElbow.y'"):
        adult.landmarks(frames)


def test_unknown_names_get_the_nearest():
    with pytest.raises(EmbodimentError, match="did you mean 'pepper'"):
        catalog.get("peper")
