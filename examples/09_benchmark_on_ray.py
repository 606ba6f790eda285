"""Compare two methods on two chains, the cells spread by Ray; ends with a page.

    python examples/09_benchmark_on_ray.py [ray:HOST:6379]

Needs `pip install 'syda-gym[ray]'`; without it two processes of this machine do the same, and this says so. The results
do not depend on who computed them.
"""

import importlib.util
import sys

from syda_gym.evaluation.benchmark import BenchmarkConfig, run_benchmark
from syda_gym.evaluation.benchmark.report import write_benchmark_report
from syda_gym.motions import Motions, load_motions

workers = sys.argv[1] if len(sys.argv) > 1 else "ray"
if workers.startswith("ray") and importlib.util.find_spec("ray") is None:
    print("Ray is not installed, so two processes of this machine compute")
    workers = "2"
config = BenchmarkConfig.of(
    {
        "routes": ["adult>pepper", "adult>kid>pepper"],
        "methods": ["syda", "ridge"],
        "physics": "servo",
        "self_collision": False,
        "baseline": "ridge",
    }
)


def told(done: int, count: int, name: str) -> None:
    """Says what is finished."""
    print(f"{done} of {count}: {name}")


if __name__ == "__main__":  # processes import this file
    shipped = load_motions("embedded", fps=5)
    takes = tuple(take for take in shipped.takes if take.action in ("wave_high", "drum", "clap", "reach_high_front"))
    motions = Motions("four actions", takes, shipped.bodies, shipped.families, synthetic=True)
    results = run_benchmark(config, "benchmark_on_ray", workers=workers, motions=motions, progress=told)
    for (method, route), rows in results.groups("method", "route").items():
        error = rows.estimate("landmark_error", over="actions").value
        print(f"{method:>6} {route:18} {100 * error:.2f} cm on unseen actions")
    print(f"page: {write_benchmark_report(results, motions, results.folder)}")
