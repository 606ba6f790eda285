"""The limb solver: within limits always, as near as a general optimiser, in time order without jumps."""

from __future__ import annotations

import functools
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import CoupledLimit, Robot
from syda_gym.errors import EmbodimentError

SEEDS = st.integers(0, 2**32 - 1)
FPS = 30.0


@functools.cache
def known(name):
    return catalog.get(name)


def reachable(robot, seed, count=20):
    q = robot.clamp(np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, robot.n_features)))
    return q, np.diff(robot.arm_points(q), axis=2)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def angles(robot, frames, directions):
    """Degrees between limbs and wanted directions ``(N, arms, 2)``."""
    found, wanted = unit(np.diff(robot.arm_points(frames), axis=2)), unit(directions)
    across = np.linalg.norm(np.cross(found, wanted), axis=-1)
    return np.degrees(np.arctan2(across, (found * wanted).sum(axis=-1)))


def wandering(seed, count, arms=2, speed=1.0, calm=1.0):
    """Limb directions that turn smoothly, ``(count, arms, 2, 3)``; the calmer, the nearer to forward and down."""
    rng = np.random.default_rng(seed)
    times = np.arange(count)[:, None, None, None] / FPS
    waves = [
        rng.normal(size=(1, arms, 2, 3)) * np.sin(speed * rng.uniform(0.5, 3.0) * times + rng.uniform(0, 6))
        for _ in range(3)
    ]
    return unit(sum(waves) + calm * np.array([0.6, 0.0, -0.8]))


@pytest.fixture(scope="module")
def wide(tmp_path_factory):
    """Seven joints per arm with nearly a whole turn each, elbow yaw in the upper arm, 2 rad/s."""
    path = tmp_path_factory.mktemp("wide") / "wide.urdf"
    path.write_text(wide_urdf())
    return Robot(discover(path))


@pytest.fixture(scope="module")
def clavicle(tmp_path_factory):
    """A joint before the shoulder, so that five joints point two limbs."""
    path = tmp_path_factory.mktemp("clavicle") / "clavicle.urdf"
    path.write_text(wide_urdf(clavicle=True))
    return Robot(discover(path))


def wide_urdf(clavicle=False):
    inertia = (
        '<inertial><mass value="0.5"/><inertia ixx=".001" iyy=".001" izz=".001" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    parts = [f'<robot name="wide"><link name="torso">{inertia}</link>']
    for side, sign in (("left", 1), ("right", -1)):
        joints = [("shoulder_pitch", "0 1 0", f"0 {0.2 * sign} 0.4"), ("shoulder_roll", "1 0 0", "0 0 0")]
        if clavicle:
            joints.insert(0, ("clavicle_yaw", "0 0 1", f"0 {0.05 * sign} 0.4"))
            joints[1] = ("shoulder_pitch", "0 1 0", f"0 {0.15 * sign} 0")
        joints += [
            ("shoulder_yaw", "0 0 1", "0 0 0"),
            ("elbow_pitch", "0 1 0", "0 0 -0.28"),
            ("forearm_yaw", "0 0 1", "0 0 0"),
            ("wrist_roll", "1 0 0", "0 0 -0.25"),
            ("wrist_pitch", "0 1 0", "0 0 0"),
        ]
        parent = "torso"
        for name, axis, place in joints:
            limit = 0.5 if "clavicle" in name else 2.97
            link = f"{side}_{name}_link"
            parts.append(
                f'<link name="{link}">{inertia}</link><joint name="{side}_{name}" type="revolute">'
                f'<origin xyz="{place}"/><parent link="{parent}"/><child link="{link}"/><axis xyz="{axis}"/>'
                f'<limit lower="-{limit}" upper="{limit}" effort="20" velocity="2.0"/></joint>'
            )
            parent = link
    return "".join([*parts, "</robot>"])


@pytest.mark.parametrize("name", ["pepper", "nao"])
@settings(max_examples=25, deadline=None)
@given(seed=SEEDS)
def test_reachable_directions_are_met_exactly(name, seed):
    robot = known(name)
    q, directions = reachable(robot, seed)
    solved = LimbIK.of(robot).solve(directions * 3.7)  # length does not matter
    np.testing.assert_allclose(robot.landmarks(solved), robot.landmarks(q), atol=1e-7)
    assert not robot.violations(solved).any()


@pytest.mark.parametrize("name", ["pepper", "nao"])
@settings(max_examples=4, deadline=None)
@given(seed=SEEDS)
def test_any_direction_is_met_nearly_as_well_as_a_general_optimiser_does(name, seed):
    """Most targets are out of reach; a local optimum may cost something now and then, never much."""
    robot = known(name)
    directions = unit(np.random.default_rng(seed).normal(size=(1, 2, 2, 3)))
    solved = LimbIK.of(robot).solve(directions)
    assert not robot.violations(solved).any()
    ours = angles(robot, solved, directions).mean(axis=2)
    for row, wanted in enumerate(directions):
        for arm, part in enumerate(robot.arm_slices):
            ours[row, arm] -= optimum(robot, arm, part, wanted[arm], seed)
    assert ours.max() < 4.0


def optimum(robot, arm, part, wanted, seed):
    """The least mean angle [deg] of one arm that L-BFGS-B finds from four starts; governed joints are clamped."""

    def cost(x):
        q = robot.rest.copy()
        q[part] = x
        inside = np.array(robot.clamp_one(q.tolist()))[None, part]
        found = unit(np.diff(robot.chains[arm].points(inside)[0, :3], axis=0))
        gap = np.linalg.norm(found - wanted, axis=-1)
        return np.sqrt((2.0 * np.arcsin(np.clip(gap / 2.0, 0.0, 1.0))) ** 2 + 1e-4).mean()

    lower, upper = robot.lower[part], robot.upper[part]
    starts = np.random.default_rng(seed).uniform(lower, upper, (4, len(lower)))
    best = min(minimize(cost, start, bounds=list(zip(lower, upper, strict=True))).fun for start in starts)
    return np.degrees(best)


@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_mirrored_directions_give_mirrored_poses(seed):
    pepper = known("pepper")
    _, directions = reachable(pepper, seed, 5)
    ik = LimbIK.of(pepper)
    mirrored = directions[:, ::-1] * np.array([1.0, -1.0, 1.0])
    np.testing.assert_allclose(
        pepper.landmarks(ik.solve(mirrored)), pepper.landmarks(pepper.mirror(ik.solve(directions))), atol=1e-6
    )


@pytest.mark.parametrize("name", ["pepper", "nao", "wide", "clavicle"])
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS)
def test_sequences_keep_limits_and_speeds_whatever_comes(name, seed, wide, clavicle):
    robot = {"wide": wide, "clavicle": clavicle}.get(name) or known(name)
    rng = np.random.default_rng(seed)
    directions = np.concatenate([wandering(seed, 30), rng.normal(size=(20, 2, 2, 3))])
    dt = rng.uniform(0.005, 0.1, len(directions))
    path = LimbIK.of(robot).follow(directions[None], LimbIK.of(robot).begin(), dt[None])[0][0]
    assert not robot.violations(path, 0.0).any()
    assert (np.abs(np.diff(path, axis=0)) <= robot.speed * dt[1:, None]).all()


