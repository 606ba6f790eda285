"""``run_benchmark``: every cell once, whatever happens in between."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from syda_gym.errors import OptionError, StorageError
from syda_gym.evaluation.benchmark.cells import FORMAT, Cell, cells_of, data_fingerprint
from syda_gym.evaluation.benchmark.config import BenchmarkConfig
from syda_gym.evaluation.benchmark.pools import Outcome, Pool, Schedule, make_pool
from syda_gym.evaluation.benchmark.results import Results, versions, write_results
from syda_gym.files import read_json, write_json
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

__all__ = ["run_benchmark"]

Progress = Callable[[int, int, str], None]
"""Told how many cells are done, how many there are, and the name of the last one."""


def run_benchmark(
    config: BenchmarkConfig,
    out: str | os.PathLike[str],
    *,
    workers: str | int = 1,
    motions: Motions | None = None,
    parquet: bool = False,
    command: str = "",
    progress: Progress | None = None,
) -> Results:
    """Computes all cells that ``out`` does not hold yet and writes the results.

    Every finished cell is a file of its own in ``out/cells``, written atomically, so that a run can be killed at any
    moment and goes on where it stopped. A cell that fails is reported with its trace, the rest goes on, and the next
    run tries it again. The results are the same whichever workers computed them.

    Args:
        config: what to compute.
        out: folder; created if need be.
        workers: see ``pools.make_pool``.
        motions: the data set, if it is loaded already; otherwise ``config.motions`` is.
        parquet: write the rows as Parquet instead of CSV.
        command: the command line, for the provenance.
        progress: told after every cell.

    Returns:
        All rows, failures under ``about["failures"]``.

    Raises:
        SydaError: bad configuration, unwritable folder, cells of another version; finished cells stay.
    """
    data = motions if motions is not None else load_motions(config.motions, config.fps)
    cells = cells_of(config, data)
    if not cells:
        raise OptionError("the configuration asks for no cell; name at least one route, method, agent and seed")
    folder = Path(out) / "cells"
    tell = progress or (lambda done, count, name: None)
    left = [cell for cell in cells if not _stored(folder, cell)]
    done = len(cells) - len(left)
    tell(done, len(cells), "")
    if left:
        pool = make_pool(workers, data)  # before the folder is made: a pool that is refused leaves nothing
        try:
            _prepare(folder)
            for outcome in _computed(pool, left):
                cell = Cell.from_dict(outcome["cell"])
                _store(folder, cell, outcome)
                done += 1
                tell(done, len(cells), cell.name)
        finally:
            pool.close()
    results = _collect(folder, config, cells, data, command)
    write_results(Path(out), results, parquet)
    return results


def _computed(pool: Pool, cells: Sequence[Cell]) -> Any:
    """Yields outcomes as they come; every worker has one cell at a time."""
    schedule = Schedule(cells, pool.size)
    running: dict[Any, tuple[int, Cell]] = {}
    for worker in range(pool.size):
        cell = schedule.next(worker)
        if cell is not None:
            running[pool.submit(worker, cell)] = (worker, cell)
    while running:
        ticket = pool.wait(list(running))
        worker, cell = running.pop(ticket)
        outcome = pool.outcome(ticket, cell)
        following = schedule.next(worker)
        if following is not None:
            running[pool.submit(worker, following)] = (worker, following)
        yield outcome


def _prepare(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.touch()
        probe.unlink()
        for leftover in folder.glob(".*-*.json"):  # a killed process could not tidy up
            leftover.unlink()
    except OSError as error:
        raise StorageError(
            f"cannot write into {folder.parent}: {error.strerror}; choose another folder with --out"
        ) from error


def _stored(folder: Path, cell: Cell) -> bool:
    """Whether a cell is there and readable."""
    path = folder / f"{cell.key}.json"
    if not path.is_file():
        return False
    try:
        stored = read_json(path)
    except StorageError:  # damaged from outside, for files are written whole: compute it again
        path.unlink()
        return False
    found = stored.get("format") if isinstance(stored, dict) else None
    if found != FORMAT:
        raise StorageError(
            f"{path} has format {found!r}, this version writes {FORMAT}; choose another folder, nothing was changed"
        )
    return True


def _store(folder: Path, cell: Cell, outcome: Outcome) -> None:
    failed = folder / f"{cell.key}.failed.json"
    if "failure" in outcome:
        write_json(failed, {"format": FORMAT, **outcome})
        return
    write_json(folder / f"{cell.key}.json", {"format": FORMAT, **outcome})
    failed.unlink(missing_ok=True)


def _collect(folder: Path, config: BenchmarkConfig, cells: Sequence[Cell], data: Motions, command: str) -> Results:
    rows: list[dict[str, Any]] = []
    timings: list[dict[str, Any]] = []
    failures: list[dict[str, Any]] = []
    for cell in cells:
        path = folder / f"{cell.key}.json"
        if path.is_file():
            stored = read_json(path)
            rows += stored["rows"]
            timings.append({"cell": cell.key, "name": cell.name, **stored["timing"]})
        else:
            failed = folder / f"{cell.key}.failed.json"
            trace = read_json(failed)["failure"] if failed.is_file() else "not computed"
            failures.append({"cell": cell.name, "key": cell.key, "trace": trace})
    about = {
        "command": command,
        "config": config.as_dict(),
        "data": {"name": data.name, "fingerprint": data_fingerprint(data), "takes": len(data.takes),
                 "synthetic": data.synthetic},
        "versions": versions(),
        "cells": {cell.key: cell.name for cell in cells},
        "failures": failures,
    }  # fmt: skip
    return Results(tuple(rows), about, tuple(timings), folder.parent)
