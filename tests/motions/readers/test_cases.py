"""37 small made-up files, one of each kind that people have: read as an independent reading reads them, or refused
in our words."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from syda_gym.errors import MotionError
from syda_gym.motions import Motions, MotionWarning, load_motions
from tests.motions.readers.independent import reading

CASES = sorted(path for path in (Path(__file__).parent / "cases").iterdir() if path.suffix != ".md")
REFUSED = {"amass_like.npz": "angles of an SMPL body, as AMASS publishes them .*, not where its joints are"}
# Files whose rate is not 30 Hz, and those that are read with a warning besides that of their unit.
RATES = {"mediapipe_coarse_time.json": 33.3, "mediapipe_two_people.json": 30.3}
ALOUD = {"mediapipe_coarse_time.json": "times are coarser than frames: 12 frames share 4 timestamps",
         "bvh_child_inches.bvh": "units may be CMU units of 0.45 inch as well"}  # fmt: skip


def _load(path: Path, **said: object) -> tuple[Motions, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", MotionWarning)
        motions = load_motions(path, **said)  # type: ignore[arg-type]
    return motions, [str(one.message) for one in caught if "converted to metres" not in str(one.message)]


def test_every_kind_is_there() -> None:
    assert len(CASES) == 37


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.name)
def test_case(path: Path) -> None:
    if path.name in REFUSED:
        with pytest.raises(MotionError, match=REFUSED[path.name]):
            load_motions(path)
        return
    motions, aloud = _load(path)
    clip = motions.clips("operator")[0]
    links = np.diff(clip.body.arm_points(clip.frames), axis=2)
    links /= np.linalg.norm(links, axis=-1, keepdims=True)
    truth = reading(path)
    assert links.shape == truth.shape
    angles = np.degrees(np.arccos(np.clip((links * truth).sum(axis=-1), -1.0, 1.0)))
    assert angles.max() < 2.0
    # What the files were made of: left upper arm 20 degrees above level, right arm hanging 10 degrees out.
    np.testing.assert_allclose(
        links[:, 0, 0],
        np.broadcast_to([0.0, np.cos(np.deg2rad(20)), np.sin(np.deg2rad(20))], (len(links), 3)),
        atol=0.03,
    )
    np.testing.assert_allclose(links[:, 1, :, 2], -np.cos(np.deg2rad(10)), atol=0.03)
    assert clip.fps == pytest.approx(RATES.get(path.name, 30.0), rel=0.01)
    if path.name in ALOUD:
        assert any(ALOUD[path.name] in text for text in aloud)
    else:
        assert not aloud
    reach = clip.body.reach
    assert reach == pytest.approx(0.3 if "child" in path.name else 0.53, rel=0.2)


def test_two_people_are_said_and_either_is_taken() -> None:
    path = next(path for path in CASES if path.name == "mediapipe_two_people.json")
    first, _ = _load(path)
    second, _ = _load(path, person=2)
    assert any("2 people in the file" in note and "person 1 was read" in note for note in first.notes)
    assert any("person 2 was read" in note for note in second.notes)
    with pytest.raises(MotionError, match="person 3 is wanted, but there are 2"):
        load_motions(path, person=3)


def test_a_blank_line_between_frames_changes_nothing() -> None:
    by_name = {path.name: path for path in CASES}
    motions, _ = _load(by_name["bvh_blank_between_frames.bvh"])
    assert len(motions.takes[0].frames["operator"]) == 12


def test_every_case_says_what_is_right() -> None:
    page = (Path(__file__).parent / "cases" / "README.md").read_text()
    assert {path.name for path in CASES} == set(re.findall(r"^- `([\w.]+\.(?!py)\w+)`", page, re.MULTILINE)) - {
        "live_cases.py"
    }
