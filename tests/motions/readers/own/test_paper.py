"""The paper's workbooks: what is read is what was recorded, and damage is named."""

from __future__ import annotations

import shutil
import time
import zipfile
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from scipy.spatial.transform import Rotation

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MotionError
from syda_gym.motions import Motions, load_motions
from syda_gym.motions.readers.own.paper import read_paper
from tests.motions.paper_workbooks import HEADER, human_sheets, pepper_sheets, write_dataset, write_workbook


@pytest.fixture(scope="module")
def recorded(paper_dir: Path) -> Motions:
    return read_paper(paper_dir)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_dataset(tmp_path / "paper")


@pytest.mark.parametrize(
    ("source", "target", "rows"), [("adult", "pepper", 740), ("kid", "pepper", 788), ("adult", "kid", 660)]
)
def test_paired_rows(recorded: Motions, source: str, target: str, rows: int) -> None:
    pair = recorded.pair(source, target)
    assert len(pair) == rows
    assert len(pair.action_names) == 9
    assert pair.source.shape == (rows, 18)
    assert pair.mirrored.sum() == rows // 2


def test_all_workbooks_are_read_in_seconds(paper_dir: Path) -> None:
    start = time.process_time()
    read_paper(paper_dir)
    assert time.process_time() - start < 15.0  # about 2 s


def _recorded_landmarks(path: Path) -> np.ndarray:
    """Elbow and wrist of each arm from the local frames of the workbook, accumulated from the torso."""
    book = openpyxl.load_workbook(path, read_only=True)
    landmarks = []
    for side in "LR":
        rotation, position = Rotation.identity(), np.zeros(3)
        origins = {}
        for part in ("Shoulder", "Bicep", "Elbow", "ForeArm", "Hand"):
            rows = list(book[side + part].iter_rows(values_only=True))
            assert rows[0][:7] == HEADER
            table = np.array([row[:7] for row in rows[1:]], dtype=float)
            position = position + rotation.apply(table[:, :3])
            rotation = rotation * Rotation.from_quat(table[:, 3:])
            origins[part] = position
        landmarks += [origins["Elbow"], origins["Hand"]]
    return np.stack(landmarks, axis=1)


@pytest.mark.parametrize("action", [1, 5, 9])
def test_pepper_angles_reproduce_the_recorded_landmarks(paper_dir: Path, recorded: Motions, action: int) -> None:
    pepper = catalog.get("pepper")
    clips = [take for take in recorded.takes if take.action == f"A{action:02d}" and "pepper" in take.frames]
    frames = np.concatenate([clips[0].frames["pepper"], clips[1].frames["pepper"]])
    truth = _recorded_landmarks(paper_dir / "Pepper" / f"pepper_P01A{action:02d}T01.xlsx")
    assert np.abs(pepper.landmarks(frames) - truth).max() < 1e-6


def test_second_half_is_the_mirror_image_of_the_first(recorded: Motions) -> None:
    by_recording: dict[str, dict[bool, dict[str, np.ndarray]]] = {}
    for take in recorded.takes:
        by_recording.setdefault(take.recording, {})[take.mirrored] = dict(take.frames)
    assert len(by_recording) == 34
    for halves in by_recording.values():
        for body, frames in halves[False].items():
            mirrored = catalog.get(body).mirror(frames)
            np.testing.assert_allclose(mirrored, halves[True][body], atol=2e-6 if body == "pepper" else 1e-12)


def test_pepper_stays_within_its_limits(recorded: Motions) -> None:
    """The URDF's limits hold everywhere; A03 alone passes the coupled elbow limit, by three degrees."""
    pepper = catalog.get("pepper")
    assert isinstance(pepper, Robot)
    for clip in recorded.clips("pepper"):
        assert ((clip.frames >= pepper.lower) & (clip.frames <= pepper.upper)).all()
        lower, upper = pepper.limits_at(clip.frames)
        excess = np.maximum(lower - clip.frames, clip.frames - upper).max()
        assert excess < (0.06 if clip.action == "A03" else 1e-6)


def test_frame_rate_is_what_the_user_says(paper_dir: Path) -> None:
    assert load_motions(f"paper:{paper_dir}", fps=12.5).pair("adult", "kid").fps == 12.5


@pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")  # its joints lie anywhere
def test_small_dataset_is_read_and_sniffed(small: Path) -> None:
    motions = load_motions(small)
    assert [take.mirrored for take in motions.takes] == [False, True] * 3
    np.testing.assert_allclose(motions.pair("adult", "pepper").target, 0.0, atol=1e-12)
    expected = np.hstack([human_sheets(6, 2)[name][:, :3] for name in ("LShoulder", "LElbow", "LHand")])
    np.testing.assert_allclose(motions.pair("kid", "pepper").source[:, :9], expected)


def test_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match=r"no folder .*Pepper"):
        read_paper(tmp_path / "nowhere")


def test_missing_partner(small: Path) -> None:
    (small / "Pepper" / "pepper_P01A01T01.xlsx").unlink()
    with pytest.raises(MotionError, match=r"pepper_P01A01T01\.xlsx"):
        read_paper(small)


def test_missing_sheet(small: Path) -> None:
    path = small / "Pepper2Human" / "human_P01A01T01.xlsx"
    sheets = human_sheets()
    del sheets["RElbow"]
    write_workbook(path, sheets)
    with pytest.raises(MotionError, match=r"human_P01A01T01\.xlsx: sheet 'RElbow' is missing"):
        read_paper(small)


def test_unequal_sheets(small: Path) -> None:
    sheets = human_sheets()
    sheets["LHand"] = sheets["LHand"][:-2]
    write_workbook(small / "Pepper2Human" / "human_P02A01T02.xlsx", sheets)
    with pytest.raises(MotionError, match=r"human_P02A01T02\.xlsx: sheets have unequal row counts .*'LHand': 4"):
        read_paper(small)


def test_unequal_partners(small: Path) -> None:
    write_workbook(small / "Pepper" / "pepper_P01A01T01.xlsx", pepper_sheets(8))
    with pytest.raises(MotionError, match=r"human_P01A01T01\.xlsx and pepper_P01A01T01\.xlsx .*'pepper': 8"):
        read_paper(small)


def test_odd_number_of_rows(tmp_path: Path) -> None:
    root = write_dataset(tmp_path / "odd", rows=7)
    with pytest.raises(MotionError, match="7 rows; expected an even number"):
        read_paper(root)


@pytest.mark.parametrize("value", [np.nan, "NaN", "a word"])
def test_cell_without_number(small: Path, value: object) -> None:
    path = small / "Pepper2Human" / "human_P01A01T01.xlsx"
    write_workbook(path, human_sheets())
    book = openpyxl.load_workbook(path)
    book["LElbow"]["B4"] = None if isinstance(value, float) else value
    book.save(path)
    with pytest.raises(MotionError, match=r"human_P01A01T01\.xlsx, sheet 'LElbow'"):
        read_paper(small)


def test_wrong_header(small: Path) -> None:
    write_workbook(small / "Pepper2Human" / "human_P01A01T01.xlsx", human_sheets(), header=HEADER[::-1])
    with pytest.raises(MotionError, match="first row must be TransX"):
        read_paper(small)


@pytest.mark.parametrize("content", [b"", b"not a workbook at all", b"PK\x03\x04 broken"])
def test_file_that_is_no_workbook(small: Path, content: bytes) -> None:
    (small / "Pepper2Human" / "human_P01A01T01.xlsx").write_bytes(content)
    with pytest.raises(MotionError, match=r"human_P01A01T01\.xlsx is no readable archive.*expected an \.xlsx workbook"):
        read_paper(small)


def test_truncated_workbook(small: Path) -> None:
    path = small / "Pepper2Human" / "human_P01A01T01.xlsx"
    path.write_bytes(path.read_bytes()[:-700])
    with pytest.raises(MotionError, match=r"human_P01A01T01\.xlsx"):
        read_paper(small)


@pytest.mark.parametrize("cell", [b"G9999999", b"ZZZZ2", b"A999999999999999999999"])
def test_a_cell_far_out_does_not_take_all_memory(small: Path, cell: bytes) -> None:
    path = small / "Pepper" / "pepper_P01A01T01.xlsx"
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    sheet = "xl/worksheets/sheet2.xml"
    members[sheet] = members[sheet].replace(b'r="G3"', b'r="' + cell + b'"')
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(MotionError, match=r"pepper_P01A01T01\.xlsx: cell .* lies beyond"):
        load_motions(f"paper:{small}")


def test_empty_folder(small: Path) -> None:
    shutil.rmtree(small / "Pepper2Human")
    (small / "Pepper2Human").mkdir()
    with pytest.raises(MotionError, match=r"no workbook .*Pepper2Human"):
        read_paper(small)
