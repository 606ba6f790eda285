"""Builds the mappings that the package ships: SyDa ``general`` between the bodies of the embedded motions.

With them ``gymnasium.make("SydaTeleop-v0")`` needs no fitting and no torch. Run it after the embedded motions or the
presets of SyDa have changed::

    python scripts/build_mappings.py

It fits every ordered pair of the named bodies to the embedded motions at 10 Hz (neighbouring frames at 30 Hz are
near-duplicates), and writes ``syda_gym/assets/mappings/A-B.safetensors`` and ``.json``. The result is the same, bit by
bit, wherever the same versions of numpy and torch run.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.files import asset
from syda_gym.mappings import fit, load_mapping, save_mapping
from syda_gym.motions.loading import load_motions, resampled

BODIES = ("adult", "kid", "pepper", "nao")
FPS = 10.0


def main() -> None:
    """Fits, saves, reads back and compares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=asset("mappings"), help="folder to write to")
    parser.add_argument("--bodies", nargs="+", default=list(BODIES), help="bodies of the embedded motions")
    arguments = parser.parse_args()
    motions = resampled(load_motions("embedded"), FPS)
    for source, target in itertools.permutations(arguments.bodies, 2):
        pair = motions.pair(source, target)
        mapping = fit(pair, method="syda", preset="general", seed=0)
        path = save_mapping(mapping, arguments.out / f"{source}-{target}")
        if not np.array_equal(load_mapping(path)(pair.source), mapping(pair.source)):
            raise SystemExit(f"{path} does not give back what was saved")
        error = landmark_error(pair.target_body, mapping(pair.source), pair.target).mean()
        bound = float(mapping.error_bound(pair.source[:1])[0])
        print(f"{path.name}: training error {error:.4f} m, bound on unseen actions {bound:.4f} m")


if __name__ == "__main__":
    main()
