"""A paired data set as a folder that people can read, check and edit.

::

    DATASET/
      dataset.json         {"format": "syda-gym pairs 1", "name", "synthetic", "bodies", "families", "notes", "takes"}
      takes/0001.csv       one take each, one line per frame

``bodies`` maps names to descriptions: humans completely (``HumanSkeleton.spec``), robots by name and joints. Each take
names its ``file``, ``recording``, ``action``, ``fps``, ``mirrored``. A table's first column is ``time`` [s]; every
other one is ``<body>:<feature>``, metres or radians; ``<body>:filled`` may mark filled gaps as a hexadecimal number
whose lowest bit is the body's first feature.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MotionError, StorageError
from syda_gym.files import read_json, write_json, write_text
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.readers.own.npz import body_from_spec, body_spec
from syda_gym.motions.readers.text import numbers, read_lines, split_row

__all__ = [
    "DATASET_FORMAT",
    "INDEX",
    "dataset_root",
    "is_dataset",
    "read_dataset",
    "read_index",
    "read_take",
    "write_dataset",
]

DATASET_FORMAT = "syda-gym pairs 1"
INDEX = "dataset.json"
_TAKE_KEYS = {"file", "recording", "action", "fps", "mirrored"}
_MAX_TAKES = 100_000


def write_dataset(motions: Motions, folder: str | os.PathLike[str]) -> Path:
    """Writes motions as a data set folder; nothing is lost.

    Args:
        motions: what to write.
        folder: is created; it must not hold another data set.

    Returns:
        The folder.

    Raises:
        MotionError: the folder already holds a data set.
        StorageError: it cannot be written.
    """
    root = Path(folder)
    if (root / INDEX).exists():
        raise MotionError(f"{root} already holds a data set; choose another folder or remove it")
    entries = []
    for index, take in enumerate(motions.takes, start=1):
        name = f"takes/{index:04d}.csv"
        write_text(root / name, _table(take, motions.bodies))
        entries.append(
            {
                "file": name,
                "recording": take.recording,
                "action": take.action,
                "fps": take.fps,
                "mirrored": take.mirrored,
                "timestamps": take.timestamps is not None,
            }
        )
    # The index comes last: a folder without it is no data set, so a broken write is never mistaken for one.
    write_json(
        root / INDEX,
        {
            "format": DATASET_FORMAT,
            "name": motions.name,
            "synthetic": motions.synthetic,
            "bodies": {name: body_spec(body) for name, body in motions.bodies.items()},
            "families": dict(motions.families),
            "notes": list(motions.notes),
            "takes": entries,
        },
    )
    return root


def is_dataset(path: Path) -> bool:
    """Whether a path is a data set folder or its ``dataset.json``."""
    return (path / INDEX).is_file() or (path.name == INDEX and path.is_file())


def read_dataset(folder: str | os.PathLike[str]) -> Motions:
    """Reads a data set folder.

    Raises:
        MotionError: something is missing or malformed; the message names file and line.
        EmbodimentError: a robot is unknown or has other joints.
    """
    root = dataset_root(folder)
    index = read_index(root)
    bodies = {name: body_from_spec(root / INDEX, spec) for name, spec in index["bodies"].items()}
    takes = tuple(read_take(root, entry, bodies) for entry in index["takes"])
    return Motions(
        str(index.get("name", root.name)),
        takes,
        bodies,
        {str(key): str(value) for key, value in index.get("families", {}).items()},
        bool(index.get("synthetic", False)),
        tuple(str(note) for note in index.get("notes", ())),
    )


def _table(take: Take, bodies: Mapping[str, Embodiment]) -> str:
    header = ["time"]
    count = len(next(iter(take.frames.values())))
    times = np.arange(count) / take.fps if take.timestamps is None else take.timestamps
    columns: list[list[str]] = [[repr(float(time)) for time in times]]
    for name, frames in take.frames.items():
        header += [f"{name}:{feature.name}" for feature in bodies[name].features]
        columns += [[repr(float(value)) for value in column] for column in frames.T]
        if name in take.filled:
            header.append(f"{name}:filled")
            columns.append([_mask(row) for row in take.filled[name]])
    rows = zip(*columns, strict=True)
    return "\n".join([",".join(header), *(",".join(row) for row in rows)]) + "\n"


def _mask(row: NDArray[np.bool_]) -> str:
    return format(sum(1 << index for index, mark in enumerate(row.tolist()) if mark), "x")


def dataset_root(folder: str | os.PathLike[str]) -> Path:
    """The data set folder itself, also when its ``dataset.json`` is given.

    Raises:
        MotionError: there is no ``dataset.json``.
    """
    path = Path(folder)
    root = path.parent if path.name == INDEX else path
    if not (root / INDEX).is_file():
        raise MotionError(f"{root} is no data set: it has no {INDEX}")
    return root


def read_index(root: Path) -> dict[str, Any]:
    """The checked content of ``dataset.json``.

    Raises:
        MotionError: missing or wrong keys; the message names them.
    """
    place = root / INDEX
    try:
        index = read_json(place)
    except StorageError as error:
        raise MotionError(str(error)) from error
    if not isinstance(index, dict) or index.get("format") != DATASET_FORMAT:
        found = index.get("format") if isinstance(index, dict) else type(index).__name__
        raise MotionError(f'{place}: expected "format": {DATASET_FORMAT!r}, got {found!r}')
    for key, kind in (("bodies", dict), ("takes", list)):
        if not isinstance(index.get(key), kind) or not index[key]:
            raise MotionError(f"{place}: expected {key!r}, a {kind.__name__} with at least one entry")
    for key, kind in (("families", dict), ("notes", list)):
        if not isinstance(index.get(key, kind()), kind):
            raise MotionError(f"{place}: {key!r} must be a {kind.__name__}")
    if len(index["takes"]) > _MAX_TAKES:
        raise MotionError(f"{place}: {len(index['takes'])} takes; at most {_MAX_TAKES}")
    for name, spec in index["bodies"].items():
        if not isinstance(spec, dict) or not re.fullmatch(r"[^:,\s]+", name):
            raise MotionError(f"{place}: body {name!r} needs a name without colon, comma or space, and a description")
    for number, entry in enumerate(index["takes"]):
        if not isinstance(entry, dict) or not set(entry) >= _TAKE_KEYS:
            raise MotionError(f"{place}: take {number} needs the keys {sorted(_TAKE_KEYS)}")
    return index


def read_take(root: Path, entry: dict[str, Any], bodies: Mapping[str, Embodiment]) -> Take:
    """Reads one take that ``dataset.json`` lists.

    Raises:
        MotionError: the table is missing or malformed; the message names file and line.
    """
    name = str(entry["file"])
    path = (root / name).resolve()
    if not path.is_relative_to(root.resolve()):
        raise MotionError(f"{root / INDEX}: {name!r} lies outside the data set")
    try:
        fps = float(entry["fps"])
    except (TypeError, ValueError):
        fps = math.nan
    if not 0.0 < fps <= 10_000.0:
        raise MotionError(f"{root / INDEX}: fps of {name!r} must be positive, got {entry['fps']!r}")
    lines = read_lines(path, "a table of frames")
    header = split_row(lines[0])
    columns = _columns(path, header, bodies)
    values, masks = _rows(path, lines, header)
    times = values[:, 0]
    if (np.diff(times) <= 0).any():
        row = int(np.flatnonzero(np.diff(times) <= 0)[0])
        raise MotionError(f"{path}, line {row + 3}: time must increase, got {times[row]} then {times[row + 1]}")
    frames = {body: values[:, where] for body, where in columns.items()}
    filled = {}
    for body, texts in masks.items():
        filled[body] = _unmasked(path, texts, frames[body].shape[1])
    stamps = times if entry.get("timestamps") else None
    marks = {body: value for body, value in filled.items() if value.any()}
    return Take(str(entry["recording"]), str(entry["action"]), fps, frames, bool(entry["mirrored"]), marks, stamps)


def _columns(path: Path, header: list[str], bodies: Mapping[str, Embodiment]) -> dict[str, list[int]]:
    """Body to the columns of its features, in the body's own order."""
    if not header or header[0] != "time":
        raise MotionError(f"{path}, line 1: the first column must be 'time', got {header[:1]}")
    if len(set(header)) != len(header):
        twice = next(cell for cell in header if header.count(cell) > 1)
        raise MotionError(f"{path}, line 1: column {twice!r} occurs twice")
    present: dict[str, list[int]] = {}
    for cell in header[1:]:
        body = cell.partition(":")[0]
        if body not in bodies:
            raise MotionError(f"{path}, line 1: column {cell!r} is of no body in {INDEX} ({', '.join(bodies)})")
        present.setdefault(body, [])
    for body in present:
        wanted = [f"{body}:{feature.name}" for feature in bodies[body].features]
        extra = [c for c in header if c.startswith(f"{body}:") and c not in wanted and c != f"{body}:filled"]
        missing = [cell for cell in wanted if cell not in header]
        if missing or extra:
            what = f"column {missing[0]!r} is missing" if missing else f"column {extra[0]!r} is unknown"
            raise MotionError(f"{path}, line 1: {what}; {body!r} has {', '.join(wanted)}")
        present[body] = [header.index(cell) for cell in wanted]
    if not present:
        raise MotionError(f"{path}, line 1: no body; expected columns <body>:<feature>")
    return present


