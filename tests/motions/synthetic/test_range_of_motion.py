"""Limb directions and the four arm angles of the human arm model."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments.embodiment import Side
from syda_gym.embodiments.parametric import ARM_ANGLES, FULL_RANGE, parametric_human
from syda_gym.motions.synthetic.range_of_motion import arm_angles, directions_from_angles, within_range

SIDES: tuple[Side, Side] = ("left", "right")


def _directions(seed: int, count: int = 20) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, 2, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), side=st.sampled_from(SIDES))
def test_angles_and_directions_are_inverse(seed: int, side: Side) -> None:
    directions = _directions(seed)
    again = directions_from_angles(arm_angles(directions, side, FULL_RANGE), side)
    np.testing.assert_allclose(again, directions, atol=1e-7)


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), side=st.sampled_from(SIDES), mobility=st.floats(0.2, 0.95))
def test_limited_directions_are_reached_by_allowed_angles(seed: int, side: Side, mobility: float) -> None:
    limits = parametric_human("stiff", mobility=mobility).joint_limits
    assert limits is not None
    limited = within_range(_directions(seed), limits, side)
    np.testing.assert_allclose(np.linalg.norm(limited, axis=-1), 1.0, atol=1e-12)
    np.testing.assert_allclose(within_range(limited, limits, side), limited, atol=1e-6)


@pytest.mark.parametrize("side", SIDES)
def test_hanging_arm_with_forearm_forward_is_zero(side: Side) -> None:
    """At zero angles the upper arm hangs and the forearm points forward."""
    directions = directions_from_angles(np.zeros((1, 4)), side)
    np.testing.assert_allclose(directions[0], [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], atol=1e-12)


def test_sides_mirror_each_other() -> None:
    angles = np.random.default_rng(1).uniform(*np.array([FULL_RANGE[name] for name in ARM_ANGLES]).T, size=(30, 4))
    left, right = (directions_from_angles(angles, side) for side in SIDES)
    np.testing.assert_allclose(left * [1.0, -1.0, 1.0], right, atol=1e-12)
