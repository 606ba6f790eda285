"""Builds what is known beforehand of the bundled bodies: sampled workspaces compared, and the default plan imitated.

``python scripts/build_transferability.py`` writes ``assets/transferability.json`` and ``assets/dry_run.npz`` (about a
minute); ``--only imitations`` makes the second alone, in seconds. With ``--check`` it computes again and says whether
the assets still hold. Run it when a bundled body, the sampling, the embedded motions or the imitation has changed.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.files import atomic_path, read_json, write_json
from syda_gym.motions.synthetic.generator import BODIES
from syda_gym.routes.dry_run import memory
from syda_gym.routes.dry_run.imitation import imitate
from syda_gym.routes.dry_run.memory import default_plan, imitation_key
from syda_gym.routes.dry_run.rehearsal import RETARGETERS
from syda_gym.routes.general import Sampling
from syda_gym.routes.metric import compare_arms, pair_arms
from syda_gym.routes.shipped import FILE, Rows, comparison_key
from syda_gym.routes.workspace.store import WorkspaceStore

TOLERANCE = 1e-9
"""Other processors round differently in the last digits."""


def comparisons() -> dict[str, Rows]:
    """Every ordered pair of arms that ``syda_gym.transferability`` compares between two of the bodies."""
    store, sampling, found = WorkspaceStore(), Sampling(), {}
    for a, b in itertools.product(map(catalog.get, BODIES), repeat=2):
        for pair in pair_arms(a, b)[0]:
            key = comparison_key(pair.source, pair.target, sampling)
            if key not in found:
                # A store of its own, so that nothing is taken from the asset.
                found[key] = compare_arms(pair, sampling, store)
    return found


def imitations() -> dict[str, np.ndarray]:
    """Directions that the bundled robots reach in every clip of the default plan, by the key of body and clip."""
    plan, found = default_plan(), {}
    for body in map(catalog.get, BODIES):
        if body.kind == "robot":
            for way in RETARGETERS["either"]:
                for clip, shown in zip(plan.clips, imitate(body, plan, way), strict=True):
                    found |= {f"{imitation_key(body, clip, way)}/{side}": arm for side, arm in shown.items()}
    return found


def main() -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    parser.add_argument("--only", choices=("comparisons", "imitations"), help="one of the two")
    arguments = parser.parse_args()
    same = True
    if arguments.only != "imitations":
        same &= _comparisons(arguments.check)
    if arguments.only != "comparisons":
        same &= _imitations(arguments.check)
    if arguments.check:
        print("holds" if same else "differs: run scripts/build_transferability.py and commit the asset")
    return 0 if same else 1


def _comparisons(check: bool) -> bool:
    """Writes them, or says whether those that are stored hold."""
    made = comparisons()
    if check:
        stored = read_json(FILE)["comparisons"]
        return stored.keys() == made.keys() and all(np.allclose(made[key], stored[key], atol=TOLERANCE) for key in made)
    write_json(FILE, {"comparisons": made})
    print(f"{FILE}: {len(made)} comparisons, {FILE.stat().st_size} bytes")
    return True


def _imitations(check: bool) -> bool:
    shown = imitations()
    if check:
        with np.load(memory.FILE, allow_pickle=False) as known:
            return set(known.files) == set(shown) and all(
                np.allclose(known[key], shown[key], atol=1e-6) for key in shown
            )
    with atomic_path(memory.FILE) as path, path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **shown)
    print(f"{memory.FILE}: {len(shown)} imitations, {memory.FILE.stat().st_size} bytes")
    return True


if __name__ == "__main__":
    raise SystemExit(main())
