"""The paper's workbooks: one ``.xlsx`` a recording, one sheet a joint, every file its own mirror image.

The recordings are published without a licence, so they are read from a folder of the user's and never shipped.
Folders: ``Pepper/``, ``Pepper2Human/`` (humans mimicking Pepper), ``HumanAdult2HumanKid/`` (kid mimicking adult).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.readers.own.workbook import read_sheets

__all__ = ["DEFAULT_FPS", "read_paper"]

DEFAULT_FPS = 10.0
"""The recordings carry no timestamps; 10 Hz is an assumption that the caller may replace."""

_HUMAN_SHEETS = ("LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand")
_ELBOW_TILT = 0.157079  # rad; Pepper's elbow frame is pitched by -9 degrees before ElbowYaw turns
# Sheet of each arm joint and the axis (0 x, 1 y, 2 z) about which it turns; the elbow first loses its tilt.
_PEPPER_SHEETS = (("Shoulder", 1), ("Bicep", 2), ("Elbow", 0), ("ForeArm", 2), ("Hand", 0))
_FILE_NAME = re.compile(r"(human|pepper)_P(\d\d)A(\d\d)T(\d\d)")


def read_paper(folder: str | Path, fps: float = DEFAULT_FPS) -> Motions:
    """Reads all recordings of the paper's data set.

    Args:
        folder: holds ``Pepper``, ``Pepper2Human`` and ``HumanAdult2HumanKid``.
        fps: frames per second to assume.

    Returns:
        Motions of adult, kid and pepper: 740 adult-pepper, 788 kid-pepper and 660 adult-kid rows, as clips cut at the
        mirror seam. Actions of the human-human set are labelled ``H01`` to ``H09``, for they are other actions than
        Pepper's ``A01`` to ``A09``.

    Raises:
        MotionError: a folder, file, sheet or value is missing or wrong; the message names it.
    """
    root = Path(folder)
    for part in ("Pepper", "Pepper2Human", "HumanAdult2HumanKid"):
        if not (root / part).is_dir():
            raise MotionError(
                f"no folder {root / part}; expected the paper's data set with Pepper, Pepper2Human and "
                "HumanAdult2HumanKid inside"
            )
    bodies: dict[str, Embodiment] = {name: catalog.get(name) for name in ("adult", "kid", "pepper")}
    takes = _pepper_takes(root, fps) + _human_takes(root, fps)
    return Motions(f"paper:{root.name}", tuple(takes), bodies)


def _pepper_takes(root: Path, fps: float) -> list[Take]:
    takes: list[Take] = []
    peppers: dict[str, FloatArray] = {}
    for path in _workbooks(root / "Pepper2Human"):
        person, action, _ = _parse(path)
        partner = root / "Pepper" / f"pepper_P01A{action}T01.xlsx"
        if action not in peppers:
            peppers[action] = _read_pepper(partner)
        body = "adult" if person == "01" else "kid"
        frames = {body: _read_human(path), "pepper": peppers[action]}
        takes += _halves(path, f"A{action}", frames, fps, partner)
    return takes


def _human_takes(root: Path, fps: float) -> list[Take]:
    takes: list[Take] = []
    folder = root / "HumanAdult2HumanKid"
    adults: dict[str, FloatArray] = {}
    for path in _workbooks(folder):
        person, action, _ = _parse(path)
        if person != "02":
            continue
        partner = folder / f"human_P01A{action}T01.xlsx"
        if action not in adults:
            adults[action] = _read_human(partner)
        frames = {"adult": adults[action], "kid": _read_human(path)}
        takes += _halves(path, f"H{action}", frames, fps, partner)
    return takes


def _halves(path: Path, action: str, frames: dict[str, FloatArray], fps: float, partner: Path) -> list[Take]:
    """Cuts at the mirror seam: rows n/2..n-1 of every file are the mirror image of rows 0..n/2-1."""
    lengths = {len(value) for value in frames.values()}
    if len(lengths) != 1:
        counts = {name: len(value) for name, value in frames.items()}
        raise MotionError(f"{path} and {partner.name} are paired row by row but have {counts} rows")
    count = lengths.pop()
    if count % 2:
        raise MotionError(f"{path}: {count} rows; expected an even number, the second half mirroring the first")
    half = count // 2
    name = f"{path.parent.name}/{path.stem}"
    return [
        Take(name, action, fps, {body: value[part] for body, value in frames.items()}, mirrored)
        for part, mirrored in ((slice(0, half), False), (slice(half, count), True))
    ]


def _workbooks(folder: Path) -> list[Path]:
    found = sorted(path for path in folder.glob("human_*.xlsx") if _FILE_NAME.fullmatch(path.stem))
    if not found:
        raise MotionError(f"no workbook human_PxxAxxTxx.xlsx in {folder}")
    return found


def _parse(path: Path) -> tuple[str, str, str]:
    match = _FILE_NAME.fullmatch(path.stem)
    if match is None:
        raise MotionError(f"{path}: expected a name such as human_P01A03T01.xlsx")
    return match.group(2), match.group(3), match.group(4)


def _read_human(path: Path) -> FloatArray:
    sheets = read_sheets(path, _HUMAN_SHEETS)
    return np.concatenate([sheets[name][:, :3] for name in _HUMAN_SHEETS], axis=1)


def _read_pepper(path: Path) -> FloatArray:
    """Joint angles ``(N, 10)`` [rad] from the quaternions of Pepper's local frames (exact, see the module)."""
    names = [side + part for side in "LR" for part, _ in _PEPPER_SHEETS]
    sheets = read_sheets(path, names)
    columns = [
        _angle(sheets[side + part][:, 3:], axis, tilt=_ELBOW_TILT if part == "Elbow" else 0.0)
        for side in "LR"
        for part, axis in _PEPPER_SHEETS
    ]
    return np.stack(columns, axis=1)


def _angle(quaternions: FloatArray, axis: int, tilt: float) -> FloatArray:
    """Angle about one axis of scalar-last quaternions, after Ry(tilt) is multiplied from the left."""
    x, y, z, w = quaternions.T
    c, s = np.cos(tilt / 2), np.sin(tilt / 2)
    turned = np.stack([c * x + s * z, c * y + s * w, c * z - s * x, c * w - s * y])
    angle = 2.0 * np.arctan2(turned[axis], turned[3])
    wrapped: FloatArray = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped
