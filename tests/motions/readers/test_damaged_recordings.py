"""Damaged recordings: one exception of the library that names file and place, whatever the damage."""

from __future__ import annotations

import contextlib
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from syda_gym.errors import MotionError
from syda_gym.motions import load_motions
from syda_gym.motions.readers import text
from syda_gym.motions.readers.bvh.read import read_bvh
from syda_gym.motions.readers.dispatch import read_mediapipe
from syda_gym.motions.readers.tables.read import read_kinect, read_openni
from tests.motions import recordings as rec

pytestmark = pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")

BVH = rec.bvh_text()
KINECT = [",".join(f"{value:.9g}" for value in row) + "," for row in rec.kinect_rows(6)]
OPENNI = [" ".join(f"{value:.6g}" for value in row) for row in rec.openni_rows(6)]
TABLE = rec.table_lines(6)
JSON = rec.json_text(rec.mediapipe_json(3))


def _file(tmp_path: Path, name: str, content: str | list[str]) -> Path:
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else "\n".join(content))
    return path


def _replaced(lines: list[str], index: int, line: str) -> list[str]:
    return [*lines[:index], line, *lines[index + 1 :]]


def _short(value: object) -> str | None:
    """Whole files would make the names of tests unreadable."""
    return "file" if len(str(value)) > 60 else None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (BVH[: BVH.index("MOTION") - 60].rsplit("\n", 1)[0], r"line \d+: the file ends inside the hierarchy"),
        (BVH[: BVH.index("Frames")], "expected 'Frames: <count>'; is the file truncated"),
        (BVH[: BVH.index("Frame Time")], "expected 'Frame Time: <seconds>'; is the file truncated"),
        ("\n".join(BVH.splitlines()[:-3]), r"line \d+: 9 frames, but the header says 12; the file is truncated"),
        (BVH[:-40], r"line \d+: \d+ numbers, the hierarchy has 51 channels; the file is truncated"),
        (BVH.replace("Frame Time: 0.0333333", "Frame Time: 0"), "frame time must be between"),
        (BVH.replace("OFFSET 29.000000 0.000000", "OFFSET 29.000000"), "OFFSET needs three numbers, got 2"),
        (BVH.replace("CHANNELS 3 Zrotation", "CHANNELS 2 Zrotation"), "CHANNELS 3 with three rotations is usual"),
        (BVH.replace("-80.000000", "nan"), "a channel is not a number"),
        (BVH.replace("-80.000000", "1e999"), "the number is infinite"),
        (BVH.replace("-80.000000", "eighty"), "'eighty' is no number"),
        (BVH.replace("LeftForeArm", "LeftHand"), "joint 'LeftHand' occurs 2 times"),
        (BVH.replace("LeftForeArm", "Gripper"), "joint LElbow is missing; it may be called LeftForearm"),
        (BVH.replace("Left", "A").replace("Right", "B"), "no arm found"),
        (BVH.replace("}", "", 1), r"MOTION comes too early, 1 braces are open|expected"),
        ("timestamp,x,y\n1,2,3", "3 columns called timestamp, x, y: no joint is named"),
        ("", "is empty"),
    ],
    ids=_short,
)  # fmt: skip
def test_damaged_bvh(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(MotionError, match=message) as caught:
        load_motions(_file(tmp_path, "clip.bvh", content))
    assert "clip.bvh" in str(caught.value)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            _replaced(KINECT, 5, KINECT[5][:300]),
            r"line 6: \d+ columns, the lines before have 101; is the file truncated",
        ),
        (_replaced(KINECT, 2, KINECT[2].replace(",2,", ",7,", 1)), "line 3: a tracking state is none of 0, 1 and 2"),
        (_replaced(KINECT, 2, "x" + KINECT[2]), "line 3, column 1: 'x8"),
        (_replaced(KINECT, 3, KINECT[1]), "line 4: time runs backward"),
        (KINECT[:1], "1 frames; expected at least two"),
        ([line.replace(",2,", ",0,") for line in KINECT], "is tracked in 0 % of the frames only .*line 1"),
        ([",".join(["nan"] * 101)] * 3, "no order of joints that is known"),
    ],
)
def test_damaged_kinect(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(MotionError, match=message) as caught:
        read_kinect(_file(tmp_path, "body.csv", lines))
    assert "body.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (_replaced(OPENNI, 4, OPENNI[4][:100]), r"line 5: \d+ columns, the lines before have 60"),
        (["1 2 3"], "3 columns of numbers, which is no order of joints"),
        (
            _replaced(OPENNI, 1, OPENNI[1].replace(OPENNI[1].split()[0], "head", 1)),
            "line 2, column 1: 'head' is no number",
        ),
        (["0 0 0 1 " * 15] * 4, "is tracked in 0 %"),
        (["END"], "no frames"),
    ],
)
def test_damaged_openni(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(MotionError, match=message) as caught:
        read_openni(_file(tmp_path, "user1.txt", lines))
    assert "user1.txt" in str(caught.value)


def _image_landmarks() -> str:
    table = rec.mediapipe_table(4)
    table[:, :, :2] = 0.5 + 0.3 * table[:, :, :2]
    return rec.json_text([frame.tolist() for frame in table])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (JSON[:-200], "not valid JSON.*truncated"),
        ("{}", "expected a list of frames"),
        ("[]", "no frames"),
        ("[1, 2]", "frame 0: expected landmarks, got int"),
        ('[{"posture": []}]', "frame 0: expected a key 'pose_world_landmarks'"),
        ('[{"pose_landmarks": []}]', "only image landmarks"),
        ("[[[0, 0, 0]]]", "1 points a frame, which is no order of joints"),
        (rec.json_text([[[0.0, 0.0]] * 33]), "frame 0, landmark 0: expected x, y, z"),
        (rec.json_text([[{"x": "left"}] * 33]), "frame 0, landmark 0"),
        (rec.json_text([[], []]), "is tracked in 0 % of the frames"),
        (re.sub('"timestamp_ms": [0-9]+', '"timestamp_ms": 7', JSON), "all frames have the same timestamp"),
        (JSON.replace('"timestamp_ms": 40', '"timestamp_ms": "soon"'), "frame 1: timestamp_ms is no number"),
        (JSON.replace('"timestamp_ms": 40', '"number": 40'), "frame 1: the time is missing"),
        (JSON.replace('"timestamp_ms": 40', '"timestamp_ms": -40'), "frame 1: time runs backward"),
        (_image_landmarks(), "image landmarks .*dump pose_world_landmarks"),
        ("[" * 100_000, "nested too deeply"),
        (rec.json_text({"fps": "fast", "frames": rec.mediapipe_json(3)}), "fps must be a number"),
    ],
)
def test_damaged_mediapipe(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(MotionError, match=message) as caught:
        read_mediapipe(_file(tmp_path, "pose.json", content))
    assert "pose.json" in str(caught.value)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"other": np.zeros(3)}, "expected an array"),
        ({"landmarks": np.zeros((5, 17, 3))}, "17 points a frame in landmarks, which make no person"),
        ({"landmarks": np.array([["a"]])}, "expected"),
        ({"landmarks": np.zeros((5, 33, 3)), "timestamps": np.zeros(4)}, r"timestamps have shape \(4,\) for 5 frames"),
        ({"landmarks": np.zeros((5, 33, 3)), "fps": np.array(0.0)}, "fps must be"),
        ({"landmarks": np.zeros((5, 33, 3))}, "coincide"),
        ({"landmarks": np.full((5, 33, 3), np.inf)}, "frame 0: a coordinate is infinite"),
        ({"landmarks": np.array([None, "x"], dtype=object)}, "no readable"),
    ],
)
def test_damaged_landmark_npz(tmp_path: Path, arrays: dict[str, np.ndarray], message: str) -> None:
    np.savez(tmp_path / "pose.npz", **arrays)
    with pytest.raises(MotionError, match=message):
        read_mediapipe(tmp_path / "pose.npz")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("clip.bvh", KINECT, None),  # a Kinect table with a wrong ending is still a Kinect table
        ("clip.csv", BVH, None),
        ("clip.csv", "a,b\n1,2", "no line of numbers .* begins with 'a,b'"),
        ("clip.npz", "text", "no readable .npz"),
        ("clip.json", "text", "no line of numbers .* begins with 'text'"),
        ("clip.txt", "just some words", "no line of numbers .* begins with 'just some words'"),
    ],
    ids=_short,
)
def test_file_that_is_not_what_its_ending_says(
    tmp_path: Path, name: str, content: str | list[str], message: str | None
) -> None:
    path = _file(tmp_path, name, content)
    if message is None:
        assert len(load_motions(path).takes) == 1
    else:
        with pytest.raises(MotionError, match=message):
            load_motions(path)


