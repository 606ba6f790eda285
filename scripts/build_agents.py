"""Writes the agents that are shipped, from a finished study: the best one per route and disturbance cell.

    python scripts/study_agents.py --out study --seeds 5
    python scripts/build_agents.py --study study
    python scripts/build_agents.py --study study --route adult pepper    # of one route only
    python scripts/build_agents.py --shipped           # chooses anew among what is shipped, without a study

Candidates are the tuned rivals and the agents trained on the cell or on the full suite. Which one is best is decided in
the servo model on the validation motions and on the motions that come with the package, for each route anew: no worse
than the base on either, and then the least mean of J over J of the base. The test motions have no say. Agents read the
base command whatever route it came by, so that those trained on adult > pepper also stand for election on
adult > kid > pepper.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from study_agents import CELLS, NAMES, Study, stored_seeds

from syda_gym.agents.agent import Agent
from syda_gym.agents.bundle import load_agent, read_card, save_agent
from syda_gym.agents.classical.tuned import tuned_rival
from syda_gym.agents.figures import Figures
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import Streams, score_streams
from syda_gym.files import asset, read_json, write_json
from syda_gym.motions.loading import load_motions

ROUTES = (("adult", "pepper"), ("adult", "kid", "pepper"))


def main() -> None:
    """Builds every bundle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", type=Path, default=Path("study"))
    parser.add_argument("--out", type=Path, default=asset("agents"))
    parser.add_argument("--shipped", action="store_true", help="candidates are what is shipped already")
    parser.add_argument("--route", nargs="+", default=None, help="only this one")
    given = parser.parse_args()
    for route in ROUTES if given.route is None else [tuple(given.route)]:
        study = Study(given.study, route=route)
        found = {cell: candidates(study, cell, shipped=given.shipped) for cell in CELLS}  # before any is written
        for cell in CELLS:
            choose(study, cell, *found[cell], given.out)
    if not given.shipped:
        write_settings(Study(given.study), given.out)


def candidates(study: Study, cell: str, *, shipped: bool) -> tuple[dict[str, Agent], dict[str, dict[str, Any]]]:
    """Agents by name, and what is known of the training of each."""
    tuned: dict[str, dict[str, Any]] = {name: {"tuned": name, "cell": cell} for name in NAMES}
    if shipped:
        agents = {name: tuned_rival(name, study.interface, f"teleop:{cell}:train") for name in NAMES}
        paths = {path.stem: path for path in sorted(asset("agents").glob("adult-pepper-*.json"))}
        paths |= {path.stem: path for path in sorted(asset("agents").glob(f"{'-'.join(study.route)}-*.json"))}
    else:
        agents = study.rivals(cell)
        paths = {path.stem: path for path in stored_seeds(study.folder(cell))}
        paths |= {f"full-{path.stem}": path for path in stored_seeds(study.folder("full"))}
    agents |= {name: load_agent(path, study.interface) for name, path in paths.items()}
    return agents, tuned | {name: dict(read_card(path)["training"]) for name, path in paths.items()}


def choose(
    study: Study, cell: str, agents: Mapping[str, Agent], trainings: Mapping[str, Mapping[str, Any]], out: Path
) -> None:
    """Stores the best of the candidates."""
    judged = {"validation": study.judged(cell), "embedded": embedded(study, cell)}
    scores = {
        name: {part: score_streams(agent, streams, study.rates) for part, streams in judged.items()}
        for name, agent in agents.items()
    }
    best = min(scores, key=lambda name: rank(scores[name], scores["base"]))
    target = out / f"{'-'.join(study.route)}-{study.folder(cell).name}"
    save_agent(
        agents[best],
        target,
        mapping={"route": list(study.route), "method": "syda", "preset": "general", "motions": "embedded"},
        training={**trainings[best], "selection": "scripts/build_agents.py", "selected_on": list(study.route)},
        figures={
            "cell": cell,
            **{part: found.as_dict() for part, found in scores[best].items()},
            **{f"{part}_of_base": found.as_dict() for part, found in scores["base"].items()},
        },
    )
    told = ", ".join(
        f"{part} J {scores[best][part].objective:.2f} (base {scores['base'][part].objective:.2f})" for part in judged
    )
    print(f"{target.name}: {best} ({' > '.join(agents[best].stack)}): {told}", flush=True)


def embedded(study: Study, cell: str) -> Streams:
    """Episodes of the motions that come with the package."""
    ground = Ground(study.options(load_motions("embedded"), cell, "train"))
    return ground.record(study.size.validation_episodes, seed=8)


def rank(mine: Mapping[str, Figures], base: Mapping[str, Figures]) -> tuple[bool, float]:
    """Whether an agent is worse than the base on any of the motions, and the mean of J over that of the base."""
    shares = [mine[part].objective / base[part].objective for part in base]
    return max(shares) > 1.0, sum(shares) / len(shares)


def write_settings(study: Study, out: Path) -> None:
    """The tuned settings of every rival in every cell, which ``--base kalman`` and every table use."""
    cells = {}
    for cell in CELLS:
        stored = read_json(study.folder(cell) / "rivals.json")
        cells[cell] = {
            name: {key: round(value, 5) for key, value in entry["settings"].items()}
            for name, entry in stored.items()
            if entry["settings"]
        }
    write_json(out / "tuned" / "settings.json", {"script": "scripts/study_agents.py", "cells": cells})


if __name__ == "__main__":
    main()
