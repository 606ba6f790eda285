"""``load_motions``: one door for every source of motions, named ``format:PATH`` or found by looking into the file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import lru_cache
from itertools import islice
from pathlib import Path

import numpy as np

from syda_gym.errors import MotionError, OptionError, nearest_name
from syda_gym.files import asset, open_archive
from syda_gym.motions.clip import Motions
from syda_gym.motions.dataset import is_dataset, read_dataset
from syda_gym.motions.film.reader import ENDINGS, is_film, read_film
from syda_gym.motions.readers.bvh.read import is_bvh, read_bvh
from syda_gym.motions.readers.captures.bag import is_bag, read_bag
from syda_gym.motions.readers.captures.c3d import is_c3d, read_c3d
from syda_gym.motions.readers.captures.mvnx import is_mvnx, read_mvnx
from syda_gym.motions.readers.dispatch import read_azure, read_keypoints, read_mediapipe
from syda_gym.motions.readers.landmarks.arrays import is_arrays
from syda_gym.motions.readers.landmarks.read import is_json
from syda_gym.motions.readers.own.npz import read_npz
from syda_gym.motions.readers.own.paper import read_paper
from syda_gym.motions.readers.own.people import doubts
from syda_gym.motions.readers.recording import say
from syda_gym.motions.readers.said import told
from syda_gym.motions.readers.tables.read import is_table, read_kinect, read_openni, read_table
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
        listens: whether ``read`` takes what a person says about the file as its second argument.
    """

    name: str
    description: str
    endings: tuple[str, ...]
    read: Callable[..., Motions]
    matches: Callable[[Path], bool]
    listens: bool = False


def load_motions(
    spec: str | os.PathLike[str] | Motions = "embedded",
    fps: float | None = None,
    *,
    joints: Mapping[str, object] | None = None,
    unit: str | float | None = None,
    up: str | None = None,
    person: int | None = None,
    layout: str | os.PathLike[str] | None = None,
) -> Motions:
    """Loads motions.

    What a recording of another tool does not say is found by looking at it: which joint is which, units, axes, the
    rate of frames. Where that fails, the arguments say it.

    Args:
        spec: ``"embedded"`` (synthetic, shipped), ``"format:PATH"`` such as ``"paper:DIR"``, a path whose format is
            found by looking into it, or motions, which are returned as they are.
        fps: frames per second. Recordings without timestamps (the paper's), or with times that cannot be right, are
            taken to have this rate; all others are resampled to it. By default the recording's own rate, 10 Hz for the
            paper's.
        joints: joint (``LShoulder``, ``LElbow``, ``LHand``, ``Head``, ...) to its name in the file, to the number of
            its point from 0, or to its three columns ``"x,y,z"`` by name or number.
        unit: unit of length of the file: ``m``, ``cm``, ``mm``, ``in``, ``ft``, or metres per unit.
        up: axis of the file that points up, such as ``"z"`` or ``"-y"``.
        person: which of several people, from 1; by default the first, and a note says that there are others.
        layout: a YAML file that describes a format of one's own, see ``docs/motions.md``.

    Returns:
        The motions.

    Raises:
        MotionError: unknown format, or the recording is missing or malformed.
        OptionError: ``fps`` is not positive, an unknown joint or unit, or something is said about motions that say it
            themselves.
    """
    if fps is not None and not (np.isfinite(fps) and 0.0 < fps <= 1000.0):
        raise OptionError(f"fps must be between 0 and 1000, got {fps}")
    said = told(joints, unit, up, None if fps is None or fps < 0.01 else fps, person, layout)
    speaks = any(value is not None for value in (joints, unit, up, person, layout))
    if isinstance(spec, Motions) or os.fspath(spec) == "embedded":
        if speaks:
            raise OptionError("joints, unit, up, person and layout are for recordings; these motions know their own")
        motions = spec if isinstance(spec, Motions) else _embedded()
        return motions if fps is None else resampled(motions, fps)
    chosen, path = _format_and_path(os.fspath(spec))
    if chosen.name == "paper" and fps is not None and not speaks:
        return _doubted(read_paper(path, fps), path)
    if speaks and not chosen.listens:
        raise OptionError(
            f"{path} is of the format {chosen.name!r}, which says joints, units and axes itself; leave them out"
        )
    motions = chosen.read(path, said) if chosen.listens else chosen.read(path)
    if chosen.name in _OWN:
        motions = _doubted(motions, path)
    rate = fps if fps is not None else said.fps
    return motions if rate is None else resampled(motions, rate)


