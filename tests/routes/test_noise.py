"""Alpha from recordings."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.errors import MotionError, OptionError
from syda_gym.routes.noise import alpha_from_noise, high_frequency_noise


@pytest.mark.parametrize("sigma", [0.002, 0.01])
def test_noise_is_found_under_motion(sigma: float) -> None:
    rng = np.random.default_rng(0)
    time = np.arange(600) / 30.0
    smooth = 0.3 * np.stack([np.sin(2.0 * time), np.cos(3.0 * time), np.sin(1.3 * time)], axis=1)
    clips = [smooth[:300], smooth[300:]]
    assert high_frequency_noise(clips) < 1e-4
    noisy = [clip + rng.normal(scale=sigma, size=clip.shape) for clip in clips]
    noisy[0][50] += 1.0  # an outlier
    assert high_frequency_noise(noisy) == pytest.approx(sigma, rel=0.1)


def test_alpha_is_one_for_the_cleanest_pair() -> None:
    alpha = alpha_from_noise({"robot": 0.0, "adult": 0.01, "kid": 0.02}, resolution=0.005)
    assert alpha[frozenset(("robot", "adult"))] == 1.0
    assert alpha[frozenset(("robot", "kid"))] == pytest.approx(np.hypot(0.005, 0.01) / np.hypot(0.005, 0.02))
    assert alpha[frozenset(("adult", "kid"))] == pytest.approx(np.hypot(0.005, 0.01) / np.hypot(0.01, 0.02))


def test_bad_noise() -> None:
    with pytest.raises(MotionError, match="four frames"):
        high_frequency_noise([np.zeros((3, 3))])
    with pytest.raises(OptionError, match="at least two"):
        alpha_from_noise({"adult": 0.1})
    with pytest.raises(OptionError, match="resolution"):
        alpha_from_noise({"a": 0.0, "b": 0.0}, resolution=0.0)
    assert alpha_from_noise({"a": 0.0, "b": 0.0}) == {frozenset("ab"): 1.0}
