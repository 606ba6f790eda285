"""Arms found by themselves in a URDF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover, discover_robot
from syda_gym.embodiments.discovery.limbs import side_by_name
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, MissingExtraError
from syda_gym.files import asset

LIMITS = '<limit lower="-1.5" upper="1.5" velocity="1" effort="1"/>'


def joint(name: str, parent: str, child: str, xyz: str, axis: str = "0 1 0", limit: str = LIMITS) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint><link name="{child}"/>'
    )


def fixed(parent: str, child: str, xyz: str, rpy: str = "0 0 0") -> str:
    return (
        f'<joint name="{child}_fixed" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/></joint><link name="{child}"/>'
    )


def arm(prefix: str, y: float, parent: str = "base", limit: str = LIMITS) -> str:
    return (
        joint(f"{prefix}1", parent, f"{prefix}upper", f"0 {y} 0.4", "0 1 0", limit)
        + joint(f"{prefix}2", f"{prefix}upper", f"{prefix}turn", "0 0 0", "0 0 1")
        + joint(f"{prefix}3", f"{prefix}turn", f"{prefix}lower", "0.3 0 0", "0 0 1")
        + fixed(f"{prefix}lower", f"{prefix}end", "0.25 0 0")
    )


def write(folder: Path, *parts: str) -> Path:
    path = folder / "machine.urdf"
    path.write_text(f'<robot name="machine"><link name="base"/>{"".join(parts)}</robot>')
    return path


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_finds_the_arms_that_were_described_by_hand(name: str) -> None:
    known = catalog.get(name)
    assert isinstance(known, Robot)
    found = discover_robot(asset("robots", f"{name}.urdf"))
    assert found.joint_names == known.joint_names
    q = np.random.default_rng(0).uniform(known.lower, known.upper, (20, len(known.lower)))
    np.testing.assert_allclose(found.arm_points(q), known.arm_points(q), atol=1e-9)
    assert found.description.axes is None


def test_a_urdf_path_is_a_body() -> None:
    body = catalog.resolve(asset("robots", "pepper.urdf"))
    assert body.kind == "robot"
    assert body.sides == ("left", "right")


def test_sides_come_from_positions_where_names_say_nothing(tmp_path: Path) -> None:
    robot = discover_robot(write(tmp_path, arm("a", -0.2), arm("b", 0.2)))
    assert [chain.joints for chain in robot.chains] == [("b1", "b2", "b3"), ("a1", "a2", "a3")]
    np.testing.assert_allclose(robot.arm_lengths, [[0.3, 0.25], [0.3, 0.25]])
    assert robot.description.height == pytest.approx(0.4)


def test_names_win_over_positions_and_turn_the_body_axes(tmp_path: Path) -> None:
    """A model that looks along -x, as iCub's does: its left arm lies at negative y."""
    robot = discover_robot(write(tmp_path, arm("left_arm_", -0.2), arm("right_arm_", 0.2)))
    points = robot.arm_points(np.zeros(6))[0]
    np.testing.assert_allclose(points[0, 0], [0.0, 0.2, 0.4], atol=1e-12)
    np.testing.assert_allclose(points[1, 1], [-0.3, -0.2, 0.4], atol=1e-12)


def test_a_sideways_model_stands_up(tmp_path: Path) -> None:
    """Biomechanical models have y up and z to the right."""
    lay = fixed("base", "body", "0 0 0", "-1.5707963267948966 0 0")
    robot = discover_robot(write(tmp_path, lay, arm("left_", 0.2, "body"), arm("right_", -0.2, "body")))
    np.testing.assert_allclose(robot.arm_points(np.zeros(6))[0, 0, 0], [0.0, 0.2, 0.4], atol=1e-9)


def test_legs_heads_and_fingers_are_no_arms(tmp_path: Path) -> None:
    legs = "".join(
        joint(f"{s}_hip", "base", f"{s}_thigh", f"0 {y} 0") + joint(f"{s}_knee", f"{s}_thigh", f"{s}_calf", "0 0 -0.4")
        for s, y in (("left", 0.1), ("right", -0.1))
    )
    head = joint("head_yaw", "base", "neck", "0 0 0.6", "0 0 1") + joint("head_pitch", "neck", "head", "0 0 0.1")
    hand = "".join(
        joint(f"left_digit{i}_a", "left_lower", f"left_digit{i}", f"0.2 {0.02 * i} 0")
        + joint(f"left_digit{i}_b", f"left_digit{i}", f"left_digit{i}_end", "0.03 0 0")
        for i in range(3)
    )
    description = discover(write(tmp_path, legs, head, arm("left_", 0.2), hand, arm("right_", -0.2)))
    assert [a.joints for a in description.arms] == [("left_1", "left_2", "left_3"), ("right_1", "right_2", "right_3")]


