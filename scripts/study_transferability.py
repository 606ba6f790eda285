"""Writes the figures behind docs/study-transferability.md: scores, what bodies between cost, and fewer fitted pairs.

Usage: python scripts/study_transferability.py [--study FILE] [--out docs/results/transferability-study.json]
                                               [--picture docs/images/transferability-study.png]

FILE is the output of `syda-gym transferability --validate --json`; without it the study is run (5 to 9 minutes).
"""

from __future__ import annotations

import argparse
import random
from pathlib import Path
from typing import Any

import networkx
import numpy as np
from scipy.stats import spearmanr

from syda_gym.embodiments import catalog
from syda_gym.files import read_json, write_bytes, write_json
from syda_gym.routes.measured import measured_bodies

Names = tuple[str, ...]
DRAWS = 10

# Leave-one-action-out errors [m] of the general preset on the paper's recordings, from the benchmark of mappings.
RECORDED = {
    ("adult", "pepper"): 0.0528,
    ("kid", "pepper"): 0.0602,
    ("pepper", "adult"): 0.1039,
    ("pepper", "kid"): 0.0936,
}


def by_hops(errors: dict[Names, float], one_armed: set[str]) -> dict[str, float]:
    """Mean error per number of hops, one-armed bodies left out between the ends."""
    kept = {route: error for route, error in errors.items() if not one_armed & set(route[1:-1])}
    return {str(h): float(np.mean([e for r, e in kept.items() if len(r) == h + 1])) for h in (1, 2, 3)}


def between(errors: dict[Names, float], bodies: list[str]) -> dict[str, float]:
    """Error of two-hop chains over that of the direct pair, mean by the body between."""
    return {
        via: float(np.mean([e / errors[r[0], r[2]] for r, e in errors.items() if len(r) == 3 and r[1] == via]))
        for via in bodies
    }


def fewer_pairs(errors: dict[Names, float], training: dict[Names, float]) -> dict[str, dict[str, float]]:
    """Correlation of the measured predictor when only some pairs are fitted: spanning trees and more, random draws."""
    routes = list(errors)
    actual = np.array([errors[route] for route in routes])
    single = np.array([len(route) == 2 for route in routes])
    pairs = sorted(pair for pair in training if pair[0] < pair[1])
    sides = {name: set(catalog.get(name).sides) for pair in pairs for name in pair}
    found = {}
    for count in (8, 12, 18, len(pairs)):
        values = []
        for seed in range(DRAWS):
            chosen = draw(pairs, count, seed)
            bodies = measured_bodies({both: training[both] for pair in chosen for both in (pair, pair[::-1])})
            predicted = np.array([bodies.error(route) / carried(route, sides) for route in routes])
            values.append([spearmanr(predicted[m], actual[m]).statistic for m in (np.ones_like(single), single)])
        everything, links = np.mean(values, axis=0)
        found[str(count)] = {"all": float(everything), "pairs": float(links)}
    return found


def draw(pairs: list[Names], count: int, seed: int) -> list[Names]:
    """A random spanning tree and random further pairs."""
    order = pairs.copy()
    random.Random(seed).shuffle(order)
    graph, chosen = networkx.Graph(), []
    graph.add_nodes_from({name for pair in pairs for name in pair})
    for pair in order:
        if not networkx.has_path(graph, *pair):
            graph.add_edge(*pair)
            chosen.append(pair)
    return [*chosen, *(pair for pair in order if pair not in chosen)][:count]


def carried(route: Names, sides: dict[str, set[str]]) -> float:
    """Share of the ends' common arms that arrives; a thousandth where none does."""
    shared = sides[route[0]] & sides[route[-1]]
    kept = shared.intersection(*(sides[name] for name in route))
    return max(1e-3, len(kept) / len(shared)) if shared else 1.0


def recorded() -> dict[str, dict[str, Any]]:
    """Errors on the paper's recordings beside both T, the general one with the resolution it was sampled at."""
    from syda_gym.routes.metric import transferability
    from syda_gym.routes.paper import PAPER_LENGTHS, paper_human

    reach = {"pepper": catalog.get("pepper").reach, **{n: sum(PAPER_LENGTHS[n]) for n in ("adult", "kid")}}
    bodies: dict[str, Any] = {"pepper": "pepper", "adult": paper_human("adult"), "kid": paper_human("kid")}
    found = {}
    for (a, b), error in RECORDED.items():
        general = transferability(bodies[a], bodies[b], "general")
        found[f"{a} > {b}"] = {
            "metres": error,
            "over_arm_length": error / reach[b],
            "T": general.T,
            "samples": general.samples,
            "cell": general.cell,
            "paper_T": transferability(a, b, "paper").T,
        }
    return found


def main() -> None:
    """Runs or reads the study and writes its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--study", type=Path)
    parser.add_argument("--out", type=Path, default=Path("docs/results/transferability-study.json"))
    parser.add_argument("--picture", type=Path, default=Path("docs/images/transferability-study.png"))
    arguments = parser.parse_args()
    if arguments.study:
        study = read_json(arguments.study)
    else:
        from syda_gym.evaluation.prediction.picture import prediction_png
        from syda_gym.evaluation.prediction.study import validate

        result = validate()
        write_bytes(arguments.picture, prediction_png(result, ground="dusk"))
        study = result.as_dict()
    errors = {tuple(route["bodies"]): route["error"] for route in study["routes"]}
    training = {tuple(r["bodies"]): -r["predicted"]["training_error"] for r in study["routes"] if len(r["bodies"]) == 2}
    one_armed = {name for name in study["bodies"] if len(catalog.get(name).sides) == 1}
    figures = {key: value for key, value in study.items() if key != "routes"}
    for score in (*figures["scores"], *figures["full_scores"]):
        score["regret_percent"] = 100.0 * score["regret"]["value"]
    figures |= {
        "routes": len(errors),
        "error_by_hops": by_hops(errors, one_armed),
        "two_hops_over_direct": between(errors, study["bodies"]),
        "fewer_fitted_pairs": fewer_pairs(errors, training),
        "paper_recordings": recorded(),
    }
    write_json(arguments.out, figures)
    for key in ("error_by_hops", "two_hops_over_direct", "fewer_fitted_pairs", "paper_recordings"):
        print(key, figures[key])


if __name__ == "__main__":
    main()
