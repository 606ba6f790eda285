"""Archives of strangers: their table of contents is checked before anything is unpacked."""

from __future__ import annotations

import io
import math
import os
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.errors import StorageError, SydaError
from syda_gym.files.budget import BUDGET, check_size

__all__ = ["open_archive", "read_arrays"]

_END = b"PK\x05\x06"
_TAIL = 22 + 65_535  # bytes of the record at the end of an archive with the longest comment
_ENTRY = 128  # bytes of the table of contents that one member may take on average


@contextmanager
def open_archive(
    path: str | os.PathLike[str], what: str, error: type[SydaError] = StorageError, unpacked: int = BUDGET.unpacked
) -> Iterator[zipfile.ZipFile]:
    """Opens a zip archive whose members unpack to at most ``unpacked`` bytes.

    Args:
        path: the archive.
        what: what it should be, for messages.
        error: exception to raise.
        unpacked: bytes of all members together.

    Yields:
        The archive.

    Raises:
        SydaError: of the kind ``error``: missing, damaged, too large, too many members.
    """
    file = check_size(path, BUDGET.packed, what, error)
    try:
        with file.open("rb") as opened:
            opened.seek(max(0, file.stat().st_size - _TAIL))
            tail = opened.read(_TAIL)
        place = tail.rfind(_END)
        listed = struct.unpack("<I", tail[place + 12 : place + 16])[0] if 0 <= place <= len(tail) - 22 else 0
        if listed > BUDGET.members * _ENTRY:
            raise error(f"{file} lists more members than the {BUDGET.members} that are read; expected {what}")
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            size = sum(entry.file_size for entry in members)
            if len(members) > BUDGET.members or size > unpacked:
                raise error(
                    f"{file} unpacks to {size >> 20} MB in {len(members)} members; at most {unpacked >> 20} MB in "
                    f"{BUDGET.members} are read as {what}. Cut it into pieces"
                )
            packed = file.stat().st_size  # zipfile asks for as many bytes as a member is said to take, there or not
            for entry in members:
                if entry.compress_size > packed or entry.header_offset > packed:
                    raise error(
                        f"{file} is damaged: {entry.filename[:80]!r} is said to take {entry.compress_size} of its "
                        f"{packed} bytes; expected {what}"
                    )
            yield archive
    except SydaError:
        raise
    except (
        zipfile.BadZipFile,
        zlib.error,
        OSError,
        EOFError,
        RuntimeError,
        ValueError,
    ) as problem:
        raise error(f"{file} is no readable archive: {problem}; expected {what}") from problem


def read_arrays(
    path: str | os.PathLike[str], what: str, error: type[SydaError] = StorageError, unpacked: int = BUDGET.unpacked
) -> dict[str, NDArray[Any]]:
    """All arrays of an ``.npz``, or the one of an ``.npy`` under the name ``""``.

    An array is made only if its header agrees with the bytes that are there; objects are never read.

    Raises:
        SydaError: of the kind ``error``: missing, damaged, too large, or with Python objects inside.
    """
    file = check_size(path, BUDGET.packed, what, error)
    with file.open("rb") as opened:
        start = opened.read(6)
        if start == b"\x93NUMPY":
            opened.seek(0)
            return {"": _array(opened, file.stat().st_size, f"{file}", error)}
    arrays: dict[str, NDArray[Any]] = {}
    with open_archive(file, what, error, unpacked) as archive:
        for entry in archive.infolist():
            if entry.filename.endswith(".npy"):
                with archive.open(entry) as member:
                    name = entry.filename.removesuffix(".npy")
                    arrays[name] = _array(io.BytesIO(member.read()), entry.file_size, f"{file}: {name[:80]}", error)
    return arrays


def _array(opened: IO[bytes], size: int, where: str, error: type[SydaError]) -> NDArray[Any]:
    try:
        major = np.lib.format.read_magic(opened)[0]
        header = np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0
        shape, columns_first, dtype = header(opened)
        if dtype.hasobject:
            raise error(f"{where} is no readable .npz or .npy: it holds Python objects; save plain numbers")
        expected = math.prod(shape) * dtype.itemsize
        if any(side < 0 for side in shape) or expected != size - opened.tell():
            raise error(
                f"{where} says that it has shape {str(shape)[:80]} and type {dtype}, which takes {expected} bytes; "
                f"there are {size - opened.tell()}"
            )
        data = np.frombuffer(opened.read(expected), dtype=dtype)
        return data.reshape(shape, order="F" if columns_first else "C").copy()
    except SydaError:
        raise
    except Exception as problem:  # numpy's header parser lets through whatever its tokens raise
        raise error(f"{where} is no readable .npz or .npy array: {str(problem)[:200]}") from problem
