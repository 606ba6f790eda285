"""Two seconds of standing tell who is there, and everything else is refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.teleoperation.calibration import AXES, Calibrator, calibrate


def standing(
    body: HumanSkeleton, *, scale: float = 1.0, yaw: float = 0.0, shift: FloatArray | None = None, axes: str = "kinect"
) -> FloatArray:
    """60 noisy frames of somebody ``scale`` times as large, turned and elsewhere, in the source's axes [m]."""
    points = body.arm_points(body.standing())[0] * scale
    c, s = np.cos(yaw), np.sin(yaw)
    turned = points @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T + (0.0 if shift is None else shift)
    noise = np.random.default_rng(0).normal(scale=0.004, size=(60, 2, 3, 3))
    return ((turned + noise) @ AXES[axes]).reshape(60, 18)


@settings(max_examples=40, deadline=None)
@given(
    scale=st.floats(0.55, 1.4),
    yaw=st.floats(-3.0, 3.0),
    x=st.floats(-5.0, 5.0),
    axes=st.sampled_from(sorted(AXES)),
    unit=st.sampled_from([("m", 1.0), ("cm", 100.0), ("mm", 1000.0)]),
)
def test_anybody_anywhere_becomes_the_mapping_s_operator(
    scale: float, yaw: float, x: float, axes: str, unit: tuple[str, float]
) -> None:
    body = catalog.get("adult")
    assert isinstance(body, HumanSkeleton)
    frames = standing(body, scale=scale, yaw=yaw, shift=np.array([x, 0.3, 1.0]), axes=axes) * unit[1]
    found = calibrate(body, frames, axes)
    assert found.unit == unit[0]
    assert bool(found.notices) == (unit[0] != "m"), "another unit is said aloud"
    assert found.scale == pytest.approx(1.0 / scale, rel=0.02)
    assert np.cos(found.yaw - yaw) > 0.999
    assert np.abs(found.apply(frames.mean(axis=0)) - body.standing()).max() < 0.02


def test_centimetres_are_named_with_the_length_that_gave_them_away(adult: HumanSkeleton) -> None:
    assert "sends cm, not metres: an arm measures 58." in calibrate(adult, 100 * standing(adult)).notices[0]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: f[:5], "at least 10 frames"),
        (lambda f: f * np.nan, "not finite"),
        (lambda f: f * 0.0, "no human arm"),
        (lambda f: f * 7.0, "no human arm"),
        (lambda f: f + np.linspace(0, 0.5, 60)[:, None], "moving by"),
        (lambda f: np.random.default_rng(1).normal(size=f.shape), "calibration: "),
        (lambda f: f.reshape(60, 6, 3)[:, :, [0, 2, 1]].reshape(60, 18), "limbs point along"),
        (lambda f: np.concatenate([f[:, :9] * [1] * 1, f[:, 9:] * 0.5], axis=1), "one arm is not tracked|shoulders"),
    ],
    ids=["few", "nan", "zero", "giant", "walking", "noise", "axes", "one arm"],
)
def test_garbage_is_refused_with_a_reason(adult: HumanSkeleton, spoil: object, message: str) -> None:
    with pytest.raises(TeleoperationError, match=message):
        calibrate(adult, spoil(standing(adult)))  # type: ignore[operator]


def test_raised_arms_are_not_standing(adult: HumanSkeleton) -> None:
    points = adult.arm_points(adult.standing())[0]
    points[0, 1] = points[0, 0] + [0.294, 0.0, 0.0]
    points[0, 2] = points[0, 1] + [0.287, 0.0, 0.0]
    frame = adult.frames_from_points(points[None])[0]
    with pytest.raises(TeleoperationError, match="left upper arm is 90 degrees"):
        calibrate(adult, np.repeat(frame[None], 60, axis=0))


def test_a_tilted_shoulder_line_is_refused(adult: HumanSkeleton) -> None:
    points = adult.arm_points(adult.standing())[0]
    points[0, :, 2] += 0.25
    frame = adult.frames_from_points(points[None])[0]
    with pytest.raises(TeleoperationError, match="stand upright"):
        calibrate(adult, np.repeat(frame[None], 60, axis=0))


def test_the_calibrator_waits_for_two_quiet_seconds(adult: HumanSkeleton) -> None:
    frames, rng, calibrator = standing(adult), np.random.default_rng(0), Calibrator(adult)
    now = 0.0
    for _ in range(90):  # fidgeting
        now += 1 / 30
        assert calibrator.add(now, frames[0] + rng.normal(scale=0.1, size=18)) is None
    assert "calibration" in calibrator.message
    for index in range(120):
        now += 1 / 30
        found = calibrator.add(now, frames[index % 60])
        if found is not None:
            break
    assert found is not None
    assert 1.9 < index / 30 < 2.6


def test_a_gap_in_the_stream_starts_the_calibration_anew(adult: HumanSkeleton) -> None:
    frame, calibrator = adult.standing(), Calibrator(adult)
    for index in range(55):
        assert calibrator.add(index / 30, frame) is None
    assert calibrator.add(10.0, frame) is None, "one frame after eight silent seconds is no standing"


def test_robots_need_no_calibration_and_unknown_axes_are_named(pepper: Robot, adult: HumanSkeleton) -> None:
    found = Calibrator(pepper).add(0.0, pepper.rest)
    assert found is not None
    assert (found.apply(pepper.rest) == pepper.rest).all()
    with pytest.raises(OptionError, match="did you mean 'kinect'"):
        Calibrator(adult, axes="kinekt")
    with pytest.raises(OptionError, match="calibration must take"):
        Calibrator(adult, seconds=-1.0)


def test_a_glitching_limb_is_noticed(adult: HumanSkeleton) -> None:
    found = calibrate(adult, standing(adult))
    frame = adult.standing()
    assert found.implausible(frame) == ""
    frame[6:9] += 0.5
    assert "left forearm is" in found.implausible(frame)