def test_one_arm_and_planar_arms(tmp_path: Path) -> None:
    planar = joint("j1", "base", "l1", "0 0 0", "0 0 1") + joint("j2", "l1", "l2", "0.3 0 0", "0 0 1")
    description = discover(write(tmp_path, planar, fixed("l2", "tool", "0.2 0 0")))
    assert [(a.side, a.shoulder, a.elbow, a.wrist) for a in description.arms] == [("right", "l1", "l2", "tool")]


def test_more_than_two_arms_must_be_named(tmp_path: Path) -> None:
    path = write(tmp_path, arm("a", 0.2), arm("b", -0.2), arm("c", 0.4))
    with pytest.raises(EmbodimentError, match=r"3 limbs that may be arms.*left=LINK, right=LINK"):
        discover(path)
    description = discover(path, left="cend", right="bend", torso="base", name="trio")
    assert [a.joints[0] for a in description.arms] == ["c1", "b1"]
    assert description.name == "trio"


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ((), "no joints"),
        ((joint("left_hip", "base", "a", "0 0 0"), joint("left_knee", "a", "b", "0 0 -1")), "has no arm.*leg"),
        ((joint("j1", "base", "a", "0 0 0"),), "has no arm"),
        ((arm("a", 0.2, limit='<limit velocity="1" effort="1"/>'),), "limit"),
        ((joint("j1", "base", "a", "0 0 0"), joint("j2", "a", "b", "0 0 0")), "bends it"),
        (
            (
                joint("j1", "base", "a", "0 0 0"),
                joint("j2", "a", "b", "1 0 0", limit='<limit lower="0" upper="0" velocity="1" effort="1"/>'),
            ),
            "locked by equal limits",
        ),
    ],
)
def test_what_cannot_be_an_arm_is_told(tmp_path: Path, parts: tuple[str, ...], expected: str) -> None:
    with pytest.raises(EmbodimentError, match=expected):
        discover_robot(write(tmp_path, *parts))


def test_files_that_are_no_urdf(tmp_path: Path) -> None:
    (tmp_path / "a.urdf").write_text("not xml")
    with pytest.raises(EmbodimentError, match="not a URDF"):
        discover(tmp_path / "a.urdf")
    with pytest.raises(EmbodimentError, match="no URDF"):
        discover(tmp_path / "b.urdf")


def test_wrong_names_are_told(tmp_path: Path) -> None:
    path = write(tmp_path, arm("a", 0.2))
    with pytest.raises(EmbodimentError, match="did you mean 'aend'"):
        discover(path, left="aendd")
    with pytest.raises(EmbodimentError, match="at least two"):
        discover(path, left="aupper")
    with pytest.raises(EmbodimentError, match="are one arm"):
        discover(path, left="aend", right="alower")
    with pytest.raises(EmbodimentError, match="no link 'chest'"):
        discover(path, torso="chest")


@pytest.mark.parametrize(
    ("name", "side"),
    [("LShoulderPitch", "left"), ("arm_right_1_joint", "right"), ("r_elbow", "right"), ("left_s0", "left"),
     ("Link1", None), ("Rotation", None), ("lower_arm", None), ("RARM_WRIST_R", "right"), ("link_l", "left")],
)  # fmt: skip
def test_sides_in_names(name: str, side: str | None) -> None:
    assert side_by_name([name]) == side


def test_real_robots() -> None:
    from syda_gym.embodiments.discovery.example_robots import two_armed_robots

    try:
        robots = two_armed_robots()
    except MissingExtraError as error:
        pytest.skip(f"SKIPPED LOUDLY: {error}")
    assert {"baxter", "g1_29dof_rev_1_0", "talos_full_v2", "tiago_dual", "icub", "romeo", "pr2"} <= set(robots)
    elbows = {"baxter": "left_lower_elbow", "pr2": "l_elbow_flex_link", "g1_29dof_rev_1_0": "left_elbow_link"}
    assert {name: robots[name].arms[0].elbow for name in elbows} == elbows
    for name, description in robots.items():
        robot = Robot(description)
        left, right = robot.arm_lengths
        np.testing.assert_allclose(left, right, atol=2e-3, err_msg=name)
        shoulders = robot.arm_points(robot.rest)[0, :, 0]
        assert shoulders[0, 1] > 0.0 > shoulders[1, 1], name
