import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot, select_sides
from syda_gym.errors import EmbodimentError
from syda_gym.files import asset

PEPPER_ARM = ("ShoulderPitch", "ShoulderRoll", "ElbowYaw", "ElbowRoll", "WristYaw")


@pytest.fixture(scope="module")
def pepper() -> Robot:
    return catalog.get("pepper")


def poses(robot: Robot, seed: int, count: int = 50) -> np.ndarray:
    return robot.clamp(np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, robot.n_features)))


def test_pepper_has_ten_arm_joints_left_first(pepper):
    assert pepper.joint_names == tuple(side + part for side in "LR" for part in PEPPER_ARM)
    assert all(feature.unit == "rad" for feature in pepper.features)


def test_zero_pose_puts_the_wrist_where_the_facts_say(pepper):
    wrist = pepper.landmarks(np.zeros(10))[0, 1]
    np.testing.assert_allclose(wrist, (0.2723533, 0.16474, 0.1104151), atol=1e-6)


def test_limits_and_speeds_are_those_of_the_robot(pepper):
    np.testing.assert_allclose(pepper.speed[:5], (7.33998, 9.22756, 7.33998, 9.22756, 17.3835))
    np.testing.assert_allclose(pepper.upper[:2], (2.08567, 1.56207))


def test_elbow_roll_limit_depends_on_elbow_yaw(pepper):
    frame = np.zeros((1, 10))
    frame[0, 2], frame[0, 3] = np.radians(-60.0), np.radians(-89.0)
    assert pepper.violations(np.where(frame == 0, pepper.clamp(frame), frame)).any()
    clamped = pepper.clamp(frame)
    assert np.degrees(clamped[0, 3]) == pytest.approx(-78.0)
    assert not pepper.violations(clamped).any()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_mirror_reflects_the_landmarks(seed):
    for name in ("pepper", "nao"):
        robot = catalog.get(name)
        q = poses(robot, seed, 5)
        mirrored = robot.landmarks(robot.mirror(q))
        expected = robot.landmarks(q)[:, [2, 3, 0, 1]] * np.array([1.0, -1.0, 1.0])
        np.testing.assert_allclose(mirrored, expected, atol=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_jacobians_match_finite_differences(seed):
    chain = catalog.get("pepper").chains[0]
    rng = np.random.default_rng(seed)
    q = rng.uniform(chain.lower, chain.upper, (3, chain.n_joints))
    points, jacobian = chain.jacobians(q)
    np.testing.assert_allclose(points, chain.points(q), atol=1e-15)
    for joint in range(chain.n_joints):
        step = np.zeros(chain.n_joints)
        step[joint] = 1e-6
        slope = (chain.points(q + step) - chain.points(q - step)) / 2e-6
        np.testing.assert_allclose(jacobian[..., joint], slope, atol=1e-8)


def test_forward_kinematics_agree_with_pinocchio(pepper):
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(pepper.urdf))
    data = model.createData()
    q = poses(pepper, 3, 20)
    ours = pepper.arm_points(q)
    for row, angles in enumerate(q):
        configuration = pinocchio.neutral(model)
        for name, angle in zip(pepper.joint_names, angles, strict=True):
            configuration[model.joints[model.getJointId(name)].idx_q] = angle
        pinocchio.framesForwardKinematics(model, data, configuration)
        torso = data.oMf[model.getFrameId("torso")]
        for arm, description in enumerate(pepper.description.arms):
            for point, link in enumerate((description.shoulder, description.elbow, description.wrist)):
                theirs = torso.actInv(data.oMf[model.getFrameId(link)]).translation
                np.testing.assert_allclose(ours[row, arm, point], theirs, atol=1e-12)


def test_spec_knows_the_robot_again_and_refuses_a_changed_one(pepper):
    assert catalog.from_spec(pepper.spec()) is pepper
    with pytest.raises(EmbodimentError, match="differs"):
        catalog.from_spec({**pepper.spec(), "kinematics": "0" * 16})
    with pytest.raises(EmbodimentError, match="unknown kind"):
        catalog.from_spec({"kind": "plant"})


