"""Other labs' styles, written from a person whose limbs are known: each is read to the same limbs, or refused with a
reason."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syda_gym.errors import MotionError, OptionError
from syda_gym.motions import Motions, MotionWarning, load_motions
from tests.motions import recordings as rec

pytestmark = pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")

COUNT = 40
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])  # forward x, left y, up z
UNITY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # left-handed: right x, up y, forward z
ARMS = [f"{side}{part}" for side in "LR" for part in ("Shoulder", "Elbow", "Hand")]


def _person(
    axes: np.ndarray = Z_UP, unit: float = 1.0, place: tuple[float, float, float] = (0.2, -0.4, 0.9)
) -> dict[str, np.ndarray]:
    _, joints = rec.moving_human(count=COUNT)
    ahead = np.array([0.12, 0.0, 0.0])
    for side in "LR":
        joints[f"{side}Toe"] = joints[f"{side}Foot"] + ahead
    joints["Nose"] = joints["Head"] + ahead
    joints["Pelvis"] = 0.5 * (joints["LHip"] + joints["RHip"])
    return {name: unit * (values @ axes.T + np.array(place)) for name, values in joints.items()}


def _truth() -> np.ndarray:
    _, joints = rec.moving_human(count=COUNT)
    points = np.array([joints[name] for name in ARMS]).reshape(2, 3, COUNT, 3).transpose(2, 0, 1, 3)
    links = np.diff(points, axis=2)
    return links / np.linalg.norm(links, axis=-1, keepdims=True)


def _degrees(motions: Motions) -> float:
    clip = motions.clips("operator")[0]
    links = np.diff(clip.body.arm_points(clip.frames), axis=2)
    links /= np.linalg.norm(links, axis=-1, keepdims=True)
    return float(np.degrees(np.arccos(np.clip((links * _truth()).sum(axis=-1), -1.0, 1.0))).max())


def _order(layout: str, joints: dict[str, np.ndarray]) -> np.ndarray:
    """``(N, P, 3)`` in an order; points that the person lacks lie beside the head."""
    return np.stack([joints[name] if name in joints else joints["Head"] + 0.05 for name in layout.split()], axis=1)


def _csv(path: Path, header: list[list[str]], table: np.ndarray, separator: str = ",", form: str = "{:.6f}") -> Path:
    lines = [separator.join(row) for row in header] + [separator.join(form.format(v) for v in row) for row in table]
    path.write_text("\n".join(lines) + "\n")
    return path


def _flat(joints: dict[str, np.ndarray], names: list[str]) -> np.ndarray:
    return np.concatenate([joints[name] for name in names], axis=1)


NAMED = [*ARMS, "LHip", "LKnee", "LFoot", "RHip", "RKnee", "RFoot", "Head", "Neck", "Pelvis"]
TIME = (np.arange(COUNT) / 100.0)[:, None]
PLUG_IN = ["LSHO", "LELB", "LWRA", "LWRB", "RSHO", "RELB", "RWRA", "RWRB", "LASI", "RASI", "LKNE", "RKNE", "LANK",
"RANK", "LTOE",
           "RTOE", "C7", "LFHD", "RFHD", "LBHD", "RBHD"]  # fmt: skip


def _markers(unit: float = 1000.0) -> dict[str, np.ndarray]:
    joints = _person(unit=unit)
    beside = np.array([0.0, 0.0, 0.03 * unit])
    found = {}
    for side in "LR":
        found |= {f"{side}SHO": joints[f"{side}Shoulder"], f"{side}ELB": joints[f"{side}Elbow"],
        f"{side}WRA": joints[f"{side}Hand"] + beside,
                  f"{side}WRB": joints[f"{side}Hand"] - beside, f"{side}ASI": joints[f"{side}Hip"],
                  f"{side}KNE": joints[f"{side}Knee"],
                  f"{side}ANK": joints[f"{side}Foot"], f"{side}TOE": joints[f"{side}Toe"],
                  f"{side}FHD": joints["Head"] + beside,
                  f"{side}BHD": joints["Head"] - beside}  # fmt: skip
    found["C7"] = joints["Neck"]
    return {name: found[name] for name in PLUG_IN}


def vicon_csv(path: Path) -> Path:
    marks = _markers()
    names = ["", "", *(cell for name in marks for cell in (f"Anna:{name}", "", ""))]
    table = np.concatenate([np.arange(COUNT)[:, None] + 1.0, np.zeros((COUNT, 1)), *marks.values()], axis=1)
    axes = ["Frame", "Sub Frame", *["X", "Y", "Z"] * len(marks)]
    return _csv(path / "vicon.csv", [["Trajectories"], ["100"], names, axes, ["", "", *["mm"] * 3 * len(marks)]], table)


def trc(path: Path) -> Path:
    marks = _markers()
    table = np.concatenate([np.arange(COUNT)[:, None] + 1.0, TIME, *marks.values()], axis=1)
    head = [
        ["PathFileType", "4", "(X/Y/Z)", "walk.trc"],
        [
            "DataRate",
            "CameraRate",
            "NumFrames",
            "NumMarkers",
            "Units",
            "OrigDataRate",
            "OrigDataStartFrame",
            "OrigNumFrames",
        ],
        ["100.0", "100.0", str(COUNT), str(len(marks)), "mm", "100.0", "1", str(COUNT)],
        ["Frame#", "Time", *(cell for name in marks for cell in (name, "", ""))],
        ["", "", *(f"{axis}{i + 1}" for i in range(len(marks)) for axis in "XYZ")],
        [],
    ]
    return _csv(path / "walk.trc", head, table, "\t")


def optitrack_csv(path: Path) -> Path:
    names = {"Hip": "Pelvis", "Neck": "Neck", "Head": "Head", "LUArm": "LShoulder", "LFArm": "LElbow",
    "LHand": "LHand", "RUArm": "RShoulder",
             "RFArm": "RElbow", "RHand": "RHand", "LThigh": "LHip", "LShin": "LKnee", "LFoot": "LFoot",
             "RThigh": "RHip", "RShin": "RKnee",
             "RFoot": "RFoot", "LToe": "LToe", "RToe": "RToe"}  # fmt: skip
    joints = _person(UNITY @ np.diag([1.0, 1.0, 1.0]) * [[-1.0], [1.0], [1.0]])
    columns = []
    for mine in names.values():
        columns += [np.full((COUNT, 4), 0.5), joints[mine]]
    table = np.concatenate([np.arange(COUNT)[:, None] * 1.0, TIME, *columns], axis=1)
    wide = len(names) * 7
    head = [
        ["Format Version", "1.23", "Take Name", "t", "Capture Frame Rate", "100.000000", "Length Units", "Meters"], [],
        ["", "Type", *["Bone"] * wide], ["", "Name", *(f"Skeleton 001:{name}" for name in names for _ in range(7))],
        ["", "ID", *(str(i) for i in range(len(names)) for _ in range(7))],
        ["", "", *["Rotation"] * 4 + ["Position"] * 3] + (["Rotation"] * 4 + ["Position"] * 3) * (len(names) - 1),
        ["Frame", "Time (Seconds)", *["X", "Y", "Z", "W", "X", "Y", "Z"] * len(names)],
    ]  # fmt: skip
    return _csv(path / "take.csv", head, table)


def german_excel(path: Path) -> Path:
    joints = _person(unit=100.0)
    names = [f"{name} {axis}" for name in NAMED for axis in ("X", "Y", "Z")]
    table = np.concatenate([TIME, _flat(joints, NAMED)], axis=1)
    file = _csv(path / "excel.csv", [["Zeit in s", *names]], table, ";")
    file.write_text(file.read_text().replace(".", ","))
    return file


def utf16(path: Path) -> Path:
    file = german_excel(path)
    file.write_bytes(file.read_text().replace("Zeit in s", "time").encode("utf-16"))
    return file


def axis_first(path: Path) -> Path:
    joints = _person()
    names = [f"{axis}_{name}" for name in NAMED for axis in "xyz"]
    return _csv(path / "first.csv", [["t", *names]], np.concatenate([TIME, _flat(joints, NAMED)], axis=1))


def with_units_and_turns(path: Path) -> Path:
    joints = _person()
    header = ["Timestamp (ms)"]
    columns = [1000.0 * TIME]
    for name in NAMED:
        header += [
            f"{name}.position.x",
            f"{name}.position.y",
            f"{name}.position.z",
            *(f"{name}.rotation.{axis}" for axis in "xyzw"),
        ]
        columns += [joints[name], np.full((COUNT, 4), 0.3)]
    return _csv(path / "unreal.csv", [header], np.concatenate(columns, axis=1))


def msrc12(path: Path) -> Path:
    order = (
        "Pelvis Torso Neck Head LShoulder LElbow LHand LHand RShoulder RElbow RHand RHand LHip LKnee LFoot LToe "
        "RHip RKnee RFoot RToe"
    )
    points = np.concatenate([_order(order, _person(rec.KINECT_AXES)), np.full((COUNT, 20, 1), 2.0)], axis=2)
    ticks = 634_000_000_000_000.0 + np.arange(COUNT)[:, None] * 333_333.0
    return _csv(path / "P1_1_1_p06.csv", [], np.concatenate([ticks, points.reshape(COUNT, -1)], axis=1), " ")


def kinect_json(path: Path) -> Path:
    joints = _person(rec.KINECT_AXES)
    names = {"SpineBase": "Pelvis", "SpineMid": "Torso", "SpineShoulder": "Neck", "Head": "Head",
    "ShoulderLeft": "LShoulder",
             "ElbowLeft": "LElbow", "WristLeft": "LHand", "ShoulderRight": "RShoulder", "ElbowRight": "RElbow",
             "WristRight": "RHand",
             "HipLeft": "LHip", "HipRight": "RHip"}  # fmt: skip
    frames = [
        {"RelativeTime": 333_333 * t, "Bodies": [{"TrackingId": 7, "Joints": {
            name: {"Position": dict(zip("XYZ", map(float, joints[mine][t]), strict=True)), "TrackingState": "Tracked"}
            for name, mine in names.items()}}]} for t in range(COUNT)
    ]  # fmt: skip
    (path / "kinect.json").write_text(json.dumps({"frames": frames}))
    return path / "kinect.json"


def tfjs(path: Path) -> Path:
    table = rec.mediapipe_table(COUNT)
    names = ["nose", *[f"p{i}" for i in range(1, 11)], "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
    "left_wrist",
             "right_wrist", *[f"q{i}" for i in range(17, 23)], "left_hip", "right_hip", "left_knee", "right_knee",
             "left_ankle",
             "right_ankle", "left_heel", "right_heel", "left_foot_index", "right_foot_index"]  # fmt: skip
    frames = [
        [{"score": 0.9, "keypoints": [{"x": 100.0, "y": 90.0, "name": name} for name in names],
          "keypoints3D": [{"x": float(x), "y": float(y), "z": float(z), "score": 0.9, "name": name}
                          for name, (x, y, z, _) in zip(names, frame, strict=True)]}] for frame in table
    ]  # fmt: skip
    (path / "tfjs.json").write_text(json.dumps(frames))
    return path / "tfjs.json"


def landmark_x(path: Path) -> Path:
    table = rec.mediapipe_table(COUNT)
    header = [f"landmark_{p}_{axis}" for p in range(33) for axis in ("x", "y", "z", "visibility")]
    return _csv(path / "landmark.csv", [header], table.reshape(COUNT, -1))


def underscore(path: Path) -> Path:
    table = rec.mediapipe_table(COUNT)
    header = [f"{axis}_{p}" for p in range(33) for axis in ("x", "y", "z")]
    return _csv(
        path / "x_0.csv",
        [["timestamp_ms", *header]],
        np.concatenate([1000 * TIME, table[:, :, :3].reshape(COUNT, -1)], axis=1),
    )


COCO = "Nose Eye Eye Head Head LShoulder RShoulder LElbow RElbow LHand RHand LHip RHip LKnee RKnee LFoot RFoot"
H36M = "Pelvis RHip RKnee RFoot LHip LKnee LFoot Torso Neck Nose Head LShoulder LElbow LHand RShoulder RElbow RHand"
SMPL = (
    "Pelvis LHip RHip Torso LKnee RKnee Torso LFoot RFoot Torso LToe RToe Neck Neck Neck Head LShoulder RShoulder "
    "LElbow RElbow LHand RHand"
)
LAFAN = (
    "Pelvis LHip LKnee LFoot LToe RHip RKnee RFoot RToe Torso Torso Torso Neck Head Neck LShoulder LElbow LHand "
    "Neck RShoulder RElbow RHand"
)
XSENS = ("Pelvis Torso Torso Torso Neck Neck Head Neck RShoulder RElbow RHand Neck LShoulder LElbow LHand RHip RKnee "
"RFoot RToe LHip LKnee "
         "LFoot LToe")  # fmt: skip


def _array(order: str, axes: np.ndarray = Z_UP, unit: float = 1.0, key: str = "") -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        points = _order(order, _person(axes, unit))
        if key:
            np.savez(path / "points.npz", **{key: points}, fps=np.array(100.0))
            return path / "points.npz"
        np.save(path / "points.npy", points)
        return path / "points.npy"

    return write


def smpl24(path: Path) -> Path:
    points = _order(SMPL + " LHand RHand", _person())
    np.save(path / "smpl.npy", points[:, None])  # (T, 1 person, 24, 3)
    return path / "smpl.npy"


def transposed(path: Path) -> Path:
    np.save(path / "t.npy", _order(COCO, _person()).transpose(0, 2, 1))
    return path / "t.npy"


WRITERS: dict[str, tuple[Callable[[Path], Path], float]] = {
    "Vicon CSV": (vicon_csv, 100.0), "TRC": (trc, 100.0), "OptiTrack CSV": (optitrack_csv, 100.0),
    "decimal commas": (german_excel, 100.0),
    "UTF-16": (utf16, 100.0), "axis before joint": (axis_first, 100.0),
    "positions beside rotations": (with_units_and_turns, 100.0),
    "MSRC-12": (msrc12, 30.0), "Kinect JSON": (kinect_json, 30.0), "TF.js keypoints3D": (tfjs, 30.0),
    "landmark_0_x": (landmark_x, 30.0),
    "x_0": (underscore, 100.0), "COCO npy": (_array(COCO), 30.0), "Human3.6M npz": (_array(H36M, key="positions_3d"),
    100.0),
    "Human3.6M millimetres": (_array(H36M, unit=1000.0), 30.0), "SMPL 22": (_array(SMPL), 30.0),
    "SMPL 23": (_array(SMPL + " LHand", key="any"), 100.0), "SMPL 24 with people": (smpl24, 30.0),
    "SMPL without root": (_array(SMPL.partition(" ")[2] + " LHand RHand"), 30.0), "LAFAN 22": (_array(LAFAN), 30.0),
    "Xsens 23": (_array(XSENS), 30.0), "axes before points": (transposed, 30.0), "y up array": (_array(COCO,
    rec.KINECT_AXES), 30.0),
}  # fmt: skip


@pytest.mark.parametrize("kind", WRITERS)
def test_other_styles_give_the_same_limbs(tmp_path: Path, kind: str) -> None:
    writer, fps = WRITERS[kind]
    path = writer(tmp_path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", MotionWarning)
        motions = load_motions(path)
    assert _degrees(motions) < 2.0
    assert motions.takes[0].fps == pytest.approx(fps, rel=0.01)
    assert motions.bodies["operator"].reach == pytest.approx(0.581, abs=0.01)
    assert not [str(w.message) for w in caught if "converted to metres" not in str(w.message)]


BVH_NAMES = {
    "Xsens": "Hips LeftHip LeftAnkle RightHip RightAnkle Chest Neck Head LeftCollar LeftShoulder LeftElbow LeftWrist "
    "RightCollar RightShoulder "
             "RightElbow RightWrist",
    "Unreal": "pelvis thigh_l foot_l thigh_r foot_r spine_01 neck_01 head clavicle_l upperarm_l lowerarm_l hand_l "
    "clavicle_r upperarm_r "
              "lowerarm_r hand_r",
    "VRM": "J_Bip_C_Hips J_Bip_L_UpperLeg J_Bip_L_Foot J_Bip_R_UpperLeg J_Bip_R_Foot J_Bip_C_Spine J_Bip_C_Neck "
    "J_Bip_C_Head J_Bip_L_Shoulder "
           "J_Bip_L_UpperArm J_Bip_L_LowerArm J_Bip_L_Hand J_Bip_R_Shoulder J_Bip_R_UpperArm J_Bip_R_LowerArm "
           "J_Bip_R_Hand",
    "Rigify": "DEF-hips DEF-thigh.L DEF-foot.L DEF-thigh.R DEF-foot.R DEF-spine DEF-neck DEF-head DEF-shoulder.L "
    "DEF-upper_arm.L DEF-forearm.L "
              "DEF-hand.L DEF-shoulder.R DEF-upper_arm.R DEF-forearm.R DEF-hand.R",
    "Rokoko": "Hips LeftThigh LeftFoot RightThigh RightFoot Spine1 Neck Head LeftShoulder LeftArm LeftForeArm "
    "LeftHand RightShoulder RightArm "
              "RightForeArm RightHand",
    "Valve": "ValveBiped.Bip01_Pelvis ValveBiped.Bip01_L_Thigh ValveBiped.Bip01_L_Foot ValveBiped.Bip01_R_Thigh "
    "ValveBiped.Bip01_R_Foot "
             "ValveBiped.Bip01_Spine ValveBiped.Bip01_Neck1 ValveBiped.Bip01_Head1 ValveBiped.Bip01_L_Clavicle "
             "ValveBiped.Bip01_L_UpperArm "
             "ValveBiped.Bip01_L_Forearm ValveBiped.Bip01_L_Hand ValveBiped.Bip01_R_Clavicle "
             "ValveBiped.Bip01_R_UpperArm "
             "ValveBiped.Bip01_R_Forearm ValveBiped.Bip01_R_Hand",
    "Second Life": "mPelvis mHipLeft mAnkleLeft mHipRight mAnkleRight mTorso mNeck mHead mCollarLeft mShoulderLeft "
    "mElbowLeft mWristLeft "
                   "mCollarRight mShoulderRight mElbowRight mWristRight",
    "MikuMikuDance": "センター 左足 左足首 右足 右足首 上半身 首 頭 左肩 左腕 左ひじ 左手首 右肩 右腕 右ひじ 右手首",
    "namespaces": " ".join(f"Character1:{name}" for name in rec.CMU),
    "Character Creator": "CC_Base_Hip CC_Base_L_Thigh CC_Base_L_Foot CC_Base_R_Thigh CC_Base_R_Foot CC_Base_Spine01 "
    "CC_Base_NeckTwist01 "
                         "CC_Base_Head CC_Base_L_Clavicle CC_Base_L_Upperarm CC_Base_L_Forearm CC_Base_L_Hand "
                         "CC_Base_R_Clavicle "
                         "CC_Base_R_Upperarm CC_Base_R_Forearm CC_Base_R_Hand",
}  # fmt: skip


@pytest.mark.parametrize("family", BVH_NAMES)
@pytest.mark.parametrize("scale", [1.0, 0.01, 1 / 2.54], ids=["centimetres", "metres", "inches"])
def test_names_of_bvh_in_three_units(tmp_path: Path, family: str, scale: float) -> None:
    path = tmp_path / "arm.bvh"
    path.write_text(rec.bvh_text(tuple(BVH_NAMES[family].split()), scale=scale))
    clip = load_motions(path).clips("operator")[0]
    links = np.diff(clip.body.arm_points(clip.frames), axis=2)
    angle = np.arctan2(links[:, 0, 0, 2], links[:, 0, 0, 1])
    np.testing.assert_allclose(np.degrees(angle), np.linspace(-80.0, -20.0, 12), atol=0.1)
    assert clip.body.reach == pytest.approx(0.56, abs=1e-3)


def test_bvh_with_z_up_one_brace_lines_and_six_channels(tmp_path: Path) -> None:
    text = rec.bvh_text(rec.CMU)
    path = tmp_path / "braces.bvh"
    path.write_text(text.replace("\n{", " {").replace("ROOT Hips {", "ROOT Hips\n{"))
    plain = tmp_path / "plain.bvh"
    plain.write_text(text)
    np.testing.assert_array_equal(
        load_motions(path).takes[0].frames["operator"], load_motions(plain).takes[0].frames["operator"]
    )


def test_a_person_can_say_it(tmp_path: Path) -> None:
    """Columns that nobody can know: named, numbered, and by a layout."""
    joints = _person(unit=39.37)
    names = [*ARMS, "LHip", "RHip"]
    header = [f"ch{i}" for i in range(24)]
    path = _csv(tmp_path / "own.csv", [header], _flat(joints, names))
    with pytest.raises(MotionError, match=r"24 columns called ch0, ch1.*--joints"):
        load_motions(path)
    said = {name: f"ch{3 * i},ch{3 * i + 1},{3 * i + 2}" for i, name in enumerate(names)}
    motions = load_motions(path, fps=50.0, joints=said, unit="in", up="z")
    assert _degrees(motions) < 2.0
    assert motions.takes[0].fps == 50.0
    layout = tmp_path / "own.yaml"
    layout.write_text(f"order: {names}\nunit: in\nup: z\nfps: 50\nskip_lines: 1\n")
    again = load_motions(path, layout=layout)
    np.testing.assert_allclose(again.takes[0].frames["operator"], motions.takes[0].frames["operator"], atol=1e-12)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"joints": {"LeftElbow": "x"}}, "'LeftElbow' is unknown; did you mean 'LElbow'"),
        ({"joints": {"LShoulder": None}}, "needs a name, a number"),
        ({"unit": "furlong"}, "unit: expected one of"), ({"up": "sideways"}, "up: expected an axis"), ({"person": 0},
        "person must be"),
    ],
)  # fmt: skip
def test_nonsense_that_a_person_says(tmp_path: Path, said: dict[str, object], message: str) -> None:
    path = axis_first(tmp_path)
    with pytest.raises(OptionError, match=message):
        load_motions(path, **said)  # type: ignore[arg-type]


def test_left_handed_axes_are_doubted_and_can_be_said(tmp_path: Path) -> None:
    joints = _person(UNITY)
    names = [f"{name}.{axis}" for name in [*NAMED, "LToe", "RToe"] for axis in "xyz"]
    path = _csv(
        tmp_path / "unity.csv",
        [["time", *names]],
        np.concatenate([TIME, _flat(joints, [*NAMED, "LToe", "RToe"])], axis=1),
    )
    with pytest.warns(MotionWarning, match="point backward: left and right seem swapped, or an axis mirrored"):
        load_motions(path)
    (tmp_path / "unity.yaml").write_text("left_handed: true\n")
    assert _degrees(load_motions(path, layout=tmp_path / "unity.yaml")) < 2.0


def test_places_in_a_picture_are_refused_with_the_reason(tmp_path: Path) -> None:
    person = {"people": [{"person_id": [-1], "pose_keypoints_2d": [100.0, 200.0, 0.9] * 25}]}
    path = tmp_path / "openpose.json"
    path.write_text(json.dumps([person, person]))
    with pytest.raises(MotionError, match=r"only image landmarks \(pose_keypoints_2d\), whose depth is unknown"):
        load_motions(path)
    path.write_text(json.dumps([{"keypoints": [[1.0, 2.0]] * 17}] * 3))
    with pytest.raises(MotionError, match="a place in a picture, whose depth is unknown"):
        load_motions(path)


def test_points_that_make_no_person_list_what_was_tried(tmp_path: Path) -> None:
    np.save(tmp_path / "noise.npy", np.random.default_rng(0).normal(size=(30, 17, 3)))
    with pytest.raises(MotionError, match=r"17 points a frame .* make no person: as (COCO|Human3.6M|MPI)") as caught:
        load_motions(tmp_path / "noise.npy")
    assert "changes its length" in str(caught.value)
    assert "Kinect" not in str(caught.value)


def test_named_joints_that_are_no_limbs_are_refused(tmp_path: Path) -> None:
    joints = {name: np.random.default_rng(i).normal(size=(COUNT, 3)) for i, name in enumerate(NAMED)}
    path = _csv(
        tmp_path / "noise.csv",
        [["t", *[f"{n}_{a}" for n in NAMED for a in "xyz"]]],
        np.concatenate([TIME, _flat(joints, NAMED)], axis=1),
    )
    with pytest.raises(MotionError, match=r"no person's arms: .* changes its length by"):
        load_motions(path)


def test_ntu_with_two_bodies(tmp_path: Path) -> None:
    table = rec.kinect_rows(COUNT)[:, 1:].reshape(COUNT, 25, 4)
    lines = [str(COUNT)]
    for frame in table:
        lines.append("2" if len(lines) > 60 else "1")
        for body in range(int(lines[-1])):
            lines += [f"7205759403793164{body} 0 1 1 1 1 0 0.1 0.1 2", "25"]
            lines += [f"{x + body} {y} {z} 0 0 0 0 0 0 0 1 2" for x, y, z, _ in frame]
    path = tmp_path / "S001.skeleton"
    path.write_text("\n".join(lines))
    motions = load_motions(path)
    assert _degrees(motions) < 2.0
    assert any("2 people in the file" in note for note in motions.notes)
    assert len(load_motions(path, person=2).takes[0].frames["operator"]) < COUNT


@pytest.mark.parametrize(
    ("name", "step", "fps"),
    [("time", 1 / 30, 30), ("timestamp", 33.3, 30), ("timestamp", 33_333.0, 30), ("timestamp", 333_333.0, 30),
    ("timestamp", 3.3333e7, 30),
     ("timestamp_us", 16_667.0, 60), ("timestamp_ms", 1 / 30, 30), ("timestamp", 41_667.0, 24)],
)  # fmt: skip
def test_the_unit_of_time_is_found_by_the_rate(tmp_path: Path, name: str, step: float, fps: float) -> None:
    names = [f"{joint}_{axis}" for joint in NAMED for axis in "xyz"]
    table = np.concatenate([5e5 + step * np.arange(COUNT)[:, None], _flat(_person(), NAMED)], axis=1)
    path = _csv(tmp_path / "clock.csv", [[name, *names]], table, form="{:.9f}")
    assert load_motions(path).takes[0].fps == pytest.approx(fps, rel=0.01)


def test_times_that_may_be_ten_times_wrong_are_said_aloud(tmp_path: Path) -> None:
    names = [f"{joint}_{axis}" for joint in NAMED for axis in "xyz"]
    table = np.concatenate([100_000.0 * np.arange(COUNT)[:, None], _flat(_person(), NAMED)], axis=1)
    path = _csv(tmp_path / "clock.csv", [["timestamp", *names]], table)
    with pytest.warns(
        MotionWarning,
        match=r"give 100 frames per second, .* 10; the first was taken, --fps|give 10 frames per second, .* 100",
    ):
        load_motions(path)
    assert load_motions(path, fps=10.0).takes[0].timestamps is None
