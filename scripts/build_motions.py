"""Builds ``syda_gym/assets/motions/embedded.npz``, the synthetic motions that ship with the package, from their seed.

``python scripts/build_motions.py`` writes the asset; with ``--check`` it says whether the asset is what the code makes.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from syda_gym.files import asset
from syda_gym.motions import generate, save_motions

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
        same = build(Path(folder) / "embedded.npz").read_bytes() == target.read_bytes()
    print("equal, byte for byte" if same else "differs: run scripts/build_motions.py and commit the asset")
    return 0 if same else 1


if __name__ == "__main__":
    raise SystemExit(main())
