"""Films as motions: every picture goes through the pose model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions
from syda_gym.motions.film.landmarks import JOINTS, VISIBLE
from syda_gym.motions.film.pictures import FilmPictures
from syda_gym.motions.film.pose_model import PoseModel, find_model
from syda_gym.motions.readers.skeleton import Recording, motions_from
from syda_gym.motions.readers.times import Stamps

__all__ = ["ENDINGS", "is_film", "read_film"]

ENDINGS = (".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v")
_EARS = (7, 8)
_LEAST_SEEN = 0.3  # share of the pictures; what the other readers ask for too


def is_film(path: Path) -> bool:
    """Whether a path ends like a film."""
    return path.suffix.lower() in ENDINGS and path.is_file()


def read_film(path: str | Path, model: str | Path | None = None) -> Motions:
    """Reads the motion of the person in a film.

    Args:
        path: of the film.
        model: the pose model's file; ``None`` for the default place, see ``find_model``.

    Returns:
        Motions of one human, ``"operator"``; landmarks of visibility below 0.5, and pictures without a person, are
        gaps, filled and flagged as ``skeleton.motions_from`` says.

    Raises:
        MissingExtraError: the extra ``camera`` is not installed.
        MotionError: no such film or model, nobody is seen in the film, or neither arm.
    """
    file = Path(path)
    film = FilmPictures(file)
    rows, times = [], []
    found = 0
    try:
        with PoseModel(find_model(model)) as see:
            while (shot := film.read()) is not None and shot.time is not None:
                pose = see(shot.picture, shot.time)
                table = np.full((33, 3), np.nan)
                if pose is not None:
                    found += 1
                    table = np.where(pose.visibility[:, None] >= VISIBLE, pose.world, np.nan)
                rows.append(table)
                times.append(shot.time)
    finally:
        film.close()
    if not rows:
        raise MotionError(f"{file}: no picture could be read; is the file complete?")
    if not found:
        raise MotionError(f"{file}: no person was found in any of {len(rows)} pictures; film one person, arms in view")
    positions = np.stack(rows)
    joints = {name: positions[:, index] for name, index in JOINTS.items()}
    joints["Head"] = positions[:, _EARS].mean(axis=1)
    notes = _without_hidden_arm(joints)
    notes += [f"a person is seen in {found} of {len(rows)} pictures"]
    return motions_from(
        Recording(
            file,
            "film",
            joints,
            stamps=Stamps(np.array(times), "s", "time of the film"),
            up=(0.0, -1.0, 0.0),
            names=tuple(JOINTS),
            notes=notes,
        )
    )


def _without_hidden_arm(joints: dict[str, FloatArray]) -> list[str]:
    """Takes an arm out that is hardly ever seen, if the other one is there; returns what to note."""
    seen = {
        side: min(float(np.isfinite(joints[side + part][:, 0]).mean()) for part in ("Elbow", "Hand")) for side in "LR"
    }
    if min(seen.values()) >= _LEAST_SEEN or max(seen.values()) < _LEAST_SEEN:
        return []
    side = min(seen, key=lambda name: seen[name])
    for part in ("Shoulder", "Elbow", "Hand"):
        del joints[side + part]
    name = {"L": "left", "R": "right"}[side]
    return [f"the {name} arm is seen in {100 * seen[side]:.0f} % of the pictures only and is left out"]
