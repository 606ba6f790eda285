"""What other laboratories hand over: the limbs come out right, or the file is refused with what to do.

Each file is written from a person whose limbs are known, as in ``test_variants``; here it is the habits around the
numbers that differ: headers, clocks, marks of lost joints, orders, endings.
"""

from __future__ import annotations

import json
import pickle
import re
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from syda_gym.errors import MotionError
from syda_gym.motions import Motions, MotionWarning, load_motions
from tests.motions import recordings as rec
from tests.motions.readers import test_variants as lab

COUNT = lab.COUNT
NAMES = [*lab.ARMS, "LHip", "RHip", "Head"]
HEADER = ["time", *(f"{name}_{axis}" for name in NAMES for axis in "xyz")]
CLOCK = [f"{i / 100:.2f}" for i in range(COUNT)]
LOST = slice(10, 20)
Rows = list[list[str]]


def rows(times: Sequence[str] = CLOCK, unit: float = 1.0, form: str = "{:.5f}") -> Rows:
    table = np.concatenate([lab._person(unit=unit)[name] for name in NAMES], axis=1)
    return [[moment, *(form.format(value) for value in row)] for moment, row in zip(times, table, strict=True)]


def write(path: Path, header: Rows, body: Rows, separator: str = ",", encoding: str = "utf-8") -> Path:
    lines = [separator.join(row) for row in (*header, *body)]
    path.write_bytes(("\n".join(lines) + "\n").encode(encoding))
    return path


def plain(path: Path, **changes: object) -> Path:
    return write(path / "lab.csv", [HEADER], rows(), **changes)  # type: ignore[arg-type]


