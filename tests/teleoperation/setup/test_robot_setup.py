"""Adding a robot: found, described, drawn, and known by name afterwards."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.files import asset
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.setup.robot_setup import add_robot, describe_robot
from syda_gym.teleoperation.tick import LoopSettings, State, Tick


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A home of its own, and a catalog that forgets what was added."""
    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(catalog, "_makers", dict(catalog._makers))
    catalog._build.cache_clear()
    yield tmp_path / "home"
    catalog._build.cache_clear()


def test_a_urdf_becomes_a_name(home: Path, tmp_path: Path) -> None:
    urdf = Path(shutil.copy(asset("robots", "nao.urdf"), tmp_path / "My Robot.urdf"))
    added = add_robot(urdf)
    assert added.robot.name == "my-robot"
    assert added.description == home / "robots" / "my-robot.yaml"
    assert added.picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert added.pointing_error < np.radians(25)
    nao = catalog.get("nao")
    assert isinstance(nao, Robot)
    assert set(added.robot.joint_names) == set(nao.joint_names)
    assert added.robot.reach == pytest.approx(nao.reach, rel=0.05), "landmarks are found where the maker has them"
    catalog._build.cache_clear()
    assert catalog.get("my-robot") == added.robot, "what was written reads back as the same robot"
    assert yaml.safe_load(added.description.read_text())["urdf"] == str(urdf)


def test_its_rest_pose_hangs_freely(home: Path, tmp_path: Path) -> None:
    urdf = shutil.copy(asset("robots", "pepper.urdf"), tmp_path / "copy.urdf")
    robot = add_robot(urdf, "copy").robot
    directions = np.diff(robot.arm_points(robot.rest), axis=2)[0]
    down = -directions[..., 2] / np.linalg.norm(directions, axis=-1)
    assert (down[:, 0] > 0.6).all(), "upper arms hang"
    assert not SelfCollision(robot, margin=0.0).touches(robot.rest)
    assert not robot.violations(robot.rest).any()


def test_a_new_robot_is_driven_at_once(home: Path, tmp_path: Path) -> None:
    add_robot(shutil.copy(asset("robots", "nao.urdf"), tmp_path / "newcomer.urdf"))
    mapping, notices = choose_mapping("adult", "newcomer")
    assert mapping.method == "geometric"
    assert notices[0] == "no recordings of you with newcomer: unfitted; `syda-gym record` improves it"
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.0, soft_start=0.0, cutoff=0.0))
    person = mapping.source
    points = person.arm_points(person.standing())[0]  # type: ignore[attr-defined]
    points[:, 1] = points[:, 0] + [0.294, 0.0, 0.0]
    points[:, 2] = points[:, 1] + [0.2, 0.0, 0.206]
    frame = person.frames_from_points(points[None])[0]  # type: ignore[attr-defined]
    for index in range(60):
        decision = loop.step(Tick(index / 30, frame))
    assert decision.state is State.FOLLOWING
    reached = np.diff(loop.robot.arm_points(decision.command), axis=2)[0]
    cosine = np.sum(reached * np.diff(points, axis=1), axis=-1) / (
        np.linalg.norm(reached, axis=-1) * np.linalg.norm(np.diff(points, axis=1), axis=-1)
    )
    assert (cosine > 0.95).all(), "its limbs point as the person's"


def test_bad_names_files_and_links_are_named(home: Path, tmp_path: Path) -> None:
    urdf = asset("robots", "nao.urdf")
    with pytest.raises(EmbodimentError, match="the name 'nao' is taken"):
        add_robot(urdf)
    with pytest.raises(OptionError, match="lower-case letters"):
        add_robot(urdf, "../evil")
    with pytest.raises(EmbodimentError, match="no URDF"):
        add_robot(tmp_path / "none.urdf", "x")
    with pytest.raises(EmbodimentError, match="did you mean 'l_wrist'"):
        add_robot(urdf, "x", left="l_wirst")
    (tmp_path / "text.urdf").write_text("hello")
    with pytest.raises(EmbodimentError, match="not a URDF"):
        add_robot(tmp_path / "text.urdf")
    assert not (home / "robots").exists(), "nothing was written"
    add_robot(urdf, "twice")
    with pytest.raises(EmbodimentError, match="--replace"):
        add_robot(urdf, "twice")
    assert add_robot(urdf, "twice", replace_existing=True).robot.name == "twice"


@pytest.mark.parametrize("name", ["baxter", "icub_reduced"])
def test_robots_of_other_makers_hang_their_arms(name: str) -> None:
    from syda_gym.embodiments.discovery.example_robots import example_urdfs
    from syda_gym.errors import MissingExtraError

    try:
        urdf = example_urdfs()[name]
    except MissingExtraError:
        pytest.skip("SKIPPED LOUDLY: needs pip install 'syda-gym[robots]'")
    description, _ = describe_robot(urdf, name)
    robot = Robot(description)
    limbs = np.diff(robot.arm_points(robot.rest), axis=2)[0]
    assert (limbs[..., 2] < 0.0).all()
    check = SelfCollision(robot)
    assert check.available
    assert not check.touches(robot.rest)