def test_batches_equal_single_frames_and_single_sequences_bit_for_bit():
    ik = LimbIK.of(known("pepper"))
    directions = np.random.default_rng(3).normal(size=(60, 2, 2, 3))
    together = ik.solve(directions)
    assert np.array_equal(together, np.concatenate([ik.solve(one[None]) for one in directions]))
    clips = np.stack([wandering(seed, 40, speed=3.0) for seed in range(5)])
    batch, state = ik.follow(clips, ik.begin(5), 1 / FPS)
    for clip, expected, numbers in zip(clips, batch, state.numbers, strict=True):
        own, rows = ik.begin(), []
        for frame in clip:
            found, own = ik.follow(frame[None, None], own, 1 / FPS)
            rows.append(found[0, 0])
        assert np.array_equal(rows, expected)
        assert np.array_equal(own.numbers[0], numbers)
        assert np.array_equal(ik.sequence(clip, FPS), expected)


def test_a_state_is_a_value():
    ik = LimbIK.of(known("pepper"))
    clip = wandering(0, 10)
    _, state = ik.follow(clip[None], ik.begin(), 1 / FPS)
    before = state.numbers.copy()
    first = ik.follow(clip[None, ::-1], state, 1 / FPS)[0]
    assert np.array_equal(state.numbers, before)
    assert np.array_equal(ik.follow(clip[None, ::-1], state, 1 / FPS)[0], first)


@pytest.mark.parametrize("name", ["wide", "clavicle"])
def test_arms_with_many_joints_follow_what_they_can_reach(name, wide, clavicle):
    robot = {"wide": wide, "clavicle": clavicle}[name]
    errors = []
    for seed in range(4):
        directions = wandering(seed, 150, speed=0.4, calm=3.0)
        ik = LimbIK.of(robot)
        path = ik.follow(directions[None], ik.begin(), 1 / FPS, limited=False)[0][0]
        errors.append(angles(robot, path, directions).mean())
    assert np.mean(errors) < 2.0


def test_a_joint_before_the_shoulder_helps(clavicle):
    """A pose that needs the clavicle is met by a single frame too; the elbow does not stay at rest."""
    _, directions = reachable(clavicle, 0, 30)
    assert angles(clavicle, LimbIK.of(clavicle).solve(directions), directions).mean() < 0.5


