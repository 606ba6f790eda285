"""Transferability: how well one body can stand in for another, before anything is recorded or fitted."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, Side
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.errors import OptionError, nearest_name
from syda_gym.routes import general, paper
from syda_gym.routes.general import Sampling
from syda_gym.routes.shipped import shipped_comparison
from syda_gym.routes.workspace.arms import canonical_arms
from syda_gym.routes.workspace.sampling import arm_length, chain_fingerprint, generic_rank
from syda_gym.routes.workspace.store import MEMORY, WorkspaceStore

__all__ = ["DEFINITIONS", "ArmPair", "Transferability", "compare_arms", "pair_arms", "transferability"]

Definition = Literal["general", "paper"]
DEFINITIONS: tuple[Definition, ...] = ("general", "paper")

_DEVIATIONS = 2.0  # a tie is declared within two standard deviations


@dataclass(frozen=True)
class Transferability:
    """The transferability from one body to another, term by term (the paper's section 3.3.1).

    Attributes:
        source: name of the body A that leads.
        target: name of the body B that follows.
        definition: ``general`` or ``paper``.
        S: share of sufficient manipulability (Eq. 8), in [0, 1].
        D: dissimilarity where manipulability lacks (Eq. 9), in [0, 1].
        L: length ratio (Eq. 7), in (0, 1].
        alpha: noise coefficient (Eq. 10), in (0, 1].
        C: capability S + (1 - S)(1 - D), in [0, 1].
        coverage: share of A's cells that B reaches at all, in [0, 1].
        T: alpha L C (Eq. 10), in [0, 1].
        noise_floor: 1 - C of A against an independent resample of itself; differences below it mean nothing.
        spread: standard deviation of T over independent samplings.
        KL: the divergence inside Eq. 9; ``None`` in the general definition, which has none.
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

    @property
    def tolerance(self) -> float:
        """Half-width of the band in which two values of T count as equal: sampling noise of both kinds."""
        return max(self.noise_floor * self.T, _DEVIATIONS * self.spread)

    def ties(self, other: Transferability) -> bool:
        """Whether the two values of T cannot be told apart."""
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
    definition: Definition = "general",
    *,
    alpha: float | None = None,
    samples: int = 2**20,
    cell: float = 0.1,
    seed: int = 0,
    repeats: int = 3,
    store: WorkspaceStore = MEMORY,
) -> Transferability:
    """Measures how well ``target`` can follow ``source`` (Eq. 10 of the paper).

    Args:
        source: the body A that leads: a name of the catalog, a body, or a path to a URDF or robot description.
        target: the body B that follows.
        definition: ``general`` (any body; see ``syda_gym.routes.general``) or ``paper`` (reproduces Tables 2
            and 5; see ``syda_gym.routes.paper`` for its limits).
        alpha: noise coefficient in (0, 1]; by default 1, and Table 2's values in the ``paper`` definition.
        samples: Sobol samples per arm and repeat (``general`` only), a power of two.
        cell: edge of a cell in arm lengths (``general`` only; the paper's is 0.1).
        seed: seed of the samples; the same seed gives the same bits.
        repeats: independent samplings, at least 2 (``general`` only).
        store: where sampled workspaces are kept; another than the default one samples the bundled bodies as well.

    Returns:
        All terms, with noise floor and spread.

    Raises:
        EmbodimentError: unknown or unusable body.
        OptionError: an option out of range.

    Example:
        >>> syda_gym.transferability("adult", "pepper").T  # doctest: +SKIP
    """
    if definition not in DEFINITIONS:
        raise OptionError(f"unknown definition {definition!r}; {nearest_name(str(definition), DEFINITIONS)}")
    if alpha is not None and not 0.0 < alpha <= 1.0:
        raise OptionError(f"alpha is sigma_min / sigma_pair and lies in (0, 1], got {alpha}")
    a, b = catalog.resolve(source), catalog.resolve(target)
    if definition == "paper":
        return _paper(a, b, alpha, store)
    return _general(a, b, 1.0 if alpha is None else alpha, Sampling(samples, cell, seed, repeats), store)


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
