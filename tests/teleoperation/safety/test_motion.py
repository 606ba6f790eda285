"""The robot reaches what is free, within every limit, whatever the rhythm of its commands."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.simulation.collision.slide import slide
from syda_gym.teleoperation.safety.detour import Detour
from syda_gym.teleoperation.safety.limiter import CommandLimiter
from syda_gym.teleoperation.safety.motion import Motion
from syda_gym.teleoperation.safety.pace import Pace, braking_speed

DT = 1 / 30


class Arm:
    """A robot's motion and an independent look at each of its commands."""

    def __init__(self, robot: Robot, start: FloatArray | None = None, jerk: float | None = None) -> None:
        self.robot, self.plain = robot, SelfCollision(robot)
        self.limiter, self.collision = CommandLimiter(robot), SelfCollision(robot)
        self.acceleration = self.limiter.speed / 0.2
        most = None if jerk is None else np.full(robot.n_features, jerk)
        begin = robot.rest if start is None else start
        self.motion = Motion(self.limiter, self.collision, DT, self.acceleration, most, begin)
        self.times, self.path = [0.0], [self.motion.command]
        self.motion.begin(0.0, None)
        self.motion.brake()

    def go(self, target: FloatArray, dt: float = DT, factor: float = 1.0) -> FloatArray:
        now = self.times[-1] + dt
        self.motion.begin(now, None)
        if factor > 0.0:
            self.motion.follow(target, factor)
        else:
            self.motion.brake()
        self.collision.measure(self.motion.command)
        self.times.append(now)
        self.path.append(self.motion.command)
        return self.motion.command

    def check(self) -> None:
        path, dt = np.array(self.path), np.diff(self.times)
        assert not self.robot.violations(path, 0.0).any()
        velocity = np.diff(path, axis=0) / dt[:, None]
        assert (np.abs(velocity) <= self.robot.speed * (1 + 1e-9)).all()
        change = np.abs(np.diff(velocity, axis=0)) / (0.5 * (dt[1:] + dt[:-1]))[:, None]
        # After a stall it stands still already, and needs no braking.
        even = np.maximum(dt[1:], dt[:-1]) < 2.0 * DT
        faster = np.abs(velocity[1:]) > np.abs(velocity[:-1])
        assert (change <= self.acceleration * (1 + 1e-6))[even[:, None] | faster].all()
        assert not any(self.plain.touches(pose) for pose in path)


def free_pose(robot: Robot, check: SelfCollision, rng: np.random.Generator) -> FloatArray:
    while True:
        pose: FloatArray = robot.clamp(rng.uniform(robot.lower, robot.upper))[0]
        if not check.touches(pose):
            return pose


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_a_free_target_is_reached_where_a_straight_way_or_one_over_rest_is_free(name: str) -> None:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    rng, reached, bent = np.random.default_rng(4), 0, 0
    check = SelfCollision(robot)
    for _ in range(25):
        start, goal = free_pose(robot, check, rng), free_pose(robot, check, rng)
        straight = check.free_path(start, goal)
        if not straight and not (check.free_path(start, robot.rest) and check.free_path(robot.rest, goal)):
            continue
        arm = Arm(robot, start)
        for _ in range(150):
            if np.abs(arm.go(goal) - goal).max() < 1e-3:
                break
        else:
            pytest.fail(f"{np.abs(arm.path[-1] - goal).max():.2f} rad away")
        arm.check()
        reached, bent = reached + 1, bent + (not straight)
    assert reached > 18


@pytest.mark.parametrize(
    ("name", "number", "steps"),
    [
        ("nao", 106, 25),  # the target lies within the reserve
        ("nao", 371, 25),  # a way to a standstill touched between two looks
        ("nao", 251, 25),  # a slide ran into a joint limit
        ("pepper", 510, 25),  # a coupled limit was missed by rounding
        ("pepper", 644, 135),  # the way back from a corner was walked from corner to corner
    ],
)
def test_pairs_of_poses_that_once_went_wrong(name: str, number: int, steps: int) -> None:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    rng, check = np.random.default_rng([0, number]), SelfCollision(robot)  # as in scripts/study_live_safety.py
    start, goal = free_pose(robot, check, rng), free_pose(robot, check, rng)
    arm = Arm(robot, start)
    for _ in range(steps):
        arm.go(goal)
    arm.check()
    assert np.abs(arm.motion.command - goal).max() < 1e-3


def test_a_detour_is_found_where_the_straight_way_is_barred(pepper: Robot) -> None:
    rng, check, limiter, found = np.random.default_rng(0), SelfCollision(pepper), CommandLimiter(pepper), 0
    for _ in range(80):
        start, goal = free_pose(pepper, check, rng), free_pose(pepper, check, rng)
        if check.free_path(start, goal):
            continue
        detour = Detour(limiter, check, start, goal, pepper.rest, [])
        for _ in range(200):
            detour.work()
        assert detour.over
        if detour.found is None:
            continue
        found += 1
        assert (detour.found[-1] == goal).all()
        assert len(detour.found) > 1
        for one, other in zip([start, *detour.found], detour.found, strict=False):
            assert check.free_path(one, other)
        arm = Arm(pepper, start)
        arm.motion._way, arm.motion._way_goal, arm.motion._goal = list(detour.found), goal, goal
        for _ in range(150):
            if np.abs(arm.go(goal) - goal).max() < 1e-3:
                break
        else:
            pytest.fail("the way that was found leads there")
        arm.check()
    assert found >= 2


