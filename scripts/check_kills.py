"""Kill long work 20 times at random moments, go on each time, and compare the end with that of an undisturbed run.

    python scripts/check_kills.py study           the paper's study on a few made-up motions
    python scripts/check_kills.py training        a residual policy, gone on with as by `train --resume`
    python scripts/check_kills.py benchmark       the same as `scripts/check_benchmark.py kills`

Each writes its part of ``docs/results/kills.json`` (``--out`` for another file). A run is a forked child that has
everything imported, so that kills (SIGKILL, to the one process, as an operating system out of memory would) fall into
the work. What is compared, bit for bit: of a study its tables, the results without processor times and the pictures; of
a training the weights, the card, the checkpoint and the log without its clock; of a benchmark what ``check_benchmark``
says. With every run that ends, the folder is a new one.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import os
import random
import signal
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import check_benchmark

from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.work import train_agent
from syda_gym.evaluation.paper.study import reproduce
from syda_gym.files import read_json, write_json
from syda_gym.motions import save_motions
from syda_gym.motions.loading import load_motions

OUT = Path(__file__).resolve().parents[1] / "docs" / "results" / "kills.json"
KILLS = 20
CONTENDERS = ["ridge/general", "geometric/procrustes"]
TRAINING = ResidualConfig(
    base="kalman",
    steps=1536,
    robots=8,
    rollout=32,
    batch=64,
    epochs=2,
    legs=6,
    episodes=3,
    validation_episodes=2,
    hidden=(32,),
)


@dataclass(frozen=True)
class Work:
    """Something long.

    Attributes:
        start: begins or goes on in a folder; the number of earlier ends is for variety.
        done: how much of it lies in a folder.
        content: all of a folder that must not differ, by name.
    """

    start: Callable[[Path, int], object]
    done: Callable[[Path], int]
    content: Callable[[Path], dict[str, Any]]


def study(root: Path) -> Work:
    """The paper's study; every second run has its parts computed by two workers."""
    few = load_motions("embedded", 3)
    actions = sorted({take.action for take in few.takes})[:6]
    bodies = ("adult", "kid", "pepper")
    takes = tuple(
        replace(take, frames={body: take.frames[body] for body in bodies})
        for take in few.takes
        if take.action in actions
    )
    path = root / "few.npz"
    save_motions(replace(few, takes=takes, bodies={body: few.bodies[body] for body in bodies}), path)

    def start(folder: Path, number: int) -> None:
        reproduce(f"npz:{path}", folder, seeds=1, contenders=CONTENDERS, workers=1 + number % 2)

    def content(folder: Path) -> dict[str, Any]:
        files: dict[str, Any] = {one.name: one.read_bytes() for one in folder.glob("*.*") if one.name[0] != "."}
        files["study.json"] = _without(read_json(folder / "study.json"), "seconds")
        return files

    return Work(start, lambda folder: len(list((folder / "cells").glob("[!.]*.json"))), content)


def training(root: Path) -> Work:
    """A residual policy on a tuned rival; it goes on from the checkpoint where there is one."""
    options = {"motions": "embedded", "actions": ["wave_high", "reach_high_front"], "mapping": "geometric"}

    def start(folder: Path, _: int) -> None:
        resume = (folder / "checkpoint.safetensors").is_file()
        train_agent(options, folder, config=TRAINING, base="kalman", seed=0, resume=resume)

    def done(folder: Path) -> int:
        log = folder / "progress.csv"
        return max(0, len(log.read_text().splitlines()) - 1) if log.is_file() else 0

    def content(folder: Path) -> dict[str, Any]:
        names = ("agent.json", "agent.safetensors", "checkpoint.safetensors")
        rows = list(csv.DictReader(io.StringIO((folder / "progress.csv").read_text())))
        clock = ("time/fps", "time/time_elapsed")
        log = [{key: value for key, value in row.items() if key not in clock} for row in rows]
        return {**{name: (folder / name).read_bytes() for name in names}, "progress.csv": log}

    return Work(start, done, content)


def killed(work: Work, root: Path, count: int, seed: int) -> dict[str, Any]:
    """Kills and goes on until ``count`` kills were had; every end is compared with the undisturbed one."""
    rng = random.Random(seed)
    work.start(root / "whole", 0)  # here, so that children find everything loaded
    wanted = work.content(root / "whole")
    start = time.monotonic()
    _finish(work, root / "again", 0)
    length = time.monotonic() - start
    if work.content(root / "again") != wanted:
        raise SystemExit("two undisturbed runs differ")
    found: dict[str, Any] = {"kills": 0, "after_parts": [], "finished_runs": 0, "equal": True, "orphans": 0}
    moments, folder = [], root / "run0"
    while found["kills"] < count:
        moment = rng.uniform(0.05, 1.0) * length
        child = _forked(work, folder, found["finished_runs"])
        if not _ends_within(child, moment):
            children = check_benchmark._children(child)
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            found["kills"] += 1
            found["orphans"] += check_benchmark._alive(children, 20.0)
            found["after_parts"].append(work.done(folder))
            moments.append(round(moment, 2))
            print(f"kill {found['kills']} after {moment:.1f} s: {work.done(folder)} parts done", flush=True)
            if work.done(folder) < work.done(root / "whole") and found["kills"] < count:
                continue
        _finish(work, folder, found["finished_runs"])
        found["finished_runs"] += 1
        content = work.content(folder)
        other = sorted(name for name in {*wanted, *content} if content.get(name) != wanted.get(name))
        found["equal"] &= not other
        print(f"run {found['finished_runs']} finished, {f'OTHER: {other}' if other else 'equal'}", flush=True)
        folder = root / f"run{found['finished_runs']}"
    parts = work.done(root / "whole")
    return {**found, "moments": moments, "parts": parts, "compared": sorted(wanted), "seconds": round(length, 2)}


def _forked(work: Work, folder: Path, number: int) -> int:
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        work.start(folder, number)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _ends_within(child: int, seconds: float) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        process, status = os.waitpid(child, os.WNOHANG)
        if process:
            if status:
                raise SystemExit("a run failed, see above")
            return True
        time.sleep(0.01)
    return False


def _finish(work: Work, folder: Path, number: int) -> None:
    _, status = os.waitpid(_forked(work, folder, number), 0)
    if status:
        raise SystemExit("a run failed, see above")


def _without(content: Any, key: str) -> Any:
    if isinstance(content, dict):
        return {name: _without(value, key) for name, value in content.items() if name != key}
    return [_without(value, key) for value in content] if isinstance(content, list) else content


def main() -> None:
    """Runs one check and stores its figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", choices=["study", "training", "benchmark"])
    parser.add_argument("--count", type=int, default=KILLS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.work == "benchmark":
        found = check_benchmark.kills(given.count, given.seed)
    else:
        with tempfile.TemporaryDirectory() as name:
            make = {"study": study, "training": training}[given.work]
            found = killed(make(Path(name)), Path(name), given.count, given.seed)
    print(json.dumps(found))
    known = read_json(given.out) if given.out.is_file() else {}
    write_json(given.out, {**known, given.work: found})


if __name__ == "__main__":
    main()
