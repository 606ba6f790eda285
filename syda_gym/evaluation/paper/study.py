"""The paper's study again: every method, three protocols, many seeds, beside the printed figures.

The study consists of *parts*: cells (one method under one protocol for one human) and two further tables, few
recordings and causal windows. Parts are computed in separate processes and kept as small JSON files, so that an
interrupted study goes on where it stopped.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from syda_gym.errors import MotionError, OptionError, StorageError
from syda_gym.evaluation.paper.cells import CONTENDERS, HUMANS, ROBOT, Cell, CellTask, Contender
from syda_gym.evaluation.paper.extras import FewShotTask, WindowTask
from syda_gym.evaluation.paper.results import Study, Task
from syda_gym.files import fingerprint, read_json, write_json
from syda_gym.mappings.card import versions
from syda_gym.motions.clip import PROTOCOLS, Motions
from syda_gym.motions.loading import load_motions

__all__ = ["CONTENDERS", "Cell", "Contender", "reproduce"]

Progress = Callable[[float, str], None]
"""Told the finished fraction and what was finished."""

_FORMAT = 3


def reproduce(
    motions: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    seeds: int = 10,
    protocols: Sequence[str] = PROTOCOLS,
    contenders: Sequence[str] | None = None,
    workers: int = 2,
    progress: Progress | None = None,
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

    Returns:
        The study.

    Raises:
        MotionError: bodies or pairs are missing.
        OptionError: unknown protocol or contender, no seed, no worker.
    """
    chosen = _chosen(contenders)
    if seeds < 1 or workers < 1:
        raise OptionError(f"seeds and workers must be at least 1, got {seeds} and {workers}")
    for protocol in protocols:
        if protocol not in PROTOCOLS:
            raise OptionError(f"unknown protocol {protocol!r}; known: {', '.join(PROTOCOLS)}")
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
    todo = []
    for task in tasks:
        found = _read_part(_part_path(out, mark, task, seeds)) if out is not None else None
        if found is None or not _add(study, task, found):
            todo.append(task)
    done = len(tasks) - len(todo)
    for task, result in _computed(sorted(todo, key=lambda task: -task.cost), workers):
        done += 1
        if isinstance(result, str):
            study.skipped[task.name] = result
        else:
            _add(study, task, result)
            if out is not None:
                write_json(_part_path(out, mark, task, seeds), {"format": _FORMAT, "part": result})
        if progress is not None:
            progress(done / len(tasks), task.name)
    if out is not None:
        from syda_gym.evaluation.paper.report import write_study

        write_study(study, out, versions())
    return study


def _computed(tasks: Sequence[Task], workers: int) -> Iterator[tuple[Task, dict[str, Any] | str]]:
    """Yields tasks with their figures (or why there are none) as they finish."""
    if workers == 1 or len(tasks) <= 1:
        for task in tasks:
            yield task, task.compute()
        return
    with ProcessPoolExecutor(min(workers, len(tasks)), mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(task.compute): task for task in tasks}
        for future in as_completed(waiting):
            yield waiting[future], future.result()


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
            raise OptionError(f"unknown contender {name!r}; known: {', '.join(known)}")
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


def _part_path(out: str | os.PathLike[str], mark: str, task: Task, seeds: int) -> Path:
    name = task.name.replace("/", "-").replace(" ", "-")
    return Path(out) / "cells" / f"{name}-{seeds}-{mark[:8]}.json"


def _read_part(path: Path) -> dict[str, Any] | None:
    """A part that an earlier run left; anything unreadable is computed again, the file is only a cache."""
    if not path.is_file():
        return None
    try:
        values = read_json(path)
    except StorageError:
        return None
    if not isinstance(values, dict) or values.get("format") != _FORMAT or not isinstance(values.get("part"), dict):
        return None
    part: dict[str, Any] = values["part"]
    return part
