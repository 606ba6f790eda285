"""Robots whose elbows and wrists are led to a person's positions."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.plan import FPS
from syda_gym.routes.dry_run.positions import Pace, by_positions, led_by_positions
from syda_gym.routes.dry_run.rehearsal import Rehearsal


@pytest.fixture(scope="module")
def wanted() -> np.ndarray:
    clips = default_plan().clips[:3]
    frames = min(len(clip) for clip in clips)
    return np.stack([clip[:frames, 0] for clip in clips])


def missed(robot: Robot, angles: np.ndarray, wanted: np.ndarray) -> float:
    """Mean distance of the wrist from where the person's is, in arm lengths."""
    points = robot.chains[0].points(angles.reshape(-1, angles.shape[-1]))
    wrist = (points[:, 2] - points[:, 0]) / robot.arm_lengths[0].sum()
    goal = (0.506 * wanted[:, :, 0] + 0.494 * wanted[:, :, 1]).reshape(-1, 3)
    return float(np.linalg.norm(wrist - goal, axis=-1).mean())


def test_a_hasty_robot_comes_nearer_than_a_lazy_one_and_both_keep_their_limits(wanted: np.ndarray) -> None:
    nao = catalog.get("nao")
    assert isinstance(nao, Robot)
    hasty, lazy = (led_by_positions(nao, 0, wanted, (0.6, 1.0), 1e-2, pace) for pace in (Pace(), Pace(0.5, 0.5, 1)))
    assert missed(nao, hasty, wanted) < missed(nao, lazy, wanted) < 0.5
    chain, speed = nao.chains[0], np.minimum(nao.speed[nao.arm_slices[0]], 20.0)
    for angles, share in ((hasty, 1.0), (lazy, 0.5)):
        assert (np.abs(np.diff(angles, axis=1)) * FPS <= share * speed + 1e-6).all()
        assert ((chain.lower <= angles) & (angles <= chain.upper)).all()


def test_directions_are_unit_vectors_of_what_is_reached(wanted: np.ndarray) -> None:
    pepper = catalog.get("pepper")
    assert isinstance(pepper, Robot)
    reached = by_positions(pepper, 0, wanted)
    assert reached.shape == wanted.shape
    np.testing.assert_allclose(np.linalg.norm(reached, axis=-1), 1.0, atol=1e-9)
    assert np.median(np.degrees(np.arccos(np.clip((reached * wanted).sum(-1), -1, 1)))) < 35.0


def test_nobody_knows_how_robots_will_be_led_so_both_ways_count_alike() -> None:
    bodies = {name: catalog.get(name) for name in ("adult", "pepper")}
    either, limbs, positions = (
        Rehearsal(bodies, default_plan(), retargeter=way) for way in ("either", "limbs", "positions")
    )
    route = ("adult", "pepper")
    np.testing.assert_array_equal(either.error(route), np.concatenate([limbs.error(route), positions.error(route)]))
    assert len(either.actions) == len(either.error(route))
    assert either.score(route).error == pytest.approx(0.5 * (limbs.score(route).error + positions.score(route).error))
    with pytest.raises(OptionError, match="did you mean 'positions'"):
        Rehearsal(bodies, default_plan(), retargeter="position")
