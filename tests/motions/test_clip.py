"""Clips, pairs and folds: no frame of a test action, its mirror or its repeats is seen in training."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.errors import MotionError, OptionError
from syda_gym.motions import MotionClip, Motions, PairedMotions, Take, generate


@pytest.fixture(scope="module")
def twins() -> Motions:
    """Three actions, two recordings each, with mirrored halves as in the paper's recordings."""
    motions = generate(["adult", "pepper"], actions=["wave_high", "drum", "reach_side"], variants=2, fps=10.0)
    takes = []
    for take in motions.takes:
        frames = {name: motions.bodies[name].mirror(values) for name, values in take.frames.items()}
        takes += [take, Take(take.recording, take.action, take.fps, frames, mirrored=True)]
    return Motions("twins", tuple(takes), motions.bodies)


@pytest.fixture(scope="module")
def pair(twins: Motions) -> PairedMotions:
    return twins.pair("adult", "pepper")


def _keys(pair: PairedMotions) -> set[tuple[str, int]]:
    return set(zip(pair.recordings.tolist(), pair.times.tolist(), strict=True))


def test_loao_sees_nothing_of_the_test_action(pair: PairedMotions) -> None:
    tested = []
    for train, test in pair.folds("loao"):
        assert len(test.action_names) == 1
        assert not set(train.action_names) & set(test.action_names)
        assert not _keys(train) & _keys(test)
        assert test.mirrored.any()
        assert not test.mirrored.all()
        assert len(train) + len(test) == len(pair)
        tested += test.action_names
    assert sorted(tested) == list(pair.action_names)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_twin3_keeps_a_frame_and_its_mirror_together(pair: PairedMotions, seed: int) -> None:
    masks = pair.fold_masks("twin3", seed=seed)
    np.testing.assert_array_equal(np.sum(masks, axis=0), 1)
    for train, test in pair.folds("twin3", seed=seed):
        assert not _keys(train) & _keys(test)
        assert 0.25 < len(test) / len(pair) < 0.42


def test_rand3_splits_twins(pair: PairedMotions) -> None:
    """The paper's protocol leaks; that is why the others exist."""
    train, test = next(pair.folds("rand3"))
    assert len(_keys(train) & _keys(test)) > 0.3 * len(test)


def test_folds_repeat_with_the_seed(pair: PairedMotions) -> None:
    for protocol in ("rand3", "twin3"):
        first, again, other = (pair.fold_masks(protocol, seed=seed) for seed in (3, 3, 4))
        assert np.array_equal(first, again)
        assert not np.array_equal(first, other)


def test_clips_never_cross_the_mirror_seam(pair: PairedMotions) -> None:
    clips = pair.clips()
    assert len(clips) == 12
    assert sum(len(clip) for clip in clips) == len(pair)
    assert {clip.name for clip in clips if clip.source.mirrored} == {
        f"{r}~mirror" for r in set(pair.recordings.tolist())
    }
    again = PairedMotions.from_clips(clips)
    assert again.fingerprint == pair.fingerprint


def test_reversed_swaps_the_bodies(pair: PairedMotions) -> None:
    back = pair.reversed()
    assert back.source_body.name == "pepper"
    np.testing.assert_array_equal(back.target, pair.source)


def test_choosing_actions(pair: PairedMotions) -> None:
    assert pair.only_actions(["drum"]).action_names == ("drum",)
    assert pair.without_actions(["drum"]).action_names == ("reach_side", "wave_high")
    with pytest.raises(MotionError, match="did you mean 'drum'"):
        pair.only_actions(["drums"])
    with pytest.raises(MotionError, match="leaves no rows"):
        pair.without_actions(list(pair.action_names))


def test_unknown_protocol(pair: PairedMotions) -> None:
    with pytest.raises(OptionError, match="did you mean 'loao'"):
        list(pair.folds("loa"))


def test_one_action_cannot_be_left_out(pair: PairedMotions) -> None:
    with pytest.raises(MotionError, match="at least two actions"):
        list(pair.only_actions(["drum"]).folds("loao"))


def test_unequal_lengths_are_refused(pair: PairedMotions) -> None:
    with pytest.raises(MotionError, match="source frames against"):
        PairedMotions(pair.source_body, pair.target_body, pair.source[:-1], pair.target)
    take = Take("r", "a", 10.0, {"adult": pair.source, "pepper": pair.target[:-1]})
    with pytest.raises(MotionError, match=r"'r' has unequal lengths"):
        Motions("m", (take,), {"adult": pair.source_body, "pepper": pair.target_body})


def test_bad_values_are_named(pair: PairedMotions) -> None:
    frames = pair.source.copy()
    frames[3, 4] = np.nan
    with pytest.raises(MotionError, match=r"frame 3, feature 'LElbow\.y' is nan"):
        PairedMotions(pair.source_body, pair.target_body, frames, pair.target)


def test_unpaired_bodies_are_named(twins: Motions) -> None:
    with pytest.raises(MotionError, match="no body 'kid'"):
        twins.pair("kid", "pepper")
    with pytest.raises(MotionError, match="never recorded together"):
        twins.pair("adult", "adult")


@pytest.mark.parametrize(
    "broken",
    [{"fps": 0.0}, {"fps": np.inf}, {"filled": np.zeros((2, 18), dtype=bool)}, {"timestamps": np.arange(3.0)}],
)
def test_clip_checks_its_parts(broken: dict[str, object]) -> None:
    adult = catalog.get("adult")
    good = {"body": adult, "frames": np.zeros((4, 18)), "fps": 10.0, "action": "a", "recording": "r"}
    assert len(MotionClip(**good)) == 4  # type: ignore[arg-type]
    with pytest.raises(MotionError, match=r"^r: "):
        MotionClip(**{**good, **broken})  # type: ignore[arg-type]
