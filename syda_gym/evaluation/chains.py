"""Chains to compare: which routes there are, which actions are held out, and the fitted links behind them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError, OptionError, RouteError, nearest_name
from syda_gym.motions.clip import Motions, PairedMotions
from syda_gym.motions.loading import resampled

if TYPE_CHECKING:
    from syda_gym.mappings.mapping import Mapping

__all__ = ["FIT_FPS", "Links", "action_groups", "all_routes", "check_route", "name_of", "robots_of", "thinned"]

Route = tuple[str, ...]
Progress = Callable[[float], None]

FIT_FPS = 10.0
"""Mappings are fitted on frames at most this dense: neighbours at 30 Hz are near-duplicates."""


def name_of(route: Sequence[str]) -> str:
    """``adult>kid>pepper``."""
    return ">".join(route)


def thinned(motions: Motions) -> Motions:
    """The motions at no more than ``FIT_FPS`` frames per second."""
    return resampled(motions, FIT_FPS) if any(take.fps > FIT_FPS for take in motions.takes) else motions


def all_routes(
    motions: Motions,
    operators: Sequence[str],
    robots: Sequence[str],
    max_hops: int,
    via: Sequence[str] | None = None,
) -> list[Route]:
    """Every route from an operator to a robot along recorded pairs, shortest first.

    Args:
        motions: their pairs are the edges; the two ends must share recordings, for otherwise nothing can be scored.
        operators: where routes begin.
        robots: where they end.
        max_hops: most links of a route, at least 1.
        via: bodies that a route may pass; all by default.

    Raises:
        RouteError: a body is unknown, or there is no route at all.
        OptionError: ``max_hops`` is below 1.
    """
    if max_hops < 1:
        raise OptionError(f"max_hops must be at least 1, got {max_hops}")
    for name in (*operators, *robots, *(via or ())):
        if name not in motions.bodies:
            raise RouteError(f"{motions.name} has no body {name!r}; {nearest_name(name, motions.bodies)}")
    edges = {edge for a, b in motions.pairs for edge in ((a, b), (b, a))}
    between = [name for name in motions.bodies if via is None or name in via]
    routes: list[Route] = []
    for operator in operators:
        for robot in robots:
            if operator == robot or (operator, robot) not in edges:
                continue
            partial: list[Route] = [(operator,)]
            for _ in range(max_hops):
                routes += [(*path, robot) for path in partial if (path[-1], robot) in edges]
                partial = [
                    (*path, name)
                    for path in partial
                    for name in between
                    if name not in path and name != robot and (path[-1], name) in edges
                ]
    if not routes:
        raise RouteError(
            f"{motions.name} has no route from {', '.join(operators)} to {', '.join(robots)} within {max_hops} hops; "
            "their ends must have been recorded together"
        )
    return sorted(dict.fromkeys(routes), key=lambda route: (operators.index(route[0]), len(route)))


def check_route(motions: Motions, route: Sequence[str]) -> Route:
    """A route that somebody wrote, checked link by link.

    Raises:
        RouteError: fewer than two bodies, a body twice, an unknown body, or a link that was never recorded.
    """
    bodies = tuple(route)
    if len(bodies) < 2 or len(set(bodies)) != len(bodies):
        raise RouteError(f"a route names two or more different bodies, got {name_of(bodies)!r}")
    for name in bodies:
        if name not in motions.bodies:
            raise RouteError(f"{motions.name} has no body {name!r}; {nearest_name(name, motions.bodies)}")
    edges = {edge for a, b in motions.pairs for edge in ((a, b), (b, a))}
    for link in [*zip(bodies[:-1], bodies[1:], strict=True), (bodies[0], bodies[-1])]:
        if link not in edges:
            pairs = ", ".join(f"{a}-{b}" for a, b in motions.pairs)
            raise RouteError(
                f"route {name_of(bodies)}: {link[0]!r} and {link[1]!r} were never recorded together; pairs: {pairs}"
            )
    return bodies


def action_groups(names: Sequence[str], groups: int | str = "loao", seed: int = 0) -> list[tuple[str, ...]]:
    """Actions that are held out together: every action is in exactly one group.

    Args:
        names: the actions.
        groups: ``"loao"`` for one action a group, or the number of groups of about equal size.
        seed: of the split into groups.

    Raises:
        OptionError: fewer than two groups, or more than there are actions.
    """
    names = sorted(set(names))
    if groups == "loao":
        count = len(names)
    elif isinstance(groups, int) and not isinstance(groups, bool):
        count = groups
    else:
        raise OptionError(f"folds must be 'loao' or a number of groups, got {groups!r}")
    if not 2 <= count <= len(names):
        raise OptionError(f"{len(names)} actions cannot be held out in {count} groups; give 2 to {len(names)}")
    if count == len(names):
        return [(name,) for name in names]
    order = np.random.default_rng(seed).permutation(len(names))
    return [tuple(sorted(names[i] for i in order[part::count])) for part in range(count)]


class Links:
    """Fitted mappings between recorded pairs, one a pair and set of held-out actions, fitted when first needed.

    All held-out sets of a pair that are announced together are fitted in one batch, which is several times faster, and
    always in the same batch, so that the numbers do not depend on what was asked for first.

    Args:
        motions: what to learn from; thinned to ``FIT_FPS``.
        method: of ``mappings.fitting.METHODS``.
        preset: of the method; its default if ``None``.
        seed: of the fits.
        groups: the sets of actions that will be held out.
        **options: of the preset.
    """

    def __init__(
        self,
        motions: Motions,
        method: str = "syda",
        preset: str | None = None,
        seed: int = 0,
        *,
        groups: Sequence[tuple[str, ...]] = (),
        **options: Any,
    ) -> None:
        self.motions = thinned(motions)
        self.method, self.preset, self.seed = method, preset, seed
        self.groups = [tuple(sorted(group)) for group in groups]
        self._options = options
        self._pairs: dict[tuple[str, str], PairedMotions] = {}
        self._fitted: dict[tuple[str, str], dict[tuple[str, ...], Mapping]] = {}

    def pair(self, source: str, target: str) -> PairedMotions:
        """The paired frames of a link, thinned."""
        if (source, target) not in self._pairs:
            self._pairs[source, target] = self.motions.pair(source, target)
        return self._pairs[source, target]

    def link(self, source: str, target: str, held_out: Sequence[str] = (), progress: Progress | None = None) -> Mapping:
        """The mapping from ``source`` to ``target`` that has not seen the held-out actions."""
        group = self._seen(source, target, tuple(sorted(held_out)))
        fitted = self._fitted.setdefault((source, target), {})
        if group not in fitted:
            announced = [self._seen(source, target, one) for one in self.groups]
            wanted = list(dict.fromkeys(announced)) if group in announced else [group]
            fitted.update(zip(wanted, self._fit(source, target, wanted, progress), strict=True))
        return fitted[group]

    def chain(self, route: Sequence[str], held_out: Sequence[str] = (), progress: Progress | None = None) -> Mapping:
        """The mapping along a route whose links have not seen the held-out actions."""
        from syda_gym.mappings.chain import ChainMapping

        edges = list(zip(route[:-1], route[1:], strict=True))
        links = []
        for place, (a, b) in enumerate(edges):
            links.append(self.link(a, b, held_out, _part(progress, place, len(edges))))
        return links[0] if len(links) == 1 else ChainMapping(links)

    def count(self) -> int:
        """How many models have been fitted."""
        return sum(len(models) for models in self._fitted.values())

    def _seen(self, source: str, target: str, group: tuple[str, ...]) -> tuple[str, ...]:
        """Only the actions that this pair has: a link without them needs no model of its own."""
        names = set(self.pair(source, target).action_names)
        return tuple(name for name in group if name in names)

    def _fit(self, source: str, target: str, groups: list[tuple[str, ...]], progress: Progress | None) -> list[Mapping]:
        from syda_gym.mappings.fitting.fit import fit_many

        pair = self.pair(source, target)
        for group in groups:
            if set(group) >= set(pair.action_names):
                raise MappingError(f"{pair!r}: every action is held out, nothing is left to fit on")
        training = [pair.without_actions(group) if group else pair for group in groups]
        return list(
            fit_many(
                training, self.method, self.preset, [self.seed] * len(training), progress=progress, **self._options
            )
        )


def _part(progress: Progress | None, place: int, count: int) -> Progress | None:
    """The progress of one of several equal parts."""
    return None if progress is None else lambda fraction: progress((place + fraction) / count)


def robots_of(motions: Motions) -> list[str]:
    """Names of the robots among the bodies."""
    return [name for name, body in motions.bodies.items() if isinstance(body, Robot)]
