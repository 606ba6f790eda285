from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import landmark_error
from syda_gym.errors import EmbodimentError, MappingError, OptionError
from syda_gym.mappings import fit, fit_many
from syda_gym.motions.clip import PairedMotions


def test_one_frame_gives_one_frame(adult_pepper):
    mapping = fit(adult_pepper, preset="paper", epochs=1)
    frames = adult_pepper.source
    assert mapping(frames).shape == adult_pepper.target.shape
    assert mapping(frames[3]).shape == (10,)
    assert np.allclose(mapping(frames[3]), mapping(frames)[3])


def test_the_same_seed_gives_the_same_bits(adult_pepper):
    first, second = (fit(adult_pepper, preset="paper", seed=4, epochs=2)(adult_pepper.source) for _ in range(2))
    assert np.array_equal(first, second)
    other = fit(adult_pepper, preset="paper", seed=5, epochs=2)(adult_pepper.source)
    assert not np.allclose(first, other)


@pytest.mark.parametrize("method", ["syda", "direct"])
def test_the_paper_preset_learns_its_training_frames(adult_pepper, method):
    mapping = fit(adult_pepper, method, "paper", epochs=200, rate=3e-3)
    pair = adult_pepper
    error = landmark_error(pair.target_body, mapping(pair.source), pair.target).mean()
    constant = landmark_error(pair.target_body, np.repeat(pair.target.mean(0)[None], len(pair), 0), pair.target).mean()
    assert error < 0.5 * constant


def test_one_syda_model_maps_both_ways(adult_pepper):
    mapping = fit(adult_pepper, preset="paper", epochs=150)
    back = mapping.inverse()
    pair = adult_pepper
    error = landmark_error(pair.source_body, back(pair.target), pair.source).mean()
    constant = landmark_error(pair.source_body, np.repeat(pair.source.mean(0)[None], len(pair), 0), pair.source).mean()
    assert error < 0.7 * constant
    assert back.card.inverted
    assert np.array_equal(back.inverse()(pair.source), mapping(pair.source))


def test_the_direct_autoencoder_says_that_it_has_no_inverse(adult_pepper):
    with pytest.raises(MappingError, match="no inverse"):
        fit(adult_pepper, "direct", "paper", epochs=1).inverse()


def test_fitting_together_is_fitting_alone(adult_pepper):
    halves = [
        adult_pepper.only_actions(["reach0", "reach1"]),
        adult_pepper.only_actions(["reach2", "reach3", "reach4"]),
    ]
    together = fit_many(halves, preset="paper", seeds=[1, 2], epochs=3)
    for half, seed, mapping in zip(halves, (1, 2), together, strict=True):
        alone = fit(half, preset="paper", seed=seed, epochs=3)
        codes = alone.source_coder.encode(half.source)
        assert np.allclose(mapping.regressor(codes), alone.regressor(codes), atol=1e-5)


def test_outputs_obey_the_joint_limits(adult_pepper, rng_frames):
    mapping = fit(adult_pepper, preset="paper", epochs=2)
    assert not mapping.target.violations(mapping(rng_frames)).any()


@pytest.fixture
def rng_frames(adult_pepper) -> np.ndarray:
    rng = np.random.default_rng(0)
    return adult_pepper.source + rng.normal(scale=0.3, size=adult_pepper.source.shape)


def test_progress_is_reported(adult_pepper):
    seen: list[float] = []
    fit(adult_pepper, preset="paper", epochs=20, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_unknown_names_are_explained(adult_pepper):
    with pytest.raises(OptionError, match="did you mean 'syda'"):
        fit(adult_pepper, "syd")
    with pytest.raises(OptionError, match="paper"):
        fit(adult_pepper, preset="papers")
    with pytest.raises(OptionError, match="epochs"):
        fit(adult_pepper, preset="paper", epoch=3)


def test_frames_that_teach_nothing_are_refused(adult_pepper):
    with pytest.raises(MappingError, match="at least 10"):
        fit(adult_pepper.rows([0, 1]), preset="paper")
    a, b = adult_pepper.source_body, adult_pepper.target_body
    still = np.repeat(adult_pepper.source[:1], 20, axis=0)
    with pytest.raises(MappingError, match="constant"):
        fit(PairedMotions(a, b, still, adult_pepper.target[:20]), preset="paper")
    line = still + np.linspace(0.0, 1.0, 20)[:, None] * np.ones(18)
    with pytest.raises(MappingError, match="rank"):
        fit(PairedMotions(a, b, line, adult_pepper.target[:20]), preset="paper")


def test_bad_frames_are_refused(adult_pepper):
    mapping = fit(adult_pepper, preset="paper", epochs=1)
    with pytest.raises(EmbodimentError, match="expected shape"):
        mapping(np.zeros((3, 17)))
    bad = adult_pepper.source[:2].copy()
    bad[1, 4] = np.nan
    with pytest.raises(EmbodimentError, match="LElbow"):
        mapping(bad)
