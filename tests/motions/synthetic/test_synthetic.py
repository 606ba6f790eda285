"""The synthetic motions: many bodies, many gestures, physically possible, the same bits every time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.files import asset
from syda_gym.motions import Motions, generate, load_motions, save_motions
from syda_gym.motions.synthetic.actions import ACTIONS, REST, limb_directions
from syda_gym.motions.synthetic.generator import BODIES

ROBOTS = ("pepper", "nao")
FEW = ["wave_high", "cross_chest", "lift_overhead"]


@pytest.fixture(scope="module")
def embedded() -> Motions:
    return load_motions("embedded")


def _clean(body: str, **options: object) -> np.ndarray:
    motions = generate([body], noise=0.0, actions=FEW, variants=1, **options)  # type: ignore[arg-type]
    return np.concatenate([take.frames[body] for take in motions.takes])


def test_enough_actions_bodies_and_families(embedded: Motions) -> None:
    assert embedded.synthetic
    assert "synthetic" in embedded.name
    assert len({take.action for take in embedded.takes}) >= 40
    assert len(set(embedded.families.values())) >= 8
    assert set(embedded.families) == {take.action for take in embedded.takes}
    assert tuple(embedded.bodies) == BODIES
    assert len(BODIES) >= 8
    for take in embedded.takes:
        assert set(take.frames) == set(BODIES)
        assert take.fps == 30.0
        assert 3.0 <= len(take.frames["adult"]) / take.fps <= 6.0


def test_bodies_are_those_of_the_catalog(embedded: Motions) -> None:
    for name, body in embedded.bodies.items():
        assert body == catalog.get(name)


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_keep_limits_and_speeds(embedded: Motions, name: str) -> None:
    robot = embedded.bodies[name]
    assert isinstance(robot, Robot)
    for clip in embedded.clips(name):
        assert not robot.violations(clip.frames).any()
        assert (np.abs(np.diff(clip.frames, axis=0)) * clip.fps <= robot.speed).all()


def test_every_action_moves_and_starts_and_ends_at_rest(embedded: Motions) -> None:
    for clip in embedded.clips("pepper"):
        marks = clip.body.landmarks(clip.frames)
        assert np.ptp(marks, axis=0).max() > 0.1
        assert np.linalg.norm(marks[0] - marks[-1], axis=1).max() < 0.12


def test_actions_differ_from_one_another() -> None:
    """Nearest other action, over key poses of both arms: a copy would be at zero."""
    tables = {
        action.name: np.stack([limb_directions(action.lead), limb_directions(action.other)]) for action in ACTIONS
    }
    names = sorted(tables)
    assert len(names) == len(set(names))
    for a in names:
        for b in names:
            if a < b and tables[a].shape == tables[b].shape:
                assert np.abs(tables[a] - tables[b]).max() > 0.15, (a, b)


def test_the_asset_is_what_the_code_generates(embedded: Motions) -> None:
    """A sample of actions, all bodies."""
    fresh = generate(actions=FEW)
    stored = {take.recording: take for take in embedded.takes}
    for take in fresh.takes:
        for name, frames in take.frames.items():
            step = 1e-3 if embedded.bodies[name].kind == "human" else 1e-4  # what the file rounds to
            np.testing.assert_allclose(frames, stored[take.recording].frames[name], rtol=0, atol=0.55 * step)
            assert np.array_equal(
                take.filled.get(name, np.zeros(1, bool)), stored[take.recording].filled.get(name, np.zeros(1, bool))
            )


def test_saving_twice_gives_equal_files(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        save_motions(generate(["adult", "nao"], actions=FEW), tmp_path / name, steps={"m": 1e-3, "rad": 1e-4})
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert asset("motions", "embedded.npz").stat().st_size < 1_500_000


def test_a_body_does_the_same_whoever_else_takes_part() -> None:
    alone = generate(["pepper"], actions=["wave_low"], variants=2)
    together = generate(["kid", "pepper", "adult"], actions=["reach_side", "wave_low"], variants=3)
    twin = next(take for take in together.takes if take.recording == alone.takes[1].recording)
    np.testing.assert_array_equal(alone.takes[1].frames["pepper"], twin.frames["pepper"])


def test_seed_and_variant_change_the_motion() -> None:
    motions = generate(["adult"], actions=["wave_low"], variants=6)
    starts = {take.frames["adult"][40].tobytes() for take in motions.takes}
    other = generate(["adult"], actions=["wave_low"], variants=1, seed=1)
    assert len(starts | {other.takes[0].frames["adult"][40].tobytes()}) == 7


def test_humans_keep_their_proportions() -> None:
    for name in ("adult", "kid", "tall", "child", "long_arms", "stiff", "left_only"):
        body = catalog.get(name)
        lengths = np.linalg.norm(np.diff(body.arm_points(_clean(name)), axis=2), axis=-1)
        np.testing.assert_allclose(lengths, np.broadcast_to(body.arm_lengths, lengths.shape), atol=1e-9)


def test_camera_noise_is_a_centimetre_and_gaps_are_held() -> None:
    clean = generate(["adult"], noise=0.0, variants=1, families=["wave", "reach"])
    noisy = generate(["adult"], variants=1, families=["wave", "reach"])
    errors = []
    for a, b in zip(clean.takes, noisy.takes, strict=True):
        held = b.filled.get("adult", np.zeros_like(b.frames["adult"], dtype=bool))
        assert not a.filled
        errors.append(np.where(held, np.nan, b.frames["adult"] - a.frames["adult"]))
        rows, columns = np.nonzero(held)
        np.testing.assert_array_equal(b.frames["adult"][rows, columns], b.frames["adult"][rows - 1, columns])
    hand = np.concatenate(errors).reshape(-1, 2, 3, 3)[:, :, 2]
    assert 0.006 < np.nanstd(hand) < 0.012
    share = np.mean([take.filled["adult"].mean() if take.filled else 0.0 for take in noisy.takes])
    assert 0.002 < share < 0.05


def test_without_variety_limbs_point_alike() -> None:
    motions = generate(["adult", "tall"], noise=0.0, variety=0.0, actions=FEW, variants=1)
    pair = motions.pair("adult", "tall")
    first, second = (
        np.diff(body.arm_points(frames), axis=2) / body.arm_lengths[:, :, None]
        for body, frames in ((pair.source_body, pair.source), (pair.target_body, pair.target))
    )
    # What is left is how smoothly each body moves.
    assert np.linalg.norm(first - second, axis=-1).mean() < 0.03


def test_mapping_them_is_neither_trivial_nor_hopeless(embedded: Motions) -> None:
    """Ridge regression of limb directions, leave-one-action-out: centimetres on Pepper."""
    pair = embedded.pair("adult", "pepper")
    x, y = (
        np.diff(body.arm_points(frames), axis=2).reshape(len(pair), -1)
        for body, frames in ((pair.source_body, pair.source), (pair.target_body, pair.target))
    )
    x = np.c_[x, np.ones(len(x))]
    errors = []
    for mask in pair.fold_masks("loao"):
        train = x[~mask]
        weights = np.linalg.solve(train.T @ train + 0.1 * np.eye(x.shape[1]), train.T @ y[~mask])
        wrist = (x[mask] @ weights - y[mask]).reshape(-1, 2, 2, 3).sum(axis=2)
        errors.append(np.linalg.norm(wrist, axis=-1).mean())
    assert 0.02 < np.mean(errors) < 0.08


def test_stiff_human_keeps_to_a_smaller_range() -> None:
    stiff, healthy = (
        np.diff(catalog.get(name).arm_points(_clean(name, variety=0.0)), axis=2)
        / catalog.get(name).arm_lengths[:, :, None]
        for name in ("stiff", "tall")
    )
    assert stiff[:, :, 0, 2].max() < healthy[:, :, 0, 2].max() - 0.2


def test_rest_hangs_down() -> None:
    assert limb_directions([REST])[0, 0, 2] < -0.8


@pytest.mark.parametrize(
    "options",
    [
        {"actions": ["wave_hihg"]},
        {"families": ["dance"]},
        {"variants": 0},
        {"noise": -1.0},
        {"fps": float("nan")},
        {"actions": ["wave_high"], "families": ["reach"]},
        {"bodies": []},
        {"bodies": ["adult", "adult"]},
    ],
)
def test_wrong_options(options: dict[str, object]) -> None:
    with pytest.raises(OptionError):
        generate(**options)  # type: ignore[arg-type]


def test_unknown_body() -> None:
    with pytest.raises(EmbodimentError, match="did you mean 'pepper'"):
        generate(["peper"])
