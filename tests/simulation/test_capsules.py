"""The capsule model against Bullet's own distances and against numerical derivatives."""

from __future__ import annotations

import numpy as np
import pybullet as bullet
import pytest

from syda_gym.embodiments import catalog
from syda_gym.simulation.capsules import CapsuleModel, _box_distance, _closest, _golden


@pytest.fixture(scope="module")
def pepper() -> CapsuleModel:
    return CapsuleModel(catalog.get("pepper"))


def poses(robot, count, seed):
    rng = np.random.default_rng(seed)
    return robot.clamp(rng.uniform(robot.lower, robot.upper, (count, len(robot.lower))))


def bullet_clearances(model, frames):
    """Least distance over the same pairs of links, by Bullet."""
    robot = model.robot
    client = bullet.connect(bullet.DIRECT)
    try:
        body = bullet.loadURDF(
            str(robot.urdf),
            useFixedBase=True,
            flags=bullet.URDF_USE_SELF_COLLISION | bullet.URDF_USE_SELF_COLLISION_INCLUDE_PARENT,
            physicsClientId=client,
        )
        joints, links = {}, {bullet.getBodyInfo(body, physicsClientId=client)[0].decode(): -1}
        for i in range(bullet.getNumJoints(body, physicsClientId=client)):
            info = bullet.getJointInfo(body, i, physicsClientId=client)
            joints[info[1].decode()], links[info[12].decode()] = i, i
        for name, angle in robot.description.rest.items():
            if name in joints:
                bullet.resetJointState(body, joints[name], angle, physicsClientId=client)
        result = []
        for frame in frames:
            for name, angle in zip(robot.joint_names, frame, strict=True):
                bullet.resetJointState(body, joints[name], angle, physicsClientId=client)
            bullet.performCollisionDetection(physicsClientId=client)
            least = np.inf
            for one, other in set(model.pairs):
                near = bullet.getClosestPoints(body, body, 1.0, links[one], links[other], physicsClientId=client)
                least = min([least, *(point[8] for point in near)])
            result.append(least)
        return np.array(result)
    finally:
        bullet.disconnect(client)


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_distances_agree_with_bullet(name):
    model = CapsuleModel(catalog.get(name))
    frames = poses(model.robot, 150, 1)
    ours, theirs = model.clearance(frames), bullet_clearances(model, frames)
    apart = theirs > 0.0
    gap = np.abs(ours - theirs)
    assert np.median(gap[apart]) < 0.002
    assert np.quantile(gap[apart], 0.95) < 0.012  # corners of the hands, which capsules round off
    agree = (ours > 0.0) == apart
    assert agree.mean() >= 0.97
    assert gap[~agree].max(initial=0.0) < 0.02


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_the_gradient_is_the_derivative_of_the_clearance(name):
    model = CapsuleModel(catalog.get(name))
    frames = poses(model.robot, 60, 2)
    nearest = model.nearest(frames)
    assert np.allclose(nearest.distance, model.clearance(frames))
    step = 1e-6
    numeric = np.stack(
        [
            (model.clearance(frames + step * unit) - model.clearance(frames - step * unit)) / (2 * step)
            for unit in np.eye(frames.shape[1])
        ],
        axis=1,
    )
    error = np.abs(numeric - nearest.gradient).max(axis=1)
    assert np.quantile(error, 0.9) < 1e-6  # the rest sits where the nearest pair changes


def test_the_nearest_few_pairs_are_those_of_the_least_distances_with_their_own_gradients(pepper):
    frames = poses(pepper.robot, 40, 4)
    found, step = pepper.nearest_pairs(frames, 3), 1e-6
    distances = pepper.distances(frames)
    assert np.allclose(found.distance, np.sort(distances, axis=1)[:, :3])
    assert np.array_equal(found.gradient[:, 0], pepper.nearest(frames).gradient)
    numeric = np.empty_like(found.gradient)
    for joint in range(frames.shape[1]):
        moved = frames.copy()
        moved[:, joint] += step
        change = (pepper.distances(moved) - distances) / step
        numeric[:, :, joint] = np.take_along_axis(change, found.pair, axis=1)
    assert np.quantile(np.abs(numeric - found.gradient).max(axis=2), 0.9) < 1e-4


def test_rest_is_free_and_the_zero_pose_with_crossed_arms_is_not(pepper):
    robot = pepper.robot
    assert pepper.clearance(robot.rest)[0] > 0.0
    crossed = robot.rest.copy()
    for side, sign in (("L", 1.0), ("R", -1.0)):
        names = robot.joint_names
        crossed[names.index(f"{side}ShoulderPitch")] = 0.8
        crossed[names.index(f"{side}ShoulderRoll")] = 0.02 * sign
        crossed[names.index(f"{side}ElbowYaw")] = -0.2 * sign
        crossed[names.index(f"{side}ElbowRoll")] = -1.4 * sign
    assert pepper.clearance(robot.clamp(crossed))[0] < 0.0


def test_a_pose_and_its_mirror_image_are_equally_clear(pepper):
    frames = poses(pepper.robot, 40, 3)
    assert np.allclose(pepper.clearance(frames), pepper.clearance(pepper.robot.mirror(frames)), atol=1e-6)


def test_segment_distances_match_a_dense_search():
    rng = np.random.default_rng(0)
    p, d, q, e = (rng.normal(size=(50, 3)) for _ in range(4))
    d[0], e[1] = 0.0, 0.0  # points
    e[2] = 2.0 * d[2]  # parallel
    s, t = _closest(p, d, q, e)
    found = np.linalg.norm(p + s[:, None] * d - q - t[:, None] * e, axis=1)
    grid = np.linspace(0, 1, 201)
    a = p[:, None] + grid[None, :, None] * d[:, None]
    b = q[:, None] + grid[None, :, None] * e[:, None]
    dense = np.linalg.norm(a[:, :, None] - b[:, None], axis=-1).min(axis=(1, 2))
    assert (found <= dense + 1e-9).all()
    assert np.allclose(found, dense, atol=0.02)


def test_distance_to_a_box_is_the_known_one_and_golden_sections_find_its_minimum():
    half = np.array([1.0, 2.0, 3.0])
    points = np.array([[2.0, 0, 0], [2.0, 3.0, 0], [0, 0, 0], [0.9, 0, 0]])
    assert np.allclose(_box_distance(points, half), [1.0, np.sqrt(2), -1.0, -0.1])
    at = _golden(lambda t: (t - np.array([0.3, 0.0, 1.0])) ** 2, (3,))
    assert np.allclose(at, [0.3, 0.0, 1.0], atol=1e-3)
