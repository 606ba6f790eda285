from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import HumanSkeleton, landmark_error
from syda_gym.embodiments.robot import Robot, select_sides
from syda_gym.errors import MappingError, OptionError
from syda_gym.mappings import fit, load_mapping, save_mapping
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.motions.clip import PairedMotions
from tests.mappings.conftest import make_pair


@pytest.fixture(scope="module")
def mapping(adult_pepper: PairedMotions) -> CodedMapping:
    return fit(adult_pepper, preset="synergies", epochs=40)


def moved(body: HumanSkeleton, frames: np.ndarray, scale: float, turn: float, shift: list[float]) -> np.ndarray:
    """The same motion of a larger person who stands elsewhere and faces elsewhere."""
    c, s = np.cos(turn), np.sin(turn)
    about_vertical = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return body.frames_from_points(scale * body.arm_points(frames) @ about_vertical.T + np.array(shift))


@given(
    scale=st.floats(0.5, 2.0),
    turn=st.floats(-3.1, 3.1),
    shift=st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3),
)
@settings(max_examples=8, deadline=None)
def test_size_heading_and_place_of_the_operator_do_not_matter(mapping, adult_pepper, scale, turn, shift):
    frames = adult_pepper.source[::7]
    elsewhere = moved(adult_pepper.source_body, frames, scale, turn, shift)
    expected, found = (mapping.target.landmarks(mapping(x)) for x in (frames, elsewhere))
    assert np.abs(expected - found).max() < 1e-5


@given(rows=st.lists(st.integers(0, 119), min_size=2, max_size=6))
@settings(max_examples=8, deadline=None)
def test_a_mirrored_motion_maps_to_the_mirrored_motion(mapping, adult_pepper, rows):
    frames = adult_pepper.source[rows]
    body, robot = mapping.source, mapping.target
    direct = robot.landmarks(robot.mirror(mapping(frames)))
    mirrored = robot.landmarks(mapping(body.mirror(frames)))
    assert np.abs(direct - mirrored).max() < 1e-4


def test_mirror_equivariance_holds_on_the_way_back(mapping, adult_pepper):
    back = mapping.inverse()
    frames = adult_pepper.target[::9]
    assert np.allclose(back.target.mirror(back(frames)), back(back.source.mirror(frames)), atol=1e-6)


def spread(pair: PairedMotions) -> float:
    """Error of the constant mean pose [m]."""
    mean = np.repeat(pair.target.mean(axis=0)[None], len(pair), axis=0)
    return float(landmark_error(pair.target_body, mean, pair.target).mean())


def test_unseen_actions_are_predicted_better_than_by_the_mean_pose(adult_pepper):
    train, test = adult_pepper.without_actions(["reach4"]), adult_pepper.only_actions(["reach4"])
    mapping = fit(train, confidence=False)
    error = landmark_error(test.target_body, mapping(test.source), test.target).mean()
    assert error < 0.6 * spread(test)


@pytest.mark.parametrize("preset", ["general", "synergies", "accurate", "interpolation"])
def test_every_preset_comes_back_from_disk_bit_by_bit(adult_pepper, tmp_path, preset):
    options = {} if preset in ("general", "accurate") else {"epochs": 2}
    mapping = fit(adult_pepper, preset=preset, **options)
    save_mapping(mapping, tmp_path / "m")
    loaded = load_mapping(tmp_path / "m")
    assert np.array_equal(loaded(adult_pepper.source), mapping(adult_pepper.source))
    assert np.array_equal(loaded.inverse()(adult_pepper.target), mapping.inverse()(adult_pepper.target))
    assert np.array_equal(loaded.error_bound(adult_pepper.source), mapping.error_bound(adult_pepper.source))
    assert np.array_equal(loaded.difficulty(adult_pepper.source), mapping.difficulty(adult_pepper.source))


def test_single_frames_and_batches_agree(mapping, adult_pepper):
    frames = adult_pepper.source[:40]
    one_by_one = np.stack([mapping(frame) for frame in frames])
    assert landmark_error(mapping.target, one_by_one, mapping(frames)).max() < 1e-4


def test_between_humans_the_general_preset_is_a_hop(adult_kid, tmp_path):
    hop = fit(adult_kid, confidence=False)
    assert hop.regressor.kind == "hop"
    pair = adult_kid
    error = landmark_error(pair.target_body, hop(pair.source), pair.target).mean()
    mean = np.repeat(pair.target.mean(axis=0)[None], len(pair), axis=0)
    assert error < 0.5 * landmark_error(pair.target_body, mean, pair.target).mean()
    save_mapping(hop, tmp_path / "hop")
    assert np.array_equal(load_mapping(tmp_path / "hop").inverse()(pair.target), hop.inverse()(pair.target))