def test_the_way_that_it_came_is_a_way_back(pepper: Robot) -> None:
    rng, check, limiter = np.random.default_rng(1), SelfCollision(pepper), CommandLimiter(pepper)
    while True:
        start, corner, goal = (free_pose(pepper, check, rng) for _ in range(3))
        if check.free_path(start, corner) and check.free_path(start, goal) and not check.free_path(corner, goal):
            break
    detour = Detour(limiter, check, corner, goal, goal, [start])
    while not detour.over:
        detour.work()
    assert detour.found is not None


def test_targets_that_jump_at_any_rhythm_break_no_limit(pepper: Robot) -> None:
    rng, arm = np.random.default_rng(1), Arm(pepper)
    goal = pepper.rest
    for index in range(600):
        if index % 9 == 0:
            goal = pepper.clamp(rng.uniform(pepper.lower, pepper.upper))[0]
        dt = float(rng.choice([0.002, DT, DT, 0.045, 0.2]))
        arm.go(goal, dt, factor=float(rng.choice([0.0, 0.3, 1.0, 1.0, 1.0])))
    arm.check()


def test_a_moving_target_is_followed_without_lag(pepper: Robot) -> None:
    arm, middle = Arm(pepper), pepper.clamp(pepper.rest + 0.4)[0]
    for _ in range(60):
        arm.go(middle)
    errors = []
    for index in range(120):
        target = middle + 0.3 * np.sin(2 * np.pi * 0.7 * index * DT)
        target = pepper.clamp(target)[0]
        errors.append(np.abs(arm.go(target) - target).max())
    assert np.mean(errors[30:]) < 0.01
    arm.check()


def test_a_jerk_limit_holds_where_nothing_is_in_the_way(pepper: Robot) -> None:
    jerk = 2000.0
    arm, goal = Arm(pepper, jerk=jerk), pepper.clamp(pepper.rest - 0.5)[0]
    arm.motion._collision = None
    for _ in range(90):
        arm.go(goal)
    assert np.abs(arm.path[-1] - goal).max() < 0.02
    third = np.diff(np.array(arm.path), n=3, axis=0) / DT**3
    assert np.abs(third).max() <= jerk * 1.001


def test_braking_is_a_way_that_is_known_to_be_free(pepper: Robot) -> None:
    rng, arm = np.random.default_rng(3), Arm(pepper)
    for _ in range(40):
        goal = pepper.clamp(rng.uniform(pepper.lower, pepper.upper))[0]
        for _ in range(int(rng.integers(4, 20))):
            arm.go(goal)
        for _ in range(11):  # 0.2 s over GENTLE
            arm.go(goal, factor=0.0)
        assert arm.motion.standing
    arm.check()


def test_a_robot_that_is_put_where_it_touches_comes_apart(pepper: Robot) -> None:
    rng, check = np.random.default_rng(5), SelfCollision(pepper)
    for _ in range(200):
        pose = pepper.clamp(rng.uniform(pepper.lower, pepper.upper))[0]
        overlaps = check.overlaps(pose)
        if overlaps and min(overlaps.values()) > -0.01:
            break
    arm = Arm(pepper)
    arm.motion.place(pose)
    before = min(overlaps.values())
    for _ in range(120):
        arm.motion.begin(arm.times[-1] + DT, None)
        arm.motion.follow(pepper.rest, 0.2)
        arm.times.append(arm.times[-1] + DT)
        now = check.overlaps(arm.motion.command)
        assert set(now) <= set(overlaps)
        assert min(now.values(), default=1.0) >= before - 1e-5, "never deeper"
        before = min(now.values(), default=1.0)


def test_speeds_count_by_when_commands_left() -> None:
    pace = Pace(DT, 1)
    for now, left in ((0.0, None), (DT, 0.001), (2 * DT, 2 * DT - 0.001)):  # the second one left late
        pace.begin(now, left)
        pace.end(now, np.full(1, 0.1))
    assert pace.dt == pytest.approx(0.001), "a step lasts as long as the wire is free"
    pace.begin(3 * DT, 2 * DT + 0.001)
    assert pace.velocity == pytest.approx(0.1 / 0.002), "over the time between two sendings"
    pace.begin(60.0, 2 * DT + 0.001)
    assert (pace.velocity == 0.0).all(), "after a stall it stands still"
    assert braking_speed(np.array([0.5]), np.array([10.0]), 0.0) == pytest.approx(np.sqrt(10.0))


def test_sliding_takes_only_away_what_leads_inside() -> None:
    wanted, low, high = np.array([1.0, 1.0]), np.full(2, -2.0), np.full(2, 2.0)
    slid = slide(wanted, low, high, np.array([[0.0, -1.0]]), np.array([-0.25]))
    assert slid == pytest.approx([1.0, 0.25])
    slid = slide(wanted, low, high, np.array([[-1.0, -1.0]]), np.array([0.0]))
    assert slid == pytest.approx([0.0, 0.0], abs=1e-9)
    assert slide(wanted, low, high, np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([1.0, 1.0])) is None
    assert slide(wanted, low, high, np.array([[1.0, 0.0]]), np.array([-1.0])) == pytest.approx(wanted)
