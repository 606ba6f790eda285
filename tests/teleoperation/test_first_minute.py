"""Somebody's first minute with the defaults: hanging arms, swapped sides, wrong axes, straight arms."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from syda_gym.cli.main import app
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.mappings.mapping import Mapping
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import Decision, LoopSettings, State, Tick

Limbs = tuple[tuple[float, float, float], tuple[float, float, float]]

# Upper arm and forearm of the left side; x forward, y left, z up.
HANGING: Limbs = ((0.0, 0.1, -1.0), (0.1, 0.05, -1.0))
FORWARD: Limbs = ((1.0, 0.1, -0.1), (1.0, 0.0, 0.0))


@pytest.fixture(scope="module", params=["nothing recorded", "fitted on request"])
def chosen(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Mapping:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SYDA_GYM_HOME", str(tmp_path_factory.mktemp("home")))
        motions = None if request.param == "nothing recorded" else "embedded"
        mapping, notices = choose_mapping("adult", "pepper", motions=motions)
    if motions is None:
        assert any("no recordings of you with pepper: unfitted" in notice for notice in notices)
    return mapping


def frame(limbs: Limbs, noise: FloatArray | float = 0.0, *, unity: bool = False, swapped: bool = False) -> FloatArray:
    """A Kinect frame: x to the person's right, y up, z backward (with ``unity``: forward)."""
    points: list[FloatArray] = []
    for side in (1.0, -1.0):
        upper, fore = (np.array(limb) * (1.0, side, 1.0) / np.linalg.norm(limb) for limb in limbs)
        shoulder = np.array([0.0, 0.18 * side, 1.4])
        points += [shoulder, shoulder + 0.28 * upper, shoulder + 0.28 * upper + 0.25 * fore]
    body = np.array(points[3:] + points[:3] if swapped else points) + noise
    return np.stack([-body[:, 1], body[:, 2], body[:, 0] if unity else -body[:, 0]], axis=1).reshape(-1)


def play(mapping: Mapping, frames: list[FloatArray], axes: str = "kinect") -> tuple[TeleoperationLoop, list[Decision]]:
    loop, decisions = TeleoperationLoop(mapping, LoopSettings(axes=axes)), []
    for index, one in enumerate(frames):
        decisions.append(loop.step(Tick(index / 30.0, one, index / 30.0)))
        loop.settle()
    return loop, decisions


def directions(robot: Robot, pose: FloatArray) -> FloatArray:
    limbs = np.diff(robot.arm_points(pose)[0], axis=1)[:, :2]
    return np.asarray(limbs / np.linalg.norm(limbs, axis=-1, keepdims=True))


def apart(one: FloatArray, other: FloatArray) -> FloatArray:
    """Degrees between limbs."""
    return np.degrees(np.arccos(np.clip((one * other).sum(axis=-1), -1.0, 1.0)))


def test_hanging_arms_get_where_the_mapping_has_them(chosen: Mapping, pepper: Robot) -> None:
    loop, decisions = play(chosen, [frame(HANGING)] * 300)
    assert loop.calibration is not None
    target = chosen(loop.calibration.apply(frame(HANGING)))
    assert not SelfCollision(pepper).touches(target), "the target is free"
    assert apart(directions(pepper, decisions[-1].command), directions(pepper, target)).max() < 2.0


def test_swapped_sides_move_no_arm(chosen: Mapping, pepper: Robot) -> None:
    frames = [frame(HANGING)] * 75 + [frame(FORWARD)] * 60 + [frame(FORWARD, swapped=True)] * 60
    _, decisions = play(chosen, frames)
    before = directions(pepper, decisions[134].command)
    moved = [apart(directions(pepper, decision.command), before).max() for decision in decisions[135:]]
    assert max(moved) < 2.0
    assert all("person: left and right are swapped" in decision.reasons for decision in decisions[135:])


def test_unity_sent_as_kinect_is_refused_and_named_rightly_it_is_followed(chosen: Mapping, pepper: Robot) -> None:
    frames = [frame(HANGING, unity=True)] * 75 + [frame(FORWARD, unity=True)] * 120
    _, decisions = play(chosen, frames)
    arrived = decisions[100:]
    assert any("right --axes?" in reason for decision in arrived for reason in decision.reasons)
    assert not any(decision.frame_used for decision in arrived)
    limbs = directions(pepper, decisions[-1].command)
    assert (limbs[:, 0, 0] > -0.3).all(), "no arm was thrown backward"
    _, decisions = play(chosen, frames, axes="unity")
    assert decisions[-1].state is State.FOLLOWING
    assert (directions(pepper, decisions[-1].command)[:, 0, 0] > 0.8).all(), "both upper arms forward"


def test_straight_arms_with_noise_keep_the_elbow_yaw_still(adult: HumanSkeleton, pepper: Robot) -> None:
    # Unfitted: what was fitted on synthetic people bends a straight arm, so that its yaw means something.
    rng = np.random.default_rng(0)
    frames = [frame(HANGING)] * 75 + [frame(FORWARD, rng.normal(0.0, 0.01, (6, 3))) for _ in range(200)]
    _, decisions = play(unfitted(adult, pepper), frames)
    spread = np.degrees([decision.command for decision in decisions[-120:]]).std(axis=0)
    for name, deviation in zip(pepper.joint_names, spread, strict=True):
        if name.endswith("ElbowYaw"):
            assert deviation < 3.0, name


def test_the_command_says_what_it_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path))
    done = CliRunner().invoke(app, shlex.split("teleop --source udp:0 --sink none --seconds 0.2"))
    assert done.exit_code == 0
    assert "- no recordings of you with pepper: unfitted; `syda-gym record` improves it" in done.output
