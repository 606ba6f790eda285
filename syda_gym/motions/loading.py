"""``load_motions``: one door for every source of motions, named ``format:PATH`` or found by looking into the file."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from itertools import islice
from pathlib import Path

import numpy as np

from syda_gym.errors import MotionError, OptionError, nearest_name
from syda_gym.files import asset
from syda_gym.motions.clip import Motions
from syda_gym.motions.dataset import is_dataset, read_dataset
from syda_gym.motions.film.reader import ENDINGS, is_film, read_film
from syda_gym.motions.readers.bvh import is_bvh, read_bvh
from syda_gym.motions.readers.kinect import is_kinect, read_kinect
from syda_gym.motions.readers.mediapipe import is_mediapipe, read_mediapipe
from syda_gym.motions.readers.npz import read_npz
from syda_gym.motions.readers.openni import is_openni, read_openni
from syda_gym.motions.readers.paper import read_paper
from syda_gym.motions.readers.text import first_bytes
from syda_gym.motions.resampling import resampled

__all__ = ["FORMATS", "Format", "load_motions", "resampled"]


@dataclass(frozen=True)
class Format:
    """One kind of recording.

    Attributes:
        name: the prefix in ``format:PATH``.
        description: one line for people.
        endings: how files of this format usually end.
        read: from a path to motions, at the recording's own frame rate.
        matches: whether a path looks like this format, by ending and content.
    """

    name: str
    description: str
    endings: tuple[str, ...]
    read: Callable[[Path], Motions]
    matches: Callable[[Path], bool]


def load_motions(spec: str | os.PathLike[str] | Motions = "embedded", fps: float | None = None) -> Motions:
    """Loads motions.

    Args:
        spec: ``"embedded"`` (synthetic, shipped), ``"format:PATH"`` such as ``"paper:DIR"``, a path whose format is
            found by looking into it, or motions, which are returned as they are.
        fps: frames per second. Recordings without timestamps (the paper's) are taken to have this rate; all others are
            resampled to it. By default the recording's own rate, 10 Hz for the paper's.

    Returns:
        The motions.

    Raises:
        MotionError: unknown format, or the recording is missing or malformed.
        OptionError: ``fps`` is not positive.
    """
    if fps is not None and not (np.isfinite(fps) and 0.0 < fps <= 1000.0):
        raise OptionError(f"fps must be between 0 and 1000, got {fps}")
    if isinstance(spec, Motions):
        return spec if fps is None else resampled(spec, fps)
    text = os.fspath(spec)
    if text == "embedded":
        return _embedded() if fps is None else resampled(_embedded(), fps)
    chosen, path = _format_and_path(text)
    if chosen.name == "paper" and fps is not None:
        return read_paper(path, fps)
    motions = chosen.read(path)
    return motions if fps is None else resampled(motions, fps)


@lru_cache(maxsize=1)
def _embedded() -> Motions:
    return read_npz(asset("motions", "embedded.npz"))


def _format_and_path(text: str) -> tuple[Format, Path]:
    prefix, colon, rest = text.partition(":")
    if colon and prefix in FORMATS:
        if not rest:
            raise MotionError(f"{text!r} names no path; expected {prefix}:PATH")
        return FORMATS[prefix], Path(rest).expanduser()
    path = Path(text).expanduser()
    if not path.exists():
        hint = f"; {prefix!r} is no format, {nearest_name(prefix, FORMATS)}" if colon else _meant(text)
        raise MotionError(f"no motions {text!r}: expected 'embedded', 'format:PATH' or the path of a recording{hint}")
    for chosen in FORMATS.values():
        if chosen.matches(path):
            return chosen, path
    for chosen in FORMATS.values():
        if path.suffix.lower() in chosen.endings:  # not what its ending says: its reader knows what is wrong with it
            return chosen, path
    raise MotionError(f"{path} is of no known format ({', '.join(FORMATS)}); name it as format:PATH")


def _meant(text: str) -> str:
    """Says "did you mean" where ``embedded`` or a file beside the missing one has nearly that name."""
    path = Path(text).expanduser()
    try:
        names = [other.name for other in islice(path.parent.iterdir(), 1000)]
    except OSError:  # no such folder, or one that may not be read
        names = []
    if path.name == text:
        names.append("embedded")
    close = get_close_matches(path.name, names, n=1)
    return f"; did you mean {str(path.with_name(close[0]))!r}?" if close else ""


def _is_paper(path: Path) -> bool:
    return (path / "Pepper2Human").is_dir()


def _is_npz(path: Path) -> bool:
    if first_bytes(path, 2) != b"PK":
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return "meta.npy" in archive.namelist()
    except (OSError, zipfile.BadZipFile):
        return path.suffix == ".npz"


FORMATS: dict[str, Format] = {
    entry.name: entry
    for entry in (
        Format("paper", "the folder of the paper's workbooks", (), read_paper, _is_paper),
        Format("pairs", "a folder of paired takes, see write_dataset", (), read_dataset, is_dataset),
        Format("npz", "a file written by save_motions", (".npz",), read_npz, _is_npz),
        Format("bvh", "motion capture, joints found by name", (".bvh",), read_bvh, is_bvh),
        Format("kinect", "Kinect v2: timestamp and 25 joints a line", (".csv",), read_kinect, is_kinect),
        Format("openni", "OpenNI / Kinect v1: 15 joints a line", (".txt", ".skeleton"), read_openni, is_openni),
        Format("film", "a film of one person, by MediaPipe's pose model (extra camera)", ENDINGS, read_film, is_film),
        Format("mediapipe", "world landmarks as JSON, CSV or npz", (".json", ".jsonl"), read_mediapipe, is_mediapipe),
    )
}
"""Known formats by prefix, in the order in which a file is tried."""
