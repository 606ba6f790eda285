"""Writes the agents that are shipped, from a finished study: the best one per disturbance cell.

    python scripts/study_agents.py --out study --seeds 5
    python scripts/build_agents.py --study study

Which agent is best is decided on the validation motions alone: the tuned rivals, and of the predictors and residual
policies the seed with the least objective. The test motions have no say.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from syda_gym.agents.bundle import load_agent, read_card, save_agent
from syda_gym.agents.classical import make_rival
from syda_gym.agents.runner import stored_interface
from syda_gym.files import asset, read_json

CELLS = ("lag", "noise", "latency", "noise-latency", "full")


def main() -> None:
    """Builds every bundle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", type=Path, default=Path("study"))
    parser.add_argument("--out", type=Path, default=asset("agents"))
    given = parser.parse_args()
    learned = sorted(given.study.glob("*/*-[0-9].json"))
    interface = stored_interface(read_card(learned[0]))
    for cell in CELLS:
        folder = given.study / cell
        tuned = read_json(folder / "rivals.json")
        name = min(tuned, key=lambda rival: float(tuned[rival]["validation"]["J"]))
        best: tuple[float, Any, dict[str, Any]] = (
            float(tuned[name]["validation"]["J"]),
            make_rival(name, interface, **tuned[name]["settings"]),
            {"tuned": name, "cell": cell},
        )
        for path in sorted(folder.glob("*-[0-9].json")):
            card = read_card(path)
            least = min(float(point["J"]) for point in card["figures"]["validation_curve"])
            if least < best[0]:
                best = (least, load_agent(path, interface), card["training"])
        route = best[2].get("route", ["adult", "pepper"])
        target = given.out / f"{'-'.join(route)}-{cell}"
        save_agent(
            best[1],
            target,
            mapping={"route": route, "method": "syda", "preset": "general", "motions": "embedded"},
            training={**best[2], "command": f"scripts/build_agents.py --study {given.study.name}"},
            figures={"validation": {"J": best[0], "cell": cell}},
        )
        print(f"{target.name}: {' > '.join(best[1].stack)}  validation J {best[0]:.2f}")


if __name__ == "__main__":
    main()
