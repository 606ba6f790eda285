"""Measures transferability against its bars: agreement with the reference values, speed, and speed against a loop.

The dry run of fifteen bodies needs the extra `robots`.

Usage: python scripts/benchmark_transferability.py [--json FILE]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.evaluation.prediction.bed import bed_bodies
from syda_gym.files import write_json
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.plan import Plan
from syda_gym.routes.dry_run.rehearsal import Rehearsal
from syda_gym.routes.metric import transferability
from syda_gym.routes.paper import paper_human
from syda_gym.routes.workspace.arms import canonical_arms
from syda_gym.routes.workspace.sampling import TIP, arm_length, sobol_angles, workspace_from_angles
from syda_gym.routes.workspace.store import WorkspaceStore

LOOP_SAMPLES = 20_000
SAMPLES = 2**20
BARS = {"ratio": 10.0, "seconds_six_pairs": 12.0, "seconds_dry_run": 60.0}

# S, KL and T behind Table 2; C and T of the general definition with alpha = 1, N = 2^20.
PAPER = {
    ("adult", "kid"): (0.326531, 0.005600, 0.508025),
    ("kid", "adult"): (0.212885, 0.073245, 0.454119),
    ("adult", "pepper"): (0.112178, 0.592378, 0.235752),
    ("pepper", "adult"): (0.321869, 2.772109, 0.199125),
    ("kid", "pepper"): (0.111645, 0.591065, 0.233548),
    ("pepper", "kid"): (0.326153, 2.740149, 0.200157),
}
GENERAL = {
    ("adult", "kid"): (0.982, 0.753),
    ("kid", "adult"): (0.973, 0.973),
    ("adult", "pepper"): (0.562, 0.306),
    ("kid", "pepper"): (0.558, 0.396),
    ("pepper", "kid"): (0.934, 0.934),
    ("pepper", "adult"): (0.934, 0.934),
}


def pinocchio_loop(robot: Robot, samples: int) -> float:
    """Seconds that a plain loop over samples takes: FK, Jacobian, manipulability and voxel of Pepper's left arm."""
    import pinocchio

    full = pinocchio.buildModelFromUrdf(str(robot.urdf))
    chain = robot.chains[0]
    locked = [i for i in range(1, full.njoints) if full.names[i] not in chain.joints]
    model = pinocchio.buildReducedModel(full, locked, pinocchio.neutral(full))
    data = model.createData()
    frame = model.getFrameId(robot.description.arms[0].tip)
    angles = sobol_angles(chain, 2**15, 0)(0, samples).T.copy()
    cells: dict[tuple[int, ...], list[float]] = {}
    length = arm_length(chain)
    local = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    start = time.perf_counter()
    for q in angles:
        jacobian = pinocchio.computeFrameJacobian(model, data, q, frame, local)[:3] / length
        position = (data.oMf[frame].translation - data.oMi[1].translation) / length
        value = float(np.sqrt(max(np.linalg.det(jacobian @ jacobian.T), 0.0)))
        cells.setdefault(tuple(np.round(position / 0.1).astype(int)), []).append(value)
    return time.perf_counter() - start


def batched(robot: Robot, samples: int) -> float:
    """Seconds that the batched sampling takes for the same arm, samples drawn before as for the loop."""
    chain = robot.chains[0]
    angles = sobol_angles(chain, samples, 0)
    start = time.perf_counter()
    workspace_from_angles(chain, angles, samples, 0.1)
    return time.perf_counter() - start


def six_pairs(measure: Callable[..., Any], definition: str) -> tuple[float, dict[tuple[str, str], Any]]:
    """Seconds and results of six ordered pairs from nothing cached."""
    from syda_gym.routes.workspace import sampling as workspace

    workspace._sobol.cache_clear()
    humans = {name: paper_human(name) for name in ("adult", "kid")} if definition == "general" else {}
    bodies = {name: humans.get(name, catalog.get(name)) for name in ("adult", "kid", "pepper")}
    store = WorkspaceStore()
    start = time.perf_counter()
    results = {(a, b): measure(bodies[a], bodies[b], definition, store=store) for a, b in permutations(bodies, 2)}
    return time.perf_counter() - start, results


