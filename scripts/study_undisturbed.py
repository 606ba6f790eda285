"""What agents gain where nothing is disturbed, on actions nobody has seen, with and without a look ahead, in Bullet.

    python scripts/study_undisturbed.py --out study-undisturbed --seeds 5 --table docs/results/undisturbed.json

For each seed a fifth of the embedded actions is held out, as in the demo: the mapping, the predictor and the policy
learn from the others, and base, lead, Kalman filter, predictor and residual play the held-out ones. Errors are counted
against what the mapping asks for. With ``preview`` steps ahead a robot acts so much later than its operator, and every
agent sees the same future commands. Finished parts are kept.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.rollout import evaluate
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.training import train_stack
from syda_gym.evaluation.chains import Links
from syda_gym.evaluation.statistics import clustered_estimate
from syda_gym.files import read_json, write_json
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

ROUTE = ("adult", "pepper")
PREVIEWS = (0, 3)
BARS = {0: 13.5, 3: 10.5}
FIGURES = ("J", "landmark_mm", "joint_mrad", "jitter")


def held_out(motions: Motions, seed: int) -> tuple[str, ...]:
    """A fifth of the actions, of as many gesture families as possible."""
    rng = np.random.default_rng([seed, 5])
    names = list(motions.pair(*ROUTE).action_names)
    shuffled = [names[index] for index in rng.permutation(len(names))]
    first_of = {motions.families.get(name, name): name for name in reversed(shuffled)}
    rest = [name for name in shuffled if name not in first_of.values()]
    return tuple(sorted([*first_of.values(), *rest][: len(names) // 5]))


def play(motions: Motions, seed: int, preview: int, steps: int | None) -> dict[str, Any]:
    """Trains on the one part and plays the other."""
    apart = held_out(motions, seed)
    learnt = [name for name in motions.pair(*ROUTE).action_names if name not in apart]
    mapping = Links(motions, seed=seed, groups=[apart]).chain(ROUTE, apart)
    options: dict[str, Any] = {
        "operator": ROUTE[0], "robot": ROUTE[-1], "mapping": mapping, "motions": motions, "reference": "mapped",
        "preview": preview,
    }  # fmt: skip
    config = ResidualConfig.preset("undisturbed", **({"steps": steps} if steps else {}))
    found = train_stack(Ground({**options, "actions": learnt}), config, seed=seed)
    played = evaluate({**options, "actions": list(apart)}, found.agents, seed=seed)
    rows = {
        name: [{"action": one.action, "motion": one.motion, **one.figures.as_dict()} for one in results]
        for name, results in played.items()
    }
    return {
        "held_out": list(apart),
        "kept_leg": found.trained.best,
        "validation": {name: figures.as_dict() for name, figures in found.comparison.figures.items()},
        "episodes": rows,
    }


def table(out: Path, seeds: int) -> dict[str, Any]:
    """Means over seeds, with intervals over actions."""
    result: dict[str, Any] = {}
    for preview in PREVIEWS:
        parts = [read_json(out / f"preview-{preview}-seed-{seed}.json") for seed in range(seeds)]
        agents: dict[str, Any] = {}
        for name in parts[0]["episodes"]:
            episodes = [(seed, row) for seed, part in enumerate(parts) for row in part["episodes"][name]]
            means = {key: float(np.mean([row[key] for _, row in episodes])) for key in FIGURES}
            actions = [str(row["action"]) for _, row in episodes]
            interval = clustered_estimate([float(row["J"]) for _, row in episodes], actions, statistic=np.mean)
            of_seeds = [float(np.mean([row["J"] for row in part["episodes"][name]])) for part in parts]
            agents[name] = {**means, "J_low": interval.low, "J_high": interval.high, "J_of_seeds": of_seeds}
        result[f"preview {preview}"] = {"bar": BARS[preview], "agents": agents}
    return result


def main() -> None:
    """Does what is missing and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("study-undisturbed"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=None, help="of the policy; those of its preset by default")
    parser.add_argument("--table", type=Path, default=None, help="JSON file of the table, when all seeds are there")
    given = parser.parse_args()
    motions = load_motions("embedded")
    for seed in range(given.first_seed, given.seeds):
        for preview in PREVIEWS:
            path = given.out / f"preview-{preview}-seed-{seed}.json"
            if not path.is_file():
                write_json(path, play(motions, seed, preview, given.steps))
                print(path, flush=True)
    if given.first_seed:
        return
    found = table(given.out, given.seeds)
    for name, part in found.items():
        for agent, row in part["agents"].items():
            print(f"{name:10} {agent:24} J {row['J']:6.2f} ({row['J_low']:.2f} to {row['J_high']:.2f})")
    if given.table is not None:
        command = f"python scripts/study_undisturbed.py --out study-undisturbed --seeds {given.seeds}"
        write_json(given.table, {"command": command, "seeds": given.seeds, **found})


if __name__ == "__main__":
    main()