def test_a_slow_motion_gives_a_smooth_path(wide):
    directions = wandering(5, 300, speed=0.2, calm=3.0)
    ik = LimbIK.of(wide)
    path = ik.follow(directions[None], ik.begin(), 1 / FPS, limited=False)[0][0]
    turned = np.degrees(np.arccos(np.clip((directions[1:] * directions[:-1]).sum(-1), -1, 1))).max(axis=(1, 2))
    jumps = (np.degrees(np.abs(np.diff(path, axis=0))).max(axis=1) > 30.0) & (turned < 15.0)
    assert jumps.sum() == 0


@pytest.mark.parametrize("limbs", [((1, 0.1, -0.1), (1, 0, 0)), ((0, 0.1, -1), (0.1, 0.05, -1))])
def test_the_yaw_of_a_straight_elbow_holds_still_under_noise(limbs):
    pepper = known("pepper")
    rng, points = np.random.default_rng(0), np.zeros((600, 2, 3, 3))
    for side, sign in enumerate((1.0, -1.0)):
        for limb, length in ((0, 0.28), (1, 0.25)):
            along = unit(np.array(limbs[limb]) * (1.0, sign, 1.0))
            points[:, side, limb + 1] = points[:, side, limb] + length * along
    points += rng.normal(0.0, 0.01, points.shape)
    path = LimbIK.of(pepper).sequence(np.diff(points, axis=2), FPS)
    yaws = [pepper.joint_names.index(name) for name in ("LElbowYaw", "RElbowYaw")]
    assert np.degrees(path[300:, yaws].std(axis=0)).max() < 3.0


def test_an_elbow_that_bends_turns_its_yaw_in_time():
    """From straight to bent by 80 degrees within half a second, in a plane that asks for another yaw."""
    pepper = known("pepper")
    bend = np.radians(np.concatenate([np.full(30, 2.0), np.linspace(2.0, 80.0, 15), np.full(45, 80.0)]))
    upper = np.broadcast_to([0.98, 0.2, 0.0], (90, 3))
    fore = np.stack([0.98 * np.cos(bend), 0.2 * np.cos(bend), np.sin(bend)], axis=1)
    left = np.stack([upper, fore], axis=1)
    directions = np.stack([left, left * [1.0, -1.0, 1.0]], axis=1)
    missed = angles(pepper, LimbIK.of(pepper).sequence(directions, FPS), directions)
    assert missed[-1].max() < 1.0
    assert missed.max() < 75.0  # a straight arm while the yaw turns by 210 degrees
    assert (missed > 15.0).any(axis=(1, 2)).sum() < 25  # frames


def test_another_branch_is_taken_after_a_while_and_within_speeds(wide):
    """The branch of the frame before ends at a limit; the arm goes over to another one instead of staying there."""
    ik = LimbIK.of(wide)
    turn = np.linspace(0.0, 2.0 * np.pi, 240)
    upper = np.stack([np.cos(turn), 0.2 + 0.0 * turn, np.sin(turn)], axis=1)
    fore = np.stack([np.cos(turn + 1.0), 0.2 + 0.0 * turn, np.sin(turn + 1.0)], axis=1)
    directions = np.repeat(np.stack([upper, fore], axis=1)[:, None], 2, axis=1)
    directions = np.concatenate([directions, np.repeat(directions[-1:], 150, axis=0)])
    path = ik.sequence(directions, FPS)
    assert angles(wide, path[-1:], directions[-1:]).max() < 1.0
    assert (np.abs(np.diff(path, axis=0)) <= wide.speed / FPS).all()


def test_wrong_input_is_refused():
    ik = LimbIK.of(known("pepper"))
    with pytest.raises(EmbodimentError, match="expected"):
        ik.solve(np.ones((2, 2, 3)))
    with pytest.raises(EmbodimentError, match="longer than zero"):
        ik.solve(np.zeros((2, 2, 2, 3)))
    with pytest.raises(EmbodimentError, match="finite"):
        ik.solve(np.full((2, 2, 2, 3), np.nan))
    with pytest.raises(EmbodimentError, match=r"expected \(B, T"):
        ik.follow(np.ones((2, 2, 2, 3)), ik.begin())
    with pytest.raises(EmbodimentError, match="state is of 1 sequences"):
        ik.follow(np.ones((2, 1, 2, 2, 3)), ik.begin())
    with pytest.raises(EmbodimentError, match="time between frames"):
        ik.follow(np.ones((1, 1, 2, 2, 3)), ik.begin(), 0.0)


def test_limits_that_exclude_every_answer_are_named():
    pepper = known("pepper")
    impossible = CoupledLimit("LElbowRoll", "LElbowYaw", (-2.0, 2.0), (0.5, 0.5), (1.0, 1.0))
    robot = Robot(replace(pepper.description, coupled_limits=(impossible,)))
    with pytest.raises(EmbodimentError, match=r"LElbowRoll.*leaves no angle"):
        LimbIK(robot)


def test_numba_is_not_imported_before_an_arm_is_solved():
    code = (
        "import sys; from syda_gym.embodiments import catalog; catalog.get('pepper'); assert 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