@pytest.mark.parametrize("reader", [read_bvh, read_kinect, read_openni, read_mediapipe])
def test_missing_binary_and_oversized(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reader: object) -> None:
    assert callable(reader)
    with pytest.raises(MotionError, match="no file"):
        reader(tmp_path / "none.csv")
    with pytest.raises(MotionError, match="no file"):
        reader(tmp_path)
    (tmp_path / "binary.csv").write_bytes(b"\0\1\2" * 100)
    with pytest.raises(MotionError, match="is binary"):
        reader(tmp_path / "binary.csv")
    monkeypatch.setattr(text, "MAX_BYTES", 100)
    with pytest.raises(MotionError, match="at most"):
        reader(_file(tmp_path, "large.csv", "1 " * 200))


_SEEDS = {
    "clip.bvh": (BVH, read_bvh),
    "body.csv": ("\n".join(KINECT), read_kinect),
    "user.txt": ("\n".join(OPENNI), read_openni),
    "user2.txt": ("\n".join(rec.cornell_lines(4)), read_openni),
    "pose.csv": ("\n".join(TABLE), read_mediapipe),
    "pose.json": (JSON, read_mediapipe),
}
_JUNK = st.sampled_from(
    ["", "\n", " ", ",", "{", "}", "[", "nan", "inf", "1e400", "-", "\0", "é", "0", "JOINT x", "\r"]
)


