from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import landmark_error
from syda_gym.errors import MappingError, OptionError
from syda_gym.mappings import fit, load_mapping, save_mapping
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.window_coder import past_frames
from syda_gym.mappings.fitting.held_out import cross_validate
from syda_gym.mappings.fitting.windows import window_study
from syda_gym.mappings.mapping import map_clips
from syda_gym.mappings.stream import FrameStream
from syda_gym.motions.clip import PairedMotions


@pytest.fixture(scope="module")
def looking_back(adult_pepper: PairedMotions) -> CodedMapping:
    return fit(adult_pepper, window=2)


def test_a_mapping_with_a_window_maps_clips(looking_back, adult_pepper):
    pair = adult_pepper.only_actions(["reach1"])
    assert looking_back.window == 2
    still = np.repeat(adult_pepper.target.mean(axis=0)[None], len(adult_pepper), axis=0)
    mapped = map_clips(looking_back, adult_pepper)
    error, spread = (landmark_error(pair.target_body, x, adult_pepper.target).mean() for x in (mapped, still))
    assert error < 0.4 * spread
    # The past matters, so that the same frame behind another past is another pose.
    assert np.abs(looking_back(pair.source)[12] - looking_back(pair.source[12:])[0]).max() > 1e-4
    limited = looking_back.sequence(pair.source, fps=10.0)
    assert (np.abs(np.diff(limited, axis=0)) * 10.0 <= looking_back.target.speed + 1e-9).all()
    assert looking_back.error_bound(pair.source)[0] > 0.0
    assert not looking_back.unfamiliar(pair.source).all()


def test_several_clips_are_mapped_one_by_one(looking_back, adult_pepper):
    whole = map_clips(looking_back, adult_pepper)
    for rows in adult_pepper.clip_rows():
        assert np.array_equal(whole[rows], looking_back(adult_pepper.source[rows]))


def test_frame_by_frame_gives_what_the_clip_gives(looking_back, adult_kid, adult_pepper):
    from_kid = fit(kid_led(adult_pepper, adult_kid), window=2, confidence=False)
    chain = fit(adult_kid, confidence=False) >> from_kid
    clip = adult_pepper.only_actions(["reach2"]).source
    for mapping in (looking_back, chain):
        stream = FrameStream(mapping)
        one_by_one = np.stack([stream(frame) for frame in clip])
        assert landmark_error(mapping.target, one_by_one, mapping(clip)).max() < 1e-6
        stream.reset()
        assert landmark_error(mapping.target, stream(clip[5])[None], mapping(clip[5:6])).max() < 1e-6
        with pytest.raises(MappingError, match="FrameStream"):
            mapping(clip[0])
    assert chain.window == 2


def kid_led(adult_pepper: PairedMotions, adult_kid: PairedMotions) -> PairedMotions:
    """The same robot motion led by the kid of another pair, frame by frame."""
    return PairedMotions(
        adult_kid.target_body,
        adult_pepper.target_body,
        adult_kid.target,
        adult_pepper.target,
        actions=adult_pepper.actions,
        recordings=adult_pepper.recordings,
        times=adult_pepper.times,
    )


@pytest.mark.parametrize("method", ["syda", "ridge"])
def test_a_window_comes_back_from_disk(method, adult_pepper, tmp_path):
    mapping = fit(adult_pepper, method, window=3)
    save_mapping(mapping, tmp_path / "m")
    loaded = load_mapping(tmp_path / "m")
    assert loaded.window == 3
    assert np.array_equal(loaded(adult_pepper.source[:24]), mapping(adult_pepper.source[:24]))


def test_the_inverse_of_a_window_maps_single_frames(looking_back, adult_pepper):
    back = looking_back.inverse()
    assert back.window == 0
    assert np.allclose(back(adult_pepper.target[7]), back(adult_pepper.target[7:9])[0])


@pytest.mark.parametrize("preset", ["synergies", "accurate", "interpolation", "nested"])
def test_other_presets_take_a_window(preset, adult_pepper):
    options = {} if preset == "accurate" else {"epochs": 2}
    mapping = fit(adult_pepper, preset=preset, window=1, confidence=False, **options)
    assert mapping(adult_pepper.source[:24]).shape == (24, 10)


def test_where_a_window_has_no_meaning_it_is_refused(adult_pepper, adult_kid):
    for pair in (adult_kid, adult_pepper.reversed()):
        with pytest.raises(MappingError, match="leave window out"):
            fit(pair, window=2)
    for method, preset in (("geometric", "procrustes"), ("syda", "paper"), ("direct", "paper")):
        with pytest.raises(OptionError, match="window"):
            fit(adult_pepper, method, preset, window=2)
    with pytest.raises(OptionError, match="'window' must be a int"):
        fit(adult_pepper, window=1.5)


def test_a_result_with_a_window_carries_its_controls(adult_pepper):
    few = adult_pepper.only_actions(["reach0", "reach1", "reach2"])
    result = cross_validate(few, "ridge", window=2, confidence=False)
    assert [row.name for row in result.controls][2] == "control: one frame and its index"
    assert cross_validate(few, "ridge", confidence=False).controls == ()


def test_a_window_never_looks_ahead_or_into_another_clip(adult_pepper):
    codes = np.arange(len(adult_pepper), dtype=np.float64)[:, None, None]
    windows = past_frames(codes, 2, adult_pepper.clip_rows())[:, 0]
    assert windows[0].tolist() == [0, 0, 0]
    assert windows[5].tolist() == [3, 4, 5]
    assert windows[24].tolist() == [24, 24, 24]  # the first frame of the second clip
    assert (windows[:, :-1] <= windows[:, -1:]).all()


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
