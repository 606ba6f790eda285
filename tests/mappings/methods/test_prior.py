"""The general preset: geometry first, and what recordings add to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import HumanSkeleton, catalog, landmark_error
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, MappingError, OptionError
from syda_gym.mappings import fit, fit_many, load_mapping, save_mapping
from syda_gym.mappings.fitting.held_out import cross_validate
from syda_gym.mappings.fitting.learning import learning_curve
from syda_gym.mappings.methods.prior import SHRINKAGES
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.mappings.models.linear import Ridge
from syda_gym.mappings.models.prior import PriorRegressor
from syda_gym.mappings.models.rotation import fitted_rotation
from syda_gym.motions.clip import PairedMotions


def error_of(mapping, pair: PairedMotions) -> float:
    return float(landmark_error(pair.target_body, mapping(pair.source), pair.target).mean())


def test_shrunk_without_end_it_is_the_rotated_unfitted(adult_pepper):
    hard = fit(adult_pepper, shrinkage=1e9, lag=0, confidence=False)
    assert isinstance(hard.regressor.main, PriorRegressor)  # type: ignore[attr-defined]
    codes = hard.source_coder.encode(adult_pepper.source)
    image = hard.regressor(codes)[..., :6]
    constant = hard.regressor.main.prior(codes)  # type: ignore[attr-defined]
    assert np.ptp((image - constant).reshape(-1, 6), axis=0).max() < 1e-6, "all that is left of the ridge is its mean"


def test_a_single_action_already_helps_where_networks_do_harm(adult_pepper):
    one, rest = adult_pepper.only_actions(["reach1"]), adult_pepper.without_actions(["reach1"])
    geometric = error_of(unfitted(rest.source_body, rest.target_body), rest)
    prior = error_of(fit(one, confidence=False), rest)
    network = error_of(fit(one, preset="synergies", confidence=False, epochs=40), rest)
    assert prior < network
    assert prior < geometric + 0.01


def test_the_penalty_is_chosen_without_the_test_action(adult_pepper, monkeypatch):
    from syda_gym.mappings.methods import prior

    seen: list[set[str]] = []
    real = prior.held_out_gaps

    def spied(pair, *rest):
        seen.append(set(pair.action_names))
        return real(pair, *rest)

    monkeypatch.setattr(prior, "held_out_gaps", spied)
    cross_validate(adult_pepper, back=False, confidence=False)
    assert len(seen) == 2 * len(adult_pepper.action_names)
    assert all(len(actions) == len(adult_pepper.action_names) - 1 for actions in seen)


def test_the_same_frames_give_the_same_bits_whatever_the_seed(adult_pepper):
    first, second = fit_many([adult_pepper, adult_pepper], seeds=[0, 7], confidence=False)
    assert np.array_equal(first(adult_pepper.source), second(adult_pepper.source))


def test_it_maps_back_and_survives_storage(adult_pepper, tmp_path):
    mapping = fit(adult_pepper)
    back = mapping.inverse()
    again = landmark_error(back.target, back(adult_pepper.target), adult_pepper.source).mean()
    assert again < 0.05
    assert np.array_equal(back.inverse()(adult_pepper.source), mapping(adult_pepper.source))
    save_mapping(mapping, tmp_path / "m")
    assert np.array_equal(load_mapping(tmp_path / "m").inverse()(adult_pepper.target), back(adult_pepper.target))


def test_single_frames_take_one_affine_map(adult_pepper):
    mapping = fit(adult_pepper, confidence=False)
    affine = mapping.regressor.affine()
    assert affine is not None
    codes = mapping.source_coder.encode(adult_pepper.source[:5])
    assert np.allclose(codes @ affine[0] + affine[1], mapping.regressor(codes), atol=1e-12)
    one = np.stack([mapping(frame) for frame in adult_pepper.source[:5]])
    assert landmark_error(mapping.target, one, mapping(adult_pepper.source[:5])).max() < 1e-4


def test_a_path_of_ridges_equals_ridges_one_by_one():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(60, 5)), rng.normal(size=(60, 3))
    for shrinkage, model in zip(SHRINKAGES, Ridge.path(x, y, SHRINKAGES), strict=True):
        assert np.allclose(model(x), Ridge.fit(x, y, shrinkage)(x), atol=1e-10)


@given(angle=st.floats(-3.0, 3.0), seed=st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_the_rotation_is_found_and_leans_to_none(angle, seed):
    rng = np.random.default_rng(seed)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    vectors = rng.normal(size=(50, 3))
    assert np.allclose(fitted_rotation(vectors, vectors @ turn.T), turn, atol=1e-9)
    along = np.outer(rng.uniform(0.5, 1.0, 20), [0.0, 0.0, 1.0])  # says nothing of turns about z
    leaning = fitted_rotation(along, along, 0.1)
    assert np.allclose(leaning, np.eye(3), atol=1e-9)


@pytest.mark.parametrize("ends", [("adult", "pepper"), ("pepper", "adult"), ("nao", "pepper"), ("adult", "kid")])
def test_the_unfitted_mapping_points_as_the_other_body_does(ends):
    source, target = (catalog.get(name) for name in ends)
    mapping = unfitted(source, target)
    rng = np.random.default_rng(0)
    if isinstance(source, Robot):
        frames = source.clamp(rng.uniform(source.lower, source.upper, (40, source.n_features)))
    else:
        assert isinstance(source, HumanSkeleton)
        points = np.repeat(source.arm_points(source.standing()), 40, axis=0)
        limbs = rng.normal(size=(40, 2, 2, 3))
        limbs *= source.arm_lengths[..., None] / np.linalg.norm(limbs, axis=-1, keepdims=True)
        points[:, :, 1] = points[:, :, 0] + limbs[:, :, 0]
        points[:, :, 2] = points[:, :, 1] + limbs[:, :, 1]
        frames = source.frames_from_points(points)
    mapped = mapping(frames)
    wanted = np.diff(source.arm_points(frames), axis=2)
    if isinstance(target, Robot):
        best = LimbIK(target).solve(wanted)
        assert not target.violations(mapped).any()
        assert np.abs(target.landmarks(mapped) - target.landmarks(best)).max() < 1e-3
    else:
        got = np.diff(target.arm_points(mapped), axis=2)
        cosine = np.sum(wanted * got, axis=-1) / np.linalg.norm(wanted, axis=-1) / np.linalg.norm(got, axis=-1)
        assert cosine.min() > 1.0 - 1e-6
    assert not mapping.unfamiliar(frames).any()
    assert (mapping.difficulty(frames) == 0.0).all()
    assert "no recordings" in repr(mapping)
    with pytest.raises(MappingError, match="no error bound"):
        mapping.error_bound(frames)


def test_bodies_that_cannot_drive_each_other_are_refused():
    pepper = catalog.get("pepper")
    with pytest.raises(EmbodimentError, match="cannot drive itself"):
        unfitted(pepper, pepper)


def test_what_recordings_gained_is_measured_on_unseen_actions(adult_pepper):
    rows = learning_curve(adult_pepper, draws=2)
    assert [row.actions for row in rows] == [0, 1, 2, 3, 4]
    assert rows[0].gained == 0.0
    assert all(abs(b.gained - (a.error - b.error)) < 1e-12 for a, b in zip(rows[:-1], rows[1:], strict=True))
    assert rows[-1].error == pytest.approx(float(cross_validate(adult_pepper, confidence=False).means[0]), abs=1e-9)
    with pytest.raises(OptionError, match="counts must lie between 1 and 4"):
        learning_curve(adult_pepper, counts=[5])


def test_unfamiliar_frames_are_few_among_unseen_actions_and_many_among_nonsense(adult_pepper):
    flagged = []
    for name in adult_pepper.action_names:
        mapping = fit(adult_pepper.without_actions([name]), "ridge")
        flagged.append(mapping.unfamiliar(adult_pepper.only_actions([name]).source).mean())
    assert np.mean(flagged) <= 0.1
