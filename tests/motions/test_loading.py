"""``load_motions``: prefixes, sniffing, resampling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.errors import MotionError, OptionError
from syda_gym.motions import Motions, Take, generate, load_motions, resampled


def _ramp(fps: float, count: int, timestamps: np.ndarray | None = None, held: list[int] | None = None) -> Motions:
    """Every feature equals the time in seconds."""
    times = np.arange(count) / fps if timestamps is None else timestamps - timestamps[0]
    filled = np.zeros((count, 18), dtype=bool)
    filled[held or []] = True
    take = Take(
        "r", "a", fps, {"adult": np.repeat(times[:, None], 18, axis=1)}, filled={"adult": filled}, timestamps=timestamps
    )
    return Motions("ramp", (take,), {"adult": catalog.get("adult")})


def test_embedded_is_loaded_once() -> None:
    assert load_motions() is load_motions("embedded")


def test_motions_pass_through() -> None:
    motions = generate(["adult"], actions=["wave_low"], variants=1)
    assert load_motions(motions) is motions


@pytest.mark.parametrize(
    ("old", "new", "count"), [(30.0, 10.0, 34), (30.0, 30.0, 100), (30.0, 60.0, 199), (25.0, 10.0, 40)]
)
def test_resampling_keeps_the_time(old: float, new: float, count: int) -> None:
    take = resampled(_ramp(old, 100), new).takes[0]
    assert take.fps == new
    assert len(take.frames["adult"]) == count
    np.testing.assert_allclose(take.frames["adult"][:, 0], np.arange(count) / new, atol=1e-12)


def test_resampling_honours_timestamps() -> None:
    stamps = 7.0 + np.cumsum(np.r_[0.0, np.tile([0.02, 0.05, 0.03], 20)])
    take = resampled(_ramp(30.0, 61, stamps), 10.0).takes[0]
    assert take.timestamps is None
    np.testing.assert_allclose(take.frames["adult"][:, 3], np.arange(21) / 10.0, atol=1e-9)


def test_resampling_a_whole_fraction_takes_recorded_frames() -> None:
    motions = generate(["adult", "pepper"], actions=["wave_low"], variants=1)
    slow = resampled(motions, 10.0).takes[0]
    for name, frames in slow.frames.items():
        np.testing.assert_array_equal(frames, motions.takes[0].frames[name][::3])


def test_resampling_spreads_the_marks_of_gaps() -> None:
    take = resampled(_ramp(30.0, 10, held=[4]), 60.0).takes[0]
    assert np.flatnonzero(take.filled["adult"][:, 0]).tolist() == [7, 8, 9]


def test_embedded_at_ten_hertz() -> None:
    motions = load_motions("embedded", fps=10.0)
    assert {take.fps for take in motions.takes} == {10.0}
    assert motions.synthetic


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("embeded", "expected 'embedded', 'format:PATH'"),
        ("papers:/tmp", "did you mean 'paper'"),
        ("paper:", "names no path"),
        ("paper:/no/such/folder", "no folder"),
        ("npz:/no/such/file.npz", "no motion file"),
    ],
)
def test_unknown_source(spec: str, message: str) -> None:
    with pytest.raises(MotionError, match=message):
        load_motions(spec)


def test_unknown_content(tmp_path: Path) -> None:
    path = tmp_path / "sound.wav"
    path.write_bytes(b"RIFF\0\0\0\0WAVE")
    with pytest.raises(MotionError, match="of no known format"):
        load_motions(path)


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf")])
def test_wrong_rate(fps: float) -> None:
    with pytest.raises(OptionError, match="fps"):
        load_motions("embedded", fps=fps)
