"""Readers of foreign formats: the limbs that were recorded are the limbs that are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.motions import MotionClip, load_motions
from syda_gym.motions.readers.bvh.read import read_bvh
from syda_gym.motions.readers.joint_names import match_joints
from syda_gym.motions.readers.layouts import KINECT_JOINTS
from syda_gym.motions.readers.skeleton import MotionWarning
from syda_gym.motions.readers.tables.read import read_kinect
from tests.motions import recordings as rec

pytestmark = pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")


def _directions(clip: MotionClip) -> np.ndarray:
    links = np.diff(clip.body.arm_points(clip.frames), axis=2)
    return links / np.linalg.norm(links, axis=-1, keepdims=True)


def _true_directions(count: int = 40) -> np.ndarray:
    _, joints = rec.moving_human(count=count)
    arms = [[joints[side + part] for part in ("Shoulder", "Elbow", "Hand")] for side in "LR"]
    links = np.diff(np.array(arms), axis=1).transpose(2, 0, 1, 3)
    return links / np.linalg.norm(links, axis=-1, keepdims=True)


def _kinect(path: Path) -> Path:
    return rec.write_rows(path / "wave.csv", rec.kinect_rows())


def _openni(path: Path) -> Path:
    return rec.write_rows(path / "wave.txt", rec.openni_rows(), separator=" ", end="")


def _cornell(path: Path) -> Path:
    (path / "0512164529.txt").write_text("\n".join(rec.cornell_lines()))
    return path / "0512164529.txt"


def _json(path: Path) -> Path:
    (path / "pose.json").write_text(rec.json_text({"fps": 25, "frames": rec.mediapipe_json()}))
    return path / "pose.json"


def _json_lines(path: Path) -> Path:
    (path / "pose.jsonl").write_text("\n".join(rec.json_text(frame) for frame in rec.mediapipe_json()))
    return path / "pose.jsonl"


def _csv(path: Path) -> Path:
    (path / "pose.csv").write_text("\n".join(rec.table_lines()))
    return path / "pose.csv"


def _npz(path: Path) -> Path:
    np.savez(
        path / "pose.npz", world_landmarks=rec.mediapipe_table().astype(np.float32), timestamps=np.arange(40) / 25.0
    )
    return path / "pose.npz"


WRITERS: dict[str, tuple[Callable[[Path], Path], float]] = {
    "kinect": (_kinect, 30.0),
    "openni": (_openni, 30.0),
    "openni cornell": (_cornell, 30.0),
    "mediapipe json": (_json, 25.0),
    "mediapipe lines": (_json_lines, 25.0),
    "mediapipe csv": (_csv, 40.0),
    "mediapipe npz": (_npz, 25.0),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_limbs_proportions_and_rate_survive(tmp_path: Path, kind: str) -> None:
    writer, fps = WRITERS[kind]
    motions = load_motions(writer(tmp_path))
    assert motions.name.startswith(kind.split()[0] + ":")
    assert not motions.synthetic
    clip = motions.clips("operator")[0]
    assert clip.fps == pytest.approx(fps, rel=1e-4)
    assert len(clip) == 40
    np.testing.assert_allclose(_directions(clip), _true_directions(), atol=2e-4)
    body = clip.body
    assert isinstance(body, HumanSkeleton)
    assert (body.upper_arm, body.forearm, body.shoulders) == pytest.approx((0.294, 0.287, 0.303), abs=1e-3)
    assert 1.5 < body.height < 2.0
    assert any("is up" in note for note in motions.notes)
    # Shoulders stand where the standing body has them.
    np.testing.assert_allclose(clip.frames[0, [0, 9]], [-0.1515, 0.1515], atol=2e-3)


def test_prefix_reads_the_same_as_sniffing(tmp_path: Path) -> None:
    path = _kinect(tmp_path)
    np.testing.assert_array_equal(
        load_motions(f"kinect:{path}").takes[0].frames["operator"], load_motions(path).takes[0].frames["operator"]
    )


def test_recorded_gestures(shared_dir: Path) -> None:
    for name in ("laban_Ges01_wavehand", "laban_Ges02_balancinghands"):
        take = load_motions(shared_dir / "data" / "kinect" / f"{name}.csv").takes[0]
        assert take.action == name
        assert take.fps == pytest.approx(29.6, abs=0.1)
        assert take.timestamps is not None
        assert len(take.timestamps) == len(take.frames["operator"])
        assert take.timestamps[0] > 8000.0  # the sensor's clock is kept
    wave = load_motions(shared_dir / "data" / "kinect" / "laban_Ges01_wavehand.csv")
    marks = wave.bodies["operator"].landmarks(wave.takes[0].frames["operator"])
    assert marks[:, 3, 2].max() > 0.6  # the right wrist goes above the head
    assert marks[:, 1, 2].max() < 0.1  # the left one hangs
    assert wave.takes[0].filled["operator"].any()


def test_untracked_joints_become_flagged_gaps(tmp_path: Path) -> None:
    table = rec.kinect_rows()
    column = 1 + 4 * KINECT_JOINTS.index("ElbowLeft")
    table[10:20, column + 3] = 1.0
    table[10:20, column : column + 3] += 0.5  # what the sensor infers is wrong
    table[0:2, 1 + 4 * KINECT_JOINTS.index("WristRight") + 3] = 0.0
    motions = read_kinect(rec.write_rows(tmp_path / "gaps.csv", table))
    take = motions.takes[0]
    held = take.filled["operator"].reshape(-1, 2, 3, 3).all(axis=-1)
    assert np.flatnonzero(held[:, 0, 1]).tolist() == list(range(10, 20))
    assert np.flatnonzero(held[:, 1, 2]).tolist() == [0, 1]
    assert held.sum() == 12
    assert any("LElbow: 10 of 40 frames untracked, filled by linear interpolation" in note for note in motions.notes)
    truth = read_kinect(_kinect(tmp_path)).takes[0].frames["operator"]
    assert np.abs(take.frames["operator"] - truth).max() < 0.12
    inferred = read_kinect(tmp_path / "gaps.csv", inferred=True).takes[0]
    assert np.abs(inferred.frames["operator"] - truth).max() > 0.4


@pytest.mark.parametrize(("unit", "name"), [(100.0, "centimetres"), (1000.0, "millimetres"), (1 / 0.0254, "inches")])
def test_other_units_are_found_and_said_aloud(tmp_path: Path, unit: float, name: str) -> None:
    path = rec.write_rows(tmp_path / "units.csv", rec.kinect_rows(unit=unit))
    with pytest.warns(MotionWarning, match=f"{name}: the arm is .* long; converted to metres"):
        motions = load_motions(path)
    assert motions.bodies["operator"].reach == pytest.approx(0.581, abs=1e-3)
    assert any(note.startswith(f"units: {name}") for note in motions.notes)


def test_unknown_units_are_scaled_to_an_adult(tmp_path: Path) -> None:
    path = rec.write_rows(tmp_path / "units.csv", rec.kinect_rows(unit=1e6))
    with pytest.warns(MotionWarning, match="units unknown"):
        assert load_motions(path).bodies["operator"].reach == pytest.approx(0.58, abs=1e-3)


def test_swapped_sides_are_said_aloud(tmp_path: Path) -> None:
    table = rec.kinect_rows()
    table[:, 1::4] *= -1.0  # a mirrored camera image: left and right keep their names
    with pytest.warns(MotionWarning, match="left and right seem swapped"):
        load_motions(rec.write_rows(tmp_path / "mirrored.csv", table))


def test_a_turning_subject_is_followed(tmp_path: Path) -> None:
    table = rec.kinect_rows(count=90)
    turn = Rotation.from_rotvec(np.linspace(0.0, 1.2, 90)[:, None] * [0.0, 1.0, 0.0])
    for index in range(len(KINECT_JOINTS)):
        part = slice(1 + 4 * index, 4 + 4 * index)
        table[:, part] = turn.apply(table[:, part])
    motions = load_motions(rec.write_rows(tmp_path / "turning.csv", table))
    assert any("turns by up to" in note for note in motions.notes)
    difference = _directions(motions.clips("operator")[0]) - _true_directions(90)
    assert np.abs(difference[10:-10]).max() < 0.03


def test_one_arm_is_enough(tmp_path: Path) -> None:
    rows = [line.split(",") for line in rec.table_lines()]
    keep = [
        i for i, name in enumerate(rows[0]) if not name.startswith(("right_elbow", "right_wrist", "right_shoulder"))
    ]
    (tmp_path / "left.csv").write_text("\n".join(",".join(row[i] for i in keep) for row in rows))
    motions = load_motions(tmp_path / "left.csv")
    assert motions.bodies["operator"].sides == ("left",)
    np.testing.assert_allclose(_directions(motions.clips("operator")[0]), _true_directions()[:, :1], atol=2e-4)


@pytest.mark.parametrize("names", [rec.CMU, rec.MIXAMO, rec.BIPED, rec.BLENDER])
def test_bvh_joint_names_of_many_tools(tmp_path: Path, names: tuple[str, ...]) -> None:
    path = tmp_path / "arm.bvh"
    path.write_text(rec.bvh_text(names))
    motions = load_motions(path)
    clip = motions.clips("operator")[0]
    assert clip.fps == pytest.approx(30.0, rel=1e-4)
    angle = np.deg2rad(np.linspace(-80.0, -20.0, 12))
    expected = np.stack([np.zeros(12), np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(_directions(clip)[:, 0, 0], expected, atol=1e-5)
    np.testing.assert_allclose(_directions(clip)[:, 1, 1, 1], -np.cos(np.deg2rad(80.0)), atol=1e-5)
    body = clip.body
    assert isinstance(body, HumanSkeleton)
    assert (body.upper_arm, body.forearm, body.shoulders) == pytest.approx((0.29, 0.27, 0.36), abs=1e-6)


def test_bvh_kinematics_against_plain_rotations(tmp_path: Path) -> None:
    """Random poses: pymotion's angles give the same wrist as rotations multiplied by hand."""
    angles = np.random.default_rng(4).uniform(-60.0, 60.0, (9, 16, 3))
    path = tmp_path / "random.bvh"
    path.write_text(rec.bvh_text(rec.CMU, angles))
    motions = read_bvh(path)
    points = motions.bodies["operator"].arm_points(motions.takes[0].frames["operator"])
    chain, rotation, position = (5, 8, 9, 10, 11), Rotation.from_euler("ZYX", angles[:, 0], degrees=True), np.zeros(3)
    places = {}
    for joint in chain:
        position = position + rotation.apply(rec._OFFSETS[joint])
        rotation = rotation * Rotation.from_euler("ZYX", angles[:, joint], degrees=True)
        places[joint] = 0.01 * position
    reach = np.linalg.norm(places[11] - places[9], axis=1)
    np.testing.assert_allclose(np.linalg.norm(points[:, 0, 2] - points[:, 0, 0], axis=1), reach, atol=1e-6)


