"""Agents on the paper's recordings, leaving three actions out at a time.

    python scripts/study_paper_agents.py DIR --out docs/results/agents-paper.json

In each of three folds the mapping is fitted, and a residual policy trained, without three of the nine actions; base,
lead, policy and the shipped agents are then played on those three in Bullet, against the recorded Pepper, without
disturbances. Nine actions are too few to claim that anything generalises; the question is only whether an agent does
harm. The shipped agents never saw these recordings.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

from syda_gym.agents.agent import Agent, BaseAlone
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.figures import Figures, mean_figures
from syda_gym.agents.interface import Interface
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.residual.residual_training import train_residual
from syda_gym.agents.rollout import evaluate
from syda_gym.agents.work import find_agent, shipped_agents
from syda_gym.files import write_json
from syda_gym.motions.loading import load_motions

PHYSICS_HZ = 60.0  # as the shipped agents


def main() -> None:
    """Prints one table, and stores it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--operator", default="adult")
    parser.add_argument("--mapping", default="syda")
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--out", type=Path, default=None)
    given = parser.parse_args()
    motions = load_motions(f"paper:{given.folder}")
    actions = sorted({t.action for t in motions.takes if {given.operator, "pepper"} <= set(t.frames)})
    found: dict[str, list[Figures]] = defaultdict(list)
    for fold in range(3):
        held = tuple(actions[fold::3])
        common = {
            "motions": motions,
            "operator": given.operator,
            "route": (given.operator, "pepper"),
            "mapping": given.mapping,
            "held_out": held,
            "physics_hz": PHYSICS_HZ,
        }
        kept = tuple(action for action in actions if action not in held)
        for seed in range(given.seeds):
            config = ResidualConfig.preset("undisturbed", steps=given.steps, episodes=64, validation_episodes=16)
            options = {**common, "actions": kept, "physics": "servo"}
            trained = train_residual(options, config, seed=seed)
            agents: dict[str, Agent] = {"residual": trained.agent}
            if seed == 0:
                agents |= _fixed(trained.agent.interface, given.operator)
            for name, results in evaluate({**common, "actions": held, "physics": "bullet"}, agents, seed=1).items():
                found[name] += [result.figures for result in results]
        print(f"fold {fold}, without {', '.join(held)}: {_line(found)}", flush=True)
    table = {name: mean_figures(figures).as_dict() for name, figures in found.items()}
    print("| agent | landmark error [mm] | against base | jitter |\n|---|---|---|---|")
    for name, figures in table.items():
        share = 100 * (figures["landmark_mm"] / table["base"]["landmark_mm"] - 1)
        print(f"| {name} | {figures['landmark_mm']:.1f} | {share:+.1f} % | {figures['jitter']:.2f} |")
    if given.out is not None:
        write_json(given.out, {"steps": given.steps, "seeds": given.seeds, "operator": given.operator, "agents": table})


def _fixed(interface: Interface, operator: str) -> dict[str, Agent]:
    """Agents that are not trained here."""
    shipped = [name for name in shipped_agents() if name.startswith(f"{operator}-pepper-")]
    return {
        "base": BaseAlone(interface),
        "lead": make_rival("lead", interface),
        **{name: find_agent(name, interface) for name in shipped},
    }


def _line(found: dict[str, list[Figures]]) -> str:
    return ", ".join(f"{name} {mean_figures(figures).landmark_mm:.1f}" for name, figures in found.items())


if __name__ == "__main__":
    main()
