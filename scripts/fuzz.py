"""Feeds damaged files and packets to everything that reads from outside, and reports what is not one of our exceptions.

    python scripts/fuzz.py [--inputs 5000] [--seeds 20] [--first 0] [--only NAME] [--out docs/results/fuzz.json]

Every reader of motions, stored mappings, agents and checkpoints, robot descriptions and URDFs, benchmark settings,
journals and network packets gets files built to hurt (circles, aliases that multiply, deep chains, sizes that disagree,
archives that unpack to gigabytes; see ``fuzz_build``) and valid samples that were damaged as bytes (cut, overwritten,
repeated, mixed) or inside their container (a JSON value replaced, a member of an archive changed, a header of weights
falsified). A reader may take what it gets or raise a ``SydaError``; anything else is a finding, as is an input that
takes longer or more memory than the limit. An input follows from its seed and number alone. Every 500 inputs the
results are written, and what they hold already is not run again: the same command goes on. Findings are kept beside
them.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_targets import Target, all_targets

from syda_gym.errors import SydaError
from syda_gym.files import read_json, write_json

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 5.0  # s of processor time for one input
MEMORY = 1 << 30  # bytes beyond what is in use before the first input
BLOCK = 500  # inputs between two writings
BUILT = 0.2  # share of inputs that are built instead of damaged
Tally = dict[str, dict[str, int]]


def main() -> int:
    """Runs one seed after the other and adds up what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=5_000, help="per seed")
    parser.add_argument("--seeds", type=int, default=20, help="number of seeds")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--only", default="", help="a part of the targets' names")
    parser.add_argument("--each", type=int, default=0, help="only this many inputs of every builder, and no damage")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "results" / "fuzz.json")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGPROF, _too_long)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # the URDF parsers print what they dislike, from C++
    result = {"inputs": 0, "seeds": [], "by_target": {}, "findings": []}
    if options.out.is_file():
        result = read_json(options.out)
    with tempfile.TemporaryDirectory() as folder:
        targets = [target for target in all_targets(Path(folder)) if options.only in target.name]
        for target in targets:  # libraries that are loaded on first use are no input's doing
            attempt(target, target.samples[0])
        limit_memory()
        if options.each:
            found = each_builder(targets, options.each)
            write_json(options.out, found)
            return 1 if any(entry["findings"] for entry in found.values()) else 0
        begun = result.setdefault("begun", {})  # seed to how many of its inputs are done
        for seed in range(options.first, options.first + options.seeds):
            while begun.get(str(seed), 0) < options.inputs:
                first = begun.get(str(seed), 0)
                last = min(first + BLOCK, options.inputs)
                add(result, *run(targets, range(first, last), seed, options.out.parent))
                begun[str(seed)] = last
                result["seeds"] = sorted(int(one) for one, done in begun.items() if done >= options.inputs)
                result["command"] = f"python scripts/fuzz.py --inputs {options.inputs} --seeds {options.seeds}"
                write_json(options.out, result)
    print(f"{result['inputs']} inputs, {len(result['findings'])} findings: {options.out}")
    return 1 if result["findings"] else 0


def each_builder(targets: list[Target], count: int) -> dict[str, dict[str, Any]]:
    """Every builder's first inputs: target and builder to the inputs, those that were read, and the findings."""
    result = {}
    for target in targets:
        for build in target.build:
            outcomes = [attempt(target, build(target.samples, np.random.default_rng([1, k]))) for k in range(count)]
            result[f"{target.name} {build.__name__}"] = {
                "inputs": count,
                "read": outcomes.count("read"),
                "findings": sorted(set(outcomes) - {"read", "refused"}),
            }
    return result


def limit_memory() -> None:
    """No input may take more than ``MEMORY`` beyond what this process has now."""
    try:
        import resource
    except ImportError:  # there is none outside of Unix
        return
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").is_file() else 0
    if pages:
        limit = pages * os.sysconf("SC_PAGE_SIZE") + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def run(targets: list[Target], numbers: range, seed: int, folder: Path) -> tuple[Tally, list[dict[str, Any]]]:
    """Gives every target its share of the inputs, of which these numbers are read.

    Returns:
        Per target the inputs and how many were read all the same; and the findings, at most one per kind of exception
        and line.
    """
    tally = {target.name: {"inputs": 0, "read": 0} for target in targets}
    seen: set[tuple[str, str]] = set()
    findings: list[dict[str, Any]] = []
    given = dict.fromkeys(tally, 0)
    for number in range(numbers.stop):
        target = min(targets, key=lambda one: given[one.name] / one.share)
        given[target.name] += 1
        if number < numbers.start:
            continue
        rng = np.random.default_rng([seed, number])
        built = target.build and rng.random() < BUILT
        make = target.build[int(rng.integers(len(target.build)))] if built else target.damage
        data = make(target.samples, rng)
        outcome = attempt(target, data)
        tally[target.name]["inputs"] += 1
        tally[target.name]["read"] += outcome == "read"
        if outcome not in ("read", "refused") and (target.name, outcome) not in seen:
            seen.add((target.name, outcome))
            kept = folder / f"fuzz-{target.name}-{seed}-{number}.bin"
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_bytes(data)
            findings.append({"target": target.name, "number": number, "seed": seed, "problem": outcome})
            print(f"{target.name}, seed {seed}, input {number}: {outcome}", flush=True)
    return tally, findings


def add(result: dict[str, Any], tally: Tally, findings: list[dict[str, Any]]) -> None:
    """Adds a block's counts and findings to the results."""
    result["findings"] += findings
    for name, counts in tally.items():
        total = result["by_target"].setdefault(name, {"inputs": 0, "read": 0})
        for key, count in counts.items():
            total[key] += count
            result["inputs"] += count if key == "inputs" else 0


def attempt(target: Target, data: bytes) -> str:
    """Reads once: ``read``, ``refused`` with one of our exceptions, or what went wrong."""
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        target.read(data)
    except SydaError:
        return "refused"
    except MemoryError:
        return "MemoryError"
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)
        inside = [frame for frame in last if "syda_gym" in frame.filename]
        place = inside[-1] if inside else last[-1]
        return f"{type(error).__name__}: {str(error)[:120]} at {Path(place.filename).name}:{place.lineno}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return "read"


def _too_long(*_: object) -> None:
    raise TimeoutError(f"more than {LIMIT} s")


if __name__ == "__main__":
    sys.exit(main())
