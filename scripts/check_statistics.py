"""Compare our interquartile means and intervals with rliable's on a fixture; development only.

    pip install --no-deps rliable 'arch<8' absl-py && pip install 'pandas<3' statsmodels seaborn
    python scripts/check_statistics.py

rliable pins nothing that we need, so it is no dependency; the figures that this prints are written down in
``tests/evaluation/test_statistics.py`` and, with ``--out``, in ``docs/results/benchmark.json``.
"""

from __future__ import annotations

import argparse
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from rliable import library, metrics

from syda_gym.evaluation import statistics
from syda_gym.files import read_json, write_json

RUNS, TASKS, REPETITIONS = 10, 6, 20000


def main() -> None:
    """Prints both sides and their largest difference."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    rng = np.random.default_rng(2024)
    shift = np.arange(TASKS) * 0.01
    first = rng.gamma(4.0, 0.015, size=(RUNS, TASKS)) + shift
    second = rng.gamma(4.0, 0.018, size=(RUNS, TASKS)) + shift
    tasks = np.tile(np.arange(TASKS), RUNS)
    rows: dict[str, Any] = {}
    for name, values in (("iqm_first", first), ("iqm_second", second)):
        found = statistics.estimate(values.ravel(), tasks, resamples=REPETITIONS)
        rows[name] = [_theirs(values, metrics.aggregate_iqm), [found.value, found.low, found.high]]
    improvement = statistics.probability_of_improvement(
        first.ravel(), second.ravel(), tasks, lower_is_better=False, resamples=REPETITIONS
    )
    rows["improvement"] = [
        _theirs((first, second), metrics.probability_of_improvement),
        [improvement.value, improvement.low, improvement.high],
    ]
    worst = 0.0
    for name, (theirs, ours) in rows.items():
        difference = float(np.abs(np.array(theirs) - np.array(ours)).max())
        worst = max(worst, difference)
        print(f"{name:12} rliable {np.round(theirs, 5)}  here {np.round(ours, 5)}  largest difference {difference:.5f}")
    if given.out:
        known = read_json(given.out) if given.out.is_file() else {}
        part = {"version": version("rliable"), "numpy": np.__version__, "repetitions": REPETITIONS}
        found = {name: {"rliable": theirs, "here": ours} for name, (theirs, ours) in rows.items()}
        write_json(given.out, {**known, "rliable": {**part, **found, "largest_difference": worst}})


def _theirs(values: Any, metric: Any) -> list[float]:
    points, intervals = library.get_interval_estimates(
        {"fixture": values}, metric if isinstance(values, tuple) else lambda x: np.array([metric(x)]), reps=REPETITIONS
    )
    interval = np.ravel(intervals["fixture"])
    return [float(np.ravel(points["fixture"])[0]), float(interval[0]), float(interval[1])]


if __name__ == "__main__":
    main()
