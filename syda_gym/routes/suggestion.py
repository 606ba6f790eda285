"""What to record next: the pair that helps most, and the smallest set of pairs that connects all bodies."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError, RouteError
from syda_gym.routes.metric import Definition
from syda_gym.routes.routing import Body, BodyGraph, Predictor

__all__ = ["SpanningPairs", "Suggestion", "best_scores", "spanning_pairs", "suggest"]

Pair = tuple[str, str]

_REHEARSED_HOPS = 2  # longer chains lose more than a further pair costs, and their number explodes


@dataclass(frozen=True)
class Suggestion:
    """A pair to record next.

    Attributes:
        pair: the two bodies.
        total: sum of best-route scores over all demands with the pair added.
        gain: how much the sum rises.
        connects: demands that had no route before.
    """

    pair: Pair
    total: float
    gain: float
    connects: tuple[Pair, ...]


@dataclass(frozen=True)
class SpanningPairs:
    """The least number of pairs that connects all bodies (Eq. 6 counts them: bodies minus one).

    Attributes:
        pairs: those to record, beside what is fitted already.
        total: sum of best-route scores over all demands with them.
        exact: whether every tree was tried; otherwise exchanging any one pair does not help.
    """

    pairs: tuple[Pair, ...]
    total: float
    exact: bool


def suggest(
    bodies: Sequence[Body],
    fitted: Iterable[tuple[Body, Body]] = (),
    definition: Definition | None = None,
    *,
    demands: Sequence[tuple[str, str]] | None = None,
    directed: bool = False,
    predictor: Predictor | None = None,
    max_hops: int | None = None,
    **options: Any,
) -> list[Suggestion]:
    """Ranks the pairs that could be recorded next by how much the sum of best-route transferabilities rises.

    In the dry run a route counts by the T of the whole of it, as rehearsed, and routes have at most ``max_hops`` links,
    two by default.

    Args:
        bodies: all bodies of the lab.
        fitted: pairs that have a mapping.
        definition: ``dry_run`` (the default), ``general`` or ``paper``.
        demands: ordered pairs (source, target) that matter; all by default.
        directed: a pair serves from first to second only; then both orders are tried.
        predictor: ``dry_run``, a name of ``routing.PREDICTORS`` or a function of a link.
        max_hops: longest chain that counts as a route.
        options: options of ``transferability``.

    Returns:
        All unfitted pairs, best first; empty if every pair is fitted.

    Raises:
        OptionError: fewer than two bodies, or a demand for an unknown body.
    """
    graph = BodyGraph(bodies, fitted, definition, directed=directed, predictor=predictor, **options)
    names, wanted = _names_and_demands(graph, demands)
    best = _best_of(graph, names, max_hops)
    fitted_mask = _fitted_mask(graph, names)
    before = best(fitted_mask)
    base = float(before[wanted].sum())
    result = []
    for i, j in _candidates(len(names), directed):
        if fitted_mask[i, j]:
            continue
        mask = fitted_mask.copy()
        mask[i, j] = True
        mask[j, i] |= not directed
        after = best(mask)
        total = float(after[wanted].sum())
        new = np.argwhere(wanted & (before == 0.0) & (after > 0.0))
        connects = tuple((names[a], names[b]) for a, b in new)
        result.append(Suggestion((names[i], names[j]), total, total - base, connects))
    return sorted(result, key=lambda s: (-s.gain, s.pair))


def spanning_pairs(
    bodies: Sequence[Body],
    fitted: Iterable[tuple[Body, Body]] = (),
    definition: Definition | None = None,
    *,
    demands: Sequence[tuple[str, str]] | None = None,
    predictor: Predictor | None = None,
    exhaustive: int = 20_000,
    **options: Any,
) -> SpanningPairs:
    """The smallest set of further pairs that connects all bodies, with the best sum over all demands.

    Finding it is the optimum communication spanning tree problem, which is NP-hard; small cases are searched in full,
    larger ones start from the best tree by single pairs and exchange one pair at a time while that helps.

    Args:
        bodies: all bodies of the lab.
        fitted: pairs that have a mapping; kept.
        definition: ``dry_run`` (the default), ``general`` or ``paper``.
        demands: ordered pairs that matter; all by default.
        predictor: ``dry_run``, a name of ``routing.PREDICTORS`` or a function of a link.
        exhaustive: how many sets may be tried before the exchange search is taken instead.
        options: options of ``transferability``.

    Raises:
        OptionError: fewer than two bodies, or a demand for an unknown body.
    """
    graph = BodyGraph(bodies, fitted, definition, predictor=predictor, **options)
    names, wanted = _names_and_demands(graph, demands)
    scores = _best_of(graph, names, None)
    links = scores(~np.eye(len(names), dtype=bool), direct=True)
    mask = _fitted_mask(graph, names)
    missing = len(_components(mask)) - 1
    free = [(i, j) for i, j in _candidates(len(names), directed=False) if not mask[i, j]]

    def total(chosen: Iterable[tuple[int, int]]) -> float:
        joined = mask.copy()
        for i, j in chosen:
            joined[i, j] = joined[j, i] = True
        return float(scores(joined)[wanted].sum())

    exact = math.comb(len(free), missing) <= exhaustive
    if exact:
        spanning = (c for c in combinations(free, missing) if _connects(mask, c))
        best = list(max(spanning, key=total))
    else:
        best = _exchange(mask, free, _greedy_tree(mask, links, free), total)
    return SpanningPairs(tuple((names[i], names[j]) for i, j in best), total(best), exact)


def best_scores(links: FloatArray, max_hops: int | None = None) -> FloatArray:
    """Best product along any route between all bodies.

    Args:
        links: ``(n, n)`` scores in [0, 1], 0 where there is no link.
        max_hops: longest route allowed.

    Returns:
        ``(n, n)``, 0 where there is no route, 1 on the diagonal.
    """
    best: FloatArray = np.array(links, dtype=np.float64)
    np.fill_diagonal(best, 1.0)
    if max_hops is None:  # Floyd and Warshall in the (max, product) semiring
        for k in range(len(best)):
            np.maximum(best, best[:, k : k + 1] * best[k : k + 1], out=best)
        return best
    step = best.copy()
    for _ in range(max_hops - 1):
        best = np.max(best[:, :, None] * step[None], axis=1)
    return best


def _names_and_demands(
    graph: BodyGraph, demands: Sequence[tuple[str, str]] | None
) -> tuple[list[str], NDArray[np.bool_]]:
    names = list(graph.bodies)
    if len(names) < 2:
        raise OptionError(f"need at least two bodies to suggest a pair, got {names}")
    wanted = np.zeros((len(names), len(names)), dtype=bool)
    if demands is None:
        wanted[:] = ~np.eye(len(names), dtype=bool)
    for a, b in demands or ():
        for name in (a, b):
            if name not in names:
                raise RouteError(f"demand {a!r} to {b!r}: {name!r} is none of the bodies {', '.join(names)}")
        wanted[names.index(a), names.index(b)] = True
    return names, wanted


class _Products:
    """Best product of link scores between all bodies, for any set of pairs."""

    def __init__(self, graph: BodyGraph, names: list[str], max_hops: int | None) -> None:
        self._links = np.array([[0.0 if a == b else graph.score(a, b) for b in names] for a in names])
        self._max_hops = max_hops

    def __call__(self, mask: NDArray[np.bool_], *, direct: bool = False) -> FloatArray:
        """``(n, n)``, 0 where no route leads."""
        links: FloatArray = np.where(mask, self._links, 0.0)
        return links if direct else best_scores(links, self._max_hops)


class _Rehearsed:
    """T of the route with the least expected error between all bodies, for any set of pairs."""

    def __init__(self, graph: BodyGraph, names: list[str], max_hops: int | None) -> None:
        self._count = len(names)
        places = range(len(names))
        hops = max_hops or _REHEARSED_HOPS
        self._tables = []
        for length in range(2, min(hops + 1, len(names)) + 1):
            routes = np.array(list(permutations(places, length)))
            judged = [graph.route([names[place] for place in route]) for route in routes]
            error = np.array([-route.score for route in judged])
            value = np.array([0.0 if route.note else route.T for route in judged])
            self._tables.append((routes, error, value))

    def __call__(self, mask: NDArray[np.bool_], *, direct: bool = False) -> FloatArray:
        """``(n, n)``, 0 where no route leads."""
        error = np.full((self._count, self._count), np.inf)
        best = np.zeros((self._count, self._count))
        for routes, errors, values in self._tables[:1] if direct else self._tables:
            steps = [mask[routes[:, k], routes[:, k + 1]] for k in range(routes.shape[1] - 1)]
            rows = np.flatnonzero(np.logical_and.reduce(steps))
            rows = rows[np.argsort(-errors[rows], kind="stable")]  # the least error is written last
            ends = routes[rows, 0], routes[rows, -1]
            least, value = np.full_like(error, np.inf), np.zeros_like(best)
            least[ends], value[ends] = errors[rows], values[rows]
            better = least < error
            error, best = np.where(better, least, error), np.where(better, value, best)
        np.fill_diagonal(best, 0.0 if direct else 1.0)
        return best


def _best_of(graph: BodyGraph, names: list[str], max_hops: int | None) -> _Products | _Rehearsed:
    return (_Rehearsed if graph.judge.composed else _Products)(graph, names, max_hops)


def _fitted_mask(graph: BodyGraph, names: list[str]) -> NDArray[np.bool_]:
    return np.array([[bool(graph.graph.has_edge(a, b)) for b in names] for a in names])


def _candidates(count: int, directed: bool) -> list[tuple[int, int]]:
    return [(i, j) for i in range(count) for j in range(count) if (i < j or (directed and i != j))]


def _components(mask: NDArray[np.bool_]) -> list[set[int]]:
    left, found = set(range(len(mask))), []
    while left:
        group, new = set(), {min(left)}
        while new:
            group |= new
            new = {int(j) for i in new for j in np.flatnonzero(mask[i] | mask[:, i])} - group
        found.append(group)
        left -= group
    return found


def _connects(mask: NDArray[np.bool_], pairs: Iterable[tuple[int, int]]) -> bool:
    joined = mask.copy()
    for i, j in pairs:
        joined[i, j] = True
    return len(_components(joined)) == 1


def _greedy_tree(mask: NDArray[np.bool_], links: FloatArray, free: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Kruskal's maximum spanning tree on the product of both directions."""
    chosen: list[tuple[int, int]] = []
    joined = mask.copy()
    for i, j in sorted(free, key=lambda pair: -links[pair] * links[pair[::-1]]):
        group = next(g for g in _components(joined) if i in g)
        if j not in group:
            chosen.append((i, j))
            joined[i, j] = True
    return chosen


def _exchange(
    mask: NDArray[np.bool_],
    free: list[tuple[int, int]],
    chosen: list[tuple[int, int]],
    total: Callable[[Iterable[tuple[int, int]]], float],
) -> list[tuple[int, int]]:
    """Replaces one pair by another while the total rises."""
    best, value = chosen, total(chosen)
    improved = True
    while improved:
        improved = False
        for index in range(len(best)):
            for other in free:
                trial = [*best[:index], other, *best[index + 1 :]]
                if other not in best and _connects(mask, trial) and (new := total(trial)) > value + 1e-12:
                    best, value, improved = trial, new, True
    return best
