"""The arms of the small case files, read by plain code that shares nothing with the library.

Every reading gives ``(N, 2, 3, 3)``: left and right arm, shoulder, elbow and wrist, in the file's own axes; with the
axes in which its subject looks forward and has left and up.
"""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np

KINECT2 = [4, 5, 6, 8, 9, 10]
AZURE = [5, 6, 7, 12, 13, 14]
MEDIAPIPE = [11, 13, 15, 12, 14, 16]
UP_Y = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # a camera in front of the person, y up
DOWN_Y = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # the same, y down
BVH = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def arms(points: np.ndarray) -> np.ndarray:
    return np.asarray(points, dtype=float).reshape(-1, 2, 3, 3)


def bvh(path: Path) -> np.ndarray:
    """Matrices of elementary rotations multiplied down the tree by recursion, one frame at a time."""
    words = path.read_text(encoding="latin-1").replace("\r", "").split("MOTION")
    stack: list[dict] = []
    order: list[dict] = []
    root: dict | None = None
    for line in words[0].splitlines():
        tokens = line.split()
        if not tokens:
            continue
        if tokens[0] in ("ROOT", "JOINT"):
            joint = {"name": line.strip().split(" ", 1)[1].strip(), "children": [], "channels": [], "end": False}
            if stack:
                stack[-1]["children"].append(joint)
            else:
                root = joint
            order.append(joint)
            pending = joint
        elif tokens[0] == "End":
            pending = {"children": [], "end": True, "channels": [], "name": "end"}
        elif tokens[0] == "{":
            stack.append(pending)
        elif tokens[0] == "}":
            stack.pop()
        elif tokens[0] == "OFFSET":
            stack[-1]["offset"] = np.array([float(v) for v in tokens[1:4]])
        elif tokens[0] == "CHANNELS":
            stack[-1]["channels"] = tokens[2:]
    rows = [line.split() for line in words[1].splitlines() if line.strip() and "Frame" not in line]
    frames = []
    for row in rows:
        values = iter([float(v) for v in row])
        places: dict[int, np.ndarray] = {}
        for joint in order:
            joint["values"] = [next(values) for _ in joint["channels"]]

        def walk(joint: dict, position: np.ndarray, turn: np.ndarray, places: dict) -> None:
            local = np.array(joint["offset"])
            own = np.eye(3)
            for channel, value in zip(joint["channels"], joint["values"], strict=True):
                axis = "XYZ".index(channel[0])
                if channel.endswith("position"):
                    local[axis] = value
                else:
                    c, s = math.cos(math.radians(value)), math.sin(math.radians(value))
                    one = {0: [[1, 0, 0], [0, c, -s], [0, s, c]], 1: [[c, 0, s], [0, 1, 0], [-s, 0, c]],
                           2: [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis]  # fmt: skip
                    own = own @ np.array(one)
            here = position + turn @ local
            places[id(joint)] = here
            for child in joint["children"]:
                if not child["end"]:
                    walk(child, here, turn @ own, places)

        assert root is not None
        walk(root, np.zeros(3), np.eye(3), places)
        frames.append([places[id(joint)] for joint in (*order[6:9], *order[10:13])])
    return arms(np.array(frames))


def rows_of(path: Path) -> list[list[str]]:
    with path.open(newline="") as opened:
        return [row for row in csv.reader(opened) if row]


def text(path: Path, before: int, width: int, points: list[int], separator: str | None = None) -> np.ndarray:
    frames = []
    for line in path.read_text().splitlines():
        cells = [float(v) for v in line.split(separator) if v.strip()]
        frames.append([cells[before + width * p : before + width * p + 3] for p in points])
    return arms(np.array(frames))


def named(path: Path, names: list[str], pattern: str) -> np.ndarray:
    table = rows_of(path)
    places = [[table[0].index(pattern.format(name, axis)) for axis in "xyz"] for name in names]
    return arms(np.array([[[float(row[c]) for c in place] for place in places] for row in table[1:]]))


def numbered(path: Path, first: int) -> np.ndarray:
    table = rows_of(path)
    places = [[table[0].index(f"{axis}{point + first}") for axis in "xyz"] for point in MEDIAPIPE]
    return arms(np.array([[[float(row[c]) for c in place] for place in places] for row in table[1:]]))


def long(path: Path) -> np.ndarray:
    names = ["left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist"]
    table = [row for row in rows_of(path)[1:] if row[1] in names]
    frames: dict[str, dict[str, list[float]]] = {}
    for frame, name, *values in table:
        frames.setdefault(frame, {})[name] = [float(v) for v in values[:3]]
    return arms(np.array([[frame[name] for name in names] for frame in frames.values()]))


def landmarks(path: Path, key: str, person: int | None = None) -> np.ndarray:
    frames = []
    for frame in json.loads(path.read_text()):
        points = frame[key] if person is None else frame[key][person]
        frames.append([[points[p][axis] for axis in "xyz"] for p in MEDIAPIPE])
    return arms(np.array(frames))


def azure(path: Path) -> np.ndarray:
    frames = json.loads(path.read_text())["frames"]
    return arms(np.array([[frame["bodies"][0]["joint_positions"][p] for p in AZURE] for frame in frames]))


def ntu(path: Path) -> np.ndarray:
    lines = path.read_text().splitlines()
    frames = []
    for frame in range(int(lines[0])):
        start = 1 + 28 * frame + 3
        rows = [lines[start + i].split() for i in range(25)]
        frames.append([[float(v) for v in rows[p][:3]] for p in KINECT2])
    return arms(np.array(frames))


def npy(path: Path) -> np.ndarray:
    loaded = np.load(path)
    array = loaded if isinstance(loaded, np.ndarray) else loaded[loaded.files[0]]
    return arms(array[:, MEDIAPIPE, :3])


_SDK = ["ShoulderLeft", "ElbowLeft", "WristLeft", "ShoulderRight", "ElbowRight", "WristRight"]
_K4A = ["SHOULDER_LEFT", "ELBOW_LEFT", "WRIST_LEFT", "SHOULDER_RIGHT", "ELBOW_RIGHT", "WRIST_RIGHT"]
_MP = ["left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist"]

READINGS = {
    "table_kinect_ok.csv": (lambda p: named(p, _SDK, "{}_{}"), UP_Y),
    "table_kinect_ticks.csv": (lambda p: named(p, _SDK, "{}_{}"), UP_Y),
    "table_kinect_in_unit_square.csv": (lambda p: named(p, _SDK, "{}_{}"), UP_Y),
    "kinect1_20_joints_61_columns.txt": (lambda p: text(p, 1, 3, [4, 5, 6, 8, 9, 10]), UP_Y),
    "kinect1_20_joints_61_columns_accepted.txt": (lambda p: text(p, 1, 3, [4, 5, 6, 8, 9, 10]), UP_Y),
    "openni_nite2_order.txt": (lambda p: text(p, 0, 3, [2, 4, 6, 3, 5, 7]), UP_Y),
    "kinect_v2_time_in_seconds.csv": (lambda p: text(p, 1, 4, KINECT2, ","), UP_Y),
    "kinect_v2_tracking_id.csv": (lambda p: text(p, 2, 4, KINECT2, ","), UP_Y),
    "ntu_rgbd.skeleton": (ntu, UP_Y),
    "azure_kinect_columns.csv": (lambda p: named(p, _K4A, "K4ABT_JOINT_{}_{}"), DOWN_Y),
    "azure_kinect_offline.json": (azure, DOWN_Y),
    "mediapipe_names.csv": (lambda p: named(p, _MP, "{}_{}"), DOWN_Y),
    "mediapipe_class_x1.csv": (lambda p: numbered(p, 1), DOWN_Y),
    "mediapipe_x0.csv": (lambda p: numbered(p, 0), DOWN_Y),
    "mediapipe_long.csv": (long, DOWN_Y),
    "mediapipe_two_people.json": (lambda p: landmarks(p, "pose_world_landmarks", 0), DOWN_Y),
    "mediapipe_visibility_null.json": (lambda p: landmarks(p, "landmarks"), DOWN_Y),
    "mediapipe_coarse_time.json": (lambda p: landmarks(p, "pose_world_landmarks"), DOWN_Y),
    "mediapipe_33x4.npy": (npy, DOWN_Y),
    "mediapipe_other_key.npz": (npy, DOWN_Y),
}
"""Case file to its reading and axes (rows: forward, left, up); BVH files are all read by ``bvh``."""


def reading(path: Path) -> np.ndarray:
    """Unit directions ``(N, 2, 2, 3)`` of upper arm and forearm in body axes."""
    points, axes = (bvh(path), BVH) if path.suffix == ".bvh" else (READINGS[path.name][0](path), READINGS[path.name][1])
    links = np.diff(points @ axes.T, axis=2)
    return links / np.linalg.norm(links, axis=-1, keepdims=True)
