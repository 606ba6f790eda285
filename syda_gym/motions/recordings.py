"""What this user recorded: every data set below one folder, joined into one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import MotionError, SydaError
from syda_gym.files import user_folder
from syda_gym.motions.clip import Motions
from syda_gym.motions.dataset import INDEX, read_dataset
from syda_gym.motions.readers.own.people import doubts

__all__ = ["Recorded", "joined", "new_recording", "recorded", "recordings_folder"]


@dataclass(frozen=True, eq=False)
class Recorded:
    """What was found.

    Attributes:
        motions: all usable takes, ``None`` if there are none.
        folders: the data sets that they are from.
        notices: data sets that were left out, each with the reason, and what is odd about those that were not.
    """

    motions: Motions | None
    folders: tuple[Path, ...] = ()
    notices: tuple[str, ...] = ()


def recordings_folder() -> Path:
    """Where ``syda-gym record`` keeps data sets: ``$SYDA_GYM_HOME/recordings`` or ``~/.syda_gym/recordings``."""
    return user_folder("recordings")


def new_recording(operator: str, robot: str) -> Path:
    """A folder for the next session of a pair, below ``recordings_folder``; not created."""
    number = 1
    while (path := recordings_folder() / f"{operator}-{robot}-{number:02d}").exists():
        number += 1
    return path


def recorded() -> Recorded:
    """Every data set below ``recordings_folder``, joined.

    A data set that cannot be read, that is synthetic, or whose bodies differ from those of an earlier one is left out:
    a live start must not fail because of an old folder.
    """
    kept: list[Motions] = []
    bodies: dict[str, Embodiment] = {}
    notices: list[str] = []
    folders: list[Path] = []
    for index in sorted(recordings_folder().glob(f"*/{INDEX}")):
        try:
            motions = read_dataset(index.parent)
        except SydaError as error:
            notices.append(f"{index.parent} left out: {error}")
            continue
        other = [name for name, body in motions.bodies.items() if bodies.setdefault(name, body) != body]
        if motions.synthetic or other:
            why = (
                "its motions are synthetic" if motions.synthetic else f"its {other[0]!r} differs from an earlier one's"
            )
            notices.append(f"{index.parent} left out: {why}; name it as motions to use it")
            continue
        notices += [f"{index.parent}: {line}" for line in doubts(motions)]
        kept.append(replace(motions, name=index.parent.name))
        folders.append(index.parent)
    return Recorded(joined(kept, "your recordings") if kept else None, tuple(folders), tuple(notices))


def joined(parts: Sequence[Motions], name: str) -> Motions:
    """Several data sets as one.

    Args:
        parts: with equal bodies where they have the same name.
        name: of the whole.

    Returns:
        All takes; where there are several parts, a part's name stands before its recordings, so that none is taken for
        another's.

    Raises:
        MotionError: no part, or bodies of one name that differ.
    """
    if not parts:
        raise MotionError(f"{name}: no data set to join; name at least one")
    if len(parts) == 1:
        return replace(parts[0], name=name)
    bodies: dict[str, Embodiment] = {}
    for part in parts:
        for body_name, body in part.bodies.items():
            if bodies.setdefault(body_name, body) != body:
                raise MotionError(
                    f"{part.name}: its body {body_name!r} differs from that of {parts[0].name}; recordings of "
                    "different people or robots cannot be joined under one name: record or convert with one body"
                )
    takes = [
        replace(take, recording=f"{number}:{part.name}/{take.recording}")
        for number, part in enumerate(parts, start=1)
        for take in part.takes
    ]
    families = {action: family for part in parts for action, family in part.families.items()}
    synthetic = any(part.synthetic for part in parts)
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    return Motions(name, tuple(takes), bodies, families, synthetic, notes)
