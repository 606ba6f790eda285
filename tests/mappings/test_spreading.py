"""Rows that stand for many: the compiled loop gives the bits of the plain one."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.mappings.spreading import spread_out


def plainly(rows: np.ndarray, count: int) -> np.ndarray:
    if len(rows) > 4000:
        rows = rows[:: -(-len(rows) // 4000)]
    chosen = [int(np.argmin(np.sum((rows - rows.mean(axis=0)) ** 2, axis=1)))]
    distance = np.sum((rows - rows[chosen[0]]) ** 2, axis=1)
    while len(chosen) < min(count, len(rows)) and distance.max() > 1e-12:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.sum((rows - rows[chosen[-1]]) ** 2, axis=1))
    return rows[chosen]


@pytest.mark.parametrize("width", [1, 6, 7, 8, 9, 12, 18, 24])
def test_compiled_and_plain_give_the_same_bits(width: int) -> None:
    rows = np.random.default_rng(width).standard_normal((5000 if width == 12 else 300, width))
    assert np.array_equal(spread_out(rows, 60), plainly(rows, 60))


def test_copies_are_taken_once_and_few_rows_are_all_taken() -> None:
    rows = np.repeat(np.random.default_rng(0).standard_normal((5, 12)), 20, axis=0)
    assert len(spread_out(rows, 60)) == 5
    few = rows[::20]
    assert sorted(map(tuple, spread_out(few, 60))) == sorted(map(tuple, few))
    assert len(spread_out(few, 2)) == 2


def test_every_further_row_is_the_farthest() -> None:
    rows = np.random.default_rng(1).standard_normal((200, 6))
    chosen = spread_out(rows, 20)
    gaps = [np.linalg.norm(chosen[k] - chosen[:k], axis=1).min() for k in range(1, 20)]
    assert gaps == sorted(gaps, reverse=True)
