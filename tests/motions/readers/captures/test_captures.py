"""C3D and bags: opened in a process of their own, read to the limbs that were written."""

from __future__ import annotations

import contextlib
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syda_gym.errors import MissingExtraError, MotionError
from syda_gym.motions import load_motions
from syda_gym.motions.readers.captures import child
from tests.motions import recordings as rec
from tests.motions.readers.test_variants import COUNT, _degrees, _markers

NAMES = {"LShoulder": "left_shoulder", "LElbow": "left_elbow", "LHand": "left_hand", "RShoulder": "right_shoulder",
         "RElbow": "right_elbow", "RHand": "right_hand", "Torso": "torso", "Neck": "neck", "Head": "head"}  # fmt: skip


def _c3d(path: Path, prefix: str = "") -> Path:
    ezc3d = pytest.importorskip("ezc3d")
    marks = _markers()
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"] = [100.0], ["mm"]
    point["LABELS"]["value"] = [prefix + name for name in marks]
    points = np.ones((4, len(marks), COUNT))
    for index, values in enumerate(marks.values()):
        points[:3, index] = values.T
    file["data"]["points"] = points
    file.write(str(path))
    return path


def test_c3d(tmp_path: Path) -> None:
    motions = load_motions(_c3d(tmp_path / "walk.c3d", "Anna:"))
    assert _degrees(motions) < 0.1
    assert motions.takes[0].fps == pytest.approx(100.0)
    assert motions.bodies["operator"].reach == pytest.approx(0.581, abs=1e-3)
    assert any("LHand = Anna:LWRA+Anna:LWRB" in note for note in motions.notes)


def test_damaged_c3d_ends_nothing_but_its_own_process(tmp_path: Path) -> None:
    data = bytearray(_c3d(tmp_path / "walk.c3d").read_bytes())
    rng = np.random.default_rng(3)
    for number in range(6):
        damaged = bytearray(data)
        for place in rng.integers(2, 1_600, 12):
            damaged[place] = int(rng.integers(256))
        path = tmp_path / f"{number}.c3d"
        path.write_bytes(bytes(damaged))
        with contextlib.suppress(MotionError):
            assert np.isfinite(load_motions(path).takes[0].frames["operator"]).all()


def test_a_c3d_whose_parameters_lead_in_a_circle_is_refused_within_seconds(tmp_path: Path) -> None:
    data = bytearray(_c3d(tmp_path / "walk.c3d").read_bytes())
    at = data.index(b"DESCRIPTIONS") + len(b"DESCRIPTIONS")  # there the way to the next parameter is written
    data[at : at + 2] = b"\xf0\xff"
    path = tmp_path / "circle.c3d"
    path.write_bytes(bytes(data))
    began = time.perf_counter()
    with pytest.raises(MotionError, match="damaged or too large"):
        load_motions(path)
    assert time.perf_counter() - began < 30.0, "it takes four seconds of processor time, on busy cores more"


def test_without_the_library_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _c3d(tmp_path / "walk.c3d")
    shutil.copy(Path(child.__file__).with_name("in_child.py"), tmp_path)
    (tmp_path / "open_c3d.py").write_text("import a_library_that_is_not_installed\n")
    monkeypatch.setattr(child, "__file__", str(tmp_path / "child.py"))
    with pytest.raises(MissingExtraError, match=r"syda-gym\[c3d\]"):
        load_motions(path)


def _messages(types: dict[str, Any], ros1: bool, people: int = 1) -> Iterator[tuple[int, Any]]:
    _, joints = rec.moving_human(count=COUNT)
    for t in range(COUNT):
        nanoseconds = int((100 + t / 30) * 1e9)
        stamp = types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        sent = []
        for person in range(1, people + 1):
            for mine, name in NAMES.items():
                extra = {"seq": t} if ros1 else {}
                header = types["std_msgs/msg/Header"](**extra, stamp=stamp, frame_id="openni_depth_frame")
                place = types["geometry_msgs/msg/Vector3"](*map(float, joints[mine][t] + person))
                turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
                move = types["geometry_msgs/msg/Transform"](translation=place, rotation=turn)
                sent.append(
                    types["geometry_msgs/msg/TransformStamped"](
                        header=header, child_frame_id=f"{name}_{person}", transform=move
                    )
                )
        yield nanoseconds, types["tf2_msgs/msg/TFMessage"](transforms=sent)


def _bag1(path: Path, people: int = 1) -> Path:
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    with Writer(path) as writer:
        connection = writer.add_connection("/tf", "tf2_msgs/msg/TFMessage", typestore=store)
        for time, message in _messages(store.types, ros1=True, people=people):
            writer.write(connection, time, store.serialize_ros1(message, "tf2_msgs/msg/TFMessage"))
    return path


def _bag2(path: Path, plugin: str) -> Path:
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9, storage_plugin=getattr(StoragePlugin, plugin)) as writer:
        connection = writer.add_connection("/tf", "tf2_msgs/msg/TFMessage", typestore=store)
        for time, message in _messages(store.types, ros1=False):
            writer.write(connection, time, store.serialize_cdr(message, "tf2_msgs/msg/TFMessage"))
    return path


