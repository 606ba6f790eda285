"""``run_benchmark``: every cell once, whatever happens in between."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

from syda_gym.errors import OptionError
from syda_gym.evaluation.benchmark.cells import Cell, cells_of, data_fingerprint
from syda_gym.evaluation.benchmark.config import BenchmarkConfig
from syda_gym.evaluation.benchmark.results import Results, write_results
from syda_gym.evaluation.benchmark.work import open_work
from syda_gym.evaluation.cell_files import CellFiles
from syda_gym.evaluation.pools import Done, make_pool, run_jobs
from syda_gym.evaluation.provenance import versions
from syda_gym.locks import locked_folder
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

__all__ = ["run_benchmark"]

Progress = Callable[[int, int, str], None]
"""Told how many cells are done, how many there are, and the name of the last one."""

Inside = Callable[[float, str], None]
"""Told the part of the running cells that is done, in cells, and the name of one of them."""


def run_benchmark(
    config: BenchmarkConfig,
    out: str | os.PathLike[str],
    *,
    workers: str | int = 1,
    motions: Motions | None = None,
    parquet: bool = False,
    command: str = "",
    progress: Progress | None = None,
    inside: Inside | None = None,
) -> Results:
    """Computes all cells that ``out`` does not hold yet and writes the results.

    Every finished cell is a file of its own in ``out/cells``, written atomically, so that a run can be killed at any
    moment and goes on where it stopped. A cell is taken again only if the same versions and the same code would compute
    it, and if its file is sound. A cell that fails, or whose worker is lost, is reported with the reason, the rest goes
    on, and the next run tries it again. The results are the same whichever workers computed them.

    Args:
        config: what to compute.
        out: folder; created if need be.
        workers: see ``pools.make_pool``.
        motions: the data set, if it is loaded already; otherwise ``config.motions`` is.
        parquet: write the rows as Parquet instead of CSV.
        command: the command line, for the provenance.
        progress: told after every cell.
        inside: told of the cells that are being computed.

    Returns:
        All rows, failures under ``about["failures"]``.

    Raises:
        SydaError: bad configuration, a folder that cannot be written or that another process writes, cells of another
            version; finished cells stay.
    """
    data = motions if motions is not None else load_motions(config.motions, config.fps)
    cells = cells_of(config, data)
    if not cells:
        raise OptionError("the configuration asks for no cell; name at least one route, method, agent and seed")
    with locked_folder(out) as folder:
        files = CellFiles(folder / "cells")
        stored, failures = _compute(files, cells, data, workers, progress, inside)
        results = Results(*_collected(cells, stored, failures, config, data, command), folder)
        write_results(folder, results, parquet)
    return results


def _compute(
    files: CellFiles,
    cells: Sequence[Cell],
    data: Motions,
    workers: str | int,
    progress: Progress | None,
    inside: Inside | None,
) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """What every cell gave, by key, and why others gave nothing."""
    tell = progress or (lambda done, count, name: None)
    stored = {cell.key: _kept(found) for cell in cells if (found := files.read(cell.key, cell.key)) is not None}
    failures: dict[str, str] = {}
    left = [cell for cell in cells if cell.key not in stored]
    tell(len(stored), len(cells), "")
    if not left:
        return stored, failures

    def told(running: dict[int, tuple[Cell, float]]) -> None:
        if inside is not None and running:
            name = next(iter(running.values()))[0].name
            inside(sum(fraction for _, fraction in running.values()), name)

    pool = make_pool(workers, open_work, data)
    for cell, done in run_jobs(pool, left, batch=lambda cell: cell.batch, inside=told):
        _keep(files, cell, done, stored, failures)
        tell(len(stored) + len(failures), len(cells), cell.name)
    return stored, failures


def _keep(
    files: CellFiles, cell: Cell, done: Done, stored: dict[str, dict[str, Any]], failures: dict[str, str]
) -> None:
    failed = f"{cell.key}.failed"
    if done.failure:
        failures[cell.key] = done.failure
        files.write(failed, cell.key, {"cell": cell.to_dict(), "failure": done.failure})
        return
    files.write(cell.key, cell.key, done.result)
    stored[cell.key] = _kept(done.result)
    files.path(failed).unlink(missing_ok=True)


def _kept(content: dict[str, Any]) -> dict[str, Any]:
    """Without the frames of the playback, which stay in the file."""
    return {name: content[name] for name in ("rows", "timing")}


def _collected(
    cells: Sequence[Cell],
    stored: dict[str, dict[str, Any]],
    failures: dict[str, str],
    config: BenchmarkConfig,
    data: Motions,
    command: str,
) -> tuple[tuple[dict[str, Any], ...], dict[str, Any], tuple[dict[str, Any], ...]]:
    """Rows, provenance and timings, in the order of the cells."""
    rows: list[dict[str, Any]] = []
    timings: list[dict[str, Any]] = []
    missing: list[dict[str, Any]] = []
    for cell in cells:
        if cell.key in stored:
            rows += stored[cell.key]["rows"]
            timings.append({"cell": cell.key, "name": cell.name, **stored[cell.key]["timing"]})
        else:
            missing.append({"cell": cell.name, "key": cell.key, "trace": failures.get(cell.key, "not computed")})
    about = {
        "command": command,
        "config": config.as_dict(),
        "data": {"name": data.name, "fingerprint": data_fingerprint(data), "takes": len(data.takes),
                 "synthetic": data.synthetic},
        "versions": versions(),
        "cells": {cell.key: cell.name for cell in cells},
        "failures": missing,
    }  # fmt: skip
    return tuple(rows), about, tuple(timings)
