"""Tables: arrays over the robots that lie one after the other in memory which several processes share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Column", "state_of", "table", "width_of"]

_ALIGNED = 64  # bytes


@dataclass(frozen=True)
class Column:
    """One array ``(count, *shape)``.

    Attributes:
        dtype: as numpy writes it.
        shape: of a row.
    """

    dtype: str
    shape: tuple[int, ...]

    @classmethod
    def like(cls, array: NDArray[Any]) -> Column:
        """A column for rows like those of an array."""
        return cls(array.dtype.str, array.shape[1:])

    def bytes(self, count: int) -> int:
        """Room for ``count`` rows, up to where the next column begins."""
        size = int(np.dtype(self.dtype).itemsize * np.prod(self.shape, dtype=np.int64)) * count
        return -(-size // _ALIGNED) * _ALIGNED


def width_of(columns: Mapping[str, Column], count: int) -> int:
    """Bytes of a table of ``count`` rows."""
    return sum(column.bytes(count) for column in columns.values())


def table(columns: Mapping[str, Column], count: int, memory: Any) -> dict[str, NDArray[Any]]:
    """The arrays by name; they write into ``memory``, which holds at least ``width_of`` bytes."""
    arrays, at = {}, 0
    for name, column in columns.items():
        shape = (count, *column.shape)
        length = int(np.prod(shape, dtype=np.int64))
        arrays[name] = np.frombuffer(memory, dtype=column.dtype, count=length, offset=at).reshape(shape)
        at += column.bytes(count)
    return arrays


def state_of(fleet: Any, info: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """What a fleet tells after its observation was taken, as flat names; clips and routes are left out.

    Args:
        fleet: a ``Fleet``.
        info: its info.
    """
    told = dict(info)
    terms = told.pop("reward_terms")
    for name in ("motion", "motion_action", "route", "transferability"):
        del told[name]
    return {
        **told,
        **{f"reward_terms.{name}": values for name, values in terms.items()},
        "reward": fleet.reward,
        "terminated": fleet.terminated,
        "truncated": fleet.truncated,
        "watched": fleet.watched(),
    }