@pytest.mark.parametrize("kind", ["bag", "db3 folder", "db3", "mcap"])
def test_people_in_tf(tmp_path: Path, kind: str) -> None:
    if kind == "bag":
        path = _bag1(tmp_path / "a.bag")
    else:
        path = _bag2(tmp_path / "recorded", "MCAP" if kind == "mcap" else "SQLITE3")
        path = path if "folder" in kind else next(path.glob(f"*.{kind}"))
    motions = load_motions(path)
    assert _degrees(motions) < 0.1
    assert motions.takes[0].fps == pytest.approx(30.0, rel=1e-3)
    assert motions.takes[0].timestamps is not None


def test_two_people_in_tf(tmp_path: Path) -> None:
    path = _bag1(tmp_path / "two.bag", people=2)
    motions = load_motions(path, person=2)
    assert _degrees(motions) < 0.1
    assert any("2 people in the file" in note for note in motions.notes)


def test_markers_in_the_order_of_azure_kinect(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    from syda_gym.motions.readers.layouts import LAYOUTS

    store = get_typestore(Stores.ROS2_HUMBLE)
    order = next(layout.joints for layout in LAYOUTS if layout.name.startswith("Azure"))
    _, joints = rec.moving_human(count=COUNT)
    joints["Pelvis"] = 0.5 * (joints["LHip"] + joints["RHip"])
    types = store.types
    with Writer(tmp_path / "bodies", version=9) as writer:
        connection = writer.add_connection("/body_tracking", "visualization_msgs/msg/MarkerArray", typestore=store)
        for t in range(COUNT):
            nanoseconds = int((5 + t / 30) * 1e9)
            stamp = types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="depth_camera_link")
            zero, one = (
                types["builtin_interfaces/msg/Duration"](0, 0),
                types["geometry_msgs/msg/Vector3"](0.1, 0.1, 0.1),
            )
            markers = []
            for index, name in enumerate(order):
                place = joints.get(name, joints["Head"])[t]
                pose = types["geometry_msgs/msg/Pose"](
                    types["geometry_msgs/msg/Point"](*map(float, place)),
                    types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
                )
                markers.append(
                    types["visualization_msgs/msg/Marker"](
                        header=header, ns="", id=300 + index, type=2, action=0, pose=pose, scale=one,
                        color=types["std_msgs/msg/ColorRGBA"](1.0, 1.0, 1.0, 1.0), lifetime=zero, frame_locked=False,
                        points=[],
                        colors=[], texture_resource="", texture=types["sensor_msgs/msg/CompressedImage"](
                            header=header, format="", data=np.zeros(0, dtype=np.uint8)),
                        uv_coordinates=[], text="", mesh_resource="", mesh_use_embedded_materials=False,
                        mesh_file=types["visualization_msgs/msg/MeshFile"](filename="", data=np.zeros(0,
                        dtype=np.uint8)),
                    )
                )  # fmt: skip
            message = types["visualization_msgs/msg/MarkerArray"](markers=markers)
            writer.write(connection, nanoseconds, store.serialize_cdr(message, "visualization_msgs/msg/MarkerArray"))
    motions = load_motions(tmp_path / "bodies")
    assert _degrees(motions) < 0.1
    assert any("markers read as Azure Kinect" in note for note in motions.notes)


def test_a_bag_without_people_lists_its_topics(tmp_path: Path) -> None:
    path = _bag1(tmp_path / "robot.bag")
    path.write_bytes(path.read_bytes().replace(b"left_", b"pipe_").replace(b"right_", b"valve_"))
    with pytest.raises(MotionError, match=r"nobody is in it: .*/tf|damaged"):
        load_motions(path)


def test_a_damaged_bag(tmp_path: Path) -> None:
    path = _bag1(tmp_path / "cut.bag")
    path.write_bytes(path.read_bytes()[:2_000])
    with pytest.raises(MotionError, match=r"cut\.bag is damaged or too large"):
        load_motions(path)


@pytest.mark.parametrize("claimed", [0, 1 << 20, 1 << 36, (1 << 63) - 1])
def test_an_mcap_whose_chunks_lie_about_their_size(tmp_path: Path, claimed: int) -> None:
    folder = _bag2(tmp_path / "recorded", "MCAP")
    data = bytearray(next(folder.glob("*.mcap")).read_bytes())
    # The first chunk: opcode 6, length, first and last time, size of its content, checksum, compression.
    at = 8
    while data[at] != 6:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    data[at + 9 + 16 : at + 9 + 24] = claimed.to_bytes(8, "little")
    path = tmp_path / "lying.mcap"
    path.write_bytes(bytes(data))
    began = time.perf_counter()
    with contextlib.suppress(MotionError):  # what is not compressed can be read all the same
        assert _degrees(load_motions(path)) < 0.2
    assert time.perf_counter() - began < 30.0