def fifteen_bodies() -> tuple[float, int]:
    """Processor seconds of a dry run of the test bed's bodies, nothing known before, and how many routes it scored."""
    plan, bodies = default_plan(), bed_bodies()
    start = time.process_time()
    together = Rehearsal(bodies, Plan(tuple(clip[:-1] for clip in plan.clips), plan.actions))  # not the shipped clips
    routes = [route for hops in (2, 3) for route in permutations(bodies, hops)]
    for route in routes:
        together.score(route)
    return time.process_time() - start, len(routes)


def main() -> int:
    """Prints every measure beside its bar; exit status 1 if one is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    pepper = catalog.get("pepper")
    assert isinstance(pepper, Robot)
    assert canonical_arms(pepper)["left"].point_joints[TIP] == 4
    failed: list[str] = []

    def check(name: str, value: float, good: bool, bar: str) -> None:
        print(f"{name:<58} {value:>10.4f}   bar {bar:<10} {'ok' if good else 'MISSED'}")
        if not good:
            failed.append(name)

    loop = pinocchio_loop(pepper, LOOP_SAMPLES) * SAMPLES / LOOP_SAMPLES
    fast = min(batched(pepper, SAMPLES) for _ in range(3))
    print(f"one 5-joint arm, 2^20 samples: loop {loop:.1f} s (from {LOOP_SAMPLES} samples), batched {fast:.2f} s")
    check("ratio of the loop to the batched sampling", loop / fast, loop / fast >= BARS["ratio"], ">= 10")
    cpu = time.process_time()
    seconds, general = six_pairs(transferability, "general")
    print(f"six ordered pairs took {time.process_time() - cpu:.1f} s of processor time (on a busy machine, see this)")
    check(
        "seconds, general, six ordered pairs, 3 repeats of 2^20", seconds, seconds <= BARS["seconds_six_pairs"], "<= 12"
    )
    paper_seconds, paper = six_pairs(transferability, "paper")
    check("seconds, paper, six ordered pairs", paper_seconds, paper_seconds <= 12.0, "<= 12")
    rehearsed, routes = fifteen_bodies()
    check(
        f"processor seconds, dry run of 15 bodies, {routes} routes",
        rehearsed,
        rehearsed <= BARS["seconds_dry_run"],
        "<= 60",
    )
    for pair, (S, KL, T) in PAPER.items():
        found = paper[pair]
        label = f"paper {pair[0]} to {pair[1]}: error of"
        check(f"{label} S", abs(found.S - S), abs(found.S - S) <= 1e-3, "<= 1e-3")
        check(f"{label} KL", abs(found.KL - KL), abs(found.KL - KL) <= 1e-2, "<= 1e-2")
        check(f"{label} T", abs(found.T - T), abs(found.T - T) <= 5e-4, "<= 5e-4")
    by_kid = paper["adult", "kid"].T * paper["kid", "pepper"].T
    by_adult = paper["kid", "adult"].T * paper["adult", "pepper"].T
    check("Table 5: T of adult, kid, pepper (0.1186)", by_kid, abs(by_kid - 0.1186) <= 5e-4, "± 5e-4")
    check("Table 5: T of kid, adult, pepper (0.1071)", by_adult, abs(by_adult - 0.1071) <= 5e-4, "± 5e-4")
    for pair, (C, T) in GENERAL.items():
        found = general[pair]
        check(f"general {pair[0]} to {pair[1]}: C ({C})", found.C, abs(found.C - C) <= 0.01, "± 0.01")
        check(f"general {pair[0]} to {pair[1]}: T ({T})", found.T, abs(found.T - T) <= 0.01, "± 0.01")
    for name in ("adult", "kid", "pepper", "nao"):
        floor = 1.0 - transferability(name, name, "general").noise_floor
        check(f"C of {name} against an independent resample of itself", floor, floor >= 0.97, ">= 0.97")
    if arguments.json:
        write_json(
            arguments.json,
            {
                "loop_seconds": loop,
                "batched_seconds": fast,
                "six_pairs_seconds": seconds,
                "paper_seconds": paper_seconds,
                "dry_run_processor_seconds": rehearsed,
                "dry_run_routes": routes,
                "general": {" to ".join(pair): result.as_dict() for pair, result in general.items()},
                "paper": {" to ".join(pair): result.as_dict() for pair, result in paper.items()},
                "missed": failed,
            },
        )
    print("all bars met" if not failed else f"missed: {', '.join(failed)}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
