"""Pilot: operator frames to base commands along a route, whatever ``mapping=`` and ``route=`` say."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import MappingError, OptionError, RouteError, StorageError, SydaError, nearest_name
from syda_gym.files import asset, read_json
from syda_gym.motions.clip import Motions

if TYPE_CHECKING:
    from syda_gym.mappings.mapping import Mapping
    from syda_gym.routes.routing import Route

__all__ = ["FIT_FPS", "Pilot", "PlannedRoute"]

FIT_FPS = 10.0
"""Mappings are fitted on frames at most this dense; neighbours at 30 Hz are near-duplicates."""

_MAX_HOPS = 2
_PAPER_BODIES = ("adult", "kid", "pepper")


@dataclass(frozen=True)
class PlannedRoute:
    """A route and how much transferability trusts it.

    Attributes:
        bodies: names from the operator to the robot.
        transferability: product along the route (Eq. 11), NaN where the metric knows a body not.
    """

    bodies: tuple[str, ...]
    transferability: float

    @property
    def name(self) -> str:
        """``adult>kid>pepper``."""
        return ">".join(self.bodies)


class Pilot:
    """Finds or fits the mappings of a route and chains them.

    Args:
        motions: the data set.
        operator: who leads.
        robot: who follows.
        mapping: a method of ``mappings.METHODS`` (shipped mappings are used where they were fitted to the same frames,
            otherwise one is fitted), a ``Mapping`` from operator to robot, or a folder of stored mappings.
        preset: of the method.
        held_out: actions that no fit may see.
        via: bodies that a route may pass; by default those of the paper that the motions hold.
        seed: of fits.

    Raises:
        OptionError: unknown method, a folder without mappings, held-out actions that do not exist.
        MappingError: a mapping between other bodies.
    """

    def __init__(
        self,
        motions: Motions,
        operator: str,
        robot: str,
        *,
        mapping: str | os.PathLike[str] | Mapping = "syda",
        preset: str | None = None,
        held_out: Sequence[str] = (),
        via: Sequence[str] | None = None,
        seed: int = 0,
    ) -> None:
        from syda_gym.mappings.mapping import Mapping

        self.motions, self.operator, self.robot = motions, operator, robot
        self.preset, self.held_out, self.seed = preset, tuple(sorted(held_out)), seed
        self._given: Mapping | None = None
        self._stored: dict[tuple[str, str], Mapping] = {}
        self._method = ""
        for body in via or ():
            if body not in motions.bodies:
                raise OptionError(f"via: {motions.name} has no body {body!r}; {nearest_name(body, motions.bodies)}")
        self._check_held_out()
        if isinstance(mapping, Mapping):
            self._take(mapping)
        elif isinstance(mapping, str | os.PathLike) and Path(mapping).is_dir():
            self._stored = _read_folder(Path(mapping))
        else:
            self._method = _method(mapping)
        default = tuple(body for body in _PAPER_BODIES if body in motions.bodies)
        self._via = tuple(dict.fromkeys((operator, *(default if via is None else via), robot)))

    @property
    def fitted(self) -> tuple[tuple[str, str], ...]:
        """Pairs with a mapping, or with frames from which one can be fitted, in the directions that work."""
        if self._given is not None:
            return ((self._given.source.name, self._given.target.name),)
        if self._stored:
            return tuple(self._stored)
        found = [pair for pair in self.motions.pairs if set(pair) <= set(self._via)]
        return tuple([*found, *((b, a) for a, b in found)])

    def plan(self, route: str | Sequence[str]) -> tuple[PlannedRoute, ...]:
        """The routes that an environment may take.

        Args:
            route: ``"auto"`` for the best one, ``"sample"`` for all (to draw from in proportion to transferability), or
                the names of the bodies.

        Raises:
            RouteError: unknown bodies, a missing link, or ends that are not operator and robot.
        """
        if self._given is not None:
            bodies = self._given.route
            if not isinstance(route, str) and tuple(route) != bodies:
                raise RouteError(f"the given mapping takes the route {bodies}; drop route={tuple(route)}")
            return (self._planned(bodies),)
        if not isinstance(route, str):
            return (self._planned(self._explicit(route)),)
        if route not in ("auto", "sample"):
            raise RouteError(f"route must be 'auto', 'sample' or names of bodies, got {route!r}")
        routes = self._ranked()
        return tuple(PlannedRoute(r.bodies, float(r.T)) for r in (routes if route == "sample" else routes[:1]))

    def mapping(self, bodies: Sequence[str]) -> Mapping:
        """The chain along ``bodies``; links are loaded or fitted on first use."""
        from syda_gym.mappings.chain import ChainMapping

        if self._given is not None:
            return self._given
        links = [self._link(a, b) for a, b in zip(bodies[:-1], bodies[1:], strict=True)]
        return links[0] if len(links) == 1 else ChainMapping(links)

    def _take(self, mapping: Mapping) -> None:
        ends = (mapping.source.name, mapping.target.name)
        if ends != (self.operator, self.robot):
            raise MappingError(
                f"the mapping goes from {ends[0]!r} to {ends[1]!r}; expected {self.operator!r} to {self.robot!r}; "
                "set operator= and robot= accordingly"
            )
        self._given = mapping

    def _check_held_out(self) -> None:
        known = {take.action for take in self.motions.takes}
        for action in self.held_out:
            if action not in known:
                raise OptionError(f"held_out: unknown action {action!r}; {nearest_name(action, known)}")
        if known <= set(self.held_out):
            raise OptionError("held_out names every action; at least one must be left to fit on")

    def _explicit(self, route: Sequence[str]) -> tuple[str, ...]:
        bodies = tuple(route)
        if len(bodies) < 2 or (bodies[0], bodies[-1]) != (self.operator, self.robot):
            raise RouteError(f"route {bodies} must lead from operator {self.operator!r} to robot {self.robot!r}")
        if len(set(bodies)) != len(bodies):
            raise RouteError(f"route {bodies} passes a body twice")
        known = list(self._stored) or [pair for a, b in self.motions.pairs for pair in ((a, b), (b, a))]
        named = {name for pair in known for name in pair}
        for name in bodies:
            if name not in named:
                words = ">".join(bodies)
                raise RouteError(f"route {words}: no mapping leads from or to {name!r}; {nearest_name(name, named)}")
        for link in zip(bodies[:-1], bodies[1:], strict=True):
            if link not in known:
                pairs = ", ".join(f"{a}>{b}" for a, b in known)
                raise RouteError(f"route {bodies}: no mapping for the link {link[0]}>{link[1]}; there are {pairs}")
        return bodies

    def _ranked(self) -> list[Route]:
        from syda_gym.routes.routing import ranked_routes

        ends = [self.motions.bodies.get(name, name) for name in (self.operator, self.robot)]
        pairs = [(self._body(a), self._body(b)) for a, b in self.fitted]
        return ranked_routes(ends[0], ends[1], pairs, max_hops=_MAX_HOPS, directed=True)

    def _planned(self, bodies: tuple[str, ...]) -> PlannedRoute:
        from syda_gym.routes.routing import BodyGraph

        known = [self._body(name) for name in bodies]
        try:
            graph = BodyGraph((), zip(known[:-1], known[1:], strict=True), directed=True)
            return PlannedRoute(bodies, float(graph.route(bodies).T))
        except SydaError:
            return PlannedRoute(bodies, float(np.nan))

    def _body(self, name: str) -> Embodiment:
        if self._given is not None:  # its bodies need no name in any catalog
            for body in (self._given.source, self._given.target):
                if body.name == name:
                    return body
        return self.motions.bodies[name] if name in self.motions.bodies else catalog.get(name)

    def _link(self, a: str, b: str) -> Mapping:
        if self._stored:
            return self._stored[a, b]
        return _fitted_link(self.motions, a, b, self._method, self.preset, self.held_out, self.seed)


_fits: OrderedDict[tuple[object, ...], Mapping] = OrderedDict()
_MAX_FITS = 64


def _fitted_link(
    motions: Motions, a: str, b: str, method: str, preset: str | None, held_out: tuple[str, ...], seed: int
) -> Mapping:
    """Loads the shipped mapping if it was fitted to these frames, otherwise fits one; kept within the process."""
    from syda_gym.mappings.fitting.fit import METHODS, fit
    from syda_gym.motions.loading import resampled

    chosen = preset or METHODS[method].default
    pair = motions.pair(a, b)
    key = (pair.fingerprint, a, b, method, chosen, held_out, seed)
    if key in _fits:
        _fits.move_to_end(key)
        return _fits[key]
    sparse = resampled(motions, FIT_FPS).pair(a, b) if pair.fps > FIT_FPS else pair
    data = sparse.without_actions(held_out) if held_out else sparse
    marks = {data.fingerprint} if held_out else {data.fingerprint, pair.fingerprint}
    found = _shipped(a, b, method, chosen, marks) if seed == 0 else None
    _fits[key] = found or fit(data, method=method, preset=chosen, seed=seed)
    while len(_fits) > _MAX_FITS:
        _fits.popitem(last=False)
    return _fits[key]


def _shipped(a: str, b: str, method: str, preset: str, data: set[str]) -> Mapping | None:
    """A mapping of the package that was fitted to the same frames by the same method."""
    from syda_gym.mappings.storage import load_mapping

    for path in sorted(asset("mappings").glob("*.json")):
        links = read_json(path).get("links", [])
        if len(links) != 1:
            continue
        card = links[0]["card"]
        if (card["method"], card["preset"]) != (method, preset):
            continue
        ends = (card["source"]["name"], card["target"]["name"])
        if ends == (a, b) and card["data"] in data:
            return load_mapping(path)
    return None


def _read_folder(folder: Path) -> dict[tuple[str, str], Mapping]:
    """Every stored mapping of a folder, and the inverses of those that have one where nothing else serves."""
    from syda_gym.mappings.storage import load_mapping

    paths = sorted(folder.glob("*.safetensors"))
    if not paths:
        raise StorageError(f"{folder} holds no mapping (*.safetensors with *.json); fit and save some first")
    found: dict[tuple[str, str], Mapping] = {}
    inverses: dict[tuple[str, str], Mapping] = {}
    for path in paths:
        mapping = load_mapping(path)
        ends = (mapping.source.name, mapping.target.name)
        if ends in found:
            raise StorageError(f"{folder} holds two mappings from {ends[0]!r} to {ends[1]!r}; keep one")
        found[ends] = mapping
        try:
            inverses[ends[1], ends[0]] = mapping.inverse()
        except MappingError:
            continue
    return {**inverses, **found}


def _method(mapping: object) -> str:
    from syda_gym.mappings.fitting.fit import METHODS

    if not isinstance(mapping, str) or mapping not in METHODS:
        raise OptionError(
            f"mapping={mapping!r} is no method, no Mapping and no folder of mappings; "
            f"{nearest_name(str(mapping), METHODS)}"
        )
    return mapping
