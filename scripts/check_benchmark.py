"""Check what the benchmark promises, and keep the figures behind docs/benchmark.md.

    python scripts/check_benchmark.py overhead          what the harness costs beside the episodes
    python scripts/check_benchmark.py kills             kill a run 20 times, resume it, compare bytes
    python scripts/check_benchmark.py summary FOLDER    the table of a finished benchmark

Every command writes its part of ``docs/results/benchmark.json`` (``--out`` for another file). Times are processor
times, so that other work on the machine disturbs them less.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

from syda_gym.evaluation.benchmark import BenchmarkConfig, Results, read_results, run_benchmark
from syda_gym.evaluation.benchmark.compare import compare
from syda_gym.evaluation.pools import InlinePool
from syda_gym.files import read_json, write_json
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

OUT = Path(__file__).resolve().parents[1] / "docs" / "results" / "benchmark.json"
BAR = 0.05
ACTIONS = 8  # of the profile
OVERHEAD = {
    "routes": ["adult>pepper", "adult>kid>pepper"],
    "methods": ["ridge"],
    "fps": 10,
    "folds": 4,
}
KILLED = {
    "routes": ["adult>pepper", "kid>pepper", "adult>kid", "adult>kid>pepper"],
    "methods": ["ridge", "nearest", "geometric"],
    "folds": 2,
    "fps": 3,
    "physics": "servo",
    "fit": {name: {"confidence": False} for name in ("ridge", "nearest", "geometric")},
}
KILLED_ACTIONS = 6
KILLS = 20


class Clock:
    """Processor time by name; a name inside another counts for the outer one only."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inside = False

    @contextmanager
    def watch(self, owner: Any, function: str, name: str) -> Iterator[None]:
        """Adds the time of every call of a function to ``name``."""
        whole = getattr(owner, function)

        def timed(*args: Any, **options: Any) -> Any:
            if self._inside:
                return whole(*args, **options)
            self._inside, start = True, time.process_time()
            try:
                return whole(*args, **options)
            finally:
                self._inside = False
                self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - start

        with mock.patch.object(owner, function, timed):
            yield


def overhead(motions_name: str) -> dict[str, Any]:
    """Shares of one benchmark's processor time: fits, episodes, and what the harness adds."""
    from syda_gym.agents.classical.rivals import BaseAlone
    from syda_gym.envs.teleop import SydaTeleopEnv
    from syda_gym.evaluation import cell_files
    from syda_gym.evaluation.benchmark import execution, work
    from syda_gym.evaluation.chains import Links

    motions = _few(load_motions(motions_name, OVERHEAD["fps"]), ACTIONS)
    clock = Clock()
    with ExitStack() as stack:
        stack.enter_context(mock.patch.object(execution, "make_pool", lambda workers, *work: InlinePool(*work)))
        with tempfile.TemporaryDirectory() as folder:  # imports and caches, which belong to no episode
            run_benchmark(BenchmarkConfig.of({**OVERHEAD, "folds": "loao"}), folder, motions=_few(motions, 2))
        for owner, function, name in (
            (Links, "link", "fits"),
            (SydaTeleopEnv, "__init__", "making environments"),
            (SydaTeleopEnv, "reset", "resets"),
            (SydaTeleopEnv, "step", "steps"),
            (SydaTeleopEnv, "action_from_command", "agent"),
            (BaseAlone, "act", "agent"),
            (work, "figures_of_all", "figures"),
            (work, "latency", "latency of one frame"),
            (cell_files.CellFiles, "write", "storing cells"),
            (execution, "_collected", "collecting"),
            (execution, "write_results", "writing results"),
        ):
            stack.enter_context(clock.watch(owner, function, name))
        with tempfile.TemporaryDirectory() as folder:
            start = time.process_time()
            results = run_benchmark(BenchmarkConfig.of(OVERHEAD), folder, motions=motions)
            whole = time.process_time() - start
    seconds = clock.seconds
    episodes = sum(seconds[name] for name in ("making environments", "resets", "steps", "agent"))
    rest = whole - sum(seconds.values())
    harness = whole - episodes - seconds["fits"]
    frames = sum(row["frames"] for row in results.rows)
    print(f"{frames} steps, {len(results.rows)} episodes, {whole:.1f} s of processor time")
    for name, value in [*seconds.items(), ("everything else", rest)]:
        print(f"  {name:22} {value:8.3f} s {100 * value / episodes:7.2f} % of the episodes' own time")
    print(f"harness beside the episodes: {100 * harness / episodes:.2f} % (bar {100 * BAR:.0f} %)")
    return {
        "motions": motions.name,
        "episodes": len(results.rows),
        "steps": frames,
        "seconds": seconds | {"everything else": rest, "all": whole},
        "episodes_seconds": episodes,
        "share": harness / episodes,
        "bar": BAR,
    }


