"""Imitations that are known already: in memory, and those of the bundled robots, which come with the package."""

from __future__ import annotations

import json
from collections import OrderedDict
from functools import lru_cache

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.files import asset, fingerprint
from syda_gym.routes.dry_run.imitation import Retargeter, imitate
from syda_gym.routes.dry_run.plan import Plan, plan_from_motions
from syda_gym.routes.dry_run.positions import by_positions

__all__ = ["FILE", "default_plan", "imitation_key", "imitation_of"]

FILE = asset("dry_run.npz")
"""Imitations of the default plan by the bundled robots, written by ``scripts/build_transferability.py``."""

PERFORMER = "adult"
"""Whose synthetic motions are the default plan."""

_MOST = 128
_known: OrderedDict[str, dict[str, FloatArray]] = OrderedDict()


@lru_cache(maxsize=1)
def default_plan() -> Plan:
    """What is planned if the user names nothing: the adult's synthetic motions that come with the package."""
    from syda_gym.motions.loading import load_motions

    return plan_from_motions(load_motions("embedded"), PERFORMER)


def imitation_of(body: Embodiment, plan: Plan, retargeter: Retargeter | None = None) -> list[dict[str, FloatArray]]:
    """``imitation.imitate`` clip by clip, each done once; arguments and result as there.

    A retargeter of the user is asked every time, because nothing tells whether it is the one of before.
    """
    if body.kind != "robot" or retargeter not in (None, by_positions):
        return imitate(body, plan, retargeter)
    keys = [imitation_key(body, clip, retargeter) for clip in plan.clips]
    shipped = _shipped()
    missing = [place for place, key in enumerate(keys) if key not in _known and key not in shipped]
    if missing:
        part = Plan(tuple(plan.clips[k] for k in missing), tuple(plan.actions[k] for k in missing))
        for place, clip in zip(missing, imitate(body, part, retargeter), strict=True):
            _known[keys[place]] = clip
    found = [_known[key] if key in _known else shipped[key] for key in keys]
    while len(_known) > _MOST * max(1, len(keys)):
        _known.popitem(last=False)
    return found


def imitation_key(body: Embodiment, clip: FloatArray, retargeter: Retargeter | None = None) -> str:
    """Identifies everything that the imitation of one clip by the library's own ways depends on."""
    spec = json.dumps(body.spec(), sort_keys=True, default=str)
    chains = getattr(body, "chains", ())
    numbers = [
        array.tobytes() for chain in chains for array in (chain.axes, chain.lower, chain.upper, chain.point_offsets)
    ]
    speed = np.asarray(getattr(body, "speed", ())).tobytes()
    return fingerprint("imitation 2" if retargeter is None else "positions 1", spec, *numbers, speed, clip.tobytes())


@lru_cache(maxsize=1)
def _shipped() -> dict[str, dict[str, FloatArray]]:
    if not FILE.is_file():
        return {}
    found: dict[str, dict[str, FloatArray]] = {}
    with np.load(FILE, allow_pickle=False) as stored:
        for name in stored.files:
            key, side = name.split("/")
            found.setdefault(key, {})[side] = np.asarray(stored[name], dtype=np.float64)
    return found
