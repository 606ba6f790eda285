"""Robots are read from URDF, xacro and MJCF; every fault is told at once, with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments.discovery.arms import discover, discover_robot
from syda_gym.embodiments.kinematics.urdf import read_urdf, zero_placements
from syda_gym.errors import EmbodimentError

CONTROL = (Path(__file__).parents[1] / "discovery" / "cases" / "control.urdf").read_text()


def changed(folder: Path, *replacements: tuple[str, str]) -> Path:
    text = CONTROL
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "robot.urdf"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('<link name="head">', "<link>", "line 4: a <link> has no name"),
        ('<link name="head">', '<link name="torso">', "line 4: link 'torso' is there twice"),
        ('name="left_elbow_pitch" type', 'name="left_wrist_roll" type', "joint 'left_wrist_roll' is there twice"),
        ('name="left_elbow_pitch" type="revolute"', 'name="left_elbow_pitch" type="revolut"', "mean 'revolute'"),
        ('<parent link="left_elbow_link"/>', '<parent link="left_elbo_link"/>', "did you mean 'left_elbow_link'"),
        ('<child link="left_elbow_link"/>', "", "joint 'left_elbow_pitch' has no <child"),
        ('<origin xyz="0 0 -0.28" rpy="0 0 0"/>', '<origin xyz="0 0 -0,28" rpy="0 0 0"/>', "must be three numbers"),
        ('<origin xyz="0 0 -0.28" rpy="0 0 0"/>', '<origin xyz="0 nan 0" rpy="0 0 0"/>', "must be three numbers"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "must be a direction"),
        ('lower="-2.3"', 'lower="-2.3rad"', "joint 'left_elbow_pitch': lower='-2.3rad' must be a number"),
        ('<mass value="0.5"/>', '<mass value="-0.5"/>', "mass '-0.5' must be a number that is not negative"),
        ('<mass value="0.5"/>', '<mass value="heavy"/>', "mass 'heavy' must be"),
        ('ixx="0.001"', 'ixx="inf"', "must be a number"),
        ('<child link="left_elbow_link"/>', '<child link="left_hand_link"/>', "is the child of two joints"),
        ('<parent link="torso"/><child link="left_shoulder_pitch_link"/>',
         '<parent link="left_hand_link"/><child link="left_shoulder_pitch_link"/>', "go in a circle"),
        ("</robot>", '<link name="island"/><link name="hut"/><joint name="path" type="fixed"><parent link="island"/>'
         '<child link="hut"/></joint></robot>', "2 trees, with the roots 'torso', 'island'"),
        ("</robot>", "", "it is no XML"),
    ],
)  # fmt: skip
def test_faults_are_told_with_what_to_write(tmp_path: Path, old: str, new: str, told: str) -> None:
    with pytest.raises(EmbodimentError, match=r"not a URDF that can be read|expected a tree") as caught:
        read_urdf(changed(tmp_path, (old, new)))
    assert told in str(caught.value)


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    path = changed(tmp_path, ('lower="-2.3"', 'lower="x"'), ('<axis xyz="0 0 1"/>', '<axis xyz="up"/>'),
                   ('<mass value="0.5"/>', '<mass value="-1"/>'))  # fmt: skip
    with pytest.raises(EmbodimentError, match=r"3 faults: line \d+:.*line \d+:.*line \d+:"):
        read_urdf(path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "it is no XML"),
        ("<sdf version='1.7'/>", "SDF, Gazebo's format"),
        ("<COLLADA/>", "a COLLADA mesh"),
        ("<robot name='x'/>", "no joints"),
        ("<html/>", "root <html>"),
        ('<!DOCTYPE r [<!ENTITY a "aa">]><robot name="&a;"/>', "URDF"),
    ],
)
def test_other_files_are_told_by_what_they_are(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(EmbodimentError, match="URDF") as caught:
        read_urdf(path)
    assert told in str(caught.value)


def test_small_faults_are_mended_and_told(tmp_path: Path) -> None:
    path = changed(
        tmp_path,
        ('velocity="6"/></joint>', 'velocity="6"/><mimic joint="gone"/></joint>'),
        ("</robot>", '<link name="lonely"/></robot>'),
    )
    notes = " ".join(read_urdf(path).notes)
    assert "'neck_yaw' of 'gone'" in notes
    assert "no joint holds link 'lonely'" in notes


def test_followers_follow_and_may_be_no_part_of_an_arm(tmp_path: Path) -> None:
    limit = '<limit lower="-1.6" upper="1.6" effort="20" velocity="6"/>'
    follower = changed(tmp_path, (limit, limit + '<mimic joint="left_elbow_pitch" multiplier="0.5"/>'))
    with pytest.raises(EmbodimentError, match=r"'left_forearm_yaw' of the left arm follows 'left_elbow_pitch'"):
        discover_robot(follower)


def test_continuous_joints_turn_once_each_way(tmp_path: Path) -> None:
    path = changed(tmp_path, ('name="left_shoulder_yaw" type="revolute"', 'name="left_shoulder_yaw" type="continuous"'))
    robot = discover_robot(path)
    at = robot.joint_names.index("left_shoulder_yaw")
    assert (robot.lower[at], robot.upper[at]) == (-np.pi, np.pi)


MJCF = """<mujoco><compiler angle="radian"/><worldbody><body name="torso" pos="0 0 1">
<geom type="box" size=".1 .15 .2" pos="0 0 .2"/>
{arms}</body></worldbody><actuator><motor joint="left_elbow" ctrlrange="-1 1" forcerange="-9 9"/></actuator></mujoco>"""
ARM = """<body name="{s}_upper" pos="0 {y} .4"><joint name="{s}_pitch" axis="0 1 0" range="-2.9 1.2"/>
<joint name="{s}_roll" axis="1 0 0" range="{roll}"/><joint name="{s}_yaw" axis="0 0 1" range="-1.7 1.7"/>
<geom type="capsule" size=".03" fromto="0 0 0 0 0 -.28"/><body name="{s}_fore" pos="0 0 -.28">
<joint name="{s}_elbow" axis="0 1 0" range="-2.3 .05"/><geom type="capsule" size=".025" fromto="0 0 0 0 0 -.25"/>
<site name="{s}_palm" pos="0 0 -.25"/></body></body>"""


def test_mjcf_becomes_the_same_robot(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    arms = ARM.format(s="left", y=0.2, roll="-.2 3") + ARM.format(s="right", y=-0.2, roll="-3 .2")
    path = tmp_path / "robot.xml"
    path.write_text(MJCF.format(arms=arms))
    robot = discover_robot(path)
    assert robot.joint_names[:4] == ("left_pitch", "left_roll", "left_yaw", "left_elbow")
    assert (robot.description.arms[0].elbow, robot.description.arms[0].wrist) == ("left_fore", "left_palm")
    np.testing.assert_allclose(robot.arm_lengths, [[0.28, 0.25]] * 2, atol=1e-9)
    assert robot.effort[3] == 9.0
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper)
    for name, angle in zip(robot.joint_names, q, strict=True):
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    palm = data.site("left_palm").xpos - data.body("torso").xpos
    np.testing.assert_allclose(robot.landmarks(q)[0, 1], palm, atol=1e-9)


def test_xacro_is_expanded(tmp_path: Path) -> None:
    pytest.importorskip("xacrodoc")
    text = CONTROL.replace('<robot name="control">', '<robot name="control" xmlns:xacro="http://www.ros.org/wiki/xacro">'
                           '<xacro:property name="upper" value="0.28"/>')  # fmt: skip
    path = tmp_path / "robot.urdf.xacro"
    path.write_text(text.replace("0 0 -0.28", "0 0 ${-upper}"))
    assert discover(path).arms[0].elbow == "left_elbow_link"


def test_the_zero_pose_is_the_files(tmp_path: Path) -> None:
    places = zero_placements(read_urdf(changed(tmp_path)))
    np.testing.assert_allclose(places["left_hand_link"][:3, 3], [0.0, 0.2, 0.4 - 0.28 - 0.25])
