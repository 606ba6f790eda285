"""Times the training of a residual policy in the servo model, recording left out: a million steps by default.

    python scripts/benchmark_training.py --out docs/results/agents-training.json

Preset ``teleop`` on an untuned Kalman filter, full suite, one process, one thread. Run it on an idle machine.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.residual.residual_training import train_on_streams
from syda_gym.agents.streams.ground import Ground
from syda_gym.files import asset, write_json
from syda_gym.mappings.storage import load_mapping
from syda_gym.motions.synthetic.generator import generate


def main() -> None:
    """Prints the time, and stores it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--out", type=Path, default=None)
    given = parser.parse_args()
    ground = Ground(
        {
            "operator": "adult",
            "robot": "pepper",
            "mapping": load_mapping(asset("mappings", "adult-pepper")),
            "motions": generate(("adult",), seed=0, families=("reach", "wave"), variants=1, noise=0.0),
            "reference": "mapped",
            "physics": "servo",
            "physics_hz": 60.0,
            "disturbances": "teleop:full:train",
        }
    )
    train, validation = ground.record(32, seed=0), ground.record(8, seed=1)
    config = ResidualConfig.preset("teleop", steps=given.steps)
    wall, cpu = time.perf_counter(), time.process_time()
    trained = train_on_streams(make_rival("kalman", ground.interface), train, validation, ground.rates, config)
    found = {
        "steps": trained.history[-1].steps,
        "wall_seconds": round(time.perf_counter() - wall, 1),
        "cpu_seconds": round(time.process_time() - cpu, 1),
        "cores": os.cpu_count(),
        "robots": config.robots,
    }
    print(found)
    if given.out is not None:
        write_json(given.out, found)


if __name__ == "__main__":
    main()
