"""The bundled robots against the tables they were made from, in the three libraries that read them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pybullet
import pytest
import yaml
import yourdfpy

REPOSITORY = Path(__file__).resolve().parents[2]
ROBOTS = REPOSITORY / "syda_gym" / "assets" / "robots"
SHARED = Path(os.environ.get("SYDA_GYM_SHARED", REPOSITORY.parent / "shared"))
NAMES = ("pepper", "nao")
DEGREES_OF_FREEDOM = {"pepper": 17, "nao": 26}
# Frames of the tables that the re-rooted Pepper has elsewhere: its Pelvis lies at the knee.
MOVED_FRAMES = {"pepper": {"Pelvis"}, "nao": set()}

pytestmark = pytest.mark.parametrize("name", NAMES)


def tables(name: str, kind: str) -> dict[str, Any]:
    path = SHARED / "robots" / f"{name}_{kind}.json"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here: set SYDA_GYM_SHARED to the folder that has robots/{path.name}")
    return json.loads(path.read_text(encoding="utf-8"))


def described(name: str) -> dict[str, Any]:
    return yaml.safe_load((ROBOTS / f"{name}.yaml").read_text(encoding="utf-8"))


def urdf(name: str) -> ET.Element:
    return ET.parse(ROBOTS / f"{name}.urdf").getroot()


def attribute(element: ET.Element, path: str, key: str) -> str:
    found = element.find(path)
    assert found is not None, f"{element.get('name')} lacks {path}"
    return found.attrib[key]


def moving(name: str) -> dict[str, ET.Element]:
    return {j.attrib["name"]: j for j in urdf(name).iter("joint") if j.get("type") == "revolute"}


@dataclass
class Bullet:
    """A robot in PyBullet, by names."""

    client: int
    body: int
    joints: dict[str, int]
    links: dict[str, int]
    parents: dict[int, int]

    def pose(self, angles: dict[str, float]) -> None:
        for joint, index in self.joints.items():
            pybullet.resetJointState(self.body, index, angles.get(joint, 0.0), physicsClientId=self.client)

    def frame(self, link: str) -> pin.SE3:
        if self.links[link] < 0:
            return pin.SE3.Identity()
        state = pybullet.getLinkState(
            self.body, self.links[link], computeForwardKinematics=True, physicsClientId=self.client
        )
        return pin.XYZQUATToSE3(np.array([*state[4], *state[5]]))

    def mass(self, link: str) -> float:
        return pybullet.getDynamicsInfo(self.body, self.links[link], physicsClientId=self.client)[0]

    def overlaps(self) -> set[frozenset[str]]:
        """Pairs of links that touch, parents and children aside."""
        names = {index: link for link, index in self.links.items()}
        points = pybullet.getClosestPoints(self.body, self.body, 0.0, physicsClientId=self.client)
        pairs = {(p[3], p[4]) for p in points if p[3] != p[4]}
        return {
            frozenset((names[a], names[b])) for a, b in pairs if self.parents.get(a) != b and self.parents.get(b) != a
        }


@pytest.fixture
def bullet(name: str) -> Iterator[Bullet]:
    client = pybullet.connect(pybullet.DIRECT)
    flags = pybullet.URDF_USE_SELF_COLLISION
    path = str(ROBOTS / f"{name}.urdf")
    body = pybullet.loadURDF(path, useFixedBase=True, flags=flags, physicsClientId=client)
    rows = [
        pybullet.getJointInfo(body, i, physicsClientId=client)
        for i in range(pybullet.getNumJoints(body, physicsClientId=client))
    ]
    root = pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()
    yield Bullet(
        client,
        body,
        {row[1].decode(): row[0] for row in rows if row[2] == pybullet.JOINT_REVOLUTE},
        {root: -1} | {row[12].decode(): row[0] for row in rows},
        {row[0]: row[16] for row in rows},
    )
    pybullet.disconnect(client)


def assert_points(poses: dict[str, Any], frame_of: Any, skip: set[str], tolerance: float) -> None:
    """Every point of every pose, in the torso frame."""
    checked = 0
    for pose, row in poses.items():
        frames = frame_of(row["q"])
        torso = frames("torso").inverse()
        for link, expected in row["pos_in_torso"].items():
            if link in skip:
                continue
            got = torso.act(frames(link).translation)
            np.testing.assert_allclose(got, expected, atol=tolerance, err_msg=f"{pose} {link}")
            checked += 1
    assert checked > 50


def test_pinocchio_places_the_landmarks(name: str) -> None:
    poses = tables(name, "fk_vectors")
    model = pin.buildModelFromUrdf(str(ROBOTS / f"{name}.urdf"))
    data = model.createData()

    def frame_of(angles: dict[str, float]) -> Any:
        q = pin.neutral(model)
        for joint, angle in angles.items():
            q[model.joints[model.getJointId(joint)].idx_q] = angle
        pin.framesForwardKinematics(model, data, q)
        return lambda link: data.oMf[model.getFrameId(link, pin.FrameType.BODY)]

    # The vectors are rounded to 1e-7 m and their angles to 1e-6 rad or less.
    assert_points(poses, frame_of, MOVED_FRAMES[name], 1e-6)


def test_yourdfpy_places_the_landmarks(name: str) -> None:
    poses = tables(name, "fk_vectors")
    robot = yourdfpy.URDF.load(str(ROBOTS / f"{name}.urdf"), load_meshes=False)

    def frame_of(angles: dict[str, float]) -> Any:
        # yourdfpy stumbles over integers, which some of the vectors hold.
        robot.update_cfg({joint: float(angles.get(joint, 0.0)) for joint in robot.actuated_joint_names})
        return lambda link: pin.SE3(robot.get_transform(link))

    assert_points(poses, frame_of, MOVED_FRAMES[name], 1e-6)


def test_pybullet_places_the_landmarks(name: str, bullet: Bullet) -> None:
    poses = tables(name, "fk_vectors")

    def frame_of(angles: dict[str, float]) -> Any:
        bullet.pose(angles)
        return bullet.frame

    assert_points(poses, frame_of, MOVED_FRAMES[name], 1e-5)


def test_every_library_reads_without_complaint(
    name: str, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    path = str(ROBOTS / f"{name}.urdf")
    capfd.readouterr()
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.loadURDF(path, useFixedBase=True, physicsClientId=client)
    pybullet.disconnect(client)
    model = pin.buildModelFromUrdf(path)
    counts = {
        tag: pin.buildGeomFromUrdf(model, path, kind).ngeoms
        for tag, kind in (("visual", pin.GeometryType.VISUAL), ("collision", pin.GeometryType.COLLISION))
    }
    robot = yourdfpy.URDF.load(path, build_collision_scene_graph=True, load_collision_meshes=True)
    said = capfd.readouterr()
    assert "warning" not in (said.out + said.err).lower()
    assert "error" not in (said.out + said.err).lower()
    assert robot.validate(), robot.errors
    assert not [r for r in caplog.records if r.levelname in ("WARNING", "ERROR")]
    assert model.nq == len(robot.actuated_joint_names) == DEGREES_OF_FREEDOM[name]
    for tag, count in counts.items():
        assert count == len(list(urdf(name).iter(tag))), f"pinocchio dropped {tag} shapes"


def test_every_link_has_the_mass_of_the_tables(name: str, bullet: Bullet) -> None:
    listed = {link: row["mass"] for link, row in tables(name, "kinematics")["links"].items()}
    if name == "pepper":
        listed["Tibia"] += sum(listed.pop(wheel) for wheel in [w for w in listed if w.startswith("Wheel")])
    total = 0.0
    for link in urdf(name).iter("link"):
        mass = float(attribute(link, "inertial/mass", "value"))
        expected = listed.get(link.attrib["name"], 0.0)
        # Frames that carry nothing weigh a gram, lest PyBullet give them a kilogram.
        assert mass == pytest.approx(expected if expected > 1e-3 else 1e-3, abs=1e-9)
        total += mass
        # PyBullet calls a fixed root weightless.
        if bullet.links[link.attrib["name"]] >= 0:
            assert bullet.mass(link.attrib["name"]) == pytest.approx(mass, abs=1e-9)
    assert total == pytest.approx(sum(listed.values()), abs=0.006)


def test_the_whole_body_balances_where_the_tables_say(name: str) -> None:
    """Weights and centres of mass of the tables, put where the forward kinematics has the links at zero."""
    table = tables(name, "kinematics")
    floating = pin.buildModelFromUrdf(str(ROBOTS / f"{name}.urdf"), pin.JointModelFreeFlyer())
    data = floating.createData()
    pin.framesForwardKinematics(floating, data, pin.neutral(floating))
    torso = data.oMf[floating.getFrameId("torso", pin.FrameType.BODY)]
    got = torso.actInv(pin.centerOfMass(floating, data, pin.neutral(floating)))

    places = {"torso": pin.SE3.Identity()}
    for joint in table["joints"] + table["fixed_joints"]:
        placement = pin.SE3(pin.rpy.rpyToMatrix(*joint["origin_rpy"]), np.array(joint["origin_xyz"], float))
        places[joint["child"]] = places[joint["parent"]] * placement
    if name == "pepper":
        for wheel in ("WheelFL_link", "WheelFR_link", "WheelB_link"):
            at = np.array(table["sensor_frames"][wheel]["xyz"], float)
            places[wheel] = places["Tibia"] * pin.SE3(np.eye(3), at)
    weights = np.array([row["mass"] for row in table["links"].values()])
    points = [places[link].act(np.array(row["com"], float)) for link, row in table["links"].items()]
    # The gram of every empty frame moves the balance by less than this.
    np.testing.assert_allclose(got, weights @ np.array(points) / weights.sum(), atol=5e-4)


def test_limits_are_those_of_the_tables(name: str) -> None:
    rows = {row["name"]: row for row in tables(name, "kinematics")["joints"]}
    joints = moving(name)
    assert joints.keys() == rows.keys()
    for joint, element in joints.items():
        for key in ("lower", "upper", "velocity", "effort"):
            assert float(attribute(element, "limit", key)) == rows[joint][key], f"{joint} {key}"


def test_inertias_are_possible(name: str) -> None:
    for link in urdf(name).iter("link"):
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        xx, xy, xz, yy, yz, zz = (float(attribute(link, "inertial/inertia", key)) for key in keys)
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert moments[0] > 0
        assert moments[2] <= moments[0] + moments[1] + 1e-12


def test_description_fits_the_urdf(name: str) -> None:
    robot = described(name)
    joints, links = moving(name), {link.attrib["name"] for link in urdf(name).iter("link")}
    limits = {
        joint: (float(attribute(e, "limit", "lower")), float(attribute(e, "limit", "upper")))
        for joint, e in joints.items()
    }
    assert robot["name"] == name
    assert (ROBOTS / robot["urdf"]).is_file()
    assert robot["torso"] in links
    assert [arm["side"] for arm in robot["arms"]] == ["left", "right"]
    for arm in robot["arms"]:
        assert set(arm["joints"]) <= joints.keys()
        assert {arm[point] for point in ("shoulder", "elbow", "wrist", "tip")} <= links
    for pair in robot["disabled_collisions"]:
        assert set(pair) <= links
        assert len(set(pair)) == 2
    for row in robot["coupled_limits"]:
        lower, upper = limits[row["joint"]]
        assert len(row["at"]) == len(row["lower"]) == len(row["upper"])
        assert row["at"] == sorted(row["at"])
        assert all(lower <= a < b <= upper for a, b in zip(row["lower"], row["upper"], strict=True))
    assert robot["rest"].keys() == joints.keys()
    for joint, angle in robot["rest"].items():
        assert limits[joint][0] <= angle <= limits[joint][1], joint


@pytest.mark.parametrize("pose", ["rest", "zero"])
def test_no_part_touches_another(name: str, pose: str, bullet: Bullet) -> None:
    bullet.pose(described(name)["rest"] if pose == "rest" else {})
    disabled = {frozenset(pair) for pair in described(name)["disabled_collisions"]}
    assert bullet.overlaps() <= disabled


def test_stands_on_the_floor_without_contacts(name: str, bullet: Bullet) -> None:
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=bullet.client)
    floor = pybullet.createMultiBody(0, plane, physicsClientId=bullet.client)
    bullet.pose(described(name)["rest"])
    gap = pybullet.getClosestPoints(bullet.body, floor, 0.1, physicsClientId=bullet.client)
    assert 0.0 <= min(point[8] for point in gap) < 0.005
    pybullet.stepSimulation(physicsClientId=bullet.client)
    assert not pybullet.getContactPoints(bullet.body, floor, physicsClientId=bullet.client)
    boxes = [pybullet.getAABB(bullet.body, i, physicsClientId=bullet.client) for i in bullet.links.values()]
    assert max(box[1][2] for box in boxes) == pytest.approx(described(name)["height"], abs=0.02)


def test_the_script_writes_these_very_bytes(name: str, tmp_path: Path) -> None:
    tables(name, "kinematics")
    script = REPOSITORY / "scripts" / "build_robots.py"
    command = [sys.executable, str(script), str(SHARED / "robots"), "--out", str(tmp_path)]
    subprocess.run(command, check=True)
    for suffix in ("urdf", "yaml"):
        written, kept = (folder / f"{name}.{suffix}" for folder in (tmp_path, ROBOTS))
        assert written.read_bytes() == kept.read_bytes(), f"run scripts/build_robots.py: {kept.name} is stale"


def test_files_say_where_their_numbers_come_from(name: str) -> None:
    text = (ROBOTS / f"{name}.urdf").read_text(encoding="utf-8")
    assert "Generated by scripts/build_robots.py" in text
    assert "Sources:" in text
    assert "<mesh" not in text
    assert "<mimic" not in text
    assert str(REPOSITORY.parent) not in text