@pytest.mark.parametrize("name", _SEEDS)
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_damage_raises_anything_else(tmp_path: Path, name: str, data: st.DataObject) -> None:
    content, reader = _SEEDS[name]
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(content)))
        stop = min(len(content), start + data.draw(st.sampled_from([0, 1, 3, 40, 400, 100_000])))
        content = content[:start] + data.draw(_JUNK) + content[stop:]
    path = tmp_path / name
    path.write_bytes(content.encode())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with contextlib.suppress(MotionError):
            take = reader(path).takes[0]
            assert all(np.isfinite(frames).all() for frames in take.frames.values())


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    shape=st.tuples(st.integers(0, 4), st.sampled_from([33, 33, 32]), st.integers(2, 6)),
    scale=st.sampled_from([0.0, 1e-300, 1.0, 1e300]),
    seed=st.integers(0, 99),
)
def test_any_landmark_array(tmp_path: Path, shape: tuple[int, int, int], scale: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = rng.normal(size=shape) * scale
    table[rng.random(shape) < 0.1] = np.nan
    np.savez(tmp_path / "any.npz", landmarks=table)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with contextlib.suppress(MotionError):
            take = read_mediapipe(tmp_path / "any.npz").takes[0]
            assert np.isfinite(take.frames["operator"]).all()


@pytest.mark.parametrize("kept", range(1, 20))
def test_a_header_that_names_more_columns_than_the_lines_have(tmp_path: Path, kept: int) -> None:
    joints = ["left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist"]
    places = [(0.2, 0.5, 2.0), (0.5, 0.5, 2.0), (0.7, 0.5, 2.0), (-0.2, 0.5, 2.0), (-0.5, 0.5, 2.0), (-0.7, 0.5, 2.0)]
    row = [f"{value}" for place in places for value in place]
    path = tmp_path / "cut.csv"
    head = ",".join(["timestamp", *(f"{joint}_{axis}" for joint in joints for axis in "xyz")])
    lines = [",".join([f"{t / 30}", *row][:kept]) for t in range(30)]
    path.write_text("\n".join([head, *lines]))
    try:
        motions = load_motions(f"table:{path}")
    except MotionError:
        assert kept < 19
    else:
        assert kept >= 10, "an arm is there"
        assert len(motions.takes) == 1
