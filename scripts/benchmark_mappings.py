"""Benchmarks mappings: one frame adult to Pepper against mink on the same targets, fits, and the paper's study.

All figures are ratios or processor times of one run on one thread, so that a busy machine disturbs them little::

    python scripts/benchmark_mappings.py                        # embedded motions
    python scripts/benchmark_mappings.py --motions paper:DIR --out docs/results/mappings.json

How long ``reproduce-paper`` takes stands in the ``study.json`` that it writes.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: threads only cost time on frames this small
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.files import write_json
from syda_gym.mappings import fit
from syda_gym.mappings.card import versions
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.mink_ik import MinkArmCoder
from syda_gym.motions.clip import PairedMotions
from syda_gym.motions.loading import load_motions, resampled

FRAMES = 150
ROUNDS = 7


def main() -> None:
    """Runs the benchmark, prints a table and writes it if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", default="embedded")
    parser.add_argument("--out", type=Path, help="JSON file for the figures")
    arguments = parser.parse_args()
    motions = load_motions(arguments.motions)
    if any(take.fps > 10.0 for take in motions.takes):
        motions = resampled(motions, 10.0)
    pair = motions.pair("adult", "pepper")
    found = {"frames": len(pair), **_fits(pair)}
    found |= _single_frames(fit(pair, confidence=False), pair.source[:FRAMES])
    for name, value in found.items():
        print(f"{name:40s} {value:10.4g}")
    if arguments.out:
        write_json(arguments.out, {"motions": motions.name, "figures": found, "versions": versions()})


def _fits(pair: PairedMotions) -> dict[str, float]:
    fit(pair, preset="synergies", epochs=1)  # imports torch and warms it up
    variants = {
        "fit general with error bound [s]": {"preset": "general"},
        "fit general [s]": {"preset": "general", "confidence": False},
        "fit nested [s]": {"preset": "nested", "confidence": False},
        "fit accurate [s]": {"preset": "accurate", "confidence": False},
    }
    return {name: _processor_time(lambda o=options: fit(pair, **o)) for name, options in variants.items()}  # type: ignore[misc]


def _single_frames(mapping: CodedMapping, frames: np.ndarray) -> dict[str, float]:
    coder = mapping.target_coder
    slow = CodedMapping(
        mapping.card,
        mapping.source_coder,
        MinkArmCoder(mapping.target, coder.settings(), coder.arrays()),
        mapping.regressor,
    )
    ours, theirs = [], []
    for _ in range(ROUNDS):  # in turns, so that both meet the same neighbours on the machine
        ours.append(_processor_time(lambda: [mapping(frame) for frame in frames]) / len(frames))
        theirs.append(_processor_time(lambda: slow(frames)) / len(frames))
    apart = landmark_error(mapping.target, slow(frames), mapping(frames)).mean()
    a, b = statistics.median(ours), statistics.median(theirs)
    return {
        "one frame [us]": 1e6 * a,
        "one frame by mink [us]": 1e6 * b,
        "times mink": b / a,
        "difference to mink [mm]": 1e3 * float(apart),
    }


def _processor_time(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


if __name__ == "__main__":
    main()
