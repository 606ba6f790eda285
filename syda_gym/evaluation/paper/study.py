"""The paper's study again: every method, three protocols, many seeds, beside the printed figures.

The study consists of *parts*: cells (one method under one protocol for one human) and two further tables, few
recordings and causal windows. Parts are computed in separate processes and kept as small JSON files, so that an
interrupted study goes on where it stopped.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any

from syda_gym.errors import MotionError, OptionError, nearest_name
from syda_gym.evaluation.cell_files import CellFiles
from syda_gym.evaluation.paper.cells import CONTENDERS, HUMANS, ROBOT, Cell, CellTask, Contender
from syda_gym.evaluation.paper.extras import FewShotTask, WindowTask
from syda_gym.evaluation.paper.results import Study, Task
from syda_gym.evaluation.pools import Tell, make_pool, run_jobs
from syda_gym.evaluation.provenance import made_by, versions
from syda_gym.files import fingerprint
from syda_gym.locks import locked_folder
from syda_gym.motions.clip import PROTOCOLS, Motions
from syda_gym.motions.loading import load_motions

__all__ = ["CONTENDERS", "Cell", "Contender", "reproduce"]

Progress = Callable[[float, str], None]
"""Told the finished fraction and what was finished."""

Inside = Callable[[float, str], None]
"""Told the finished fraction, running parts included, and the name of one that runs."""


def reproduce(
    motions: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    seeds: int = 10,
    protocols: Sequence[str] = PROTOCOLS,
    contenders: Sequence[str] | None = None,
    workers: int = 2,
    progress: Progress | None = None,
    inside: Inside | None = None,
) -> Study:
    """Runs the paper's study.

    Args:
        motions: ``paper:DIR``, or any motions with adult, kid and pepper recorded in pairs.
        out: folder for tables, plots and the finished parts (by which an interrupted study is resumed); nothing is
            written if ``None``.
        seeds: of splits and networks.
        protocols: some of ``rand3``, ``twin3``, ``loao``.
        contenders: names ``method/preset`` out of ``CONTENDERS``; by default all, and the tables of few recordings and
            causal windows.
        workers: processes; each uses one thread.
        progress: told the finished fraction and the last finished part.
        inside: told how far the running parts are.

    Returns:
        The study. A part that went wrong, or whose worker was lost, stands under ``failed`` with the reason.

    Raises:
        MotionError: bodies or pairs are missing.
        OptionError: unknown protocol or contender, no seed, no worker.
        StorageError: ``out`` cannot be written, or another process writes there.
    """
    chosen = _chosen(contenders)
    if seeds < 1 or workers < 1:
        raise OptionError(f"seeds and workers must be at least 1, got {seeds} and {workers}")
    for protocol in protocols:
        if protocol not in PROTOCOLS:
            raise OptionError(f"unknown protocol {protocol!r}; {nearest_name(protocol, PROTOCOLS)}")
    spec = os.fspath(motions)
    loaded = load_motions(spec)
    mark = _check(loaded)
    tasks: list[Task] = [
        CellTask(spec, contender, protocol, human, seeds)
        for protocol in protocols
        for contender in chosen
        for human in HUMANS
    ]
    if contenders is None and "loao" in protocols:
        tasks += [kind(spec, human, seeds) for kind in (FewShotTask, WindowTask) for human in HUMANS]
    study = Study(loaded.name, seeds, {})
    with nullcontext() if out is None else locked_folder(out) as folder:
        files = None if folder is None else _Parts(CellFiles(folder / "cells"), mark, seeds)
        todo = [task for task in tasks if files is None or not files.take(study, task)]
        _compute(study, tasks, todo, workers, files, progress, inside)
        if folder is not None:
            from syda_gym.evaluation.paper.report import write_study

            write_study(study, folder, versions())
    return study


class _Parts:
    """The finished parts in the output folder; only those of these motions, seeds, versions and this code count."""

    def __init__(self, files: CellFiles, mark: str, seeds: int) -> None:
        self._files = files
        self._made = f"{mark} {seeds} {made_by()}"

    def take(self, study: Study, task: Task) -> bool:
        """Puts a part that an earlier run left in its place."""
        found = self._files.read(*self._where(task))
        return found is not None and _add(study, task, found)

    def keep(self, task: Task, part: dict[str, Any]) -> None:
        """Stores a part."""
        self._files.write(*self._where(task), part)

    def _where(self, task: Task) -> tuple[str, str]:
        """The name of a part's file and the key of its content."""
        name = task.name.replace("/", "-").replace(" ", "-")
        key = f"{task.name} {self._made}"
        return f"{name}-{fingerprint(key)[:8]}", key


def _compute(
    study: Study,
    tasks: Sequence[Task],
    todo: Sequence[Task],
    workers: int,
    files: _Parts | None,
    progress: Progress | None,
    inside: Inside | None,
) -> None:
    """Computes parts in processes, the longest first, and puts them in their places."""
    if not todo:
        return
    finished = len(tasks) - len(todo)

    def told(running: dict[int, tuple[Task, float]]) -> None:
        if inside is not None and running:
            part = sum(fraction for _, fraction in running.values())
            inside((finished + part) / len(tasks), next(iter(running.values()))[0].name)

    pool = make_pool(min(workers, len(todo)), _open_work)
    for task, done in run_jobs(pool, sorted(todo, key=lambda task: -task.cost), inside=told):
        finished += 1
        if done.failure:
            study.failed[task.name] = done.failure
        elif isinstance(done.result, str):
            study.skipped[task.name] = done.result
        else:
            _add(study, task, done.result)
            if files is not None:
                files.keep(task, done.result)
        if progress is not None:
            progress(finished / len(tasks), task.name)


def _open_work() -> Callable[[Task, Tell], dict[str, Any] | str]:
    """What a worker of the pool does with a part."""
    return lambda task, tell: task.compute(tell)


def _add(study: Study, task: Task, part: dict[str, Any]) -> bool:
    """Puts a part in its place; ``False`` if it does not have the expected fields."""
    try:
        if isinstance(task, FewShotTask):
            study.few_shot[task.newcomer] = part["rows"]
        elif isinstance(task, WindowTask):
            study.windows[task.human] = part["rows"]
        else:
            cell = Cell(**part)
            study.cells[cell.contender, cell.protocol, cell.human] = cell
    except (TypeError, KeyError):
        return False
    return True


def _chosen(names: Sequence[str] | None) -> tuple[Contender, ...]:
    if names is None:
        return CONTENDERS
    known = {contender.name: contender for contender in CONTENDERS}
    for name in names:
        if name not in known:
            raise OptionError(f"unknown contender {name!r}; {nearest_name(name, known)}")
    return tuple(known[name] for name in names)


def _check(motions: Motions) -> str:
    """The data's fingerprint, if everything that the study needs is there."""
    for name in (*HUMANS, ROBOT):
        if name not in motions.bodies:
            raise MotionError(
                f"{motions.name} has no body {name!r}; the paper's study needs adult, kid and pepper: "
                "give --motions paper:DIR"
            )
    pairs = [motions.pair(*ends) for ends in (("adult", ROBOT), ("kid", ROBOT), ("adult", "kid"))]
    return fingerprint(*(pair.fingerprint for pair in pairs))
