"""Files of weights (safetensors): the table at their beginning is checked before anything is loaded."""

from __future__ import annotations

import json
import math
import os
import struct

from syda_gym.errors import StorageError, SydaError
from syda_gym.files.budget import BUDGET, check_size

__all__ = ["check_tensors"]

_WIDTHS = {
    "F64": 8,
    "F32": 4,
    "F16": 2,
    "I64": 8,
    "I32": 4,
    "I16": 2,
    "I8": 1,
    "U8": 1,
    "U16": 2,
    "U32": 4,
    "U64": 8,
    "BOOL": 1,
}
_TABLE = 4 * 2**20  # bytes


def check_tensors(
    path: str | os.PathLike[str], what: str, limit: int, error: type[SydaError] = StorageError
) -> dict[str, tuple[int, ...]]:
    """Checks a safetensors file without loading it.

    Args:
        path: the file.
        what: what it should be, for messages.
        limit: bytes of the whole file.
        error: exception to raise.

    Returns:
        Name to shape.

    Raises:
        SydaError: of the kind ``error``: missing, too large, a table that does not fit the file, too many tensors, or
            numbers of a type that this library does not write (``BF16``, ``F8``).
    """
    file = check_size(path, limit, what, error)
    size = file.stat().st_size
    with file.open("rb") as opened:
        start = opened.read(8)
        length = struct.unpack("<Q", start)[0] if len(start) == 8 else 0
        if not 2 <= length <= min(_TABLE, size - 8):
            raise error(f"{file} is corrupt: its table has {length} bytes; expected {what}")
        data = opened.read(length)
    try:
        table = json.loads(data)
        table.pop("__metadata__", None)
        if len(table) > BUDGET.tensors:
            raise error(f"{file} holds {len(table)} tensors; at most {BUDGET.tensors} are read as {what}")
        shapes: dict[str, tuple[int, ...]] = {}
        end = 0
        for name, entry in table.items():
            kind, shape, (first, last) = entry["dtype"], entry["shape"], entry["data_offsets"]
            if kind not in _WIDTHS:
                raise error(
                    f"{file}: {name[:80]!r} has numbers of type {str(kind)[:20]}; expected {', '.join(_WIDTHS)}"
                )
            if not all(isinstance(side, int) and side >= 0 for side in (*shape, first, last)):
                raise ValueError(f"{name[:80]!r} has a negative or broken size")
            if math.prod(shape) * _WIDTHS[kind] != last - first or len(shape) > 8:
                raise ValueError(f"{name[:80]!r} of shape {str(shape)[:80]} does not fit its {last - first} bytes")
            shapes[name] = tuple(shape)
            end = max(end, last)
        if end != size - 8 - length:
            raise ValueError(f"the tensors take {end} bytes, the file has {size - 8 - length}")
    except SydaError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError) as problem:
        raise error(f"{file} is corrupt: {str(problem)[:200]}; expected {what}") from problem
    return shapes
