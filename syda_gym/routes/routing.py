"""Routes: which chain of fitted pairs to take from one body to another (Eq. 11 of the paper).

Bodies are nodes, fitted pairs are edges, and the transferability of a chain is the product along it. As every factor
lies in [0, 1], the best chain is the shortest path on -log T and Dijkstra's algorithm finds it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import OptionError, RouteError, nearest_name
from syda_gym.routes.metric import Definition, Transferability
from syda_gym.routes.metric import transferability as measure

__all__ = [
    "PREDICTORS",
    "BodyGraph",
    "Predictor",
    "Route",
    "best_route",
    "models_chained",
    "models_direct",
    "ranked_routes",
]

Body = str | os.PathLike[str] | Embodiment
Predictor = Callable[[Transferability], float]

PREDICTORS: dict[str, Predictor] = {
    "T": lambda link: link.T,
    "C": lambda link: link.C,
    "L": lambda link: link.L,
    "coverage": lambda link: link.coverage,
    "arm_length_ratio": lambda link: link.L,
    "hops": lambda link: math.exp(-1.0),
}
"""Scores in (0, 1] of one link; a route's score is the product. ``T`` is the paper's choice."""


@dataclass(frozen=True)
class Route:
    """A chain of bodies with its transferability.

    Attributes:
        bodies: names from source to target.
        T: product of the links' transferabilities (Eq. 11) times ``carried``.
        links: the transferability of each link.
        carried: share of the arms of both ends that every body on the way has; 0.5 if a one-armed body stands between
            two-armed ones, because C is a mean over arms and nothing of the other arm arrives.
        score: product of the predictor along the route; equals ``T`` for the predictor ``T``.
        tolerance: half-width of the band of ``score`` in which another route counts as equal.
        ties: other routes within the tolerance, best first (filled by ``best_route``).
    """

    bodies: tuple[str, ...]
    T: float
    links: tuple[Transferability, ...]
    score: float
    tolerance: float
    ties: tuple[Route, ...] = ()
    carried: float = 1.0

    @property
    def hops(self) -> int:
        """Number of links."""
        return len(self.links)

    def as_dict(self) -> dict[str, Any]:
        """Everything, JSON-able."""
        return {
            "bodies": list(self.bodies),
            "T": self.T,
            "score": self.score,
            "tolerance": self.tolerance,
            "hops": self.hops,
            "carried": self.carried,
            "links": [link.as_dict() for link in self.links],
            "ties": [list(route.bodies) for route in self.ties],
        }

    def __str__(self) -> str:
        return f"{' -> '.join(self.bodies)} (T = {self.T:.4f})"


class BodyGraph:
    """Bodies and fitted pairs as a directed graph; links are measured when they are first needed.

    Args:
        bodies: bodies that may stand alone, beside those of ``fitted``.
        fitted: pairs of bodies between which a mapping exists or will exist.
        definition: ``general`` or ``paper``.
        directed: a pair serves from first to second only; by default both ways, as SyDa models invert.
        predictor: what to multiply along a route: a name of ``PREDICTORS`` or a function of a link.
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
        definition: Definition = "general",
        *,
        directed: bool = False,
        predictor: str | Predictor = "T",
        alpha: Mapping[frozenset[str], float] | None = None,
        **options: Any,
    ) -> None:
        import networkx

        self.definition = definition
        self.directed = directed
        self._score = _predictor(predictor)
        self._options = options
        self._alpha = dict(alpha or {})
        self._measured: dict[tuple[str, str], Transferability] = {}
        self.bodies: dict[str, Embodiment] = {}
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
        if (a, b) not in self._measured:
            self._measured[a, b] = measure(
                self.bodies[a],
                self.bodies[b],
                self.definition,
                alpha=self._alpha.get(frozenset((a, b))),
                **self._options,
            )
        return self._measured[a, b]

    def score(self, a: str, b: str) -> float:
        """The predictor's value for a link, in [0, 1].

        Raises:
            OptionError: a predictor of the user returned something else.
        """
        value = float(self._score(self.link(a, b)))
        if not 0.0 <= value <= 1.0:
            raise OptionError(f"a predictor must return a score in [0, 1]; for {a} to {b} it returned {value}")
        return value

    def route(self, names: Sequence[str]) -> Route:
        """The route along the given bodies."""
        steps = list(zip(names[:-1], names[1:], strict=True))
        links = tuple(self.link(a, b) for a, b in steps)
        shared = self._shared_arms(names[0], names[-1])
        carried = math.prod(self._carried(a, b, shared) for a, b in steps)
        score = carried * math.prod(self.score(a, b) for a, b in steps)
        relative = math.sqrt(sum((link.tolerance / link.T) ** 2 for link in links if link.T > 0.0))
        product = carried * math.prod(link.T for link in links)
        return Route(tuple(names), product, links, score, relative * score, carried=carried)

    def _shared_arms(self, start: str, end: str) -> frozenset[str]:
        return frozenset(self.bodies[start].sides) & frozenset(self.bodies[end].sides)

    def _carried(self, a: str, b: str, shared: frozenset[str]) -> float:
        """Share of the arms in question that get from ``a`` to ``b``."""
        before = shared & frozenset(self.bodies[a].sides)
        return len(before & frozenset(self.bodies[b].sides)) / len(before) if before else 1.0

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
        weighted = networkx.DiGraph()
        weighted.add_nodes_from(self.graph.nodes)
        shared = self._shared_arms(start, end)
        reachable = self._between(start, end, max_hops)
        for a, b in self.graph.edges:
            if a in reachable and b in reachable:
                value = self.score(a, b) * self._carried(a, b, shared)
                if value > 0.0:
                    weighted.add_edge(a, b, weight=-math.log(value))
        if not networkx.has_path(weighted, start, end):
            raise RouteError(self._no_path(start, end, max_hops))
        return self._simple_paths(weighted, start, end, max_hops)

    def _simple_paths(self, weighted: Any, start: str, end: str, max_hops: int | None) -> Iterator[Route]:
        import networkx

        if max_hops is None:  # Yen's algorithm, whose first path is Dijkstra's
            for path in networkx.shortest_simple_paths(weighted, start, end, weight="weight"):
                yield self.route(path)
            return
        paths = networkx.all_simple_paths(weighted, start, end, cutoff=max_hops)
        # all_simple_paths knows no weights: sort, and prefer the shorter of equal ones.
        yield from sorted((self.route(path) for path in paths), key=lambda r: (-r.score, r.hops, r.bodies))

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
    definition: Definition = "general",
    *,
    max_hops: int | None = None,
    directed: bool = False,
    predictor: str | Predictor = "T",
    **options: Any,
) -> Route:
    """The route that transferability ranks best (Eq. 11), with the routes that tie with it.

    Args:
        source: the operator.
        target: the robot, or any body.
        fitted: pairs of bodies with a mapping; each serves both ways unless ``directed``.
        definition: ``general`` or ``paper``.
        max_hops: longest chain allowed; ``None`` for any.
        directed: pairs serve from first to second only.
        predictor: what decides: a name of ``PREDICTORS`` or a function of a link with values in [0, 1].
        options: ``alpha`` (noise coefficients of pairs) and options of ``transferability``.

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
    ties = []
    for other in islice(routes, 100):
        if best.score - other.score > max(best.tolerance, other.tolerance):
            break
        ties.append(other)
    return replace(best, ties=tuple(ties))


def ranked_routes(
    source: Body,
    target: Body,
    fitted: Iterable[tuple[Body, Body]],
    definition: Definition = "general",
    *,
    count: int = 10,
    max_hops: int | None = None,
    directed: bool = False,
    predictor: str | Predictor = "T",
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


def _predictor(predictor: str | Predictor) -> Predictor:
    if not isinstance(predictor, str):
        return predictor
    if predictor not in PREDICTORS:
        raise OptionError(f"unknown predictor {predictor!r}; {nearest_name(predictor, PREDICTORS)}")
    return PREDICTORS[predictor]
