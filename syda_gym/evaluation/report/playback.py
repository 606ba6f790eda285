"""Packs the playback into JSON that a browser unpacks chain by chain: 16-bit numbers, every track stored once."""

from __future__ import annotations

import base64
from dataclasses import asdict
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.evaluation.report.figures import Track
from syda_gym.evaluation.report.model import Playback, PlaybackChain
from syda_gym.files import fingerprint

__all__ = ["BYTE_BUDGET", "pack_playback"]

BYTE_BUDGET = 15 * 2**20
"""Raw bytes of tracks that a page may hold; with more, frames are thinned so that the page stays below 25 MB."""

_LENGTH_STEP = 1e-3 / 4  # m; 16 bits reach 8.19 m
_TURN_STEP = 1.0 / 32767.0


def pack_playback(playback: Playback, budget: int = BYTE_BUDGET) -> dict[str, Any]:
    """Returns the JSON-able content of a playback.

    Args:
        playback: chains with their tracks.
        budget: raw bytes allowed for all tracks; frames are dropped evenly to stay below it.

    Returns:
        ``models`` (solids of each body, once), ``tracks`` (numbers of each distinct track, once) and ``chains``.
    """
    stride = max(1, -(-_raw_bytes(playback) // budget))
    models: dict[str, Any] = {}
    tracks: dict[str, Any] = {}
    chains = [_pack_chain(chain, stride, models, tracks) for chain in playback.chains]
    return {"models": models, "tracks": tracks, "chains": chains, "stride": stride}


def _raw_bytes(playback: Playback) -> int:
    seen = {id(t): t for chain in playback.chains for t in (*chain.figures, chain.reference) if t is not None}
    return sum(2 * (t.points.size + t.poses.size) for t in seen.values())


def _pack_chain(chain: PlaybackChain, stride: int, models: dict[str, Any], tracks: dict[str, Any]) -> dict[str, Any]:
    return {
        "name": chain.name,
        "clip": chain.clip,
        "fps": chain.fps / stride,
        "figures": [_pack_track(figure, stride, models, tracks) for figure in chain.figures],
        "reference": _pack_track(chain.reference, stride, models, tracks) if chain.reference else None,
        "error": [round(float(value) * 1e4) for value in np.asarray(chain.error)[::stride]],
        "bound": None if chain.bound is None else round(float(chain.bound) * 1e4),
    }


def _pack_track(track: Track, stride: int, models: dict[str, Any], tracks: dict[str, Any]) -> str:
    points = _encode(track.points[::stride], _LENGTH_STEP)
    poses = track.poses[::stride]
    positions, turns = _encode(poses[..., :3], _LENGTH_STEP), _encode(poses[..., 3:], _TURN_STEP)
    shapes = [asdict(shape) for shape in track.shapes]
    model = fingerprint(track.name, repr(shapes))
    models.setdefault(
        model,
        {"name": track.name, "kind": track.kind, "height": round(track.height, 3), "shapes": _rounded(shapes)},
    )
    key = fingerprint(model, points, positions, turns)
    tracks.setdefault(
        key,
        {
            "model": model,
            "frames": len(track.points[::stride]),
            "points": points,
            "positions": positions,
            "turns": turns,
        },
    )
    return key


def _encode(values: FloatArray, step: float) -> str:
    whole = np.clip(np.rint(values / step), -32767, 32767).astype("<i2")
    return base64.b64encode(whole.tobytes()).decode("ascii")


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, 5)
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return value
