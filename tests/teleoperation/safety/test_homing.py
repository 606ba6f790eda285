"""The way home: straight where it is free, else back around the obstacle."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.teleoperation.safety.homing import WayHome
from syda_gym.teleoperation.safety.watchdog import Ease, Watch, Watchdog


class Disc:
    """Two joints; poses within 1 rad of the origin touch."""

    def free_path(self, start: FloatArray, end: FloatArray, step: float = 0.1) -> bool:
        shares = np.linspace(0.0, 1.0, 200)[:, None]
        return bool((np.linalg.norm(start + shares * (end - start), axis=1) > 1.0).all())


REST = np.array([2.0, 0.0])


def walk_home(home: WayHome, pose: FloatArray, ticks: int = 3000) -> FloatArray:
    """A robot that moves at most 0.05 rad a tick and stands still at the disc."""
    moved = True
    path = [pose]
    for tick in range(ticks):
        goal = home.target(pose, tick / 30, moved)
        step = pose + np.clip(goal - pose, -0.05, 0.05)
        moved = Disc().free_path(pose, step)
        pose = step if moved else pose
        path.append(pose)
    return np.array(path)


def way_out() -> list[FloatArray]:
    return [2.0 * np.array([np.cos(a), np.sin(a)]) for a in np.linspace(0.0, np.pi, 120)]


def test_it_goes_back_around_what_bars_the_straight_way() -> None:
    home = WayHome(REST, np.ones(2), Disc())  # type: ignore[arg-type]
    for pose in way_out():
        home.remember(pose)
    path = walk_home(home, np.array([-2.0, 0.0]))
    assert np.abs(path[-1] - REST).max() < 1e-3
    assert (np.linalg.norm(path, axis=1) > 1.0).all()
    turned = path[np.argmax(path[:, 0] > 0.0)]
    assert turned[1] < 2.0, "it leaves the old way as soon as the straight one is free"


def test_without_a_memory_it_stays_before_the_obstacle() -> None:
    path = walk_home(WayHome(REST, np.ones(2), Disc()), np.array([-2.0, 0.0]))  # type: ignore[arg-type]
    assert path[-1][0] < -0.9


def test_where_nothing_is_in_the_way_it_goes_straight() -> None:
    home = WayHome(REST, np.ones(2), None)
    for pose in way_out():
        home.remember(pose)
    path = walk_home(home, np.array([2.0, 1.5]), 300)
    assert np.abs(path[-1] - REST).max() < 1e-3
    assert np.abs(path[:, 0] - 2.0).max() < 1e-9


def test_easing_keeps_its_speed_and_ends_gently() -> None:
    ease = Ease(np.zeros(3), np.array([1.0, -0.5, 0.0]), np.full(3, 0.5), 10.0)
    times = np.linspace(9.0, 10.5 + ease.duration, 400)
    path = np.array([ease.at(time) for time in times])
    speed = np.abs(np.gradient(path, times, axis=0))
    assert speed.max() == pytest.approx(0.5, rel=0.02)
    assert speed[-1].max() < 1e-6
    assert (path[0] == 0.0).all()
    assert np.abs(path[-1] - [1.0, -0.5, 0.0]).max() < 1e-12


def test_the_watchdog_holds_then_eases() -> None:
    dog = Watchdog(silence=0.25, hold=1.0)
    assert dog.verdict(0.0) is Watch.EASE, "never fed"
    dog.feed(5.0)
    assert [dog.verdict(time) for time in (5.2, 5.3, 6.2, 6.3)] == [Watch.FOLLOW, Watch.HOLD, Watch.HOLD, Watch.EASE]
