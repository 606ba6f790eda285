"""The study on bodies that can fail: robots of other makers and people, several sessions, beside the ceiling.

Usage: python scripts/study_robots_that_fail.py --out FOLDER [--motions SPEC[=BODY] ...] [--robots NAME,...]
           [--humans NAME,...] [--sessions 3] [--workers 2] [--method syda] [--json FILE]

SPEC is what `load_motions` takes; BODY of it performs the plan (its first one by default). Without --motions, the
adult's embedded synthetic motions are planned. Robots are Pepper, NAO, or names of `example-robot-data` (extra
`robots`). Finished pieces are kept in FOLDER: the same command goes on from there. The table is Markdown.
"""

from __future__ import annotations

import argparse
from functools import reduce
from operator import add
from pathlib import Path

from syda_gym.evaluation.prediction.bed import HUMANS, ROBOTS, TestBed, bed_bodies
from syda_gym.evaluation.prediction.bed_study import study_bed
from syda_gym.evaluation.prediction.bed_work import BedSettings
from syda_gym.files import write_json
from syda_gym.motions.loading import load_motions
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.plan import Plan, plan_from_motions


def planned(texts: list[str]) -> Plan:
    """One plan of all that is named."""
    if not texts:
        return default_plan()
    plans = []
    for text in texts:
        name, _, body = text.partition("=")
        motions = load_motions(name)
        plans.append(plan_from_motions(motions, body or next(iter(motions.bodies))))
    return reduce(add, plans)


def main() -> None:
    """Runs the study and prints its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--motions", action="append", default=[])
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--humans", default=",".join(HUMANS))
    parser.add_argument("--sessions", type=int, default=3)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--method", default="syda")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    bodies = bed_bodies(*(tuple(filter(None, text.split(","))) for text in (arguments.humans, arguments.robots)))
    name = "recorded" if arguments.motions else "embedded (synthetic)"
    settings = BedSettings(TestBed(bodies, planned(arguments.motions), name), method=arguments.method)
    figures = study_bed(
        settings,
        arguments.out,
        sessions=arguments.sessions,
        workers=arguments.workers,
        progress=lambda done, what: print(f"{100 * done:5.1f} %  {what}", flush=True),
    )
    columns = ("pairs", "chains", "pairs_average", "chains_average", "choice", "regret")
    print("| predictor |", " | ".join(columns), "|\n|---|" + "---|" * len(columns))
    for predictor, scores in figures["scores"].items():
        cells = [f"{one['value']:.2f} [{one['low']:.2f}, {one['high']:.2f}]" for one in map(scores.get, columns)]
        print(f"| {predictor} |", " | ".join(cells), "|")
    print("| ceiling |", " | ".join(f"{figures['ceiling'].get(one, float('nan')):.2f}" for one in columns), "|")
    if arguments.json:
        write_json(arguments.json, figures)


if __name__ == "__main__":
    main()
