"""The general presets take whoever comes: other landmark sets, one arm, arms with other joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments import HumanSkeleton, catalog, landmark_error
from syda_gym.embodiments.discovery.arms import discover_robot
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.mappings import fit
from syda_gym.motions.clip import PairedMotions
from syda_gym.motions.loading import load_motions
from tests.mappings.conftest import _directions, human_frames, make_pair
from tests.motions.recordings import json_text as to_json
from tests.motions.recordings import kinect_rows, mediapipe_json, table_lines, write_rows


def spread(pair: PairedMotions) -> float:
    """Error of the constant mean pose [m]."""
    mean = np.repeat(pair.target.mean(axis=0)[None], len(pair), axis=0)
    return float(landmark_error(pair.target_body, mean, pair.target).mean())


def kinect(folder: Path) -> str:
    return str(write_rows(folder / "k.csv", kinect_rows()))


def mediapipe(folder: Path) -> str:
    (folder / "m.json").write_text(to_json(mediapipe_json()))
    return str(folder / "m.json")


def table(folder: Path) -> str:
    (folder / "t.csv").write_text("\n".join(table_lines()) + "\n")
    return str(folder / "t.csv")


@pytest.mark.parametrize("recording", [kinect, mediapipe, table])
@pytest.mark.parametrize("preset", ["general", "accurate"])
def test_humans_with_other_landmark_sets(recording: Callable[[Path], str], preset: str, tmp_path: Path) -> None:
    """Kinect's 25 joints, MediaPipe's 33 landmarks, a table with names of its own; other axes, origins and sizes."""
    motions = load_motions(recording(tmp_path))
    (clip,) = motions.clips(next(iter(motions.bodies)))[:1]
    person, pepper = clip.body, catalog.get("pepper")
    assert isinstance(person, HumanSkeleton)
    assert isinstance(pepper, Robot)
    directions = np.diff(person.arm_points(clip.frames), axis=2)
    actions = np.repeat(["one", "two", "three", "four"], 10)
    pair = PairedMotions(person, pepper, clip.frames, LimbIK(pepper).solve(directions), actions=actions)
    mapping = fit(pair, preset=preset, confidence=False)
    error = landmark_error(pepper, mapping(pair.source), pair.target).mean()
    assert error < 0.5 * spread(pair)
    assert landmark_error(pepper, mapping(pair.source[3])[None], mapping(pair.source[3:5])[:1]).max() < 1e-6
    assert mapping.inverse()(pair.target).shape == pair.source.shape


AXES = {3: "yzz", 4: "yzxy", 6: "yzxyxz", 7: "yzxyxyz"}
"""Turns from shoulder to wrist by the number of joints."""


def limb(prefix: str, y: float, joints: int) -> str:
    """An arm that points forward at zero: upper arm 0.3 m, forearm 0.25 m."""
    elbow, parent, text = 2 if joints == 3 else 3, "base", ""
    for index, axis in enumerate(AXES[joints]):
        place = {0: f"0 {y} 0.4", elbow: "0.3 0 0", elbow + 1: "0.25 0 0"}.get(index, "0 0 0")
        vector = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}[axis]
        text += (
            f'<joint name="{prefix}{index}" type="revolute"><parent link="{parent}"/><child link="{prefix}l{index}"/>'
            f'<origin xyz="{place}"/><axis xyz="{vector}"/><limit lower="-2.2" upper="2.2" velocity="4" effort="9"/>'
            f'</joint><link name="{prefix}l{index}"/>'
        )
        parent = f"{prefix}l{index}"
    if joints <= 4:
        text += (
            f'<joint name="{prefix}tip" type="fixed"><parent link="{parent}"/><child link="{prefix}end"/>'
            f'<origin xyz="0.25 0 0"/></joint><link name="{prefix}end"/>'
        )
    return text


def machine(folder: Path, *arms: str) -> Robot:
    path = folder / "machine.urdf"
    path.write_text(f'<robot name="machine"><link name="base"/>{"".join(arms)}</robot>')
    return discover_robot(path)


def led_by(person: HumanSkeleton, robot: Robot, actions: int = 5, frames: int = 20) -> PairedMotions:
    """A person who mimics a robot's smooth random motions with the arms that both have."""
    rng, time = np.random.default_rng(4), 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, frames))
    poses = robot.clamp(rng.uniform(0.4 * robot.lower, 0.4 * robot.upper, (actions + 1, robot.n_features)))
    target = np.concatenate([poses[0] + time[:, None] * (pose - poses[0]) for pose in poses[1:]])
    limbs = np.diff(robot.arm_points(target), axis=2)
    limbs /= np.linalg.norm(limbs, axis=-1, keepdims=True)
    directions = np.repeat(limbs[:, :1], 2, axis=1) * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])[:, None]
    for index, side in enumerate(robot.sides):
        directions[:, person.sides.index(side)] = limbs[:, index]
    source = human_frames(person, directions)
    labels = np.repeat([f"a{index}" for index in range(actions)], frames)
    return PairedMotions(person, robot, source, target, actions=labels, times=np.tile(np.arange(frames), actions))


@pytest.mark.parametrize("arms", [(3, 3), (4, 4), (6, 6), (7, 7), (0, 7), (4, 0), (7, 4)])
@pytest.mark.parametrize("preset", ["general", "accurate"])
def test_robots_with_other_arms(arms: tuple[int, int], preset: str, tmp_path: Path) -> None:
    """Joints on the left and on the right; 0 is no arm."""
    left, right = arms
    robot = machine(tmp_path, limb("left_", 0.2, left) if left else "", limb("right_", -0.2, right) if right else "")
    assert robot.n_features == left + right
    person = catalog.get("adult")
    assert isinstance(person, HumanSkeleton)
    pair = led_by(person, robot)
    mapping = fit(pair, preset=preset, confidence=False)
    mapped = mapping(pair.source)
    assert not robot.violations(mapped).any()
    assert landmark_error(robot, mapped, pair.target).mean() < 0.5 * spread(pair)
    one_by_one = np.stack([mapping(frame) for frame in pair.source[::17]])
    assert landmark_error(robot, one_by_one, mapped[::17]).max() < 1e-4
    assert mapping.inverse()(pair.target).shape == pair.source.shape


def test_a_chain_through_a_one_armed_robot(tmp_path: Path) -> None:
    robot = machine(tmp_path, limb("left_", 0.2, 7))
    kid, adult = catalog.get("kid"), catalog.get("adult")
    assert isinstance(kid, HumanSkeleton)
    into = fit(led_by(kid, robot), confidence=False)
    chain = fit(make_pair("adult", "kid"), confidence=False) >> into
    directions = _directions(np.random.default_rng(3), 1, 12)[0]
    frames = human_frames(adult, directions)  # type: ignore[arg-type]
    assert chain(frames).shape == (12, 7)
    assert chain.route == ("adult", "kid", "machine")
    alone = np.stack([chain(frame) for frame in frames])
    assert landmark_error(robot, alone, chain(frames)).max() < 1e-4
