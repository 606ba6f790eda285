"""Minimal robots, each with one trap, and what is right for it (``cases/README.md``)."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover, search
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, MissingExtraError
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.simulation.making import make_world
from syda_gym.simulation.rates import Rates

CASES = Path(__file__).with_name("cases")
REFUSED = ("reversed_limits", "telescoping_arm")
RIGHT = sorted(path.stem for path in CASES.glob("*.urdf") if path.stem not in REFUSED)


def case(name: str) -> Robot:
    return Robot(discover(CASES / f"{name}.urdf"))


@pytest.mark.parametrize("name", RIGHT)
def test_every_case_has_two_arms_of_human_proportions_facing_forward(name: str) -> None:
    robot = case(name)
    assert robot.sides == ("left", "right")
    assert (robot.arm_lengths > 0.24).all()
    assert (robot.arm_lengths < 0.43).all()
    left, right = robot.arm_points(np.zeros(robot.n_features))[0, :, 0]
    assert left[1] - right[1] > 0.25
    np.testing.assert_allclose((left - right)[[0, 2]], 0.0, atol=1e-9)


@pytest.mark.parametrize("name", RIGHT)
def test_bullet_has_every_case_where_the_kinematics_has_it(name: str) -> None:
    robot = case(name)
    world = make_world(robot, Rates(30, 240))
    q = robot.clamp(np.random.default_rng(1).uniform(robot.lower, robot.upper, (4, robot.n_features)))
    for angles in q:
        world.reset(np.array([0]), angles[None])
        seen = world.pose[0, robot.n_features :].reshape(-1, 3)
        np.testing.assert_allclose(seen, robot.landmarks(angles)[0], atol=1e-4)
    world.close()


@pytest.mark.parametrize("name", ["elbow_last", "elbow_last_ball_shoulder"])
def test_a_file_that_ends_at_the_elbow_has_its_wrist_at_the_end_of_the_forearm(name: str) -> None:
    arm = case(name).description.arms[0]
    assert (arm.elbow, arm.wrist) == ("left_forearm_link", "left_forearm_link")
    np.testing.assert_allclose(arm.offsets["wrist"], [0.0, 0.0, -0.255])


def _without(name: str, tmp_path: Path, *parts: str) -> Path:
    from lxml import etree

    tree = etree.parse(str(CASES / f"{name}.urdf"))
    for part in parts:
        for element in list(tree.getroot().iter(part)):
            element.getparent().remove(element)
    path = tmp_path / f"{name}.urdf"
    tree.write(str(path))
    return path


def test_a_forearm_without_shape_is_measured_by_its_mass(tmp_path: Path) -> None:
    arm = discover(_without("elbow_last", tmp_path, "visual", "collision")).arms[0]
    np.testing.assert_allclose(arm.offsets["wrist"], [0.0, 0.0, -0.26])


def test_a_forearm_without_shape_and_mass_is_refused_with_the_way_out(tmp_path: Path) -> None:
    path = _without("elbow_last_ball_shoulder", tmp_path, "visual", "collision", "inertial")
    with pytest.raises(EmbodimentError, match=r"ends at the elbow, say where the wrist is: .*offset: \[x, y, z\]"):
        discover(path)


@pytest.mark.parametrize("name", ["first_joint_slid", "gear_leaves", "clavicle", "wide_limits"])
def test_frames_that_slide_gears_and_clavicles_move_no_elbow(name: str) -> None:
    arm = case(name).description.arms[0]
    assert (arm.shoulder, arm.elbow, arm.wrist) == (
        "left_shoulder_roll_link",
        "left_elbow_link",
        "left_wrist_roll_link",
    )
    assert len(arm.joints) == (8 if name == "clavicle" else 7)


def test_what_is_left_out_is_named() -> None:
    assert "left_shoulder_yaw_gear" in search(CASES / "gear_leaves.urdf").left_out


def test_the_elbow_lies_where_its_axis_meets_the_arm() -> None:
    slid, control = case("elbow_frame_slid"), case("control")
    assert slid.description.arms[0].offsets["elbow"] == (0.0, -0.03, 0.0)
    q = np.random.default_rng(0).uniform(control.lower, control.upper, (32, 14))
    np.testing.assert_allclose(slid.arm_points(q), control.arm_points(q), atol=1e-9)


def test_arms_that_point_fore_and_aft_turn_no_body() -> None:
    robot = case("arms_stretched_fore_and_aft")
    assert robot.description.axes is None
    shoulders = robot.arm_points(np.zeros(robot.n_features))[0, :, 0]
    np.testing.assert_allclose(shoulders[0] - shoulders[1], [0.0, 0.7, 0.0], atol=1e-9)


def test_a_telescoping_arm_is_refused_with_its_prismatic_joints() -> None:
    with pytest.raises(EmbodimentError, match="prismatic joints lift_joint, arm_extension_joint"):
        discover(CASES / "telescoping_arm.urdf")


def test_all_reversed_limits_are_named_at_once_with_their_lines() -> None:
    with pytest.raises(EmbodimentError, match=r"'left_elbow_pitch' \(line \d+\).*'right_elbow_pitch' \(line \d+\)"):
        discover(CASES / "reversed_limits.urdf")


def test_a_joint_with_a_links_name_keeps_self_collision() -> None:
    assert SelfCollision(case("joint_named_as_link")).available


def test_missing_meshes_keep_the_other_shapes() -> None:
    check = SelfCollision(case("mesh_absent"))
    assert check.available
    assert check.pairs > 20


def test_placeholders_are_unknown_and_told() -> None:
    robot = case("effort_minus_one")
    assert np.isfinite(robot.effort).all()  # the neck's is the placeholder
    text = (CASES / "effort_minus_one.urdf").read_text().replace('effort="20"', 'effort="5e4"')
    assert text.count('effort="5e4"') > 10


def test_placeholder_efforts_of_arms_are_unknown_and_told(tmp_path: Path) -> None:
    path = tmp_path / "p.urdf"
    path.write_text(
        (CASES / "control.urdf").read_text().replace('effort="20" velocity="6"', 'effort="-1" velocity="1e9"')
    )
    found = search(path)
    assert any("placeholders" in note and "left_elbow_pitch" in note for note in found.notes)
    robot = Robot(found.description)
    assert np.isinf(robot.effort).all()
    assert np.isinf(robot.speed).all()


def test_links_without_inertia_weigh_nothing() -> None:
    from syda_gym.simulation.plain_body import plain_body

    robot = case("massless_tool_frames")
    moving = [float(mass) for mass in _masses(plain_body(robot).xml) if 1e-3 < float(mass) < 1.0]
    np.testing.assert_allclose(moving, [0.1] * robot.n_features, atol=1e-9)


def _masses(xml: str) -> list[str]:
    import re

    return re.findall(r'<mass value="([^"]+)"', xml)


def test_capital_endings_and_xacro(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copy(CASES / "control.urdf", tmp_path / "ROBOT.URDF")
    assert catalog.resolve(tmp_path / "ROBOT.URDF").sides == ("left", "right")
    monkeypatch.setitem(__import__("sys").modules, "xacrodoc", None)
    with pytest.raises(
        MissingExtraError, match=r"is xacro, not yet a URDF \(`xacro unexpanded.urdf.xacro > unexpanded.urdf`"
    ):
        discover(CASES / "unexpanded.urdf.xacro")


def test_mjcf_is_named_where_mujoco_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match=r"is MJCF, MuJoCo's format.*syda-gym\[mjcf\]"):
        discover(CASES / "mjcf_model.xml")


def changed(tmp_path: Path, *replacements: tuple[str, str]) -> Path:
    text = (CASES / "control.urdf").read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    return path


def test_an_arm_cut_by_a_prismatic_joint_is_refused_with_its_name(tmp_path: Path) -> None:
    path = changed(tmp_path, ('shoulder_yaw" type="revolute"', 'shoulder_yaw" type="prismatic"'))
    with pytest.raises(EmbodimentError, match=r"prismatic joint 'left_shoulder_yaw' between 'left_shoulder_roll' and"):
        discover(path)


@pytest.mark.parametrize("rpy", ["0 0 0.7853981", "-1.5707963 0 0", "1.5707963 0 1.5707963"])
def test_a_root_that_is_turned_turns_no_body(tmp_path: Path, rpy: str) -> None:
    lay = (
        f'<link name="base"/><joint name="lay" type="fixed"><origin rpy="{rpy}"/><parent link="base"/>'
        '<child link="torso"/></joint><link name="torso">'
    )
    robot = Robot(discover(changed(tmp_path, ('<link name="torso">', lay))))
    left, right = robot.arm_points(np.zeros(14))[0, :, 0]
    np.testing.assert_allclose(left - right, [0.0, 0.4, 0.0], atol=1e-6)
    assert robot.arm_points(np.zeros(14))[0, 0, 2, 2] < left[2] - 0.5


def test_left_is_what_is_called_left(tmp_path: Path) -> None:
    path = changed(tmp_path, ("left_", "tmp_"), ("right_", "left_"), ("tmp_", "right_"))
    assert discover(path).axes == ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))


def test_a_wrist_whose_frame_slid_along_its_axis(tmp_path: Path) -> None:
    moved = ('<origin xyz="0 0 -0.25" rpy="0 0 0"/>', '<origin xyz="0.2 0 -0.25" rpy="0 0 0"/>')
    assert discover(changed(tmp_path, moved)).arms[0].offsets["wrist"] == (-0.2, 0.0, 0.0)
