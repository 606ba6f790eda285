"""Builds ``syda_gym/assets/transferability.json``: the sampled comparisons of the bodies of the embedded motions.

``python scripts/build_transferability.py`` writes the asset (about a minute); with ``--check`` it samples again and
says whether the asset still holds. Run it when a bundled body or the sampling has changed.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.files import read_json, write_json
from syda_gym.motions.synthetic.generator import BODIES
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


def main() -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    check, made = parser.parse_args().check, comparisons()
    if not check:
        write_json(FILE, {"comparisons": made})
        print(f"{FILE}: {len(made)} comparisons, {FILE.stat().st_size} bytes")
        return 0
    stored = read_json(FILE)["comparisons"]
    same = stored.keys() == made.keys() and all(np.allclose(made[key], stored[key], atol=TOLERANCE) for key in made)
    print("holds" if same else "differs: run scripts/build_transferability.py and commit the asset")
    return 0 if same else 1


if __name__ == "__main__":
    raise SystemExit(main())
