"""Builds ``syda_gym/assets/motions/embedded.npz``, the synthetic motions that ship with the package, from their seed.

``python scripts/build_motions.py`` writes the asset; with ``--check`` it says whether the asset is what the code makes.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from syda_gym.files import asset
from syda_gym.motions import generate, save_motions
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

STEPS = {"m": 1e-3, "rad": 1e-4}
"""Rounding: a millimetre, the depth camera's own unit; a tenth of a milliradian."""


def build(path: Path) -> Path:
    """Writes the embedded motions to ``path``."""
    return save_motions(generate(name="embedded (synthetic)"), path, steps=STEPS)


def main() -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    target = asset("motions", "embedded.npz")
    if not parser.parse_args().check:
        print(f"{build(target)}: {target.stat().st_size} bytes")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        fresh = build(Path(folder) / "embedded.npz")
        same = fresh.read_bytes() == target.read_bytes()
        close = same or within_a_step(load_motions(f"npz:{fresh}"), load_motions(f"npz:{target}"))
    words = "equal, byte for byte" if same else "equal up to one step of rounding"
    print(words if close else "differs: run scripts/build_motions.py and commit the asset")
    return 0 if close else 1


def within_a_step(fresh: Motions, stored: Motions) -> bool:
    """Whether two data sets hold the same takes, and frames no more than a step of rounding apart."""
    if [take.recording for take in fresh.takes] != [take.recording for take in stored.takes]:
        return False
    steps = {name: STEPS["m" if body.kind == "human" else "rad"] for name, body in stored.bodies.items()}
    return all(
        ours.frames.keys() == theirs.frames.keys()
        and all(np.allclose(ours.frames[b], theirs.frames[b], rtol=0, atol=1.001 * steps[b]) for b in ours.frames)
        for ours, theirs in zip(fresh.takes, stored.takes, strict=True)
    )


if __name__ == "__main__":
    raise SystemExit(main())
