"""The study on the test bed: which predictor knows beforehand how pairs and chains will do, in several sessions."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from syda_gym.errors import OptionError
from syda_gym.evaluation.cell_files import CellFiles
from syda_gym.evaluation.pools import Pool, make_pool, run_jobs
from syda_gym.evaluation.prediction.bed_scores import bed_figures
from syda_gym.evaluation.prediction.bed_work import DRY_RUNS, BedJob, BedSettings, open_bed
from syda_gym.locks import locked_folder

__all__ = ["bed_jobs", "study_bed"]

Told = Callable[[float, str], None]


def bed_jobs(sessions: int, dry_runs: Sequence[str] | None = None) -> list[BedJob]:
    """Everything that the study computes, the longest first."""
    kept = list(DRY_RUNS) if dry_runs is None else list(dry_runs)
    return [
        *(BedJob("session", str(number)) for number in range(sessions)),
        BedJob("T", "general"),
        *(BedJob("dry_run", name) for name in kept),
        BedJob("T", "paper"),
    ]


def study_bed(
    settings: BedSettings,
    out: str | os.PathLike[str],
    *,
    sessions: int = 3,
    dry_runs: Sequence[str] | None = None,
    workers: int = 2,
    resamples: int = 300,
    pool: Pool | None = None,
    progress: Told | None = None,
) -> dict[str, Any]:
    """Fits every pair of every session, asks every predictor, and scores the predictions.

    Finished pieces are kept in ``out/cells``; the same call goes on from there.

    Args:
        settings: the bed, and what is done with it.
        out: folder.
        sessions: how often everything is recorded anew, at least 2.
        dry_runs: variants of the dry run, names of ``DRY_RUNS``; all by default.
        workers: processes.
        resamples: bootstrap samples over pairs of ends.
        pool: where to compute; ``workers`` processes if ``None``.
        progress: told the finished fraction and the name of the piece.

    Returns:
        All figures, JSON-able.

    Raises:
        OptionError: fewer than two sessions, or a piece that failed.
    """
    if sessions < 2:
        raise OptionError(f"sessions must be at least 2, for their agreement is the ceiling; got {sessions}")
    jobs = bed_jobs(sessions, dry_runs)
    found: dict[BedJob, dict[str, Any]] = {}
    with locked_folder(out) as folder:
        cells = CellFiles(Path(folder) / "cells")
        for job in jobs:
            content = cells.read(job.name, settings.key(job))
            if content is not None:
                found[job] = content
        missing = [job for job in jobs if job not in found]
        if missing:
            chosen = pool or make_pool(workers, open_bed, settings)
            for job, done in run_jobs(chosen, missing):
                if done.failure:
                    raise OptionError(f"{job.kind} {job.what!r} failed: {done.failure.strip().splitlines()[-1]}")
                cells.write(job.name, settings.key(job), done.result)
                found[job] = done.result
                if progress is not None:
                    progress(len(found) / len(jobs), f"{job.kind} {job.what}")
    return bed_figures(settings, [found[job] for job in jobs], jobs, resamples=resamples)
