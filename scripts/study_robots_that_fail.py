"""The study on bodies that can fail: robots of other makers and people, several sessions, beside the ceiling.

Usage: python scripts/study_robots_that_fail.py --out FOLDER [--motions SPEC[=BODY] ...] [--robots NAME,...]
           [--humans NAME,...] [--sessions 3] [--workers 2] [--method syda] [--json FILE] [--page FILE]

SPEC is what `load_motions` takes; BODY of it performs the plan (its first one by default). Without --motions, the
adult's embedded synthetic motions are planned. Robots are Pepper, NAO, or names of `example-robot-data` (extra
`robots`). Finished pieces are kept in FOLDER: the same command goes on from there. The tables are Markdown; --page puts
them into a page, between the lines `<!-- tables of the bed -->` and `<!-- end of the tables -->`.
"""

from __future__ import annotations

import argparse
import math
import re
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

from syda_gym.evaluation.prediction.bed import HUMANS, ROBOTS, TestBed, bed_bodies
from syda_gym.evaluation.prediction.bed_study import study_bed
from syda_gym.evaluation.prediction.bed_work import BedSettings
from syda_gym.files import write_json, write_text
from syda_gym.motions.loading import load_motions
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.plan import Plan, plan_from_motions

COLUMNS = {
    "pairs": "pairs",
    "chains": "chains",
    "pairs_average": "pairs, average",
    "chains_average": "chains, average",
    "choice": "choice",
    "regret": "regret [%]",
}


BARS = {"pairs": 0.70, "chains": 0.70, "pairs_average": 0.78, "chains_average": 0.78, "regret": 0.04}
"""What the dry run of the planned motion is to reach; set before, on other recordings."""


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
    parser.add_argument("--page", type=Path)
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
    figures["missed"] = missed(figures["scores"]["planned motion"])
    print(tables(figures))
    print("all bars met" if not figures["missed"] else f"missed: {'; '.join(figures['missed'])}")
    if arguments.json:
        write_json(arguments.json, plain(figures))
    if arguments.page:
        put_into(arguments.page, tables(figures), arguments.json)


def put_into(page: Path, found: str, source: Path | None) -> None:
    """Replaces the tables of a page, each with the file that its figures come from."""
    begin, end = "<!-- tables of the bed -->", "<!-- end of the tables -->"
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    if not after:
        raise SystemExit(f"{page} has no lines {begin} and {end}")
    marked = re.sub(r"(?m)^(?=\| (?:predictor|without) \|)", f"<!-- numbers: {source} -->\n\n" if source else "", found)
    write_text(page, f"{before}{begin}\n\n{marked}\n\n{end}{after}")


def missed(scores: dict[str, Any]) -> list[str]:
    """The bars that the dry run does not reach."""
    found = []
    for column, bar in BARS.items():
        value = scores[column]["value"]
        if not (value <= bar if column == "regret" else value >= bar):
            found.append(f"{column} {value:.3f}, bar {bar}")
    return found


def tables(figures: dict[str, Any]) -> str:
    """The page's tables in Markdown: everybody, those whom the paper's definition knows, and without any one body."""
    known = figures["where_the_paper_knows_everybody"]
    apart = figures["without_one_body"]
    lines = [*scores_table(figures, "planned motion"), "", f"{', '.join(known['bodies'])}:", ""]
    lines += [*scores_table(known, "planned motion"), "", "| without | pairs | chains | measured: pairs | chains |"]
    lines.append("|---|---|---|---|---|")
    for body in figures["bodies"]:
        cells = [apart[name][body][part] for name in ("planned motion", "measured") for part in ("pairs", "chains")]
        lines.append(f"| {body} | " + " | ".join(f"{cell:.2f}" for cell in cells) + " |")
    return "\n".join(lines)


def scores_table(figures: dict[str, Any], first: str) -> list[str]:
    """Predictors as rows, the default first, with the ceiling below."""
    lines = ["| predictor | " + " | ".join(COLUMNS.values()) + " |", "|---" * (len(COLUMNS) + 1) + "|"]
    scores = figures["scores"]
    for name in sorted(scores, key=lambda one: one != first):
        cells = []
        for column in COLUMNS:
            scale, digits = (100.0, 1) if column == "regret" else (1.0, 2)
            value, low, high = (scale * scores[name][column][end] for end in ("value", "low", "high"))
            cells.append(f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    ceiling = figures["ceiling"]
    values = [f"{ceiling[column]:.2f}" if column in ceiling else "" for column in COLUMNS]
    lines.append("| ceiling | " + " | ".join(values) + " |")
    lines.append(
        "| reliability | "
        + " | ".join(f"{ceiling[key]:.2f}" if (key := f"{column}_reliability") in ceiling else "" for column in COLUMNS)
        + " |"
    )
    return lines


def plain(value: Any) -> Any:
    """JSON has no NaN: what could not be computed, as the choice among one chain, is null."""
    if isinstance(value, dict):
        return {name: plain(one) for name, one in value.items()}
    if isinstance(value, list):
        return [plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


if __name__ == "__main__":
    main()
