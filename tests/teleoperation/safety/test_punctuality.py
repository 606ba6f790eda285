"""Late commands look like braking: the speed at which they do no harm, and what the wire sees of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.teleoperation.safety.limiter import CommandLimiter
from syda_gym.teleoperation.safety.motion import Motion
from syda_gym.teleoperation.safety.punctuality import GENTLE, SPACING, Punctuality

DT = 1 / 30


def fed(late: list[float], known: bool = True, begin: float = 10.0) -> Punctuality:
    found = Punctuality(DT)
    found.saw(0.0, DT, late[0], known)
    for index, one in enumerate(late):
        found.saw(begin + index * DT, DT, one, known)
    return found


def test_who_was_never_late_may_be_as_fast_as_it_likes() -> None:
    assert fed([0.0] * 20).seconds == math.inf
    assert fed([0.0] * 20, known=False, begin=0.0).seconds == math.inf
    assert fed([0.0015] * 20).seconds == math.inf, "what every command is late changes no interval"
    assert fed([0.0015] * 20).least == pytest.approx(0.0015)
    assert fed([0.0015] * 20 + [0.0002] + [0.005] * 20).least == pytest.approx(0.0002), "what was so for a moment only"


def test_at_the_beginning_nobody_knows() -> None:
    careful = fed([0.0] * 20, begin=0.1)
    assert careful.seconds < 3.0 * DT


def test_the_later_the_slower_down_to_a_speed_that_no_lateness_harms() -> None:
    speeds = [fed([0.0] * 20 + [late]).seconds for late in (0.001, 0.004, 0.016, 0.1, 10.0)]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[-1] == speeds[-2]
    assert 2.2 * DT < speeds[-1] < 2.3 * DT
    # By brute force: a joint that brakes already and is kept waiting for any time.
    most, velocity, late = 1.0, speeds[-1], np.linspace(1e-6, 2.0, 100_000)
    planned = velocity - GENTLE * most * DT
    seen = planned * DT / (DT + late)
    assert ((velocity - seen) / (DT + 0.5 * late) <= most * (1 + 1e-9)).all()
    steady = velocity * DT / (DT + late)
    assert ((velocity - steady) / (DT + 0.5 * late) <= most * (1 + 1e-9)).all()


def recovery(hiccups: list[float]) -> float:
    """How long after the last of the late commands the robot is fast again [s]."""
    found, last = Punctuality(DT), max(hiccups)
    late = {round(at / DT) for at in hiccups}
    for step in range(round((last + 120.0) / DT)):
        found.saw(step * DT, DT, 0.02 if step in late else 0.0, True)
        if step * DT > last and found.seconds == math.inf:
            return step * DT - last
    return math.inf


def test_one_hiccup_is_soon_forgiven_and_a_busy_machine_is_remembered() -> None:
    assert 4.5 < recovery([20.0]) < 5.5
    assert 9.5 < recovery([20.0, 26.0]) < 10.5, "the second time it is slow for longer"
    assert 4.5 < recovery([20.0, 90.0]) < 5.5, "what was more than a minute ago says nothing"
    assert 35.0 < recovery([20.0 + 3.0 * index for index in range(20)]) < 41.0


def test_an_emergency_stop_out_of_turn_makes_nobody_slow(pepper: Robot) -> None:
    limiter = CommandLimiter(pepper)
    motion = Motion(limiter, None, DT, limiter.speed / 0.2, None, pepper.rest)
    goal, now, late, allowed = 0.5 * (pepper.lower + pepper.upper), 0.0, 0.0, list[float]()
    for step in range(400):
        hasty = step == 200
        last, now = now, now + (0.001 if hasty else DT)
        motion.begin(now, last + late + 0.0005, last + late)
        late = 0.004 if step % 7 == 0 else 0.0
        if hasty:
            motion.freeze()
        else:
            motion.follow(goal if step % 60 < 30 else pepper.rest, 1.0)
        allowed.append(motion._pace.punctuality.seconds)
    assert min(allowed[210:]) > 0.5 * min(allowed[150:200]), "as late as before is as fast as before"


def wire(robot: Robot, rng: np.random.Generator, rate: float, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times of arrival and poses of a loop that is late, stalls, and sends at any moment within its brackets."""
    limiter = CommandLimiter(robot)
    acceleration, period = limiter.speed / 0.2, 1.0 / rate
    motion = Motion(limiter, None, period, acceleration, None, robot.rest)
    clock, left, leaving, times, path = 0.0, None, None, list[float](), list[FloatArray]()
    goal, decides = robot.rest, 0.0
    for index in range(count):
        wait = max(SPACING, rng.exponential(0.5) + 0.5) * period
        clock = (clock if left is None else left + wait) + rng.exponential(2e-4)
        clock += float(rng.choice([0.0, rng.uniform(0.0, 0.01), rng.choice([0.02, 0.1, 1.0])], p=[0.94, 0.04, 0.02]))
        motion.begin(clock, left, leaving)
        if index % 15 == 0:
            goal = robot.clamp(rng.uniform(robot.lower, robot.upper))[0]
        motion.follow(goal, 1.0)
        if index % 25 == 0:  # for a while every decision takes longer; that must not be counted on
            decides = float(rng.choice([8e-4, 3e-3, 6e-3]))
        took = decides + rng.uniform(0.0, 1e-3)
        took += float(rng.choice([0.0, rng.uniform(0.0, 0.01), rng.choice([0.02, 0.1])], p=[0.94, 0.04, 0.02]))
        leaving = clock + took
        clock = left = leaving + rng.uniform(5e-5, 1.2e-4)
        times.append(rng.uniform(leaving, left))
        path.append(motion.command)
    return np.array(times), np.array(path), acceleration


@pytest.mark.parametrize("rate", [30.0, 60.0])
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_accelerations_hold_on_a_wire_that_is_late(pepper: Robot, rate: float, seed: int) -> None:
    times, path, most = wire(pepper, np.random.default_rng(seed), rate, 1500)
    dt = np.diff(times)
    velocity = np.diff(path, axis=0) / dt[:, None]
    change = np.abs(np.diff(velocity, axis=0)) / (0.5 * (dt[1:] + dt[:-1]))[:, None]
    first = int(np.searchsorted(times, 2.0))  # it has to be late once to be known as late
    assert (np.abs(velocity) <= pepper.speed * (1 + 1e-9)).all()
    # Turning round after a stall included: 1.17 where the stand between the two steps was taken for the wire's view.
    assert (change[first:] <= 1.01 * most).all()
    assert np.abs(np.diff(path, axis=0)).sum() > 20.0, "it does move"