def test_the_lag_of_a_recording_is_found(adult_pepper):
    from syda_gym.mappings.methods.arm_problem import ArmProblem, Coding

    late = adult_pepper.target.copy()
    rows = adult_pepper.recordings == "take1"
    late[rows] = np.roll(adult_pepper.target[rows], 3, axis=0)
    late[np.flatnonzero(rows)[:3]] = adult_pepper.target[np.flatnonzero(rows)[0]]
    pair = PairedMotions(
        adult_pepper.source_body,
        adult_pepper.target_body,
        adult_pepper.source,
        late,
        actions=adult_pepper.actions,
        recordings=adult_pepper.recordings,
        times=adult_pepper.times,
    )
    lags = ArmProblem.build(pair, 0, Coding(6)).lags
    assert lags["take1"] == 3
    assert abs(lags["take0"]) <= 1


def test_robots_with_other_arms(adult_pepper):
    """NAO has the same kind of arm; a left-only Pepper has one arm."""
    pair = make_pair("adult", "nao")
    mapping = fit(pair, confidence=False)
    assert landmark_error(pair.target_body, mapping(pair.source), pair.target).mean() < 0.4 * spread(pair)
    pepper = adult_pepper.target_body
    assert isinstance(pepper, Robot)
    left = Robot(select_sides(pepper, ["left"]))
    one_armed = PairedMotions(
        adult_pepper.source_body,
        left,
        adult_pepper.source,
        adult_pepper.target[:, :5],
        actions=adult_pepper.actions,
        recordings=adult_pepper.recordings,
        times=adult_pepper.times,
    )
    mapping = fit(one_armed, confidence=False)
    assert mapping(one_armed.source).shape == (len(one_armed), 5)
    assert landmark_error(left, mapping(one_armed.source), one_armed.target).mean() < 0.5 * spread(one_armed)
    back = mapping.inverse()(one_armed.target)
    assert back.shape == one_armed.source.shape
    # What a one-armed robot cannot tell stays at the median pose.
    assert np.ptp(back.reshape(-1, 2, 9)[:, 1], axis=0).max() < 1e-9


def test_a_one_armed_human_drives_one_arm(adult_pepper):
    adult = adult_pepper.source_body
    assert isinstance(adult, HumanSkeleton)
    spec = {key: value for key, value in adult.spec().items() if key != "kind"}
    right = HumanSkeleton(**{**spec, "name": "right_only", "sides": ("right",)})
    pair = PairedMotions(
        right,
        adult_pepper.target_body,
        adult_pepper.source[:, 9:],
        adult_pepper.target,
        actions=adult_pepper.actions,
        recordings=adult_pepper.recordings,
        times=adult_pepper.times,
    )
    mapping = fit(pair, confidence=False)
    error = landmark_error(pair.target_body, mapping(pair.source), pair.target).mean(axis=0)
    assert error[2:].mean() < 0.5 * spread(pair)
    assert np.ptp(mapping(pair.source)[:, :5], axis=0).max() < 1e-9


def test_outputs_obey_limits_even_for_absurd_input(mapping, adult_pepper):
    rng = np.random.default_rng(1)
    wild = adult_pepper.source + rng.normal(scale=0.5, size=adult_pepper.source.shape)
    assert not mapping.target.violations(mapping(wild)).any()
    limited = mapping.sequence(wild, 30.0)
    assert (np.abs(np.diff(limited, axis=0)) <= mapping.target.speed / 30.0 + 1e-9).all()


def test_a_zero_length_arm_does_not_break_the_mapping(mapping, adult_pepper):
    frame = adult_pepper.source[0].copy()
    frame[3:6] = frame[0:3]
    frame[6:9] = frame[0:3]
    assert np.isfinite(mapping(frame)).all()


def test_options_are_checked(adult_pepper):
    with pytest.raises(OptionError, match="lag"):
        fit(adult_pepper, lag=-2)
    with pytest.raises(OptionError, match="did you mean 'noise'"):
        fit(adult_pepper, preset="synergies", nois=0.1)
    with pytest.raises(OptionError, match="did you mean 'shrinkage'"):
        fit(adult_pepper, shrinkag=0.1)
    with pytest.raises(MappingError, match="confidence=True"):
        fit(adult_pepper, confidence=False).error_bound(adult_pepper.source)


def test_one_action_gives_no_bound_and_says_why(adult_pepper):
    mapping = fit(adult_pepper.only_actions(["reach0"]))
    with pytest.raises(MappingError, match="two actions"):
        mapping.error_bound(adult_pepper.source)
    assert "no error bound: one action" in repr(mapping)
    assert mapping.difficulty(adult_pepper.source).shape == (len(adult_pepper),)
    assert not mapping.unfamiliar(adult_pepper.source).any(), "one action cannot tell how far another one may be"