def _doubted(motions: Motions, path: Path) -> Motions:
    """The same motions; what is odd about their people is noted and said aloud, as foreign readers do."""
    odd = doubts(motions)
    for line in odd:
        say(f"{path}: {line}")
    return replace(motions, notes=tuple(dict.fromkeys((*motions.notes, *odd)))) if odd else motions


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
    raise MotionError(_unknown(path))


def _unknown(path: Path) -> str:
    """What to say about a path that nothing reads."""
    if path.is_dir():
        inside = sorted(entry.name for entry in islice(path.iterdir(), 1000) if entry.is_file())
        if not inside:
            return f"{path} is an empty folder; expected a recording"
        if sum(name.endswith("_keypoints.json") for name in inside) > 0.5 * len(inside):
            return (
                f"{path} holds one file a frame, as OpenPose writes them. Places in a picture have no depth: use a "
                "tracker that gives positions in space, or read the film itself, film:FILE; files with "
                "pose_keypoints_3d can be joined into one list of frames"
            )
        return (
            f"{path} is a folder and no data set of this library; name one of its files, such as "
            f"{path / inside[0]}, or pair them all: syda-gym motions pair"
        )
    remedy = _ELSEWHERE.get(path.suffix.lower())
    if remedy is not None:
        return f"{path}: {path.suffix} files are not read; {remedy}"
    return f"{path} is of no known format ({', '.join(FORMATS)}); name it as format:PATH"


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
        with open_archive(path, "motions", MotionError) as archive:
            return "meta.npy" in archive.namelist()
    except MotionError:
        return path.suffix == ".npz"


def _is_points(path: Path) -> bool:
    return is_json(path) or is_arrays(path)


def _never(_: Path) -> bool:
    """A name that only people give; what it holds is found under another one."""
    return False


FORMATS: dict[str, Format] = {
    entry.name: entry
    for entry in (
        Format("paper", "the folder of the paper's workbooks", (), read_paper, _is_paper),
        Format("pairs", "a folder of paired takes, see write_dataset", (), read_dataset, is_dataset),
        Format("npz", "a file written by save_motions", (".npz",), read_npz, _is_npz),
        Format("bvh", "motion capture as a tree of joints", (".bvh",), read_bvh, is_bvh, True),
        Format("c3d", "motion capture as markers (extra c3d)", (".c3d",), read_c3d, is_c3d, True),
        Format("mvnx", "Xsens MVN: where segments begin, as XML", (".mvnx",), read_mvnx, is_mvnx, True),
        Format("bag", "ROS 1 and 2 bags, MCAP: tf or markers (extra ros)", (".bag", ".mcap", ".db3"), read_bag,
        is_bag, True),
        Format("kinect", "Kinect v1 and v2: 20 or 25 joints a line", (), read_kinect, _never, True),
        Format("azure", "Azure Kinect: 32 joints, JSON or table", (), read_azure, _never, True),
        Format("openni", "OpenNI, NiTE, Cornell: 15 joints a line", (), read_openni, _never, True),
        Format("film", "a film of one person, by MediaPipe's pose model (extra camera)", ENDINGS, read_film, is_film),
        Format("mediapipe", "33 world landmarks: JSON, tables, npy, npz", (), read_mediapipe, _never, True),
        Format("keypoints", "points of other trackers: JSON, npy, npz", (".json", ".jsonl", ".npy"), read_keypoints,
        _is_points, True),
        Format("table", "any text: TRC, OptiTrack, Vicon, NTU, named columns", (".csv", ".tsv", ".txt", ".trc",
        ".skeleton"), read_table,
               is_table, True),
    )
}  # fmt: skip
"""Known formats by prefix, in the order in which a file is tried."""

_OWN = ("paper", "pairs", "npz")  # whose readers make no person of joints, but take the bodies that the file names

_ELSEWHERE = {
    **dict.fromkeys((".fbx", ".asf", ".amc", ".usd", ".glb", ".vrm", ".vmd"), "export BVH from the tool that made it"),
    **dict.fromkeys((".pkl", ".pickle", ".pt", ".pth", ".joblib"), "such a file can run code when it is opened: save "
                    "joint positions as npz or CSV"),
    **dict.fromkeys((".mat", ".h5", ".hdf5", ".parquet"), "save joint positions as npz or CSV"),
    **dict.fromkeys((".xlsx", ".xls", ".ods"), "save the sheet as CSV"),
    **dict.fromkeys((".mot", ".sto", ".trb"), "they hold angles or are binary: export marker positions as TRC or C3D"),
}  # fmt: skip
"""What helps with files that other tools write and nothing here reads, by their ending."""
