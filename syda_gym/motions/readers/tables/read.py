"""Reading recordings that are lines of text, whatever tool wrote them."""

from __future__ import annotations

from pathlib import Path

from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions
from syda_gym.motions.readers.recording import Recording
from syda_gym.motions.readers.said import NOTHING_SAID, Said
from syda_gym.motions.readers.skeleton import motions_from
from syda_gym.motions.readers.tables.columns import find_columns
from syda_gym.motions.readers.tables.grid import Grid, numeric, read_grid
from syda_gym.motions.readers.tables.long import from_long, is_long
from syda_gym.motions.readers.tables.named import from_header
from syda_gym.motions.readers.tables.ntu import from_ntu, is_ntu
from syda_gym.motions.readers.tables.positional import from_numbers, may_be_positions
from syda_gym.motions.readers.tables.stacked import from_stacked, is_stacked
from syda_gym.motions.readers.text import first_bytes, read_lines

__all__ = ["is_table", "read_kinect", "read_openni", "read_table", "table_recording"]

_SHOWN = 8


def is_table(path: Path) -> bool:
    """Whether a file is text whose first lines hold several numbers each."""
    start = first_bytes(path, 16_384)
    if not start or (b"\0" in start and start[:2] not in (b"\xff\xfe", b"\xfe\xff")):
        return False
    text = start.decode("utf-16" if start[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8", "replace").lstrip(
        "\ufeff \r\n\t"
    )
    if not text or text[:1] in ("{", "[", "<") or text.startswith("HIERARCHY"):
        return False
    if path.suffix.lower() in (".csv", ".tsv", ".trc", ".skeleton"):
        return True
    words = text.replace(",", " ").replace(";", " ").split()
    return sum(numeric(word) for word in words) >= 0.3 * len(words)


def read_table(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads a recording that is lines of text.

    Headers that name joints and axes, in one line or in several; one point a line; no header at all; the skeletons of
    NTU RGB+D. The order of columns without names is found by which order makes a person.

    Args:
        path: the file.
        said: what a person says about it.

    Returns:
        Motions of one human, ``"operator"``; gaps are filled and flagged by ``skeleton.motions_from``.

    Raises:
        MotionError: missing, too large, damaged (the message names the line), or no person in it.
    """
    return motions_from(table_recording(Path(path), said), said)


def read_kinect(path: str | Path, said: Said = NOTHING_SAID, *, inferred: bool = False) -> Motions:
    """Reads a recording of a Kinect: v1 with 20 joints, v2 with 25, in any arrangement of columns.

    Args:
        path: the file.
        said: what a person says about it.
        inferred: take inferred positions as they are; by default they count as gaps, for the sensor guessed them.

    Raises:
        MotionError: see ``read_table``.
    """
    if inferred:
        said = Said(**{**vars(said), "inferred": True})
    return motions_from(table_recording(Path(path), said, "kinect"), said)


def read_openni(path: str | Path, said: Said = NOTHING_SAID) -> Motions:
    """Reads a skeleton of OpenNI or NiTE, 15 joints a line, or rows of the Cornell data sets.

    Raises:
        MotionError: see ``read_table``.
    """
    return motions_from(table_recording(Path(path), said, "openni"), said)


def table_recording(path: Path, said: Said, format: str | None = None) -> Recording:
    """The joints of a text file, before units and axes are found.

    Args:
        path: the file.
        said: what a person says about it.
        format: what a person called it; other arrangements are not tried.

    Raises:
        MotionError: see ``read_table``.
    """
    lines = read_lines(path, "a recording as text")
    if is_ntu(lines):
        return from_ntu(path, lines, said)
    grid = read_grid(path, lines, said)
    if not grid.header:
        return from_numbers(grid, said, format)
    if is_stacked(grid):
        return from_stacked(grid, said, format if format not in ("kinect", "openni") else None)
    width = grid.values.shape[1]  # what a header names beyond is in no line
    best = max((find_columns(row[:width]) for row in grid.header), key=lambda one: (len(one.points), len(one.axes)))
    if is_long(best):
        return from_long(grid, best, said, format)
    if best.points or any("," in place for place in said.joints.values()):
        return from_header(grid, best, said, format)
    return _headed_numbers(grid, said, format)


def _headed_numbers(grid: Grid, said: Said, format: str | None) -> Recording:
    """A header that names no axes above what may be columns of joints all the same."""
    columns = grid.values.shape[1]
    names = [cell for cell in grid.header[-1] if cell]
    shown = ", ".join(cell[:30] for cell in names[:_SHOWN]) + (" ..." if len(names) > _SHOWN else "")
    if may_be_positions(columns, format):
        try:
            return from_numbers(grid, said, format)
        except MotionError as error:
            raise MotionError(f"{error} (the header says {shown})") from error
    raise MotionError(
        f"{grid.path}: {columns} columns called {shown}: no joint is named; expected columns such as "
        f"left_shoulder_x, left_shoulder_y, "
        "left_shoulder_z. Say which is which: --joints LShoulder=NAME or LShoulder=X,Y,Z (columns), or a layout in YAML"
    )