def test_one_arm_of_a_robot(pepper):
    robot = Robot(select_sides(pepper, ("right",)))
    assert robot.sides == ("right",)
    assert robot.n_features == 5
    assert robot.landmark_names == ("right_elbow", "right_wrist")
    with pytest.raises(EmbodimentError, match="mirror"):
        robot.mirror(np.zeros(5))


def _description(tmp_path, **changes):
    data = yaml.safe_load(asset("robots", "pepper.yaml").read_text())
    data["urdf"] = str(asset("robots", "pepper.urdf"))
    data.update(changes)
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in data.items() if value is not None}))
    return path


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"arms": None}, "expected the keys"),
        ({"colour": "white"}, "unknown key 'colour'"),
        ({"torso": "tors"}, "did you mean 'torso'"),
        ({"urdf": "nowhere.urdf"}, "no URDF"),
        ({"height": "tall"}, "wrong value"),
        ({"rest": 3}, "wrong value"),
        ({"coupled_limits": [{"joint": "a", "by": "b", "at": [0, 1], "lower": [0], "upper": [1, 2]}]}, "equally many"),
    ],
)
def test_bad_descriptions_say_what_to_do(tmp_path, changes, message):
    with pytest.raises(EmbodimentError, match=message):
        Robot.read(_description(tmp_path, **changes))


def test_bad_arms_are_named(tmp_path):
    arms = yaml.safe_load(asset("robots", "pepper.yaml").read_text())["arms"]
    wrong = [{**arms[0], "joints": ["LShoulderPich", *arms[0]["joints"][1:]]}, arms[1]]
    with pytest.raises(EmbodimentError, match="did you mean 'LShoulderPitch'"):
        Robot.read(_description(tmp_path, arms=wrong))
    with pytest.raises(EmbodimentError, match=r"line \d+: arms: .*'wrist' must be a link, .* got 3"):
        Robot.read(_description(tmp_path, arms=[{**arms[0], "wrist": 3}, arms[1]]))
    reordered = [{**arms[0], "joints": arms[0]["joints"][::-1]}, arms[1]]
    with pytest.raises(EmbodimentError, match="does not come after"):
        Robot.read(_description(tmp_path, arms=reordered))
    with pytest.raises(EmbodimentError, match="left arm has no joint"):
        Robot.read(_description(tmp_path, arms=[{**arms[0], "joints": []}, arms[1]]))
    with pytest.raises(EmbodimentError, match="must have a length"):
        Robot.read(_description(tmp_path, arms=[{**arms[0], "elbow": arms[0]["shoulder"]}, arms[1]]))
    with pytest.raises(EmbodimentError, match=r"one left and/or one right arm, got sides \['left', 'righ'\]"):
        Robot.read(_description(tmp_path, arms=[arms[0], {**arms[1], "side": "righ"}]))


def test_what_is_no_urdf_is_refused(tmp_path):
    path = tmp_path / "no.urdf"
    path.write_text("<html><body>hello</body></html>")
    with pytest.raises(EmbodimentError, match="URDF"):
        Robot.read(_description(tmp_path, urdf=str(path)))
    with pytest.raises(EmbodimentError, match="no robot description"):
        Robot.read(tmp_path / "missing.yaml")


def test_register_and_resolve(tmp_path, pepper, monkeypatch):
    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path))
    assert catalog.resolve(pepper) is pepper
    assert catalog.resolve(_description(tmp_path)) == pepper
    with pytest.raises(EmbodimentError, match="taken"):
        catalog.register("pepper", pepper)
    (tmp_path / "robots").mkdir()
    _description(tmp_path / "robots", name="mine").rename(tmp_path / "robots" / "mine.yaml")
    assert "mine" in catalog.names()
    assert catalog.get("mine").name == "mine"


@pytest.mark.parametrize("side", ["[]", "{a: 1}", "null", "3", "up"])
def test_a_side_that_is_none_is_refused_in_our_words(tmp_path: Path, side: str) -> None:
    text = asset("robots", "pepper.yaml").read_text()
    path = tmp_path / "pepper.yaml"
    path.write_text(re.sub(r"side: \w+", f"side: {side}", text, count=1))
    assert path.read_text() != text
    (tmp_path / "pepper.urdf").write_bytes(asset("robots", "pepper.urdf").read_bytes())
    with pytest.raises(EmbodimentError, match=r"side|arms"):
        Robot.read(path)