def loaded(path: Path) -> tuple[Motions, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", MotionWarning)
        motions = load_motions(path)
    return motions, [str(one.message) for one in caught if "converted to metres" not in str(one.message)]


def lost(path: Path, word: str, joints: Sequence[str] = ("LElbow", "LHand")) -> Path:
    """An arm that is missing for a while."""
    body = rows()
    for row in body[LOST]:
        for joint in joints:
            place = 1 + 3 * NAMES.index(joint)
            row[place : place + 3] = [word] * 3
    return write(path / "lost.csv", [HEADER], body)


def degrees(motions: Motions) -> np.ndarray:
    """Largest angle of a limb from what was written, for each frame."""
    clip = motions.clips("operator")[0]
    links = np.diff(clip.body.arm_points(clip.frames), axis=2)
    links /= np.linalg.norm(links, axis=-1, keepdims=True)
    angles = np.degrees(np.arccos(np.clip((links * lab._truth()).sum(axis=-1), -1.0, 1.0)))
    return np.asarray(angles.max(axis=(1, 2)))


def recorded(motions: Motions) -> np.ndarray:
    """Frames without a gap: what is filled in between is a guess."""
    marks = motions.takes[0].filled.get("operator")
    return np.ones(COUNT, dtype=bool) if marks is None else ~marks.any(axis=1)


def vicon_two_header_rows(path: Path) -> Path:
    marks = lab._markers()
    table = np.concatenate(list(marks.values()), axis=1)
    header = [[cell for name in marks for cell in (f"Anna:{name}", "", "")], ["X", "Y", "Z"] * len(marks)]
    return write(path / "two.csv", header, [[f"{value:.3f}" for value in row] for row in table])


def mvnx(path: Path, **changes: object) -> Path:
    file = path / "walk.mvnx"
    file.write_text(rec.mvnx_text(lab._order(lab.XSENS, lab._person()), **changes))  # type: ignore[arg-type]
    return file


def mediapipe_lines(path: Path) -> Path:
    """JSON lines of the Tasks API for the web, picture and world side by side."""
    lines = []
    for index, frame in enumerate(rec.mediapipe_table(COUNT)):
        world = [dict(zip(("x", "y", "z", "visibility"), map(float, point), strict=True)) for point in frame]
        seen = [{"x": 0.5, "y": 0.5, "z": 0.0, "visibility": 1.0}] * 33
        lines.append(json.dumps({"timestamp": 10 * index, "landmarks": [seen], "worldLandmarks": [world]}))
    (path / "web.jsonl").write_text("\n".join(lines))
    return path / "web.jsonl"


def azure_with_confidence(path: Path) -> Path:
    """Millimetres, microseconds, and a wrist that is half a metre off where its confidence is none."""
    names = {"SHOULDER_LEFT": "LShoulder", "ELBOW_LEFT": "LElbow", "WRIST_LEFT": "LHand", "SHOULDER_RIGHT": "RShoulder",
             "ELBOW_RIGHT": "RElbow", "WRIST_RIGHT": "RHand", "PELVIS": "Pelvis", "HIP_LEFT": "LHip",
             "HIP_RIGHT": "RHip", "NECK": "Neck", "HEAD": "Head", "NOSE": "Nose"}  # fmt: skip
    joints = lab._person(rec.MEDIAPIPE_AXES, 1000.0)
    body = []
    for t in range(COUNT):
        row = [str(10_000 * t)]
        for name, mine in names.items():
            off = name == "WRIST_LEFT" and 10 <= t < 15
            row += [f"{value + 500 * off:.2f}" for value in joints[mine][t]] + ["0" if off else "2"]
        body.append(row)
    header = [["timestamp_usec", *(f"{name}_{axis}" for name in names for axis in ("X", "Y", "Z", "CONF"))]]
    return write(path / "azure.csv", header, body)


def commas_and_an_empty_column(path: Path) -> Path:
    body = [[cell.replace(".", ",") for cell in row] + [""] for row in rows()]
    return write(path / "excel.csv", [["Zeit", *HEADER[1:], ""]], body, ";", "utf-8-sig")


def tabs_and_blank_lines(path: Path) -> Path:
    file = write(path / "tabs.txt", [HEADER], rows(), "\t")
    lines = file.read_text().split("\n")
    file.write_text("\n".join(["", *lines[:1], "", *lines[1:9], "", "   ", *lines[9:], "", ""]))
    return file


def remarks(path: Path) -> Path:
    file = plain(path)
    lines = file.read_text().split("\n")
    file.write_text("\n".join(["# made by Anna", "% 100 Hz", *lines[:9], "# a pause", *lines[9:], "// end"]))
    return file


def header_again(path: Path) -> Path:
    body = rows()
    return write(path / "again.csv", [HEADER], [*body[:20], HEADER, *body[20:]])


def clocked(times: list[str], name: str = "time") -> Callable[[Path], Path]:
    return lambda path: write(path / "clock.csv", [[name, *HEADER[1:]]], rows(times))


def shuffled(path: Path, name: str = "time", times: Sequence[str] = CLOCK) -> Path:
    order = np.random.default_rng(3).permutation(COUNT)
    body = rows(times)
    return write(path / "shuffled.csv", [[name, *HEADER[1:]]], [body[i] for i in order])


def twice(path: Path) -> Path:
    return write(path / "twice.csv", [HEADER], [row for row in rows() for _ in range(2)])


SORTED = "are not in the order of their"
MIDNIGHT = [f"{23 if i < 20 else 0:02d}:{59 if i < 20 else 0:02d}:{(59.8 + i / 100) % 60:06.3f}" for i in range(COUNT)]
READ: dict[str, tuple[Callable[[Path], Path], float, str]] = {
    "Vicon with two header rows": (vicon_two_header_rows, 30.0, ""),
    "MVNX": (mvnx, 60.0, ""),
    "MVNX without a rate": (lambda path: mvnx(path, rate=""), 60.0, ""),
    "MediaPipe JSON lines": (mediapipe_lines, 100.0, ""),
    "Azure with confidence": (azure_with_confidence, 100.0, ""),
    "decimal commas": (commas_and_an_empty_column, 100.0, ""),
    "tabs and blank lines": (tabs_and_blank_lines, 100.0, ""),
    "byte order mark": (lambda path: plain(path, encoding="utf-8-sig"), 100.0, ""),
    "millimetres, z up": (lambda path: write(path / "mm.csv", [HEADER], rows(unit=1000.0, form="{:.2f}")), 100.0, ""),
    "remarks between frames": (remarks, 100.0, ""),
    "the header again": (header_again, 100.0, ""),
    "an arm as NaN": (lambda path: lost(path, "NaN"), 100.0, ""),
    "an arm as nothing": (lambda path: lost(path, ""), 100.0, ""),
    "an arm as N/A": (lambda path: lost(path, "N/A"), 100.0, ""),
    "an arm as zeros": (lambda path: lost(path, "0"), 100.0, ""),
    "an arm as -1": (lambda path: lost(path, "-1.0"), 100.0, ""),
    "an arm as -9999": (lambda path: lost(path, "-9999"), 100.0, ""),
    "an arm as 1e6": (lambda path: lost(path, "1e6"), 100.0, ""),
    "everything as zeros": (lambda path: lost(path, "0.00000", NAMES), 100.0, ""),
    "ISO dates": (clocked([f"2024-05-01T12:00:{i / 100:09.6f}" for i in range(COUNT)], "timestamp"), 100.0, ""),
    "dates with a zone": (clocked([f"2024-05-01 12:00:{i / 100:06.3f}+02:00" for i in range(COUNT)]), 100.0, ""),
    "time of day": (clocked([f"09:15:{i / 100:06.3f}" for i in range(COUNT)]), 100.0, ""),
    "past midnight": (clocked(MIDNIGHT), 100.0, ""),
    "timecode": (clocked([f"01:00:{i // 25:02d}:{i % 25:02d}" for i in range(COUNT)], "timecode"), 25.0, ""),
    "times out of order": (shuffled, 100.0, SORTED),
    "numbers out of order": (
        lambda path: shuffled(path, "frame", [str(i) for i in range(COUNT)]), 30.0, SORTED,
    ),
    "every row twice": (twice, 100.0, ""),
}  # fmt: skip


@pytest.mark.parametrize("kind", READ)
def test_the_limbs_come_out_right(tmp_path: Path, kind: str) -> None:
    writer, fps, doubt = READ[kind]
    motions, aloud = loaded(writer(tmp_path))
    assert degrees(motions)[recorded(motions)].max() < 2.0
    assert motions.takes[0].fps == pytest.approx(fps, rel=0.01)
    assert motions.bodies["operator"].reach == pytest.approx(0.581, abs=0.01)
    assert [line for line in aloud if doubt not in line] == []
    assert bool(aloud) == bool(doubt)


@pytest.mark.parametrize("word", ["NaN", "", "0", "-9999", "1e6"])
def test_a_missing_arm_is_marked_and_said_not_shown_at_the_end_of_the_world(tmp_path: Path, word: str) -> None:
    motions, _ = loaded(lost(tmp_path, word))
    marks = motions.takes[0].filled["operator"]
    assert marks[LOST, 3:9].all()
    assert not marks[:, :3].any()
    assert not marks[:10].any()
    assert not marks[20:].any()
    assert any("LHand: 10 of 40 frames untracked" in note for note in motions.notes)
    if word in ("0", "-9999", "1e6"):
        assert any(f"x = y = z = {float(word):g}" in note for note in motions.notes)


def test_a_joint_at_the_origin_of_the_file_is_no_gap(tmp_path: Path) -> None:
    joints = lab._person()
    header = ["time", *(f"{name}_{axis}" for name in (*NAMES, "Pelvis") for axis in "xyz")]
    table = np.concatenate([joints[name] - joints["Pelvis"] for name in (*NAMES, "Pelvis")], axis=1)
    body = [[moment, *(f"{value:.5f}" for value in row)] for moment, row in zip(CLOCK, table, strict=True)]
    motions, aloud = loaded(write(tmp_path / "root.csv", [header], body))
    assert lab._degrees(motions) < 2.0
    assert not aloud
    assert not any("taken as gaps" in note for note in motions.notes)


def test_a_joint_that_a_tool_held_is_said(tmp_path: Path) -> None:
    """The body sways, an arm hangs in the air; a body at rest is none of this."""
    body = rows()
    for index, row in enumerate(body):
        row[1:] = [f"{float(cell) + 0.001 * index:.5f}" for cell in row[1:]]
    assert not any("does not move" in note for note in loaded(write(tmp_path / "a.csv", [HEADER], body))[0].notes)
    for row in body[10:30]:
        row[4:10] = body[10][4:10]
    motions, aloud = loaded(write(tmp_path / "held.csv", [HEADER], body))
    assert [note[:6] for note in motions.notes if "does not move at all for 0.2" in note] == ["LElbow", "LHand "]
    assert not aloud
    slow = [[f"{10 * float(row[0]):.2f}", *row[1:]] for row in body]
    _, aloud = loaded(write(tmp_path / "held.csv", [HEADER], slow))
    assert any("LElbow does not move at all for 2.0" in line for line in aloud)


def test_a_body_at_rest_is_not_held(tmp_path: Path) -> None:
    body = [[moment, *rows()[0][1:]] for moment in CLOCK]
    motions, aloud = loaded(write(tmp_path / "rest.csv", [HEADER], body))
    assert not aloud
    assert not any("does not move" in note for note in motions.notes)


def test_rate_of_a_bvh_at_120_hertz(tmp_path: Path) -> None:
    text = rec.bvh_text(rec.CMU)
    (tmp_path / "a.bvh").write_text(text)
    (tmp_path / "b.bvh").write_text(re.sub(r"Frame Time:.*", "Frame Time: 0.00833333", text))
    usual, fast = (loaded(tmp_path / name)[0].takes[0] for name in ("a.bvh", "b.bvh"))
    assert fast.fps == pytest.approx(120.0, rel=1e-4)
    np.testing.assert_allclose(fast.frames["operator"], usual.frames["operator"], atol=2e-3)  # the heading's smoothing


def test_several_recordings_in_one_file_are_not_mixed(tmp_path: Path) -> None:
    """Times that begin again, and those of two clocks that lie between one another: sorted, people would flicker."""
    with pytest.raises(MotionError, match=r"line 22: time runs backward.*cut it"):
        load_motions(clocked([*CLOCK[:20], *CLOCK[:20]])(tmp_path))
    between = [*CLOCK[:20], *(f"{float(moment) + 0.005:.3f}" for moment in CLOCK[:20])]
    with pytest.raises(MotionError, match=r"line 22: time runs backward.*cut it"):
        load_motions(clocked(between)(tmp_path))


def openpose_folder(path: Path) -> Path:
    folder = path / "op"
    folder.mkdir()
    person = {"pose_keypoints_2d": [100.0, 200.0, 0.9] * 25, "pose_keypoints_3d": []}
    for index in range(3):
        (folder / f"clip_{index:012d}_keypoints.json").write_text(json.dumps({"version": 1.3, "people": [person]}))
    return folder


def smplx(path: Path) -> Path:
    np.savez(path / "smplx.npz", global_orient=np.zeros((9, 3)), body_pose=np.zeros((9, 63)), transl=np.zeros((9, 3)))
    return path / "smplx.npz"


def smpl(path: Path) -> Path:
    np.savez(path / "smpl.npz", poses=np.zeros((9, 72)), betas=np.zeros(10), trans=np.zeros((9, 3)))
    return path / "smpl.npz"


def pickled(path: Path) -> Path:
    (path / "smpl.pkl").write_bytes(pickle.dumps({"poses": [0.0]}))
    return path / "smpl.pkl"


def folder_of_files(path: Path) -> Path:
    (path / "lab").mkdir()
    plain(path / "lab")
    return path / "lab"


def named(name: str) -> Callable[[Path], Path]:
    def make(path: Path) -> Path:
        (path / name).write_bytes(b"\x01\x02\x03\x00" * 20)
        return path / name

    return make


def metres_that_are_millimetres(path: Path) -> Path:
    header = ["Time [s]", *(f"{name} {axis} [m]" for name in NAMES for axis in "XYZ")]
    return write(path / "unit.csv", [header], rows(unit=1000.0, form="{:.2f}"))


REFUSED: dict[str, tuple[Callable[[Path], Path], str]] = {
    "SMPL-X": (smplx, "angles of an SMPL body, as AMASS publishes them"),
    "SMPL": (smpl, "angles of an SMPL body, as AMASS publishes them"),
    "SMPL as a pickle": (pickled, r"\.pkl files are not read; such a file can run code .* save joint positions"),
    "OpenPose folder": (openpose_folder, "one file a frame, as OpenPose writes them. Places in a picture have no"),
    "one of OpenPose": (
        lambda path: openpose_folder(path) / "clip_000000000000_keypoints.json",
        "holds one frame, .* places in a picture, whose depth is unknown",
    ),
    "a folder of files": (folder_of_files, r"is a folder .* name one of its files, such as .*lab\.csv, or .*pair"),
    "an empty folder": (lambda path: path, "is an empty folder"),
    "FBX": (named("walk.fbx"), r"\.fbx files are not read; export BVH"),
    "ASF": (named("walk.amc"), r"\.amc files are not read; export BVH"),
    "MATLAB": (named("walk.mat"), r"\.mat files are not read; save joint positions as npz or CSV"),
    "MVNX without positions": (lambda path: mvnx(path, position=False), "without the position of a segment; export"),
    "MVNX with entities": (
        lambda path: mvnx(path, before='<!DOCTYPE x [<!ENTITY a "aaaa">]>'), "declares entities",
    ),
    "another unit than it says": (metres_that_are_millimetres, "--unit says what the file's numbers are"),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")
@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_read_says_what_to_do(tmp_path: Path, kind: str) -> None:
    writer, words = REFUSED[kind]
    with pytest.raises(MotionError, match=words):
        load_motions(writer(tmp_path))


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("</mvnx>", "", "is no whole XML"),
        ('type="normal"><position>', 'type="normal"><position>zero', "frame 0: a position is no number"),
        ('<segment label="Pelvis" id="1"/>', "", r"69 numbers for 22 segments"),
        ("LeftForeArm", "LeftArmour", "LElbow is missing"),
        ("<subject", "<object", "is no whole XML"),
        ("UTF-8", "UT", "is no whole XML: unknown encoding"),
    ],
)
def test_damaged_mvnx(tmp_path: Path, before: str, after: str, words: str) -> None:
    path = mvnx(tmp_path)
    text = path.read_text()
    assert before in text
    path.write_text(re.sub(re.escape(before), after, text))
    with pytest.raises(MotionError, match=words):
        load_motions(path)


def test_mvnx_with_two_subjects_and_said_joints(tmp_path: Path) -> None:
    path = mvnx(tmp_path)
    text = path.read_text()
    subject = text[text.index("<subject") : text.index("</mvnx>")]
    path.write_text(text.replace("</mvnx>", subject.replace("Anna", "Otto") + "</mvnx>"))
    motions, _ = loaded(path)
    assert any("2 people in the file (1 is Anna, 2 is Otto)" in note for note in motions.notes)
    assert any("person 2 was read" in note for note in load_motions(path, person=2).notes)
    said = load_motions(path, joints={"LShoulder": "LeftShoulder"})
    assert said.bodies["operator"].upper_arm > 0.0
    with pytest.raises(MotionError, match="no segment 'Hat' for Head"):
        load_motions(path, joints={"Head": "Hat"})
