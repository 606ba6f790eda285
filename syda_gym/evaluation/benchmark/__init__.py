"""The benchmark: chains x methods x agents x disturbances x seeds as episodes, resumable, on one machine or many."""

from syda_gym.evaluation.benchmark.compare import Comparison, compare
from syda_gym.evaluation.benchmark.config import BenchmarkConfig, EfficiencyConfig
from syda_gym.evaluation.benchmark.execution import run_benchmark
from syda_gym.evaluation.benchmark.results import Results, read_results

__all__ = [
    "BenchmarkConfig",
    "Comparison",
    "EfficiencyConfig",
    "Results",
    "compare",
    "read_results",
    "run_benchmark",
]
