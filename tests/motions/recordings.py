"""Recordings in foreign formats, written for tests from a synthetic human whose limbs are known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.human import SKELETON_JOINTS, HumanSkeleton
from syda_gym.motions import generate
from syda_gym.motions.readers.layouts import CORNELL_JOINTS, KINECT_JOINTS

# Columns: forward, left, up of the subject in the axes of each tool, which it faces.
KINECT_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
MEDIAPIPE_AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])


def moving_human(action: str = "wave_high", count: int = 40) -> tuple[HumanSkeleton, dict[str, np.ndarray]]:
    """An adult and its joints ``(N, 3)`` in body axes, about the middle of the hips."""
    adult = catalog.get("adult")
    assert isinstance(adult, HumanSkeleton)
    frames = generate(["adult"], actions=[action], variants=1, noise=0.0).takes[0].frames["adult"][:count]
    joints = adult.complete(frames)
    hips = 0.5 * (joints["LHip"] + joints["RHip"])
    return adult, {name: values - hips for name, values in joints.items()}


def seen(axes: np.ndarray, joints: dict[str, np.ndarray], place: tuple[float, float, float]) -> dict[str, np.ndarray]:
    return {name: values @ axes.T + np.array(place) for name, values in joints.items()}


def kinect_rows(count: int = 40, unit: float = 1.0) -> np.ndarray:
    """``(N, 101)`` as the SDK orders it; feet and hands have toes and tips."""
    _, joints = moving_human(count=count)
    world = seen(KINECT_AXES, joints, (0.1, -0.2, 2.5))
    toward = KINECT_AXES[:, 0] * 0.12
    names = {
        "SpineBase": "Torso", "SpineMid": "Torso", "Neck": "Neck", "Head": "Head", "SpineShoulder": "Neck",
        **{f"{part}{word}": f"{word[0]}{mine}" for word in ("Left", "Right") for part, mine in (
            ("Shoulder", "Shoulder"), ("Elbow", "Elbow"), ("Wrist", "Hand"), ("Hand", "Hand"), ("HandTip", "Hand"),
            ("Thumb", "Hand"), ("Hip", "Hip"), ("Knee", "Knee"), ("Ankle", "Foot"), ("Foot", "Foot"))},
    }  # fmt: skip
    table = np.full((count, 101), 2.0)
    table[:, 0] = 89_810_293_609 + np.arange(count) * 333_333
    for index, name in enumerate(KINECT_JOINTS):
        shift = toward if name.startswith("Foot") else 0.0
        table[:, 1 + 4 * index : 4 + 4 * index] = (world[names[name]] + shift) * unit
    return table


def write_rows(path: Path, table: np.ndarray, separator: str = ",", end: str = ",") -> Path:
    lines = [separator.join(f"{value:.17g}" for value in row) + end for row in table]
    path.write_text("\n".join(lines) + "\n")
    return path


def openni_rows(count: int = 40, unit: float = 1000.0) -> np.ndarray:
    _, joints = moving_human(count=count)
    world = seen(KINECT_AXES, joints, (0.1, -0.2, 2.5))
    return np.hstack([np.hstack([world[name] * unit, np.ones((count, 1))]) for name in SKELETON_JOINTS])


def cornell_lines(count: int = 40) -> list[str]:
    _, joints = moving_human(count=count)
    world = seen(KINECT_AXES, joints, (0.1, -0.2, 2.5))
    lines = []
    for t in range(count):
        cells = [str(t + 1)]
        for index, name in enumerate(CORNELL_JOINTS):
            cells += ["1", "0", "0", "0", "1", "0", "0", "0", "1", "1"] if index < 11 else []
            cells += [repr(float(value) * 1000.0) for value in world[name][t]] + ["1"]
        lines.append(",".join(cells) + ",")
    return [*lines, "END"]


def mediapipe_table(count: int = 40) -> np.ndarray:
    """``(N, 33, 4)`` world landmarks."""
    _, joints = moving_human(count=count)
    world = seen(MEDIAPIPE_AXES, joints, (0.0, 0.0, 0.0))
    ahead = MEDIAPIPE_AXES[:, 0] * 0.1
    table = np.zeros((count, 33, 4))
    table[:, :, 3] = 0.99
    table[:, :11, :3] = world["Head"][:, None]
    table[:, 0, :3] += ahead
    places = {11: "LShoulder", 12: "RShoulder", 13: "LElbow", 14: "RElbow", 23: "LHip", 24: "RHip", 25: "LKnee",
              26: "RKnee", 27: "LFoot", 28: "RFoot", 29: "LFoot", 30: "RFoot"}  # fmt: skip
    for index, name in places.items():
        table[:, index, :3] = world[name]
    for side, indices in (("L", (15, 17, 19, 21)), ("R", (16, 18, 20, 22))):
        table[:, indices, :3] = world[f"{side}Hand"][:, None]
    table[:, 31, :3], table[:, 32, :3] = world["LFoot"] + ahead, world["RFoot"] + ahead
    return table


def mediapipe_json(count: int = 40) -> list[dict[str, object]]:
    return [
        {
            "timestamp_ms": 40 * t,
            "pose_world_landmarks": [
                dict(zip(("x", "y", "z", "visibility"), map(float, mark), strict=True)) for mark in frame
            ],
        }
        for t, frame in enumerate(mediapipe_table(count))
    ]


def table_lines(count: int = 40) -> list[str]:
    _, joints = moving_human(count=count)
    world = seen(MEDIAPIPE_AXES, joints, (0.0, 0.0, 0.0))
    names = {"left_shoulder": "LShoulder", "left_elbow": "LElbow", "left_wrist": "LHand", "left_hip": "LHip",
             "right_shoulder": "RShoulder", "right_elbow": "RElbow", "right_wrist": "RHand", "right_hip": "RHip",
             }  # fmt: skip
    header = ["frame", "time_ms", *(f"{name}_{axis}" for name in names for axis in ("x", "y", "z", "visibility"))]
    rows = [
        [
            str(t),
            str(25 * t),
            *(cell for mine in names.values() for cell in [*map(repr, map(float, world[mine][t])), "0.9"]),
        ]
        for t in range(count)
    ]
    return [",".join(row) for row in [header, *rows]]


CMU = ("Hips", "LeftUpLeg", "LeftFoot", "RightUpLeg", "RightFoot", "Spine", "Neck", "Head", "LeftShoulder", "LeftArm",
       "LeftForeArm", "LeftHand", "RightShoulder", "RightArm", "RightForeArm", "RightHand")  # fmt: skip
LAFAN = CMU
MIXAMO = tuple(f"mixamorig:{name}" for name in CMU)
BIPED = ("Bip01_Pelvis", "Bip01_L_Thigh", "Bip01_L_Foot", "Bip01_R_Thigh", "Bip01_R_Foot", "Bip01_Spine", "Bip01_Neck",
         "Bip01_Head", "Bip01_L_Clavicle", "Bip01_L_UpperArm", "Bip01_L_Forearm", "Bip01_L_Hand", "Bip01_R_Clavicle",
         "Bip01_R_UpperArm", "Bip01_R_Forearm", "Bip01_R_Hand")  # fmt: skip
BLENDER = ("hips", "thigh.L", "foot.L", "thigh.R", "foot.R", "spine", "neck", "head", "shoulder.L", "upper_arm.L",
           "forearm.L", "hand.L", "shoulder.R", "upper_arm.R", "forearm.R", "hand.R")  # fmt: skip
_PARENTS = (-1, 0, 1, 0, 3, 0, 5, 6, 5, 8, 9, 10, 5, 12, 13, 14)
# Centimetres, T pose, y up, the subject looks along z and its left is x.
_OFFSETS = np.array([
    [0, 95, 0], [9, -5, 0], [0, -85, 0], [-9, -5, 0], [0, -85, 0], [0, 25, 0], [0, 25, 0], [0, 15, 0],
    [4, 20, 0], [14, 0, 0], [29, 0, 0], [27, 0, 0], [-4, 20, 0], [-14, 0, 0], [-29, 0, 0], [-27, 0, 0],
], dtype=float)  # fmt: skip


def bvh_text(names: tuple[str, ...] = CMU, angles: np.ndarray | None = None, scale: float = 1.0) -> str:
    """A BVH file; ``angles`` ``(N, 16, 3)`` are rotations about z, y, x in degrees."""
    if angles is None:
        angles = np.zeros((12, len(names), 3))
        angles[:, 9, 0] = np.linspace(-80.0, -20.0, 12)  # the left arm goes from hanging to level
        angles[:, 13, 0] = 80.0
    lines = ["HIERARCHY"]

    def joint(index: int, depth: int) -> None:
        tab = "\t" * depth
        kind = "ROOT" if index == 0 else "JOINT"
        place = "Xposition Yposition Zposition " if index == 0 else ""
        lines.extend([f"{tab}{kind} {names[index]}", tab + "{"])
        lines.append(f"{tab}\tOFFSET " + " ".join(f"{value * scale:.6f}" for value in _OFFSETS[index]))
        lines.append(f"{tab}\tCHANNELS {6 if index == 0 else 3} {place}Zrotation Yrotation Xrotation")
        children = [i for i, parent in enumerate(_PARENTS) if parent == index]
        for child in children:
            joint(child, depth + 1)
        if not children:
            lines.extend([f"{tab}\tEnd Site", tab + "\t{", f"{tab}\t\tOFFSET 0 0 {5 * scale}", tab + "\t}"])
        lines.append(tab + "}")

    joint(0, 0)
    lines += ["MOTION", f"Frames: {len(angles)}", "Frame Time: 0.0333333"]
    for t, frame in enumerate(angles):
        values = [scale * t, 95.0 * scale, 0.0, *frame.ravel()]
        lines.append(" ".join(f"{value:.6f}" for value in values))
    return "\n".join(lines) + "\n"


def json_text(value: object) -> str:
    return json.dumps(value)


MVNX_SEGMENTS = (
    "Pelvis L5 L3 T12 T8 Neck Head RightShoulder RightUpperArm RightForeArm RightHand LeftShoulder LeftUpperArm "
    "LeftForeArm LeftHand RightUpperLeg RightLowerLeg RightFoot RightToe LeftUpperLeg LeftLowerLeg LeftFoot LeftToe"
)


def mvnx_text(points: np.ndarray, *, rate: str = ' frameRate="60"', position: bool = True, before: str = "") -> str:
    """An export of Xsens MVN of ``points`` ``(N, 23, 3)``: two poses of the calibration, then the frames at 60 Hz."""

    def frame(kind: str, index: int, values: np.ndarray) -> str:
        text = " ".join(f"{value:.6f}" for value in values.ravel())
        place = f"<position>{text}</position>" if position else "<orientation>1 0 0 0</orientation>"
        return f'<frame time="{round(1000 * index / 60)}" index="{index}" type="{kind}">{place}</frame>\n'

    frames = "".join(frame(kind, 0, np.zeros(69)) for kind in ("identity", "tpose"))
    frames += "".join(frame("normal", index, row) for index, row in enumerate(points))
    labels = "".join(f'<segment label="{name}" id="{i + 1}"/>' for i, name in enumerate(MVNX_SEGMENTS.split()))
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>{before}\n<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">'
        f'<subject label="Anna"{rate}><segments>{labels}</segments><frames>{frames}</frames></subject></mvnx>'
    )
