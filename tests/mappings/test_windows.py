from __future__ import annotations

import numpy as np
import pytest

from syda_gym.errors import OptionError
from syda_gym.mappings.windows import past_frames, window_study


def test_a_window_never_looks_ahead_or_into_another_clip(adult_pepper):
    codes = np.arange(len(adult_pepper), dtype=np.float64)[:, None, None]
    windows = past_frames(adult_pepper, codes, 2)[:, 0]
    assert windows[0].tolist() == [0, 0, 0]
    assert windows[5].tolist() == [5, 4, 3]
    assert windows[24].tolist() == [24, 24, 24]  # the first frame of the second clip
    assert (windows[:, 1:] <= windows[:, :1]).all()


def test_the_controls_stand_beside_every_result(adult_pepper):
    rows = window_study(adult_pepper.rows(np.arange(0, 120, 2)), window=2)
    assert [row.name for row in rows] == [
        "one frame",
        "window of 2",
        "control: one frame and its index",
        "control: window of 2 and index",
    ]
    assert rows[0].gain == rows[0].gain_inside == 0.0
    for row in rows:
        assert 0.0 < row.error < 0.2
        assert row.gain == pytest.approx(1.0 - row.error / rows[0].error)


def test_a_window_looks_back_at_least_one_frame(adult_pepper):
    with pytest.raises(OptionError, match="at least 1"):
        window_study(adult_pepper, window=0)
