"""Routing: which chain of fitted pairs to take from one body to another.

Bodies are nodes, fitted pairs are edges. By default every simple path of up to three links is rehearsed as a whole
(``dry_run``) and the one with the least expected error is taken. With a predictor of links the worth of a chain is the
product along it (Eq. 11 of the paper); as every factor lies in [0, 1], the best chain is then the shortest path on
-log T and Dijkstra's algorithm finds it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import OptionError, RouteError, nearest_name
from syda_gym.routes.judges import PREDICTORS, LinkPredictor, carried, make_judge
from syda_gym.routes.metric import Definition, Transferability
from syda_gym.routes.route import Route

__all__ = [
    "PREDICTORS",
    "BodyGraph",
    "Predictor",
    "best_route",
    "models_chained",
    "models_direct",
    "ranked_routes",
]

Body = str | os.PathLike[str] | Embodiment
Predictor = str | LinkPredictor
"""``dry_run``, a name of ``PREDICTORS``, or a function of a link with values in [0, 1]."""

_REHEARSED_HOPS = 3  # longest chain that is rehearsed unless the user says otherwise


class BodyGraph:
    """Bodies and fitted pairs as a directed graph; links are measured when they are first needed.

    Args:
        bodies: bodies that may stand alone, beside those of ``fitted``.
        fitted: pairs of bodies between which a mapping exists or will exist.
        definition: ``dry_run`` (the default), ``general`` or ``paper``.
        directed: a pair serves from first to second only; by default both ways, as SyDa models invert.
        predictor: what routes are ranked by: ``dry_run``, a name of ``PREDICTORS`` or a function of a link, whose
            values are multiplied; by default what the definition says, its T.
        alpha: noise coefficients of pairs, for example from ``noise.alpha_from_noise``; the definition's own where
            absent.
        options: options of ``transferability`` (seed, samples, ...).

    Raises:
        RouteError: a pair of a body with itself, or two different bodies of one name.
        OptionError: unknown predictor.
    """

    def __init__(
        self,
        bodies: Iterable[Body] = (),
        fitted: Iterable[tuple[Body, Body]] = (),
        definition: Definition | None = None,
        *,
        directed: bool = False,
        predictor: Predictor | None = None,
        alpha: Mapping[frozenset[str], float] | None = None,
        **options: Any,
    ) -> None:
        import networkx

        self.directed = directed
        self.bodies: dict[str, Embodiment] = {}
        self.judge = make_judge(self.bodies, definition, predictor, alpha, options)
        self.graph: Any = networkx.DiGraph()
        for body in bodies:
            self.add(body)
        for a, b in fitted:
            self.connect(a, b)

    def add(self, body: Body) -> str:
        """Adds a body and returns its name."""
        found = self.bodies[body] if isinstance(body, str) and body in self.bodies else catalog.resolve(body)
        known = self.bodies.setdefault(found.name, found)
        if known is not found and known != found:
            raise RouteError(f"two different bodies are called {found.name!r}; give one of them another name")
        self.graph.add_node(found.name)
        return found.name

    def connect(self, a: Body, b: Body) -> None:
        """Adds a fitted pair."""
        first, second = self.add(a), self.add(b)
        if first == second:
            raise RouteError(f"a pair needs two bodies, got {first!r} twice")
        for edge in ((first, second),) if self.directed else ((first, second), (second, first)):
            self.graph.add_edge(*edge)

    def link(self, a: str, b: str) -> Transferability:
        """Transferability from body ``a`` to body ``b``, measured once."""
        return self.judge.link(a, b)

    def score(self, a: str, b: str) -> float:
        """What a link is worth, in [0, 1].

        Raises:
            OptionError: a predictor of the user returned something else.
        """
        return self.judge.score(a, b)

    def route(self, names: Sequence[str]) -> Route:
        """The route along the given bodies."""
        return self.judge.route(names)

    def routes(self, source: Body, target: Body, max_hops: int | None = None) -> Iterator[Route]:
        """Routes from source to target, best first, without repeated bodies.

        Raises:
            RouteError: unknown body, no path, or none within ``max_hops``.
        """
        import networkx

        start, end = self._known(source), self._known(target)
        if start == end:
            raise RouteError(f"source and target are both {start!r}; a route needs two bodies")
        if max_hops is not None and max_hops < 1:
            raise OptionError(f"max_hops must be at least 1, got {max_hops}")
        if not networkx.has_path(self.graph, start, end):
            raise RouteError(self._no_path(start, end, max_hops))
        if self.judge.composed:
            return self._rehearsed(start, end, max_hops or _REHEARSED_HOPS)
        return self._multiplied(start, end, max_hops)

    def _rehearsed(self, start: str, end: str, max_hops: int) -> Iterator[Route]:
        """Every path within ``max_hops``, by expected error; those that cannot be judged come last."""
        import networkx

        found = [self.route(path) for path in networkx.all_simple_paths(self.graph, start, end, cutoff=max_hops)]
        if not found:
            raise RouteError(self._no_path(start, end, max_hops))
        return iter(sorted(found, key=lambda route: (-route.score, route.hops, route.bodies)))

    def _multiplied(self, start: str, end: str, max_hops: int | None) -> Iterator[Route]:
        import networkx

        weighted = networkx.DiGraph()
        weighted.add_nodes_from(self.graph.nodes)
        shared = frozenset(self.bodies[start].sides) & frozenset(self.bodies[end].sides)
        reachable = self._between(start, end, max_hops)
        for a, b in self.graph.edges:
            if a in reachable and b in reachable:
                value = self.score(a, b) * carried(self.bodies, (a, b), shared)
                if value > 0.0:
                    weighted.add_edge(a, b, weight=-math.log(value))
        if not networkx.has_path(weighted, start, end):
            raise RouteError(self._no_path(start, end, max_hops))
        if max_hops is None:  # Yen's algorithm, whose first path is Dijkstra's
            paths = networkx.shortest_simple_paths(weighted, start, end, weight="weight")
            return (self.route(path) for path in paths)
        within = networkx.all_simple_paths(weighted, start, end, cutoff=max_hops)
        # all_simple_paths knows no weights: sort, and prefer the shorter of equal ones.
        return iter(sorted((self.route(path) for path in within), key=lambda r: (-r.score, r.hops, r.bodies)))

    def _between(self, start: str, end: str, max_hops: int | None) -> set[str]:
        """Bodies that lie on a path short enough, so that no other link is measured."""
        import networkx

        ahead = networkx.single_source_shortest_path_length(self.graph, start)
        behind = networkx.single_source_shortest_path_length(self.graph.reverse(copy=False), end)
        limit = math.inf if max_hops is None else max_hops
        return {name for name in ahead if name in behind and ahead[name] + behind[name] <= limit}

    def _known(self, body: Body) -> str:
        name = body if isinstance(body, str) else catalog.resolve(body).name
        if name not in self.bodies:
            raise RouteError(f"no fitted pair holds {name!r}; {nearest_name(name, self.bodies)}. Fit one with it first")
        return name

    def _no_path(self, start: str, end: str, max_hops: int | None) -> str:
        import networkx

        reach = sorted(networkx.descendants(self.graph, start))
        within = "" if max_hops is None else f" within {max_hops} hops"
        return (
            f"no path{within} from {start!r} to {end!r}: from {start!r} the fitted pairs lead to "
            f"{', '.join(reach) or 'nowhere'}. Fit a pair that joins them; `suggest` says which is best"
        )


def best_route(
    source: Body,
    target: Body,
    fitted: Iterable[tuple[Body, Body]],
    definition: Definition | None = None,
    *,
    max_hops: int | None = None,
    directed: bool = False,
    predictor: Predictor | None = None,
    **options: Any,
) -> Route:
    """The route that is expected to do best, with the routes that tie with it.

    Args:
        source: the operator.
        target: the robot, or any body.
        fitted: pairs of bodies with a mapping; each serves both ways unless ``directed``.
        definition: ``dry_run`` (the default), ``general`` or ``paper``.
        max_hops: longest chain allowed; by default three links in the dry run, else any.
        directed: pairs serve from first to second only.
        predictor: what decides: ``dry_run``, a name of ``PREDICTORS`` or a function of a link with values in [0, 1].
        options: of ``transferability``; ``alpha`` maps pairs to noise coefficients here.

    Raises:
        RouteError: no such body, no path, or none within ``max_hops``.
        OptionError: unknown definition or predictor.

    Example:
        >>> best_route("adult", "pepper", fitted=[("adult", "kid"), ("kid", "pepper")]).bodies
        ('adult', 'kid', 'pepper')
    """
    graph = BodyGraph((), fitted, definition, directed=directed, predictor=predictor, **options)
    routes = graph.routes(source, target, max_hops)
    best = next(routes)
    if best.note:
        raise RouteError(f"no route from {best.bodies[0]!r} to {best.bodies[-1]!r} can be judged; {best.note}")
    ties = []
    for other in islice(routes, 100):
        if not graph.judge.tie(best, other):
            break
        ties.append(other)
    return replace(best, ties=tuple(ties))


def ranked_routes(
    source: Body,
    target: Body,
    fitted: Iterable[tuple[Body, Body]],
    definition: Definition | None = None,
    *,
    count: int = 10,
    max_hops: int | None = None,
    directed: bool = False,
    predictor: Predictor | None = None,
    **options: Any,
) -> list[Route]:
    """The ``count`` best routes, best first; arguments as ``best_route``."""
    graph = BodyGraph((), fitted, definition, directed=directed, predictor=predictor, **options)
    return list(islice(graph.routes(source, target, max_hops), count))


def models_direct(humans: int, robots: int) -> int:
    """Number of models if every human is mapped to every robot: n_h n_r (Eq. 5)."""
    _check_counts(humans, robots)
    return humans * robots


def models_chained(humans: int, robots: int) -> int:
    """Least number of models if chains connect all bodies: n_h + n_r - 1 (Eq. 6)."""
    _check_counts(humans, robots)
    return humans + robots - 1


def _check_counts(humans: int, robots: int) -> None:
    if humans < 1 or robots < 1:
        raise OptionError(f"need at least one human and one robot, got {humans} and {robots}")
