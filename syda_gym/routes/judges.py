"""Judges: what a route is worth. One rehearses it as a whole, the other multiplies what its links are worth."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import EmbodimentError, OptionError, RouteError, nearest_name
from syda_gym.routes.dry_run.rehearsal import Rehearsal
from syda_gym.routes.metric import OPTIONS, Definition, Transferability, rehearsal, rehearsed
from syda_gym.routes.metric import transferability as measure
from syda_gym.routes.route import Route

__all__ = ["PREDICTORS", "Judge", "LinkPredictor", "ProductJudge", "RehearsalJudge", "carried", "make_judge"]

LinkPredictor = Callable[[Transferability], float]

PREDICTORS: dict[str, LinkPredictor] = {
    "T": lambda link: link.T,
    "C": lambda link: link.C,
    "L": lambda link: link.L,
    "coverage": lambda link: link.coverage,
    "arm_length_ratio": lambda link: link.L,
    "hops": lambda link: math.exp(-1.0),
}
"""Scores in (0, 1] of one link; a route's score is the product. ``T`` is the paper's choice."""

REHEARSED = "dry_run"
"""The predictor that scores routes as a whole, and the default."""


class Judge(Protocol):
    """Says what routes among some bodies are worth.

    Attributes:
        bodies: name to body; may grow.
        composed: whether a route is judged as a whole; otherwise its score is the product of its links' scores.
    """

    bodies: dict[str, Embodiment]
    composed: bool

    def link(self, a: str, b: str) -> Transferability:
        """Transferability of one link."""

    def score(self, a: str, b: str) -> float:
        """What one link is worth, in [0, 1]."""

    def route(self, names: Sequence[str]) -> Route:
        """A route with its score."""

    def tie(self, best: Route, other: Route) -> bool:
        """Whether two routes cannot be told apart."""


def make_judge(
    bodies: dict[str, Embodiment],
    definition: Definition | None,
    predictor: str | LinkPredictor | None,
    alpha: Mapping[frozenset[str], float] | None,
    options: Mapping[str, Any],
) -> Judge:
    """The judge that a definition and a predictor ask for.

    Without either, routes are rehearsed. A definition alone is ranked by its T, a predictor alone takes its terms from
    the ``general`` definition.

    Raises:
        OptionError: unknown predictor, or options of another definition.
    """
    if predictor is None:
        predictor = REHEARSED if definition in (None, REHEARSED) else "T"
    if isinstance(predictor, str) and predictor not in (*PREDICTORS, REHEARSED):
        known = [REHEARSED, *PREDICTORS]
        raise OptionError(f"unknown predictor {predictor!r}; {nearest_name(predictor, known)}")
    if predictor == REHEARSED:
        if definition not in (None, REHEARSED):
            raise OptionError(f"the predictor 'dry_run' has its own definition; drop definition={definition!r}")
        if alpha:
            raise OptionError("the dry run takes noise as sensor= in metres, alpha= belongs to 'general' and 'paper'")
        for name in options:
            if name not in (*OPTIONS[REHEARSED], "seed"):
                raise OptionError(f"the dry run takes no {name!r}; {nearest_name(name, OPTIONS[REHEARSED])}")
        return RehearsalJudge(bodies, options)
    chosen = PREDICTORS[predictor] if isinstance(predictor, str) else predictor
    return ProductJudge(bodies, definition or "general", chosen, alpha or {}, options)


class RehearsalJudge:
    """Rehearses every route as a whole and ranks by the expected error.

    Args:
        bodies: name to body; may grow until the first route is judged.
        options: of ``metric.rehearsal``.
    """

    composed = True

    def __init__(self, bodies: dict[str, Embodiment], options: Mapping[str, Any]) -> None:
        self.bodies = bodies
        self._options = dict(options)
        self._together: Rehearsal | None = None
        self._links: dict[tuple[str, str], Transferability] = {}

    def link(self, a: str, b: str) -> Transferability:
        """Transferability of one link in the dry run."""
        if (a, b) not in self._links:
            self._links[a, b] = rehearsed(self._rehearsal(), a, b)
        return self._links[a, b]

    def score(self, a: str, b: str) -> float:
        """T of one link."""
        return self.link(a, b).T

    def route(self, names: Sequence[str]) -> Route:
        """A route with its expected error; one that cannot be judged says why and scores minus infinity."""
        bodies = tuple(names)
        try:
            score = self._rehearsal().score(bodies)
            links = tuple(self.link(a, b) for a, b in zip(bodies[:-1], bodies[1:], strict=True))
        except (EmbodimentError, RouteError) as error:
            return Route(bodies, math.nan, (), -math.inf, 0.0, note=f"cannot be judged: {error}")
        return Route(
            bodies,
            score.T,
            links,
            -score.relative,
            score.relative * score.standard_error / score.error,
            carried=carried(self.bodies, bodies),
            error=score.error,
            standard_error=score.standard_error,
        )

    def tie(self, best: Route, other: Route) -> bool:
        """Whether the margin between two routes lies below its standard error over actions."""
        if best.error is None or other.error is None:
            return False
        margin, noise = self._rehearsal().margin(best.bodies, other.bodies)
        return margin <= noise

    def _rehearsal(self) -> Rehearsal:
        if self._together is None or set(self._together.bodies) != set(self.bodies):
            self._together = rehearsal(self.bodies, **self._options)
            self._links.clear()
        return self._together


class ProductJudge:
    """Multiplies a predictor along the route (Eq. 11).

    Args:
        bodies: name to body; may grow.
        definition: of the links' transferability.
        predictor: of a link, in [0, 1].
        alpha: noise coefficients of pairs; the definition's own where absent.
        options: of ``transferability``.
    """

    composed = False

    def __init__(
        self,
        bodies: dict[str, Embodiment],
        definition: Definition,
        predictor: LinkPredictor,
        alpha: Mapping[frozenset[str], float],
        options: Mapping[str, Any],
    ) -> None:
        self.bodies = bodies
        self._definition = definition
        self._predictor = predictor
        self._alpha = dict(alpha)
        self._options = dict(options)
        self._links: dict[tuple[str, str], Transferability] = {}

    def link(self, a: str, b: str) -> Transferability:
        """Transferability of one link, measured once."""
        if (a, b) not in self._links:
            own = self._alpha.get(frozenset((a, b)))
            noise: dict[str, Any] = {} if own is None else {"alpha": own}
            self._links[a, b] = measure(self.bodies[a], self.bodies[b], self._definition, **noise, **self._options)
        return self._links[a, b]

    def score(self, a: str, b: str) -> float:
        """The predictor's value for a link.

        Raises:
            OptionError: a predictor of the user returned something outside [0, 1].
        """
        value = float(self._predictor(self.link(a, b)))
        if not 0.0 <= value <= 1.0:
            raise OptionError(f"a predictor must return a score in [0, 1]; for {a} to {b} it returned {value}")
        return value

    def route(self, names: Sequence[str]) -> Route:
        """The route along the given bodies."""
        steps = list(zip(names[:-1], names[1:], strict=True))
        links = tuple(self.link(a, b) for a, b in steps)
        share = carried(self.bodies, names)
        score = share * math.prod(self.score(a, b) for a, b in steps)
        relative = math.sqrt(sum((link.tolerance / link.T) ** 2 for link in links if link.T > 0.0))
        product = share * math.prod(link.T for link in links)
        return Route(tuple(names), product, links, score, relative * score, carried=share)

    def tie(self, best: Route, other: Route) -> bool:
        """Whether the scores lie within sampling noise of each other."""
        return best.score - other.score <= max(best.tolerance, other.tolerance)


def carried(bodies: Mapping[str, Embodiment], names: Sequence[str], shared: frozenset[str] | None = None) -> float:
    """Share of the arms in question that every body on the way has.

    Args:
        bodies: name to body.
        names: the way.
        shared: sides in question; by default those that both ends have.
    """
    asked = frozenset(bodies[names[0]].sides) & frozenset(bodies[names[-1]].sides) if shared is None else shared
    share = 1.0
    for a, b in zip(names[:-1], names[1:], strict=True):
        before = asked & frozenset(bodies[a].sides)
        share *= len(before & frozenset(bodies[b].sides)) / len(before) if before else 1.0
    return share
