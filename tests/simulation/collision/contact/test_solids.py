"""Nearest points are the nearest of many, in every degenerate position too."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from syda_gym.simulation.collision.contact.solids import points_of_axes, share_of_axis, to_solid

SHARES = np.linspace(-1.0, 1.0, 401)


def _axes(rng: np.random.Generator, kind: str) -> tuple[np.ndarray[Any, Any], ...]:
    c, d, h, k = rng.normal(size=(4, 3))
    if kind == "parallel":
        k = -0.7 * h
    elif kind == "in one line":
        k, d = 0.5 * h, c + 3.0 * h
    elif kind == "points":
        h = k = np.zeros(3)
    elif kind == "a point":
        h = np.zeros(3)
    elif kind == "the other a point":
        k = np.zeros(3)
    elif kind == "crossing":
        d = c + 0.3 * h - 0.2 * k
    return c, h, d, k


@pytest.mark.parametrize(
    "kind", ["any", "parallel", "in one line", "points", "a point", "the other a point", "crossing"]
)
def test_no_two_points_of_two_axes_are_nearer(kind: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        c, h, d, k = _axes(rng, kind)
        s, t = points_of_axes(*(c - d), *h, *k)
        assert -1.0 <= s <= 1.0
        assert -1.0 <= t <= 1.0
        found = np.linalg.norm(c + s * h - d - t * k)
        ones, others = c + SHARES[:, None] * h, d + SHARES[:, None] * k
        assert found <= np.linalg.norm(ones[:, None] - others[None], axis=-1).min() + 1e-12
        if kind == "crossing":
            assert found < 1e-9


@pytest.mark.parametrize(("box", "through"), itertools.product([True, False], [True, False]))
def test_no_point_of_an_axis_is_nearer_to_a_solid(box: bool, through: bool) -> None:
    rng, size, inside = np.random.default_rng(1), (0.3, 0.2, 0.5), 0

    def distance(point: np.ndarray[Any, Any]) -> float:
        return float(np.linalg.norm(to_solid(box, *size, *point)))

    for _ in range(60):
        c, h = rng.normal(scale=0.2 if through else 1.0, size=3), rng.normal(size=3)
        if rng.random() < 0.2:
            h = np.eye(3)[rng.integers(3)]  # along an edge
        share = share_of_axis(box, *size, *c, *h)
        least = min(distance(c + s * h) for s in SHARES)
        assert -1.0 <= share <= 1.0
        assert distance(c + share * h) <= least + 1e-12
        inside += least == 0.0
    assert (inside > 30) == through


@pytest.mark.parametrize("box", [True, False])
def test_the_nearest_point_of_a_solid_is_on_it(box: bool) -> None:
    rng, size = np.random.default_rng(2), np.array((0.3, 0.2, 0.5))
    for point in rng.normal(scale=0.6, size=(50, 3)):
        way = np.array(to_solid(box, *size, *point))
        on = point + way
        if box:
            assert (np.abs(on) <= size + 1e-12).all()
            spread = rng.uniform(-size, size, (2000, 3))
        else:
            assert np.hypot(*on[:2]) <= size[0] + 1e-12
            assert abs(on[2]) <= size[2] + 1e-12
            turn, out = rng.uniform(0.0, 2.0 * np.pi, 2000), size[0] * np.sqrt(rng.uniform(size=2000))
            spread = np.stack([out * np.cos(turn), out * np.sin(turn), rng.uniform(-0.5, 0.5, 2000)], axis=1)
        assert np.linalg.norm(way) <= np.linalg.norm(spread - point, axis=1).min() + 1e-12
