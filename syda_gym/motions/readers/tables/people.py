"""Several people in one table: one is taken, and the others are mentioned."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.errors import MotionError
from syda_gym.motions.readers.said import Said

__all__ = ["chosen", "one_person"]


def one_person(
    path: Path, identities: Sequence[Any] | NDArray[Any] | None, count: int, said: Said
) -> tuple[NDArray[np.intp], list[str]]:
    """The rows of one person.

    Args:
        path: file, for messages.
        identities: who each row is; ``None`` if there is one person.
        count: rows of the table.
        said: which person is wanted.

    Returns:
        Rows, and notes.

    Raises:
        MotionError: there are fewer people.
    """
    if identities is None:
        if said.person not in (None, 1):
            raise MotionError(f"{path}: person {said.person} is wanted, but there is one person in the file")
        return np.arange(count), []
    values = np.asarray(identities)
    names, first = np.unique(values, return_index=True)
    people = [names[index] for index in np.argsort(first)]
    index, notes = chosen(path, [str(name) for name in people], said)
    return np.flatnonzero(values == people[index]), notes


def chosen(path: Path, people: Sequence[str], said: Said) -> tuple[int, list[str]]:
    """Which of several people is read, and a note if there are others.

    Raises:
        MotionError: there are fewer people than the one who is wanted.
    """
    wanted = said.person or 1
    if wanted > len(people):
        raise MotionError(f"{path}: person {wanted} is wanted, but there are {len(people)} in the file")
    if len(people) == 1:
        return 0, []
    others = ", ".join(f"{number} is {name[:30]}" for number, name in enumerate(people[:6], start=1))
    return wanted - 1, [
        f"{len(people)} people in the file ({others}); person {wanted} was read, --person takes another"
    ]
