"""Agents on the paper's recordings, leaving three actions out at a time.

    python scripts/study_paper_agents.py DIR

In each of three folds the mapping is fitted, and a residual policy trained, without three of the nine actions; base,
lead and policy are then played on those three, against the recorded Pepper. Nine actions are too few to claim that
anything generalises; the question is only whether an agent does harm.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.classical import make_rival
from syda_gym.agents.config import ResidualConfig
from syda_gym.agents.rollout import evaluate
from syda_gym.agents.training import train_residual
from syda_gym.motions.loading import load_motions


def main() -> None:
    """Prints one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--operator", default="adult")
    parser.add_argument("--mapping", default="syda")
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--seeds", type=int, default=1)
    given = parser.parse_args()
    motions = load_motions(f"paper:{given.folder}")
    actions = sorted({t.action for t in motions.takes if {given.operator, "pepper"} <= set(t.frames)})
    errors: dict[str, list[float]] = defaultdict(list)
    for fold in range(3):
        held = tuple(actions[fold::3])
        common = {
            "motions": motions,
            "operator": given.operator,
            "route": (given.operator, "pepper"),
            "mapping": given.mapping,
            "held_out": held,
        }
        kept = tuple(action for action in actions if action not in held)
        for seed in range(given.seeds):
            config = ResidualConfig.preset("undisturbed", steps=given.steps, episodes=64, validation_episodes=16)
            options = {**common, "actions": kept, "physics": "servo"}
            trained = train_residual(options, config, seed=seed)
            interface = trained.agent.interface
            agents = {"residual": trained.agent}
            if seed == 0:
                agents |= {"base": BaseAlone(interface), "lead": make_rival("lead", interface)}
            for name, found in evaluate({**common, "actions": held, "physics": "bullet"}, agents, seed=1).items():
                errors[name] += [result.figures.landmark_mm for result in found]
        print(f"fold {fold}, without {', '.join(held)}: {_line(errors)}", flush=True)
    print("| agent | landmark error [mm] | against base |\n|---|---|---|")
    for name, values in errors.items():
        mean, base = float(np.mean(values)), float(np.mean(errors["base"]))
        print(f"| {name} | {mean:.1f} | {100 * (mean / base - 1):+.1f} % |")


def _line(errors: dict[str, list[float]]) -> str:
    return ", ".join(f"{name} {np.mean(values):.1f}" for name, values in errors.items())


if __name__ == "__main__":
    main()
