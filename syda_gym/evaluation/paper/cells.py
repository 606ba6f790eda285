"""Cells of the paper's study: one method under one protocol for one human."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MappingError, MissingExtraError
from syda_gym.evaluation.pools import Tell
from syda_gym.mappings.fitting.fit import fit_many
from syda_gym.mappings.fitting.held_out import Fold, Validation, fit_folds, held_out_errors
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.clip import Motions, PairedMotions
from syda_gym.motions.loading import load_motions

__all__ = ["CONTENDERS", "HUMANS", "ROBOT", "Cell", "CellTask", "Contender"]

HUMANS = ("adult", "kid")
ROBOT = "pepper"
OTHER = {"adult": "kid", "kid": "adult"}


@dataclass(frozen=True)
class Contender:
    """A method and preset of the study.

    Attributes:
        method: of ``mappings.METHODS``.
        preset: of the method.
        seeded: whether the fit itself is random; otherwise seeds only matter for random splits.
        bounds: in how many seeds the error bound is checked (leave-one-action-out only).
        cost: relative time of a cell, so that the longest are started first and two processes end together.
    """

    method: str
    preset: str
    seeded: bool = True
    bounds: int = 0
    cost: float = 1.0

    @property
    def name(self) -> str:
        """``method/preset``."""
        return f"{self.method}/{self.preset}"


CONTENDERS = (
    Contender("syda", "general", seeded=False, bounds=1, cost=2.0),
    Contender("syda", "synergies", bounds=2, cost=4.0),
    Contender("syda", "nested", bounds=1, cost=4.0),
    Contender("syda", "accurate", bounds=1, cost=4.0),
    Contender("syda", "paper", cost=9.0),
    Contender("direct", "paper", cost=9.0),
    Contender("syda", "interpolation", cost=6.0),
    Contender("direct", "general", cost=4.0),
    Contender("ridge", "general", seeded=False, bounds=1),
    Contender("kernel_ridge", "general", seeded=False, cost=2.0),
    Contender("nearest", "general", seeded=False),
    Contender("geometric", "procrustes", seeded=False),
    Contender("geometric", "fixed", seeded=False),
    Contender("mink", "procrustes", seeded=False, cost=2.0),
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
class CellTask:
    """One cell to compute.

    Attributes:
        spec: the motions.
        contender: the method.
        protocol: how rows are held out.
        human: who leads.
        seeds: how many.
    """

    spec: str
    contender: Contender
    protocol: str
    human: str
    seeds: int

    @property
    def name(self) -> str:
        """For progress and files."""
        return f"{self.contender.name} {self.protocol} {self.human}"

    @property
    def cost(self) -> float:
        """Relative time: leave-one-action-out has nine folds, the others three."""
        return self.contender.cost * (3.0 if self.protocol == "loao" else 1.0)

    def compute(self, tell: Tell = lambda fraction: None) -> dict[str, Any] | str:
        """The cell's figures, or the message of a missing optional dependency; ``tell`` hears the finished fraction."""
        import torch

        torch.set_num_threads(1)
        start = time.process_time()
        motions = load_motions(self.spec)
        contender, protocol, human = self.contender, self.protocol, self.human
        pair = motions.pair(human, ROBOT)
        numbers = range(self.seeds if contender.seeded or protocol != "loao" else 1)
        try:
            folds = fit_folds(
                pair,
                contender.method,
                contender.preset,
                protocol=protocol,
                seeds=numbers,
                progress=lambda fitted: tell(0.6 * fitted),
                **_options(contender),
            )
        except MissingExtraError as error:
            return str(error)
        tell(0.6)
        scores = held_out_errors(pair, folds, protocol)
        tell(0.7)
        chain = _chain_errors(motions, contender, protocol, human, folds, numbers)
        tell(0.8)
        bound = _bounds(pair, contender, tell) if contender.bounds and protocol == "loao" else None
        cell = Cell(
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
        return asdict(cell)


def _options(contender: Contender) -> dict[str, Any]:
    """The published networks know no confidence; the others go without one, because it costs a fit per action."""
    return {} if contender.preset == "paper" else {"confidence": False}


def _bounds(pair: PairedMotions, contender: Contender, tell: Tell) -> Validation:
    """Checks the error bound: every fold holds its own training actions out once more."""
    folds = fit_folds(
        pair,
        contender.method,
        contender.preset,
        protocol="loao",
        seeds=range(contender.bounds),
        back=False,
        progress=lambda fitted: tell(0.8 + 0.2 * fitted),
    )
    return held_out_errors(pair, folds, "loao")


def _chain_errors(
    motions: Motions, contender: Contender, protocol: str, human: str, folds: Sequence[Fold], seeds: Sequence[int]
) -> list[FloatArray]:
    """Per seed the errors of other human > human > robot on all rows of the other human's pairing with the robot.

    That pairing was never fitted. In leave-one-action-out the link into the robot is the one without the row's action;
    otherwise, as in the paper, it is fitted to all rows.
    """
    if protocol == "twin3":
        return []
    other = OTHER[human]
    end, pair = motions.pair(other, ROBOT), motions.pair(human, ROBOT)
    options = _options(contender)
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
