"""Comparisons of arms that were sampled once and come with the package.

Sampling two bodies takes a second or two, and the bodies of the catalog do not change, so
``scripts/build_transferability.py`` writes their comparisons down. Each is found by a fingerprint of both arms and of
the sampling: an arm that differs, or other options, are sampled as ever.
"""

from __future__ import annotations

from functools import lru_cache

from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.files import asset, fingerprint, read_json
from syda_gym.routes.general import Sampling
from syda_gym.routes.workspace.sampling import chain_fingerprint

__all__ = ["FILE", "Rows", "comparison_key", "shipped_comparison"]

FILE = asset("transferability.json")

Rows = list[tuple[float, ...]]
"""S, C, coverage and C(A, A resampled) of one pair of arms, one row per repeat."""


def comparison_key(source: ArmChain, target: ArmChain, sampling: Sampling) -> str:
    """Identifies everything that the comparison of two canonical arms depends on."""
    how = repr((sampling.samples, sampling.cell, sampling.seed, sampling.repeats))
    return fingerprint("comparison", chain_fingerprint(source), chain_fingerprint(target), how)


def shipped_comparison(source: ArmChain, target: ArmChain, sampling: Sampling) -> Rows | None:
    """What sampling these arms would give, or ``None`` if it does not come with the package."""
    if sampling != Sampling():
        return None
    return _table().get(comparison_key(source, target, sampling))


@lru_cache(maxsize=1)
def _table() -> dict[str, Rows]:
    if not FILE.is_file():
        return {}
    content = read_json(FILE)["comparisons"]
    return {key: [tuple(float(value) for value in row) for row in rows] for key, rows in content.items()}
