"""Frames in time order: one by one, in pieces and as a clip they give the same."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.mappings.chain import ChainMapping
from syda_gym.mappings.fitting.fit import fit
from syda_gym.mappings.limits import speed_violations
from syda_gym.mappings.stream import FrameStream

from .conftest import make_pair

FPS = 30.0


@pytest.fixture(scope="module")
def pair():
    return make_pair("adult", "pepper", actions=4, frames=20)


@pytest.fixture(scope="module")
def mappings(pair):
    hop = fit(make_pair("kid", "adult", actions=4, frames=20), "ridge", confidence=False)
    direct = fit(pair, "geometric", confidence=False)
    looking_back = fit(pair, "ridge", confidence=False, window=2)
    return {"direct": direct, "chain": hop >> direct, "window": looking_back, "window in a chain": hop >> looking_back}


def clip_of(mapping, pair):
    frames = pair.source[:20] + np.random.default_rng(1).normal(0.0, 0.02, (20, pair.source.shape[1]))
    return frames * (0.7 if mapping.source.name == "kid" else 1.0)


@pytest.mark.parametrize("name", ["direct", "chain", "window", "window in a chain"])
def test_a_stream_gives_the_clip_row_by_row(name, mappings, pair):
    mapping = mappings[name]
    frames = clip_of(mapping, pair)
    stream = FrameStream(mapping, FPS)
    for _ in range(2):
        rows = np.array([stream(frame) for frame in frames])
        np.testing.assert_allclose(rows, mapping.follow(frames, mapping.begin(), 1 / FPS)[0], atol=1e-9)
        stream.reset()
    still = FrameStream(mapping)
    np.testing.assert_allclose([still(frame) for frame in frames], mapping(frames), atol=1e-9)


@pytest.mark.parametrize("name", ["direct", "chain"])
def test_pieces_of_a_clip_give_the_clip_and_leave_the_memory_as_it_was(name, mappings, pair):
    mapping = mappings[name]
    frames = clip_of(mapping, pair)
    whole, _ = mapping.follow(frames, mapping.begin(), 1 / FPS)
    first, memory = mapping.follow(frames[:7], mapping.begin(), 1 / FPS)
    for _ in range(2):
        rest, _ = mapping.follow(frames[7:], memory, 1 / FPS)
        np.testing.assert_array_equal(np.concatenate([first, rest]), whole)


def test_sequences_obey_limits_and_speeds_where_frames_for_themselves_jump(mappings, pair):
    mapping = mappings["direct"]
    frames = np.random.default_rng(0).permutation(pair.source)
    path = mapping.sequence(frames, FPS)
    assert not mapping.target.violations(path).any()
    assert not speed_violations(mapping.target, path, FPS).any()
    assert speed_violations(mapping.target, mapping(frames), FPS).any()


def test_a_frame_that_cannot_be_taken_leaves_the_past_as_it_was(mappings, pair):
    mapping = mappings["chain"]
    assert isinstance(mapping, ChainMapping)
    frames = clip_of(mapping, pair)
    stream, other = FrameStream(mapping, FPS), FrameStream(mapping, FPS)
    for frame in frames[:5]:
        stream(frame), other(frame)
    with pytest.raises(EmbodimentError):
        stream(np.full(frames.shape[1], np.nan))
    np.testing.assert_array_equal(stream(frames[5]), other(frames[5]))


@pytest.mark.parametrize("fps", [0.0, -1.0, np.nan, np.inf])
def test_rates_that_are_none_are_refused(fps, mappings, pair):
    with pytest.raises(OptionError, match="fps must be positive"):
        mappings["direct"].sequence(pair.source, fps)
    with pytest.raises(OptionError, match="fps must be positive"):
        FrameStream(mappings["direct"], fps)
