"""Benchmarks mappings: one frame adult to Pepper against mink on the same targets, fits, and the paper's study.

All figures are ratios or processor times of one run on one thread, so that a busy machine disturbs them little::

    python scripts/benchmark_mappings.py                        # embedded motions
    python scripts/benchmark_mappings.py --motions paper:DIR --study
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: threads only cost time on frames this small
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.mappings import fit
from syda_gym.mappings.coded import CodedMapping
from syda_gym.mappings.mink_ik import MinkArmCoder
from syda_gym.motions.loading import load_motions, resampled

FRAMES = 150
ROUNDS = 7


def main() -> None:
    """Runs the benchmark and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", default="embedded")
    parser.add_argument("--study", action="store_true", help="also time reproduce-paper with 10 seeds (minutes)")
    arguments = parser.parse_args()
    motions = load_motions(arguments.motions)
    if any(take.fps > 10.0 for take in motions.takes):
        motions = resampled(motions, 10.0)
    pair = motions.pair("adult", "pepper")
    _fits(pair)
    mapping = fit(pair, confidence=False)
    _single_frames(mapping, pair.source[:FRAMES])
    if arguments.study:
        _study(arguments.motions)


def _fits(pair: object) -> None:
    fit(pair, epochs=1)  # type: ignore[arg-type]  # imports torch and warms it up
    for preset, options in (("general", {}), ("general", {"confidence": False}), ("accurate", {"confidence": False})):
        seconds = _processor_time(lambda p=preset, o=options: fit(pair, preset=p, **o))  # type: ignore[misc,arg-type]
        note = " without error bound" if options else " with error bound"
        print(f"fit {preset:9s}{note:22s} {seconds:8.2f} s")


def _single_frames(mapping: CodedMapping, frames: np.ndarray) -> None:
    coder = mapping.target_coder
    slow = CodedMapping(
        mapping.card,
        mapping.source_coder,
        MinkArmCoder(mapping.target, coder.settings(), coder.arrays()),
        mapping.regressor,
    )
    ours, theirs, network = [], [], []
    for _ in range(ROUNDS):  # in turns, so that both meet the same neighbours on the machine
        ours.append(_processor_time(lambda: [mapping(frame) for frame in frames]) / len(frames))
        theirs.append(_processor_time(lambda: slow(frames)) / len(frames))
        codes = mapping.source_coder.encode(frames)[:, None]
        network.append(_processor_time(lambda c=codes: [mapping.regressor(x) for x in c]) / len(frames))  # type: ignore[misc]
    apart = landmark_error(mapping.target, slow(frames), mapping(frames)).mean()
    a, b, c = (statistics.median(values) for values in (ours, theirs, network))
    print(f"one frame, encoder, network and closed-form inverse kinematics: {1e6 * a:8.0f} us")
    print(f"of which the network in numpy:                                 {1e6 * c:8.0f} us")
    print(f"one frame of a sequence, the same targets by mink:             {1e6 * b:8.0f} us")
    print(f"ratio {b / a:.1f}; the two differ by {1000 * apart:.2f} mm on average")


def _study(spec: str) -> None:
    from syda_gym.evaluation.paper import reproduce

    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        study = reproduce(spec, folder, seeds=10, workers=2)
        wall = time.perf_counter() - start
    busy = sum(cell.seconds for cell in study.cells.values())
    print(f"reproduce-paper, 10 seeds, 2 processes: {wall / 60:.1f} min ({busy / 60:.1f} min of processor time)")


def _processor_time(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


if __name__ == "__main__":
    main()
