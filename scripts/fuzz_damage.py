"""Ways to damage a valid input: as bytes, as a JSON value, inside an archive, inside a file of weights.

Bytes alone rarely get past a checksum or a parser; the others keep the container whole and damage what is in it.
"""

from __future__ import annotations

import copy
import io
import json
import zipfile
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np
import yaml

__all__ = ["Damage", "in_archive", "in_bytes", "in_json", "in_json_lines", "in_weights", "in_yaml", "mixed"]

Damage = Callable[[list[bytes], np.random.Generator], bytes]
"""From valid samples and a generator to one damaged input."""

NASTY = (
    b"nan",
    b"inf",
    b"-1",
    b"1e308",
    b"99999999999",
    b"",
    b"\x00",
    b"null",
    b"[]",
    b"{}",
    b'"',
    b",",
    b"\n",
    b"\xff\xfe",
)
VALUES: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    10**30,
    1.5,
    float("nan"),
    float("inf"),
    -1e308,
    "",
    "nan",
    "../../x",
    "\u0000",
    "x" * 5000,
    [],
    [[]],
    [None],
    [1, [2, 3]],
    {},
    {"kind": None},
)
_DEEP = b"[" * 100_000


def in_bytes(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """One sample with a wound, rarely with as many as eight."""
    data = bytearray(samples[rng.integers(len(samples))])
    for _ in range(min(int(rng.geometric(0.5)), 8)):
        size = max(len(data), 1)
        place = int(rng.integers(size))
        length = int(min(rng.geometric(0.05), size))
        kind = rng.integers(9)
        if kind == 0:
            del data[place:]  # cut off
        elif kind == 1:
            del data[place : place + length]
        elif kind == 2:
            data[place : place + length] = rng.integers(0, 256, length, dtype=np.uint8).tobytes()
        elif kind == 3 and data:
            data[place % len(data)] ^= 1 << int(rng.integers(8))
        elif kind == 4:
            data[place:place] = data[place : place + length] * int(rng.integers(1, 20))  # repeated
        elif kind == 5:
            data[place : place + int(rng.integers(0, 6))] = NASTY[rng.integers(len(NASTY))]
        elif kind == 6:
            other = samples[rng.integers(len(samples))]
            data[place:] = other[min(place, len(other)) :]  # mixed with another sample
        elif kind == 7 and rng.random() < 0.02:
            data[place:place] = _DEEP  # nested deeper than a parser's stack
        else:
            digits = [i for i in range(place, min(place + 200, len(data))) if 48 <= data[i] <= 57]
            if digits:  # another number where there was one
                at = digits[0]
                data[at : at + 1] = NASTY[rng.integers(5)]
    return bytes(data)


def in_json(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A JSON text in which up to three values were replaced, removed, or moved elsewhere."""
    value = json.loads(samples[rng.integers(len(samples))])
    return json.dumps(_wounded(value, rng)).encode()


def in_yaml(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A YAML text, written anew as JSON (which is YAML), in which values were replaced, removed or moved."""
    return json.dumps(_wounded(yaml.safe_load(samples[rng.integers(len(samples))]), rng)).encode()


def in_json_lines(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """JSON lines, one of them damaged as JSON."""
    lines = samples[rng.integers(len(samples))].splitlines()
    where = int(rng.integers(len(lines)) if rng.random() < 0.7 else 0)
    lines[where] = in_json([lines[where]], rng)
    return b"\n".join(lines) + b"\n"


def in_archive(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A zip archive (npz, workbook) that is whole, with one damaged, missing or doubled member."""
    with zipfile.ZipFile(io.BytesIO(samples[rng.integers(len(samples))])) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    where = int(rng.integers(len(members)))
    name, content = members[where]
    chance = rng.random()
    if chance < 0.05:
        del members[where]
    elif chance < 0.1:
        members[where] = (f"../{name}", content)
    elif chance < 0.15:
        members[where] = (name, members[rng.integers(len(members))][1])
    else:
        members[where] = (name, _json_member(content, rng) or in_bytes([content], rng))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for entry, data in members:
            archive.writestr(entry, data)
    return out.getvalue()


def in_weights(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A safetensors file whose header is damaged as JSON, or whose numbers are."""
    data = samples[rng.integers(len(samples))]
    length = int.from_bytes(data[:8], "little")
    header, numbers = data[8 : 8 + length], data[8 + length :]
    if rng.random() < 0.5:
        header = in_json([header], rng)
    elif len(numbers) >= 8:
        at = 8 * int(rng.integers(len(numbers) // 8))
        bad = np.array([np.nan, np.inf, -1e300, 0.0, 1e18])[rng.integers(5)]
        numbers = numbers[:at] + np.float64(bad).tobytes() + numbers[at + 8 :]
    return len(header).to_bytes(8, "little") + header + numbers


def mixed(structured: Damage) -> Damage:
    """Damages as bytes and as structure in turn, at random."""

    def damage(samples: list[bytes], rng: np.random.Generator) -> bytes:
        return (in_bytes if rng.random() < 0.4 else structured)(samples, rng)

    return damage


def _json_member(content: bytes, rng: np.random.Generator) -> bytes | None:
    """A member of an npz that holds JSON as bytes, damaged as JSON; ``None`` if it is no such member."""
    try:
        array = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
        text = in_json([array.tobytes()], rng)
    except (ValueError, EOFError, zlib.error):
        return None
    out = io.BytesIO()
    np.lib.format.write_array(out, np.frombuffer(text, dtype=np.uint8))
    return out.getvalue()


def _wounded(value: Any, rng: np.random.Generator) -> Any:
    value = copy.deepcopy(value)
    for _ in range(min(int(rng.geometric(0.6)), 3)):
        places = list(_places(value))
        if not places:
            return VALUES[rng.integers(len(VALUES))]
        holder, key = places[rng.integers(len(places))]
        kind = rng.random()
        if kind < 0.6:
            holder[key] = copy.deepcopy(VALUES[rng.integers(len(VALUES))])
        elif kind < 0.75:
            del holder[key]
        elif kind < 0.9:
            other, name = places[rng.integers(len(places))]
            holder[key] = copy.deepcopy(other[name]) if _has(other, name) else None
        elif isinstance(holder, dict):
            holder[f"{key}_"] = holder.pop(key)
        else:
            holder.insert(key, copy.deepcopy(holder[key]))
    return value


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Every container and key of a JSON value; of long lists only the ends."""
    found: list[tuple[Any, Any]] = []
    todo = [value]
    while todo:
        holder = todo.pop()
        if isinstance(holder, dict):
            keys: list[Any] = list(holder)
        elif isinstance(holder, list):
            keys = list(range(len(holder)))
            keys = keys if len(keys) <= 12 else [*keys[:6], *keys[-6:]]
        else:
            continue
        found += [(holder, key) for key in keys]
        todo += [holder[key] for key in keys]
    return found


def _has(holder: Any, key: Any) -> bool:
    return key in holder if isinstance(holder, dict) else key < len(holder)