def _few(motions: Motions, actions: int) -> Motions:
    """The first actions of every recorded pair."""
    names = {name for pair in motions.pairs for name in motions.pair(*pair).action_names[:actions]}
    return replace(motions, takes=tuple(take for take in motions.takes if take.action in names))


def kills(count: int, seed: int) -> dict[str, Any]:
    """Kills a run at random moments, resumes it, and compares the results with those of an undisturbed run."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        config = root / "config.yaml"
        config.write_text(json.dumps(KILLED))  # JSON is YAML
        start = time.monotonic()
        _finish(config, root / "whole", 1)
        length = time.monotonic() - start
        wanted = _bytes(root / "whole")
        found = {"kills": 0, "after_cells": [], "finished_runs": 0, "equal": True, "orphans": 0}
        moments, folder, workers = [], root / "run0", 1
        while found["kills"] < count:
            moment = rng.uniform(0.1, 1.0) * length
            process = _start(config, folder, workers)
            try:
                process.wait(timeout=moment)
            except subprocess.TimeoutExpired:
                children = _children(process.pid)
                process.send_signal(signal.SIGKILL)
                process.wait()
                found["kills"] += 1
                found["orphans"] += _alive(children, 20.0)
                done = len(list((folder / "cells").glob("[0-9a-f]*.json")))
                found["after_cells"].append(done)
                moments.append(round(moment, 2))
                print(f"kill {found['kills']} after {moment:.1f} s, {workers} workers: {done} cells done", flush=True)
                if done < len(wanted["cells"]) and found["kills"] < count:
                    continue
            _finish(config, folder, workers)
            found["finished_runs"] += 1
            equal = _bytes(folder) == wanted
            found["equal"] &= equal
            print(f"run {found['finished_runs']} finished, equal: {equal}", flush=True)
            folder, workers = root / f"run{found['finished_runs']}", 3 - workers
    return {**found, "moments": moments, "cells": len(wanted["cells"]), "undisturbed_seconds": round(length, 2)}


def _start(config: Path, folder: Path, workers: int) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, __file__, "run", str(config), str(folder), str(workers)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def run(config: Path, folder: Path, workers: int) -> None:
    """The run that is killed: a few actions, so that a death costs seconds."""
    motions = _few(load_motions("embedded", KILLED["fps"]), KILLED_ACTIONS)
    run_benchmark(BenchmarkConfig.read(config), folder, workers=workers, motions=motions)


def _finish(config: Path, folder: Path, workers: int) -> None:
    if _start(config, folder, workers).wait():
        raise SystemExit("a run failed; try it by hand")


def _bytes(folder: Path) -> dict[str, Any]:
    """Everything that must not differ: the results, their provenance, and the rows of every cell."""
    cells = {path.name: read_json(path)["content"]["rows"] for path in sorted((folder / "cells").glob("*.json"))}
    files = {name: (folder / name).read_bytes() for name in ("results.csv", "benchmark.json")}
    return {**files, "cells": cells, "leftovers": [path.name for path in (folder / "cells").glob(".*")]}


def _children(process: int) -> list[int]:
    text = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process)], capture_output=True, text=True).stdout
    return [int(line) for line in text.split()]


def _alive(processes: Sequence[int], patience: float) -> int:
    """How many of the processes are still there after some seconds."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline and any(map(_exists, processes)):
        time.sleep(0.1)
    return sum(map(_exists, processes))


