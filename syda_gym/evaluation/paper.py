"""The paper's study again: every method, three protocols, many seeds, beside the printed figures.

A *cell* is one method under one protocol for one human. Cells are computed in separate processes and kept as small JSON
files, so that an interrupted study goes on where it stopped.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.errors import MappingError, MissingExtraError, MotionError, OptionError, StorageError
from syda_gym.files import fingerprint, read_json, write_json
from syda_gym.mappings.card import versions
from syda_gym.mappings.fitting import fit_many
from syda_gym.mappings.mapping import Mapping
from syda_gym.mappings.validation import Fold, Validation, fit_folds, held_out_errors
from syda_gym.motions.clip import PROTOCOLS, Motions, PairedMotions
from syda_gym.motions.loading import load_motions

__all__ = ["CONTENDERS", "Cell", "Contender", "Study", "paper_transferability", "reproduce"]

Progress = Callable[[float, str], None]
"""Told the finished fraction and what was finished."""

HUMANS = ("adult", "kid")
ROBOT = "pepper"
_OTHER = {"adult": "kid", "kid": "adult"}
_FORMAT = 1


@dataclass(frozen=True)
class Contender:
    """A method and preset of the study.

    Attributes:
        method: of ``mappings.METHODS``.
        preset: of the method.
        seeded: whether the fit itself is random; otherwise seeds only matter for random splits.
        bounds: in how many seeds the error bound is checked (leave-one-action-out only).
        slow: whether to leave it out of a quick study.
    """

    method: str
    preset: str
    seeded: bool = True
    bounds: int = 0
    slow: bool = False

    @property
    def name(self) -> str:
        """``method/preset``."""
        return f"{self.method}/{self.preset}"


CONTENDERS = (
    Contender("syda", "general", bounds=2),
    Contender("syda", "accurate", bounds=1),
    Contender("syda", "paper"),
    Contender("direct", "paper"),
    Contender("syda", "interpolation", slow=True),
    Contender("direct", "general"),
    Contender("ridge", "general", seeded=False, bounds=1),
    Contender("kernel_ridge", "general", seeded=False),
    Contender("nearest", "general", seeded=False),
    Contender("geometric", "procrustes", seeded=False),
    Contender("geometric", "fixed", seeded=False),
    Contender("mink", "procrustes", seeded=False),
)
"""Every method of the study, the most telling first."""


@dataclass(frozen=True)
class Cell:
    """Figures of one method under one protocol for one human; lists run over seeds.

    Attributes:
        contender: ``method/preset``.
        protocol: ``rand3``, ``twin3`` or ``loao``.
        human: ``adult`` or ``kid``.
        error: human to robot [m].
        error_back: robot to human [m]; empty if the method does not map back.
        chain: other human to this one to the robot, scored on the other's own pairing [m]; empty if there is none.
        chain_joints: per seed the mean of each landmark of the chain [m], as ``landmark_names`` of the robot.
        chain_spread: per seed the standard deviation over frames of each landmark of the chain [m].
        actions: action to mean error human to robot [m].
        limit_violations: share of joint angles beyond the limits before they are enforced.
        speed_violations: share of joint steps beyond the speed limits; ``None`` where clips are not held out whole.
        aligned: human to robot after the best shift of every test recording (an oracle) [m].
        bound: mean error bound [m], ``None`` if not checked.
        covered: share of frames within the bound.
        covered_worst: the same of the worst action.
        seconds: processor time.
    """

    contender: str
    protocol: str
    human: str
    error: list[float]
    error_back: list[float] = field(default_factory=list)
    chain: list[float] = field(default_factory=list)
    chain_joints: list[list[float]] = field(default_factory=list)
    chain_spread: list[list[float]] = field(default_factory=list)
    actions: dict[str, float] = field(default_factory=dict)
    limit_violations: float = 0.0
    speed_violations: float | None = None
    aligned: list[float] = field(default_factory=list)
    bound: float | None = None
    covered: float | None = None
    covered_worst: float | None = None
    seconds: float = 0.0


@dataclass(frozen=True)
class Study:
    """All cells that could be computed.

    Attributes:
        data: name of the data set.
        seeds: how many.
        cells: by contender, protocol and human.
        skipped: contender to the reason why it is missing.
    """

    data: str
    seeds: int
    cells: dict[tuple[str, str, str], Cell]
    skipped: dict[str, str]

    def cell(self, contender: str, protocol: str, human: str) -> Cell | None:
        """One cell, ``None`` if there is none."""
        return self.cells.get((contender, protocol, human))


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
        out: folder for tables, plots and the finished cells (by which an interrupted study is resumed); nothing is
            written if ``None``.
        seeds: of splits and networks.
        protocols: some of ``rand3``, ``twin3``, ``loao``.
        contenders: names ``method/preset`` out of ``CONTENDERS``; all by default.
        workers: processes; each uses one thread.
        progress: told the finished fraction and the last finished cell.

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
    tasks = [
        (spec, contender, protocol, human, seeds) for protocol in protocols for contender in chosen for human in HUMANS
    ]
    cells: dict[tuple[str, str, str], Cell] = {}
    skipped: dict[str, str] = {}
    todo = []
    for task in tasks:
        found = _read_cell(_cell_path(out, mark, task)) if out is not None else None
        if found is None:
            todo.append(task)
        else:
            cells[found.contender, found.protocol, found.human] = found
    done = len(tasks) - len(todo)
    for task, result in _computed(todo, workers):
        done += 1
        if isinstance(result, str):
            skipped[task[1].name] = result
        else:
            cells[result.contender, result.protocol, result.human] = result
            if out is not None:
                write_json(_cell_path(out, mark, task), {"format": _FORMAT, **asdict(result)})
        if progress is not None:
            progress(done / len(tasks), f"{task[1].name} {task[2]} {task[3]}")
    study = Study(loaded.name, seeds, cells, skipped)
    if out is not None:
        from syda_gym.evaluation.paper_report import write_study

        write_study(study, out, versions())
    return study


Task = tuple[str, Contender, str, str, int]


def _computed(tasks: Sequence[Task], workers: int) -> Any:
    """Yields tasks with their cells (or why there is none) as they finish."""
    if workers == 1 or len(tasks) <= 1:
        for task in tasks:
            yield task, compute_cell(task)
        return
    with ProcessPoolExecutor(min(workers, len(tasks)), mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(compute_cell, task): task for task in tasks}
        for future in as_completed(waiting):
            yield waiting[future], future.result()


def compute_cell(task: Task) -> Cell | str:
    """Computes one cell; a missing optional dependency gives its message instead."""
    import time

    import torch

    spec, contender, protocol, human, seeds = task
    torch.set_num_threads(1)
    start = time.process_time()
    motions = load_motions(spec)
    pair = motions.pair(human, ROBOT)
    numbers = range(seeds if contender.seeded or protocol != "loao" else 1)
    options: dict[str, Any] = {} if contender.preset == "paper" else {"confidence": False}
    try:
        folds = fit_folds(pair, contender.method, contender.preset, protocol=protocol, seeds=numbers, **options)
    except MissingExtraError as error:
        return str(error)
    scores = held_out_errors(pair, folds, protocol)
    chain = _chain_errors(motions, contender, protocol, human, folds, numbers)
    bound = _bounds(pair, contender) if contender.bounds and protocol == "loao" else None
    return Cell(
        contender=contender.name,
        protocol=protocol,
        human=human,
        error=scores.means.tolist(),
        error_back=[] if scores.errors_back is None else scores.errors_back.mean(axis=(1, 2)).tolist(),
        chain=[float(errors.mean()) for errors in chain],
        chain_joints=[errors.mean(axis=0).tolist() for errors in chain],
        chain_spread=[errors.std(axis=0).tolist() for errors in chain],
        actions=scores.per_action(),
        limit_violations=scores.limit_violations,
        speed_violations=scores.speed_violations,
        aligned=[] if scores.aligned is None else scores.aligned.tolist(),
        bound=None if bound is None or bound.bounds is None else float(bound.bounds.mean()),
        covered=None if bound is None or bound.covered is None else float(bound.covered.mean()),
        covered_worst=None
        if bound is None or bound.covered is None
        else min(bound.per_action(bound.covered.astype(np.float64)).values()),
        seconds=time.process_time() - start,
    )


def _bounds(pair: PairedMotions, contender: Contender) -> Validation:
    """Checks the error bound: every fold holds its own training actions out once more."""
    folds = fit_folds(
        pair, contender.method, contender.preset, protocol="loao", seeds=range(contender.bounds), back=False
    )
    return held_out_errors(pair, folds, "loao")


def _chain_errors(
    motions: Motions, contender: Contender, protocol: str, human: str, folds: Sequence[Fold], seeds: Sequence[int]
) -> list[np.ndarray[Any, np.dtype[np.float64]]]:
    """Per seed the errors of other human > human > robot on all rows of the other human's pairing with the robot.

    That pairing was never fitted. In leave-one-action-out the link into the robot is the one without the row's action;
    otherwise, as in the paper, it is fitted to all rows.
    """
    if protocol == "twin3":
        return []
    other = _OTHER[human]
    end, pair = motions.pair(other, ROBOT), motions.pair(human, ROBOT)
    options: dict[str, Any] = {} if contender.preset == "paper" else {"confidence": False}
    count = len(list(seeds))
    try:
        hops = fit_many(
            [motions.pair(other, human)] * count, contender.method, contender.preset, list(seeds), **options
        )
    except MappingError:
        return []  # this method does not reach humans
    result = []
    if protocol == "rand3":
        links = fit_many([pair] * count, contender.method, contender.preset, list(seeds), **options)
        for hop, whole in zip(hops, links, strict=True):
            result.append(landmark_error(end.target_body, (hop >> whole)(end.source), end.target))
        return result
    for seed, hop in zip(seeds, hops, strict=True):
        links_by_action: dict[str, Mapping] = {
            fold.test.action_names[0]: fold.mapping for fold in folds if fold.seed == seed
        }
        parts = []
        for action, link in links_by_action.items():
            if action in end.action_names:
                rows = end.only_actions([action])
                parts.append(landmark_error(rows.target_body, (hop >> link)(rows.source), rows.target))
        result.append(np.concatenate(parts))
    return result


def paper_transferability() -> dict[str, dict[str, float]]:
    """The transferability figures of Tables 2 and 5 as this library computes them, ``{"H2-R1": {"T": ...}}``."""
    from syda_gym.transferability import transferability

    names = {"H1": "kid", "H2": "adult", "R1": "pepper"}
    result = {}
    for a, b in (("H2", "R1"), ("H1", "R1"), ("R1", "H1"), ("R1", "H2"), ("H2", "H1"), ("H1", "H2")):
        t = transferability(names[a], names[b], definition="paper")
        result[f"{a}-{b}"] = {"S": float(t.S), "D": float(t.D), "alpha": float(t.alpha), "T": float(t.T)}
    return result


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


def _cell_path(out: str | os.PathLike[str], mark: str, task: Task) -> Path:
    _, contender, protocol, human, seeds = task
    name = f"{contender.name.replace('/', '-')}-{protocol}-{human}-{seeds}-{mark[:8]}.json"
    return Path(out) / "cells" / name


def _read_cell(path: Path) -> Cell | None:
    if not path.is_file():
        return None
    try:
        values = read_json(path)
        if values.pop("format") != _FORMAT:
            return None
        return Cell(**values)
    except (StorageError, TypeError, KeyError, AttributeError):
        return None  # computed again; the file is only a cache
