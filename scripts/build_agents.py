"""Writes the agents that are shipped, from a finished study: the best one per route and disturbance cell.

    python scripts/study_agents.py --out study --seeds 5
    python scripts/build_agents.py --study study

Candidates are the tuned rivals and the agents trained on the cell or on the full suite. Which one is best is decided on
validation motions alone, in the servo model, for each route anew; the test motions have no say. Agents read the base
command whatever route it came by, so that those trained on adult > pepper also stand for election on
adult > kid > pepper.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from study_agents import CELLS, Study, stored_seeds

from syda_gym.agents.bundle import load_agent, read_card, save_agent
from syda_gym.agents.streams.streams import score_streams
from syda_gym.files import asset

ROUTES = (("adult", "pepper"), ("adult", "kid", "pepper"))


def main() -> None:
    """Builds every bundle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", type=Path, default=Path("study"))
    parser.add_argument("--out", type=Path, default=asset("agents"))
    given = parser.parse_args()
    for route in ROUTES:
        study = Study(given.study, route=route)
        for cell in CELLS:
            streams = study.judged(cell)
            candidates = study.rivals(cell)
            paths = {path.stem: path for path in stored_seeds(study.folder(cell))}
            paths |= {f"full-{path.stem}": path for path in stored_seeds(study.folder("full"))}
            candidates |= {name: load_agent(path, study.interface) for name, path in paths.items()}
            scores = {name: score_streams(agent, streams, study.rates) for name, agent in candidates.items()}
            best = min(scores, key=lambda name: scores[name].objective)
            training = read_card(paths[best])["training"] if best in paths else {"tuned": best, "cell": cell}
            target = given.out / f"{'-'.join(route)}-{study.folder(cell).name}"
            save_agent(
                candidates[best],
                target,
                mapping={"route": list(route), "method": "syda", "preset": "general", "motions": "embedded"},
                training={**training, "selection": "scripts/build_agents.py", "selected_on": list(route)},
                figures={
                    "cell": cell,
                    "validation": scores[best].as_dict(),
                    "validation_of_base": scores["base"].as_dict(),
                },
            )
            print(f"{target.name}: {best} ({' > '.join(candidates[best].stack)})  J {scores[best].objective:.2f}, base "
                  f"{scores['base'].objective:.2f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