def _rows(path: Path, lines: list[str], header: list[str]) -> tuple[FloatArray, dict[str, list[str]]]:
    mask_columns = {column: cell.partition(":")[0] for column, cell in enumerate(header) if cell.endswith(":filled")}
    masks: dict[str, list[str]] = {body: [] for body in mask_columns.values()}
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        cells = split_row(line)
        if len(cells) != len(header):
            raise MotionError(f"{path}, line {number}: {len(cells)} columns, the header has {len(header)}")
        for column, body in mask_columns.items():
            masks[body].append(cells[column])
            cells[column] = "0"
        row = numbers(cells, path, number)
        if np.isnan(row).any():
            column = int(np.flatnonzero(np.isnan(row))[0])
            raise MotionError(f"{path}, line {number}: {header[column]} is empty or NaN; fill gaps before pairing")
        rows.append(row)
    if not rows:
        raise MotionError(f"{path} has a header but no frames")
    return np.array(rows), masks


def _unmasked(path: Path, texts: list[str], features: int) -> NDArray[np.bool_]:
    result = np.zeros((len(texts), features), dtype=bool)
    for row, text in enumerate(texts):
        if not re.fullmatch(r"[0-9a-fA-F]{1,64}", text) or int(text, 16) >= 1 << features:
            raise MotionError(f"{path}, line {row + 2}: {text[:20]!r} marks no gaps of {features} features")
        bits = int(text, 16)
        result[row] = [bool(bits >> index & 1) for index in range(features)]
    return result
