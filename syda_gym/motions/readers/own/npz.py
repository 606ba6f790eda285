"""The library's own motion file: one ``.npz`` of plain arrays and a JSON description, nothing pickled.

``meta`` is UTF-8 JSON as bytes; ``frames_<i>`` holds all frames of body ``i`` after one another, ``filled_<i>`` its
gaps as packed bits, ``timestamps`` the recorded times of the takes that have them. Rounded files keep frames as 16-bit
differences over time and the step in the description; they are small and read to the same bits everywhere.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import EmbodimentError, MotionError
from syda_gym.files import BUDGET, atomic_path, read_arrays, shortened
from syda_gym.motions.clip import Motions, Take

__all__ = ["FORMAT", "MAX_BYTES", "body_from_spec", "body_spec", "read_npz", "save_motions"]

FORMAT = "syda-gym motions 1"
MAX_BYTES = BUDGET.unpacked
"""Files that unpack to more are refused."""

_EPOCH = (1980, 1, 1, 0, 0, 0)  # a fixed date, so that equal motions make equal files


def save_motions(motions: Motions, path: str | os.PathLike[str], *, steps: Mapping[str, float] | None = None) -> Path:
    """Writes motions to a file that ``read_npz`` reads.

    Args:
        motions: what to write.
        path: the ``.npz`` file.
        steps: rounding per unit, for example ``{"m": 5e-4, "rad": 1e-4}``; by default nothing is lost.

    Returns:
        ``path``.

    Raises:
        MotionError: a value does not fit into 16 bits at the wanted step.
        StorageError: the file cannot be written.
    """
    arrays: dict[str, NDArray[Any]] = {}
    bodies = []
    for index, (name, body) in enumerate(motions.bodies.items()):
        step = (steps or {}).get(body.features[0].unit)
        takes = [take for take in motions.takes if name in take.frames]
        frames = [take.frames[name] for take in takes]
        if frames:
            arrays[f"frames_{index}"] = _encode(np.concatenate(frames), step, name)
        if any(name in take.filled for take in takes):
            marks = [take.filled.get(name, np.zeros(take.frames[name].shape, dtype=bool)) for take in takes]
            arrays[f"filled_{index}"] = np.packbits(np.concatenate(marks))
        bodies.append({"name": name, "spec": body_spec(body), "step": step})
    stamped = [take.timestamps for take in motions.takes if take.timestamps is not None]
    if stamped:
        arrays["timestamps"] = np.concatenate(stamped)
    order = list(motions.bodies)
    meta: dict[str, Any] = {
        "format": FORMAT,
        "name": motions.name,
        "synthetic": motions.synthetic,
        "families": dict(motions.families),
        "bodies": bodies,
        "takes": [
            {
                "recording": take.recording,
                "action": take.action,
                "fps": take.fps,
                "mirrored": take.mirrored,
                "frames": len(next(iter(take.frames.values()))),
                "bodies": sorted(order.index(name) for name in take.frames),
                "timestamps": take.timestamps is not None,
            }
            for take in motions.takes
        ],
    }
    if motions.notes:
        meta["notes"] = list(motions.notes)
    arrays["meta"] = np.frombuffer(json.dumps(meta, sort_keys=True).encode(), dtype=np.uint8)
    with atomic_path(path) as temporary:
        _write(temporary, arrays)
    return Path(path)


def read_npz(path: str | os.PathLike[str]) -> Motions:
    """Reads a file written by ``save_motions``.

    Raises:
        MotionError: the file is missing, too large, no such file, or inconsistent in itself.
        EmbodimentError: it holds a robot that the catalog does not know, or knows with other joints.
    """
    file = Path(path)
    arrays = _read(file)
    try:
        meta = json.loads(bytes(arrays["meta"]).decode())
        if meta["format"] != FORMAT:
            raise MotionError(
                f"{file}: format {shortened(meta['format'], 60)}, expected {FORMAT!r}; write it again with this version"
            )
        bodies = {str(entry["name"]): body_from_spec(file, entry["spec"]) for entry in meta["bodies"]}
        frames = [
            _decode(file, arrays.get(f"frames_{index}"), body, entry["step"])
            for index, (body, entry) in enumerate(zip(bodies.values(), meta["bodies"], strict=True))
        ]
        filled = [_unpack(file, arrays.get(f"filled_{index}"), values) for index, values in enumerate(frames)]
        takes = _takes(file, meta["takes"], list(bodies), frames, filled, arrays.get("timestamps"))
        families = {str(key): str(value) for key, value in meta["families"].items()}
        notes = tuple(str(note) for note in meta.get("notes", ()))
        return Motions(str(meta["name"]), takes, bodies, families, bool(meta["synthetic"]), notes)
    except (MotionError, EmbodimentError):
        raise
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError, RecursionError) as error:
        raise MotionError(
            f"{file} is no motion file of this library or is damaged ({type(error).__name__}: "
            f"{str(error)[:400]}); "
            "expected one written by save_motions"
        ) from error


def _takes(
    file: Path,
    entries: list[dict[str, Any]],
    names: list[str],
    frames: list[FloatArray],
    filled: list[NDArray[np.bool_] | None],
    timestamps: NDArray[Any] | None,
) -> tuple[Take, ...]:
    used = [0] * len(names)
    clock = 0
    takes = []
    for entry in entries:
        count = int(entry["frames"])
        if count < 1:
            raise MotionError(f"{file}: take {entry['recording']!r} has {count} frames; expected at least one")
        own: dict[str, FloatArray] = {}
        marks: dict[str, NDArray[np.bool_]] = {}
        for index in map(int, entry["bodies"]):
            part = slice(used[index], used[index] + count)
            used[index] += count
            own[names[index]] = frames[index][part]
            if len(own[names[index]]) != count:
                raise MotionError(f"{file}: take {entry['recording']!r} ends early for body {names[index]!r}")
            mark = filled[index]
            if mark is not None and mark[part].any():
                marks[names[index]] = mark[part]
        times = None
        if entry["timestamps"]:
            if timestamps is None or len(timestamps) < clock + count:
                raise MotionError(f"{file}: timestamps of take {entry['recording']!r} are missing")
            times = np.asarray(timestamps[clock : clock + count], dtype=np.float64)
            clock += count
        takes.append(
            Take(str(entry["recording"]), str(entry["action"]), float(entry["fps"]), own, bool(entry["mirrored"]),
                 marks, times)
        )  # fmt: skip
    for name, values, end in zip(names, frames, used, strict=True):
        if len(values) != end:
            raise MotionError(f"{file}: body {name!r} has {len(values)} frames, its takes have {end}")
    return tuple(takes)


def _encode(frames: FloatArray, step: float | None, name: str) -> NDArray[Any]:
    """Frames as they are, or rounded: low and high bytes ``(2, F, N)`` of 16-bit differences over time."""
    if step is None:
        return np.ascontiguousarray(frames, dtype=np.float64)
    counts = np.round(frames / step)
    if np.abs(counts).max() > np.iinfo(np.int16).max:
        raise MotionError(f"{name!r}: values up to {np.abs(frames).max():.3g} do not fit into 16 bits at step {step}")
    whole = np.ascontiguousarray(counts.astype(np.int16).T)
    # Differences wrap around in 16 bits; summing them wraps back, so nothing is lost.
    change = np.diff(whole, axis=1, prepend=np.zeros((len(whole), 1), dtype=np.int16))
    # Small numbers of either sign become small positive ones, whose high bytes are nearly all zero.
    folded = (change.astype(np.int32) << 1 ^ change.astype(np.int32) >> 15).astype(np.uint16)
    return np.stack([folded & 0xFF, folded >> 8]).astype(np.uint8)


def _unfold(stored: NDArray[Any], step: float) -> FloatArray:
    """Inverse of the rounding branch of ``_encode``."""
    folded = stored[0].astype(np.int32) | stored[1].astype(np.int32) << 8
    change = (folded >> 1 ^ -(folded & 1)).astype(np.int16)
    result: FloatArray = np.cumsum(change, axis=1, dtype=np.int16).T.astype(np.float64) * step
    return result


def _decode(file: Path, stored: NDArray[Any] | None, body: Embodiment, step: float | None) -> FloatArray:
    if stored is None:
        return np.zeros((0, body.n_features))
    if step is not None:
        if stored.dtype != np.uint8 or stored.ndim != 3 or len(stored) != 2 or not 0.0 < float(step) < 1.0:
            raise MotionError(f"{file}: rounded frames of {body.name!r} are damaged")
        stored = np.asarray(_unfold(stored, float(step)))
    if stored.dtype != np.float64 or stored.ndim != 2 or stored.shape[1] != body.n_features:
        raise MotionError(
            f"{file}: frames of {body.name!r} have shape {stored.shape} and type {stored.dtype}, "
            f"expected (N, {body.n_features}) float64"
        )
    bad = np.argwhere(~np.isfinite(stored))
    if len(bad):
        raise MotionError(
            f"{file}: frame {bad[0][0]} of {body.name!r}, {body.features[bad[0][1]].name} is not a finite number"
        )
    return np.ascontiguousarray(stored, dtype=np.float64)


def _unpack(file: Path, stored: NDArray[Any] | None, frames: FloatArray) -> NDArray[np.bool_] | None:
    if stored is None:
        return None
    if stored.dtype != np.uint8 or stored.ndim != 1 or len(stored) != (frames.size + 7) // 8:
        raise MotionError(f"{file}: the marks of filled gaps do not fit the frames")
    return np.unpackbits(stored, count=frames.size).astype(bool).reshape(frames.shape)


def body_spec(body: Embodiment) -> dict[str, Any]:
    """Humans completely; of robots name and joints, for motions stay valid when a URDF is refined."""
    spec = body.spec()
    return spec if body.kind == "human" else {"kind": "robot", "name": body.name, "joints": spec["joints"]}


def body_from_spec(file: Path, spec: dict[str, Any]) -> Embodiment:
    """Inverse of ``body_spec``.

    Raises:
        EmbodimentError: a robot that the catalog does not know, or knows with other joints.
        MotionError: the description is incomplete.
    """
    try:
        body = catalog.from_spec(spec) if spec.get("kind") == "human" else catalog.get(str(spec["name"]))
    except EmbodimentError as error:
        raise EmbodimentError(f"{file}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise MotionError(f"{file}: a body is described wrongly ({type(error).__name__}: {error})") from error
    joints = [feature.name for feature in body.features]
    if body.kind == "robot" and joints != spec.get("joints"):
        raise EmbodimentError(f"{file}: robot {body.name!r} has joints {joints}, the motions {spec.get('joints')}")
    return body


def _write(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(arrays):
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, arrays[name], version=(1, 0), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=_EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, buffer.getvalue())


def _read(file: Path) -> dict[str, NDArray[Any]]:
    """All arrays of an ``.npz``, after checking that it does not unpack to something huge."""
    if not file.is_file():
        raise MotionError(f"no motion file {file}; check the path")
    try:
        return read_arrays(file, "a file written by save_motions", MotionError, MAX_BYTES)
    except MotionError as error:
        if "no readable archive" in str(error):
            raise MotionError(f"{file} is no readable .npz file; expected one written by save_motions") from error
        raise
