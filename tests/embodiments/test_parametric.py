"""Parametric humans: proportions as asked for, and a range of motion that shrinks with mobility."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.parametric import ARM_ANGLES, FULL_RANGE, PARAMETRIC_HUMANS, parametric_human
from syda_gym.errors import EmbodimentError


@given(
    stature=st.floats(0.5, 2.5), arms=st.floats(0.4, 1.9), share=st.floats(0.25, 0.75), shoulders=st.floats(0.4, 1.9)
)
def test_lengths_follow_the_proportions(stature: float, arms: float, share: float, shoulders: float) -> None:
    body = parametric_human(
        "someone", stature=stature, arm_proportion=arms, upper_share=share, shoulder_proportion=shoulders
    )
    usual = parametric_human("usual", stature=stature)
    assert body.height == stature
    assert body.reach == pytest.approx(arms * usual.reach)
    assert body.upper_arm == pytest.approx(share * body.reach)
    assert body.shoulders == pytest.approx(shoulders * usual.shoulders)
    standing = body.arm_points(body.standing())[0]
    np.testing.assert_allclose(np.linalg.norm(np.diff(standing, axis=1), axis=-1), body.arm_lengths)


def test_the_usual_adult_is_the_papers() -> None:
    usual, adult = parametric_human("usual", stature=1.75), catalog.get("adult")
    np.testing.assert_allclose(usual.arm_lengths, adult.arm_lengths, atol=2e-3)


@given(st.floats(0.2, 0.99), st.floats(0.2, 0.99))
def test_less_mobility_is_a_smaller_range(one: float, other: float) -> None:
    low, high = sorted((one, other))
    less, more = (parametric_human("stiff", mobility=value).joint_limits for value in (low, high))
    assert less is not None
    assert more is not None
    for angle in ARM_ANGLES:
        assert FULL_RANGE[angle][0] <= more[angle][0] <= less[angle][0] < less[angle][1] <= more[angle][1]
        assert more[angle][1] <= FULL_RANGE[angle][1]


def test_full_mobility_has_no_limits() -> None:
    assert parametric_human("free").joint_limits is None


@pytest.mark.parametrize("name", sorted(PARAMETRIC_HUMANS))
def test_catalog_knows_them_and_their_description_rebuilds_them(name: str) -> None:
    body = catalog.get(name)
    assert body.name == name
    assert catalog.from_spec(body.spec()) == body


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stature": 175.0}, "stature must be between"),
        ({"stature": float("nan")}, "stature must be between"),
        ({"arm_proportion": 0.0}, "arm_proportion must be between"),
        ({"mobility": 1.5}, "mobility must be between"),
        ({"sides": ()}, "sides must be"),
        ({"axes": np.ones((3, 3))}, "3x3 rotation"),
    ],
)
def test_wrong_proportions(options: dict[str, object], message: str) -> None:
    with pytest.raises(EmbodimentError, match=message):
        parametric_human("someone", **options)  # type: ignore[arg-type]
