from __future__ import annotations

import builtins

import numpy as np
import pytest

from syda_gym.embodiments import landmark_error
from syda_gym.errors import MappingError, MissingExtraError, StorageError
from syda_gym.mappings import METHODS, fit, load_mapping, save_mapping
from syda_gym.mappings.models.linear import KernelRidge, Nearest, Ridge


@pytest.mark.parametrize("method", ["ridge", "kernel_ridge", "nearest", "geometric"])
def test_baselines_map_their_training_frames(adult_pepper, tmp_path, method):
    mapping = fit(adult_pepper, method, confidence=False)
    pair = adult_pepper
    error = landmark_error(pair.target_body, mapping(pair.source), pair.target).mean()
    mean = np.repeat(pair.target.mean(axis=0)[None], len(pair), axis=0)
    assert error < 0.4 * landmark_error(pair.target_body, mean, pair.target).mean()
    save_mapping(mapping, tmp_path / "m")
    assert np.array_equal(load_mapping(tmp_path / "m")(pair.source), mapping(pair.source))


@pytest.mark.parametrize("method", sorted(METHODS))
def test_each_method_inverts_or_says_that_it_cannot(adult_pepper, method):
    options = {"epochs": 1} if method == "direct" else {}
    if method == "mink":
        pytest.importorskip("mink")
    mapping = fit(adult_pepper.rows(np.arange(0, 120, 6)), method, confidence=False, **options)
    if METHODS[method].invertible:
        assert mapping.inverse()(adult_pepper.target[:3]).shape == (3, 18)
    elif method != "mink":
        with pytest.raises(MappingError, match="no inverse"):
            mapping.inverse()


def test_ridge_recovers_a_linear_map():
    rng = np.random.default_rng(0)
    x, weight = rng.normal(size=(200, 4)), rng.normal(size=(4, 3))
    assert np.allclose(Ridge.fit(x, x @ weight + 2.0, 1e-9)(x), x @ weight + 2.0, atol=1e-6)


def test_the_robust_ridge_ignores_outliers():
    rng = np.random.default_rng(0)
    x, weight = rng.normal(size=(300, 3)), rng.normal(size=(3, 2))
    y = x @ weight
    spoiled = y.copy()
    spoiled[:20] += 30.0
    plain, robust = (Ridge.fit(x, spoiled, 1e-6, robust=flag)(x) for flag in (False, True))
    assert np.abs(robust - y)[20:].mean() < 0.2 * np.abs(plain - y)[20:].mean()


def test_kernel_ridge_bends_and_thins_out_large_sets():
    x = np.random.default_rng(0).uniform(-2.0, 2.0, (2000, 1))
    model = KernelRidge.fit(x, np.sin(2.0 * x), 1e-3, 2.0)
    assert len(model.centres) == 1500
    assert np.abs(model(x) - np.sin(2.0 * x)).max() < 0.02


def test_nearest_returns_a_training_target():
    x, y = np.array([[0.0], [1.0], [5.0]]), np.array([[10.0], [20.0], [30.0]])
    model = Nearest.fit(x, y, 1)
    assert np.array_equal(model(np.array([[0.9], [4.0]])), [[20.0], [30.0]])
    assert np.allclose(Nearest.fit(x, y, 2)(np.array([[0.4]])), [[15.0]])


def test_mink_finds_what_the_closed_form_finds(adult_pepper):
    pytest.importorskip("mink")
    rows = adult_pepper.rows(np.arange(0, 120, 8))
    slow, closed = fit(rows, "mink"), fit(rows, "geometric", confidence=False)
    # Where limits forbid the goal, a differential solver may stop in another corner; mostly they agree.
    assert np.median(landmark_error(rows.target_body, slow(rows.source), closed(rows.source))) < 1e-4


def test_without_mink_the_extra_is_named(adult_pepper, monkeypatch):
    real = builtins.__import__

    def refuse(name, *args, **kwargs):
        if name.split(".")[0] in ("mink", "daqp"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(MissingExtraError, match=r"syda-gym\[ik\]"):
        fit(adult_pepper, "mink")


def test_mink_reaches_robots_only(adult_kid):
    with pytest.raises(MappingError, match="must be a robot"):
        fit(adult_kid, "mink")


def test_storage_refuses_foreign_mappings(adult_pepper, tmp_path):
    class Foreign(type(fit(adult_pepper, "geometric", confidence=False)).__mro__[1]):
        card = None
        source, target = adult_pepper.source_body, adult_pepper.target_body
        route = ("adult", "pepper")
        method = preset = "none"
        raw = inverse = error_bound = difficulty = unfamiliar = lambda self, *_: None

    with pytest.raises(StorageError, match="cannot be stored"):
        save_mapping(Foreign(), tmp_path / "m")