def _exists(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def summary(folder: Path) -> dict[str, Any]:
    """Interquartile means of every chain and method with both intervals, and paired differences."""
    results = read_results(folder)
    episodes = results.select(kind="episodes")
    chains = [
        {
            "route": route,
            "method": method,
            "landmark_error": _estimate(group, "landmark_error", "episodes"),
            "over_actions": _estimate(group, "landmark_error", "actions"),
            "mapping_error": _estimate(group, "mapping_error", "actions"),
            "success": _mean(group, "success"),
            "coverage": _mean(group, "coverage"),
            "seeds": len({row["seed"] for row in group.rows}),
            "episodes": len(group.rows),
        }
        for (route, method), group in episodes.groups("route", "method").items()
    ]
    config = results.about["config"]
    baseline = config["baseline"] or config["methods"][0]
    differences = [
        {
            "method": method,
            "baseline": baseline,
            "route": one.route,
            "difference": [one.difference.value, one.difference.low, one.difference.high],
            "verdict": one.verdict,
        }
        for method in config["methods"]
        if method != baseline
        for one in compare(episodes.select(method=method), episodes.select(method=baseline))
    ]
    seconds = [float(row["seconds"]) for row in results.timings]
    print(f"{len(results.rows)} rows, {len(seconds)} cells, {sum(seconds):.0f} s in cells")
    for entry in chains:
        low, high = entry["over_actions"][1:]
        print(
            f"  {entry['route']:18} {entry['method']:12} {100 * entry['over_actions'][0]:6.2f} cm "
            f"[{100 * low:.2f}, {100 * high:.2f}]"
        )
    return {
        "config": {key: value for key, value in config.items() if key != "motions"},
        "data": results.about["data"]["fingerprint"],
        "versions": results.about["versions"],
        "cells": len(seconds),
        "rows": len(results.rows),
        "failures": len(results.about["failures"]),
        "cell_seconds": sum(seconds),
        "cell_processor_seconds": sum(float(row.get("processor") or 0.0) for row in results.timings),
        "chains": chains,
        "differences": differences,
    }


def _estimate(group: Results, name: str, over: str) -> list[float]:
    found = group.estimate(name, over=over)
    return [found.value, found.low, found.high]


def _mean(group: Results, name: str) -> float | None:
    values = [float(row[name]) for row in group.rows if row[name] is not None]
    return sum(values) / len(values) if values else None


def main() -> None:
    """Runs one check and stores its figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=OUT)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("overhead")
    one.add_argument("--motions", default="embedded")
    two = commands.add_parser("kills")
    two.add_argument("--count", type=int, default=KILLS)
    two.add_argument("--seed", type=int, default=0)
    three = commands.add_parser("summary")
    three.add_argument("folder", type=Path)
    four = commands.add_parser("run", help="the run that `kills` kills")
    four.add_argument("config", type=Path)
    four.add_argument("folder", type=Path)
    four.add_argument("workers", type=int)
    given = parser.parse_args()
    if given.command == "run":
        run(given.config, given.folder, given.workers)
        return
    checks: dict[str, Callable[[], dict[str, Any]]] = {
        "overhead": lambda: overhead(given.motions),
        "kills": lambda: kills(given.count, given.seed),
        "summary": lambda: summary(given.folder),
    }
    found = checks[given.command]()
    machine = {"cores": os.cpu_count(), "load": os.getloadavg()[0], "python": platform.python_version()}
    known = read_json(given.out) if given.out.is_file() else {}
    write_json(given.out, {**known, given.command: {**found, "machine": machine}})


if __name__ == "__main__":
    main()