def test_cmu_clip(shared_dir: Path) -> None:
    motions = load_motions(shared_dir / "data" / "bvh" / "cmu_01_01.bvh")
    take = motions.takes[0]
    assert take.fps == pytest.approx(120.0, rel=1e-3)
    assert len(take.frames["operator"]) == 2751  # without the calibration pose
    assert any("CMU units" in note for note in motions.notes)
    assert any("calibration pose" in note for note in motions.notes)
    assert 0.4 < motions.bodies["operator"].reach < 0.7
    slow = load_motions(shared_dir / "data" / "bvh" / "cmu_01_01.bvh", fps=30.0).takes[0]
    assert len(slow.frames["operator"]) == 688


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"], ["LeftArm", "LeftForeArm", "LeftHand"]),
        (["LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist"], ["LeftShoulder", "LeftElbow", "LeftWrist"]),
        (["mixamorig:LeftShoulder", "mixamorig:LeftArm", "mixamorig:LeftForeArm", "mixamorig:LeftHand"],
         ["mixamorig:LeftArm", "mixamorig:LeftForeArm", "mixamorig:LeftHand"]),
        (["ShoulderLeft", "ElbowLeft", "WristLeft", "HandLeft"], ["ShoulderLeft", "ElbowLeft", "WristLeft"]),
        (["l_shoulder", "l_elbow", "l_hand"], ["l_shoulder", "l_elbow", "l_hand"]),
        (["lShldr", "lForeArm", "lHand"], ["lShldr", "lForeArm", "lHand"]),
        (["upperarm_l", "lowerarm_l", "hand_l"], ["upperarm_l", "lowerarm_l", "hand_l"]),
        (["LEFT_SHOULDER", "LEFT_ELBOW", "LEFT_WRIST"], ["LEFT_SHOULDER", "LEFT_ELBOW", "LEFT_WRIST"]),
        (["leftshoulder", "leftelbow", "leftwrist"], ["leftshoulder", "leftelbow", "leftwrist"]),
        (["J_L_Shoulder", "J_L_UpperArm", "J_L_LowerArm", "J_L_Hand"], ["J_L_UpperArm", "J_L_LowerArm", "J_L_Hand"]),
    ],
)  # fmt: skip
def test_names_are_matched(names: list[str], expected: list[str]) -> None:
    found = match_joints(names)
    assert [found["LShoulder"], found["LElbow"], found["LHand"]] == expected
    assert not {"RShoulder", "RElbow", "RHand"} & set(found)
