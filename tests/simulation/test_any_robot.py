"""The world, its pictures and the environment with robots that PyBullet alone would get wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import syda_gym  # noqa: F401  (registers the environment)
from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover
from syda_gym.embodiments.kinematics.urdf import read_urdf
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError
from syda_gym.simulation import agreement
from syda_gym.simulation.making import make_world
from syda_gym.simulation.pictures.camera import Camera, CameraView
from syda_gym.simulation.plain_body import is_plain, weak_joints
from syda_gym.simulation.rates import Rates

CASES = Path(__file__).parents[1] / "embodiments" / "discovery" / "cases"


def case(name: str) -> Robot:
    return Robot(discover(CASES / f"{name}.urdf"))


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_our_own_robots_are_loaded_as_they_are(name: str) -> None:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    assert is_plain(robot, read_urdf(robot.urdf))


@pytest.mark.parametrize("name", ["massless_tool_frames", "torso_frame_turned", "more_than_128_joints"])
@pytest.mark.parametrize("self_collision", [False, True])
def test_standing_still_stands_still(name: str, self_collision: bool) -> None:
    robot = case(name)
    world = make_world(robot, Rates(30, 240), self_collision=self_collision)
    for _ in range(45):
        world.advance(robot.rest[None])
    seen = world.pose[0, robot.n_features :].reshape(-1, 3)
    np.testing.assert_allclose(seen, robot.landmarks(robot.rest)[0], atol=1e-3)
    world.close()


def test_a_world_that_disagrees_is_refused() -> None:
    robot = case("control")

    class Shifted:
        def reset(self, angles: list[float]) -> None:
            self.angles = angles

        def read(self) -> list[float]:
            points = robot.landmarks(np.array(self.angles))[0] + np.array([0.0, 0.002, 0.0])
            return [*self.angles, *points.ravel().tolist(), *([0.0] * robot.n_features)]

    agreement._agreed.clear()
    with pytest.raises(EmbodimentError, match=r"left_elbow lies 2\.0 mm from where the kinematics has it"):
        agreement.check_agreement(robot, Shifted())


@pytest.mark.parametrize("name", ["torso_frame_turned", "mesh_absent", "elbow_last"])
def test_pictures_show_an_upright_robot(name: str) -> None:
    robot = case(name)
    with Camera(robot, None, CameraView(width=80, height=80, ghost=False, error=False)) as camera:
        shown = camera.picture(robot.rest)
        empty = camera._background
        assert camera._floor < -0.05
    assert shown.std() > 5.0
    assert (shown != empty).any()  # the arms


def test_small_robots_get_small_markers_and_large_ones_room() -> None:
    small, large = catalog.get("nao"), case("arms_stretched_fore_and_aft")
    with (
        Camera(small, None, CameraView(width=32, height=32)) as a,
        Camera(large, None, CameraView(width=32, height=32)) as b,
    ):
        assert a.stage.marker < 0.03 < b.stage.marker
        assert a.stage.distance < 1.5 < b.stage.distance


def test_any_robot_is_an_environment_without_recordings() -> None:
    env = gym.make(
        "SydaTeleop-v0", robot=str(CASES / "massless_tool_frames.urdf"), reference="mapped", actions=["wave_side"]
    )
    env.reset(seed=0)
    errors = [env.step(np.zeros(14, dtype=np.float32))[4]["landmark_error"].mean() for _ in range(40)]
    env.close()
    assert np.mean(errors) < 0.025
    with pytest.warns(UserWarning, match="no recordings of you with control: unfitted"):
        gym.make("SydaTeleop-v0", robot=str(CASES / "control.urdf")).close()


def test_motors_that_gravity_overcomes_are_named(tmp_path: Path) -> None:
    path = tmp_path / "weak.urdf"
    path.write_text((CASES / "control.urdf").read_text().replace('effort="20"', 'effort="2"'))
    names = [joint for joint, needed, effort in weak_joints(Robot(discover(path))) if needed > effort]
    assert "left_shoulder_pitch" in names
    assert weak_joints(case("control")) == []


def test_axes_turn_what_the_world_shows() -> None:
    robot = case("control")
    turned = Robot(replace(robot.description, axes=((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))))
    world = make_world(turned, Rates(30, 240))
    world.reset(np.array([0]), np.zeros((1, 14)))
    np.testing.assert_allclose(world.pose[0, 14:].reshape(-1, 3), turned.landmarks(np.zeros(14))[0], atol=1e-5)
    world.close()
