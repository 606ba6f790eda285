"""Files that say themselves whose joints they hold are asked whether these are people, as all others are."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syda_gym.motions import Motions, MotionWarning, generate, load_motions, save_motions, write_dataset
from syda_gym.motions.readers.own.people import doubts
from tests.motions import paper_workbooks

ACTIONS = ["bow_down", "drum", "lift_box"]


def aloud(path: Path | str) -> tuple[Motions, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        motions = load_motions(path)
    return motions, [str(one.message) for one in caught if issubclass(one.category, MotionWarning)]


def changed(motions: Motions, change: Callable[[np.ndarray], np.ndarray], action: str | None = None) -> Motions:
    """The adult's points ``(N, arms, 3, 3)`` of all recordings, or of one action, changed."""
    body = motions.bodies["adult"]
    takes = []
    for take in motions.takes:
        frames = dict(take.frames)
        if action in (None, take.action):
            points = np.array(body.arm_points(frames["adult"]))
            frames["adult"] = body.frames_from_points(change(points))  # type: ignore[attr-defined]
        takes.append(replace(take, frames=frames, filled={}))
    return replace(motions, takes=tuple(takes))


@pytest.fixture(scope="module")
def recorded() -> Motions:
    made = generate(["adult", "pepper"], actions=ACTIONS, variants=2)
    return replace(made, synthetic=False)


def swap(points: np.ndarray) -> np.ndarray:
    return points[:, ::-1]


def away(points: np.ndarray) -> np.ndarray:
    """Depth mirrored: everything that was before the body is behind it."""
    return points * [-1.0, 1.0, 1.0]


def on_its_head(points: np.ndarray) -> np.ndarray:
    return points * [1.0, -1.0, -1.0]


def other_axes(points: np.ndarray) -> np.ndarray:
    return points[..., [1, 0, 2]] * [1.0, -1.0, 1.0]


def wrong_joint(points: np.ndarray) -> np.ndarray:
    """The left hand's columns hold its shoulder's neighbour."""
    points[:, 0, 2] = points[:, 0, 1] + 0.3 * (points[:, 0, 1] - points[:, 0, 0])
    return points


def stretching(points: np.ndarray) -> np.ndarray:
    points[:, 1, 1] += 0.3 * np.sin(np.arange(len(points)))[:, None]
    return points


ODD = [
    (swap, "the left shoulder is on the right"),
    (away, "elbows bend backward"),
    (on_its_head, "the left shoulder is on the right"),
    (other_axes, "not the body's left"),
    (wrong_joint, "one forearm is"),
    (stretching, "changes its length by"),
]


@pytest.mark.parametrize("store", ["npz", "pairs"])
@pytest.mark.parametrize(("change", "words"), ODD, ids=lambda value: getattr(value, "__name__", ""))
def test_odd_people_are_doubted_aloud_and_read(recorded: Motions, tmp_path: Path, store: str, change, words) -> None:
    """All recordings, or one of them only, which is then named."""
    for action in (None, "drum"):
        odd = changed(recorded, change, action)
        path = tmp_path / f"{action}.npz" if store == "npz" else tmp_path / str(action)
        (save_motions if store == "npz" else write_dataset)(odd, path)
        motions, said = aloud(path)
        assert len(motions.takes) == len(recorded.takes)
        right = [line for line in said if "adult" in line and words in line]
        assert right, said
        assert any(words in note for note in motions.notes)
        assert action is None or ("drum-01" in right[0] and "lift_box" not in right[0])


def test_other_units_than_the_body_says(recorded: Motions, tmp_path: Path) -> None:
    path = save_motions(changed(recorded, lambda points: 100.0 * points), tmp_path / "cm.npz")
    assert any("the body says 0.294 m; are frames in metres" in line for line in aloud(path)[1])
    upward = changed(recorded, lambda points: np.abs(points - points[:, :, :1]) * [1, 0, 1] + points[:, :, :1])
    path = save_motions(upward, tmp_path / "up.npz")
    assert any("both hands are above the shoulders all the time" in line for line in aloud(path)[1])


def test_people_as_they_are_pass_in_silence(recorded: Motions, tmp_path: Path) -> None:
    for number, motions in enumerate((recorded, changed(recorded, lambda points: points[:, :] + 5.0))):
        assert aloud(save_motions(motions, tmp_path / f"{number}.npz"))[1] == []
        assert aloud(write_dataset(motions, tmp_path / str(number)))[1] == []
    assert doubts(load_motions("embedded")) == ()


@pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")
def test_what_is_odd_is_said_once_however_often_it_is_stored(recorded: Motions, tmp_path: Path) -> None:
    first = load_motions(save_motions(changed(recorded, swap), tmp_path / "a.npz"))
    again = load_motions(save_motions(first, tmp_path / "b.npz"))
    assert again.notes == first.notes


def test_the_papers_recordings_are_not_doubted(paper_dir: Path) -> None:
    """Their sensor stretches an upper arm by up to a quarter within one recording; no person is odd for it."""
    began = time.process_time()
    motions, said = aloud(f"paper:{paper_dir}")
    reading = time.process_time() - began
    assert said == []
    assert motions.notes == ()
    began = time.process_time()
    assert doubts(motions) == ()
    assert time.process_time() - began < 0.1 * reading


def test_a_papers_folder_of_nobody_is_doubted_and_read(tmp_path: Path) -> None:
    """The joints of the small workbooks lie anywhere."""
    motions, said = aloud(f"paper:{paper_workbooks.write_dataset(tmp_path / 'paper')}")
    assert len(motions.takes) == 6
    for name in ("adult", "kid"):
        assert any(f"{name}: the left upper arm changes its length by" in line for line in said)
