"""Transferability: how well one body can stand in for another, before anything is recorded or fitted.

Three definitions give it. ``dry_run``, the default, rehearses the pair on the operator's planned motion and predicts
the error that a fitted mapping will have. ``general`` compares workspaces term by term as the paper does, for any body;
``paper`` reproduces the printed tables. Neither of the two predicts errors (``docs/study-transferability.md``).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, Side
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.errors import OptionError, nearest_name
from syda_gym.motions.clip import Motions
from syda_gym.routes import general, paper
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.plan import Plan, plan_from_motions
from syda_gym.routes.dry_run.rehearsal import Rehearsal
from syda_gym.routes.general import Sampling
from syda_gym.routes.shipped import shipped_comparison
from syda_gym.routes.workspace.arms import canonical_arms
from syda_gym.routes.workspace.sampling import arm_length, chain_fingerprint, generic_rank
from syda_gym.routes.workspace.store import MEMORY, WorkspaceStore

__all__ = [
    "DEFINITIONS",
    "OPTIONS",
    "ArmPair",
    "Transferability",
    "compare_arms",
    "pair_arms",
    "rehearsal",
    "rehearsed",
    "transferability",
]

Definition = Literal["dry_run", "general", "paper"]
DEFINITIONS: tuple[Definition, ...] = get_args(Definition)

OPTIONS: dict[str, tuple[str, ...]] = {
    "dry_run": ("motions", "plan", "sensor", "imprecision", "retargeter"),
    "general": ("alpha", "samples", "cell", "repeats", "store"),
    "paper": ("alpha", "store"),
}
"""What each definition can be told, beside the seed."""

_DEVIATIONS = 2.0  # a tie is declared within two standard deviations


@dataclass(frozen=True)
class Transferability:
    """The transferability from one body to another, term by term (the paper's section 3.3.1).

    Attributes:
        source: name of the body A that leads.
        target: name of the body B that follows.
        definition: ``dry_run``, ``general`` or ``paper``.
        S: share of sufficient manipulability (Eq. 8), or of frames within the tolerance, in [0, 1].
        D: dissimilarity where manipulability lacks (Eq. 9), or how far the other frames lie off, in [0, 1].
        L: length ratio (Eq. 7), in (0, 1]; 1 in the dry run, whose errors are counted in arm lengths.
        alpha: noise coefficient (Eq. 10), in (0, 1].
        C: capability S + (1 - S)(1 - D), in [0, 1].
        coverage: share of A's cells that B reaches at all, or of B's arms that A has, in [0, 1].
        T: alpha L C (Eq. 10), in [0, 1].
        noise_floor: 1 - C of A against an independent resample of itself; differences below it mean nothing.
        spread: standard deviation of T over independent samplings.
        KL: the divergence inside Eq. 9; ``None`` in the general definition, which has none.
        error: expected landmark error on unseen actions [m]; ``dry_run`` only.
        standard_error: of ``error``, over actions [m]; ``dry_run`` only.
        samples: poses sampled per arm; ``general`` only, whose T rises with them by some percent and is therefore
            comparable at equal resolution alone.
        cell: edge of the cells in which manipulability is averaged [arm lengths]; ``general`` only.
        notes: what a reader should know about this pair (planar arms, missing arms, little coverage).
    """

    source: str
    target: str
    definition: Definition
    S: float
    D: float
    L: float
    alpha: float
    C: float
    coverage: float
    T: float
    noise_floor: float = 0.0
    spread: float = 0.0
    KL: float | None = None
    notes: tuple[str, ...] = ()
    error: float | None = None
    standard_error: float | None = None
    samples: int | None = None
    cell: float | None = None

    @property
    def tolerance(self) -> float:
        """Half-width of the band in which two values of T count as equal: sampling noise of both kinds."""
        return max(self.noise_floor * self.T, _DEVIATIONS * self.spread)

    def ties(self, other: Transferability) -> bool:
        """Whether the two cannot be told apart: by their expected errors where both have one, else by T."""
        if self.error is not None and other.error is not None:
            noise = float(np.hypot(self.standard_error or 0.0, other.standard_error or 0.0))
            return abs(self.error - other.error) <= noise
        return abs(self.T - other.T) <= max(self.tolerance, other.tolerance)

    def as_dict(self) -> dict[str, Any]:
        """All terms, JSON-able."""
        return {**asdict(self), "notes": list(self.notes), "tolerance": self.tolerance}


@dataclass(frozen=True, eq=False)
class ArmPair:
    """One arm of A and the arm of B that follows it, both in canonical form."""

    source: ArmChain
    target: ArmChain
    source_side: Side
    target_side: Side


def transferability(
    source: str | os.PathLike[str] | Embodiment,
    target: str | os.PathLike[str] | Embodiment,
    definition: Definition = "dry_run",
    *,
    seed: int = 0,
    **options: Any,
) -> Transferability:
    """Measures how well ``target`` can follow ``source`` (Eq. 10 of the paper).

    Args:
        source: the body A that leads: a name of the catalog, a body, or a path to a URDF or robot description.
        target: the body B that follows.
        definition: ``dry_run`` (expected error on the operator's planned motion; see
            ``syda_gym.routes.dry_run.rehearsal``), ``general`` (workspaces of any bodies; see
            ``syda_gym.routes.general``) or ``paper`` (reproduces Tables 2 and 5; see ``syda_gym.routes.paper``).
        seed: of samples, folds and noise; the same seed gives the same bits.
        options: of the definition. ``dry_run``: ``motions`` (clips to plan beside the shipped ones: a ``Motions`` or
            what ``load_motions`` takes), ``plan`` (a ``Plan`` instead of both), ``sensor`` (body to noise of a landmark
            [m]), ``imprecision`` (body to arm lengths), ``retargeter`` (how robots imitate). ``general``: ``alpha``,
            ``samples`` (a power of two), ``cell`` [arm lengths], ``repeats``, ``store``. ``paper``: ``alpha``,
            ``store``.

    Returns:
        All terms.

    Raises:
        EmbodimentError: unknown or unusable body, or one that cannot imitate the plan.
        RouteError: bodies without an arm on the same side (``dry_run``).
        MotionError: motions that hold nothing to plan (``dry_run``).
        OptionError: an option out of range or of another definition.

    Example:
        >>> syda_gym.transferability("adult", "pepper").T  # doctest: +SKIP
    """
    if definition not in DEFINITIONS:
        raise OptionError(f"unknown definition {definition!r}; {nearest_name(str(definition), DEFINITIONS)}")
    for name in options:
        if name not in OPTIONS[definition]:
            raise OptionError(
                f"the definition {definition!r} takes no {name!r}; {nearest_name(name, OPTIONS[definition])}"
            )
    alpha = options.pop("alpha", None)
    if alpha is not None and not 0.0 < alpha <= 1.0:
        raise OptionError(f"alpha is sigma_min / sigma_pair and lies in (0, 1], got {alpha}")
    a, b = catalog.resolve(source), catalog.resolve(target)
    if definition == "dry_run":
        return rehearsed(rehearsal({a.name: a, b.name: b}, seed=seed, **options), a.name, b.name)
    store = options.pop("store", MEMORY)
    if definition == "paper":
        return _paper(a, b, alpha, store)
    return _general(a, b, 1.0 if alpha is None else alpha, Sampling(seed=seed, **options), store)


def rehearsal(
    bodies: Mapping[str, Embodiment],
    *,
    motions: str | os.PathLike[str] | Motions | None = None,
    plan: Plan | None = None,
    **options: Any,
) -> Rehearsal:
    """Bodies that rehearse together.

    Args:
        bodies: name to body.
        motions: clips to plan beside the shipped ones, performed by the first of ``bodies`` that is in them, else by
            their first body.
        plan: what to plan instead.
        options: of ``Rehearsal``.

    Raises:
        MotionError: motions that hold nothing to plan.
        OptionError: both ``motions`` and ``plan``.
    """
    if plan is not None and motions is not None:
        raise OptionError("give either plan= or motions=; a plan says all that is planned")
    if plan is None:
        plan = default_plan()
        if motions is not None:
            from syda_gym.motions.loading import load_motions

            known = motions if isinstance(motions, Motions) else load_motions(motions)
            performer = next((name for name in bodies if name in known.bodies), next(iter(known.bodies)))
            plan = plan + plan_from_motions(known, performer)
    return Rehearsal(bodies, plan, **options)


def rehearsed(together: Rehearsal, source: str, target: str) -> Transferability:
    """The transferability of one pair of a rehearsal."""
    score = together.score((source, target))
    sides = [together.bodies[name].sides for name in (source, target)]
    carried = sum(side in sides[0] for side in sides[1]) / len(sides[1])
    lost = f"{source!r} has not every arm of {target!r}; the missing one is guessed"
    alone = f"only the {sides[1][0]} arm counts: {target!r} has no other"
    return Transferability(
        source=source,
        target=target,
        definition="dry_run",
        S=score.S,
        D=score.D,
        L=1.0,
        alpha=score.alpha,
        C=score.C,
        coverage=carried,
        T=score.T,
        spread=0.5 * score.standard_error / score.error * score.T,
        notes=(*((lost,) if carried < 1.0 else ()), *((alone,) if len(sides[1]) < len(sides[0]) else ())),
        error=score.error,
        standard_error=score.standard_error,
    )


def pair_arms(source: Embodiment, target: Embodiment) -> tuple[list[ArmPair], list[str]]:
    """Which arm of the target follows which arm of the source: the same side, or the only one there is.

    Returns:
        The pairs, left before right, and notes about arms left out.
    """
    arms_a, arms_b = canonical_arms(source), canonical_arms(target)
    common = [side for side in arms_a if side in arms_b]
    if common:
        notes = [
            f"only the {' and '.join(common)} arm is compared: {short.name!r} has no other"
            for short, count, other in ((source, len(arms_a), len(arms_b)), (target, len(arms_b), len(arms_a)))
            if count < other
        ]
        return [ArmPair(arms_a[side], arms_b[side], side, side) for side in common], notes
    side_a, side_b = next(iter(arms_a)), next(iter(arms_b))
    note = f"the {side_a} arm of {source.name!r} is compared with the mirrored {side_b} arm of {target.name!r}"
    return [ArmPair(arms_a[side_a], arms_b[side_b], side_a, side_b)], [note]


def _paper(a: Embodiment, b: Embodiment, alpha: float | None, store: WorkspaceStore) -> Transferability:
    arm_a, arm_b = paper.paper_arm(a), paper.paper_arm(b)
    terms = paper.compare(paper.paper_workspace(arm_a, store), paper.paper_workspace(arm_b, store))
    lengths = sum(arm_a.lengths), sum(arm_b.lengths)
    ratio = min(lengths) / max(lengths)
    if alpha is None:
        alpha = paper.PAPER_ALPHA.get(frozenset((a.name, b.name)), 1.0)
    capability = terms.S + (1.0 - terms.D) * (1.0 - terms.S)
    notes = () if terms.lacking_cells else ("no cell lacks manipulability, so D has no meaning here and is sigmoid(0)",)
    return Transferability(
        source=a.name,
        target=b.name,
        definition="paper",
        S=terms.S,
        D=terms.D,
        L=ratio,
        alpha=alpha,
        C=capability,
        coverage=terms.coverage,
        T=alpha * ratio * capability,
        KL=terms.KL,
        notes=notes,
    )


def _general(a: Embodiment, b: Embodiment, alpha: float, sampling: Sampling, store: WorkspaceStore) -> Transferability:
    pairs, notes = pair_arms(a, b)
    measured = [compare_arms(pair, sampling, store) for pair in pairs]
    # (arms, repeats, [S, C, coverage, C of A resampled]) -> mean over arms, per repeat
    repeats = np.array(measured).mean(axis=0)
    S, C, coverage, self_capability = (float(value) for value in repeats.mean(axis=0))
    ratio = min(1.0, sum(arm_length(pair.target) for pair in pairs) / sum(arm_length(pair.source) for pair in pairs))
    per_repeat = alpha * ratio * repeats[:, 1]
    return Transferability(
        source=a.name,
        target=b.name,
        definition="general",
        S=S,
        D=float(np.clip(1.0 - (C - S) / (1.0 - S), 0.0, 1.0)) if S < 1.0 else 0.0,
        L=ratio,
        alpha=alpha,
        C=C,
        coverage=coverage,
        T=alpha * ratio * C,
        noise_floor=1.0 - self_capability,
        spread=float(per_repeat.std(ddof=1)),
        samples=sampling.samples,
        cell=sampling.cell,
        notes=(*notes, *_planar_notes(a, b, pairs), *_coverage_note(a, b, coverage)),
    )


def compare_arms(pair: ArmPair, sampling: Sampling, store: WorkspaceStore) -> list[tuple[float, ...]]:
    """S, C, coverage and C(A, A resampled) of one pair of arms, per repeat.

    Args:
        pair: the arms.
        sampling: how they are sampled.
        store: where workspaces are kept; with the shared one, comparisons that come with the package are not repeated.
    """
    if store is MEMORY and (known := shipped_comparison(pair.source, pair.target, sampling)) is not None:
        return known
    rank = min(generic_rank(pair.source), generic_rank(pair.target))
    a = [general.general_workspace(pair.source, sampling, i, rank, store) for i in range(sampling.repeats)]
    b = [general.general_workspace(pair.target, sampling, i, rank, store) for i in range(sampling.repeats)]
    # Equal arms share their samples, so that C(A, A) = 1. Others are compared across independent samples: shared ones
    # would hide the noise between similar arms and not between different ones.
    shift = 0 if chain_fingerprint(pair.source) == chain_fingerprint(pair.target) else 1
    rows: list[tuple[float, ...]] = []
    for i in range(sampling.repeats):
        terms = general.compare(a[i], b[(i + shift) % sampling.repeats])
        floor = general.compare(a[i], a[(i + 1) % sampling.repeats])
        rows.append((terms.S, terms.C, terms.coverage, floor.C))
    return rows


def _planar_notes(a: Embodiment, b: Embodiment, pairs: list[ArmPair]) -> list[str]:
    notes = []
    ranks = [(generic_rank(pair.source), generic_rank(pair.target)) for pair in pairs]
    for body, rank in ((a, min(r[0] for r in ranks)), (b, min(r[1] for r in ranks))):
        if rank < 3:
            shape = "planar: its tip moves in a surface" if rank == 2 else "a single hinge: its tip moves on a curve"
            notes.append(
                f"the arm of {body.name!r} is {shape}, so manipulability is the product of the {rank} largest "
                f"singular value{'s' if rank > 1 else ''} on both sides"
            )
    return notes


def _coverage_note(a: Embodiment, b: Embodiment, coverage: float) -> list[str]:
    if coverage >= 0.25:
        return []
    return [f"{b.name!r} reaches only {coverage:.1%} of the cells where {a.name!r} moves"]
