"""Pilot: a mapping from body to body, whatever ``mapping=`` and ``route=`` say; the one road to it.

Environments, benchmarks and the live loop all ask here. What was recorded decides; where nothing was, the unfitted
mapping serves, and a notice says so.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MappingError, OptionError, RouteError, SydaError, nearest_name
from syda_gym.motions.clip import Motions

if TYPE_CHECKING:
    from syda_gym.mappings.mapping import Mapping
    from syda_gym.routes.measured import MeasuredBodies
    from syda_gym.routes.piloting.links import Links
    from syda_gym.routes.route import Route

__all__ = ["AUTO", "Pilot", "PlannedRoute"]

AUTO = "auto"
"""As ``mapping=``: this user's stored mapping, else a fit of what was recorded, else the unfitted mapping."""

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
        motions: the data set; ``None`` for what this user recorded (``syda-gym record`` and ``syda-gym fit``).
        operator: who leads.
        robot: who follows.
        mapping: ``auto``; a method of ``mappings.METHODS`` (shipped mappings are used where they were fitted to the
            same frames, otherwise one is fitted); a ``Mapping`` from operator to robot; or a folder of stored mappings.
        preset: of the method.
        held_out: actions that no fit may see.
        via: bodies that a route may pass; by default those of the paper that the motions hold, or all that this user
            recorded.
        seed: of fits.
        predictor: what routes are ranked by: ``dry_run``, ``measured`` (training errors of the fitted pairs) or a name
            of ``routing.PREDICTORS``.

    Attributes:
        notices: what a person should know about the choice, a line each.

    Raises:
        OptionError: unknown method, a folder without mappings, held-out actions that do not exist.
        MappingError: a mapping between other bodies.
        EmbodimentError: unknown bodies, or bodies without an arm that could drive or be driven.
    """

    def __init__(
        self,
        motions: Motions | None,
        operator: str | Embodiment,
        robot: str | Embodiment,
        *,
        mapping: str | os.PathLike[str] | Mapping = "syda",
        preset: str | None = None,
        held_out: Sequence[str] = (),
        via: Sequence[str] | None = None,
        seed: int = 0,
        predictor: str = "dry_run",
    ) -> None:
        from syda_gym.mappings.mapping import Mapping

        self.motions, self.predictor, self.seed = motions, _predictor(predictor), seed
        self._held_out = tuple(held_out)
        self.operator, self.robot = (_name(body) for body in (operator, robot))
        self.notices: tuple[str, ...] = ()
        self._ends = [body if isinstance(body, Embodiment) else self._found(body) for body in (operator, robot)]
        self._given: Mapping | None = None
        self._links: Links | None = None
        self._chains: dict[tuple[str, ...], Mapping] = {}  # finding a fit again takes a hash of all its frames
        if motions is not None:
            self._check(motions, via, held_out)
        if isinstance(mapping, Mapping):
            self._take(mapping)
        elif isinstance(mapping, str | os.PathLike) and Path(mapping).is_dir():
            from syda_gym.routes.piloting.links import StoredLinks

            self._links = StoredLinks(Path(mapping))
        else:
            self._choose(_method(mapping), preset, tuple(held_out), via, seed)

    @property
    def fitted(self) -> tuple[tuple[str, str], ...]:
        """Pairs with a mapping, or with frames from which one can be fitted, in the directions that work."""
        if self._given is not None:
            return ((self._given.source.name, self._given.target.name),)
        assert self._links is not None
        return self._links.edges

    def plan(self, route: str | Sequence[str]) -> tuple[PlannedRoute, ...]:
        """The routes that an environment may take.

        Args:
            route: ``"auto"`` for the best one, ``"sample"`` for all (to draw from in proportion to transferability),
                ``"per_motion"`` for all, the best one first (``for_clips`` says which for a clip), or the names of the
                bodies.

        Raises:
            RouteError: unknown bodies, a missing link, or ends that are not operator and robot.
            OptionError: ``"per_motion"`` with a predictor that knows no motion.
        """
        if not isinstance(route, str):
            return (self._planned(self._explicit(route)),)
        if route not in ("auto", "sample", "per_motion"):
            raise RouteError(f"route must be 'auto', 'sample', 'per_motion' or names of bodies, got {route!r}")
        if route == "per_motion" and self.predictor != "dry_run":
            raise OptionError(
                f"route='per_motion' asks the dry run, for it alone knows the motion; drop predictor={self.predictor!r}"
            )
        if self._given is not None:
            return (self._planned(self._given.route),)
        routes = self._ranked()
        return tuple(PlannedRoute(r.bodies, float(r.T)) for r in (routes[:1] if route == "auto" else routes))

    def for_clips(self, routes: Sequence[PlannedRoute], clips: Sequence[FloatArray], fps: float) -> list[int]:
        """Which of the routes to take for each clip of the operator, see ``per_motion.routes_for_clips``.

        Args:
            routes: of ``plan("per_motion")``.
            clips: frames ``(N, F)`` of the operator.
            fps: of the clips.
        """
        from syda_gym.routes.piloting.per_motion import routes_for_clips

        names = [route.bodies for route in routes]
        bodies = {name: self._body(name) for route in names for name in route}
        return routes_for_clips(bodies, names, clips, fps, seed=self.seed)

    def mapping(self, bodies: Sequence[str]) -> Mapping:
        """The chain along ``bodies``; links are loaded or fitted on first use."""
        from syda_gym.mappings.chain import ChainMapping

        if self._given is not None:
            return self._given
        assert self._links is not None
        route = tuple(bodies)
        if route not in self._chains:
            links = [self._links.link(a, b) for a, b in zip(route[:-1], route[1:], strict=True)]
            self._chains[route] = links[0] if len(links) == 1 else ChainMapping(links)
        return self._chains[route]

    def __getstate__(self) -> dict[str, object]:
        # Mappings are found again where the pilot is unpickled; they are larger than everything else together.
        return {**self.__dict__, "_chains": {}}

    def _choose(
        self, method: str | None, preset: str | None, held_out: tuple[str, ...], via: Sequence[str] | None, seed: int
    ) -> None:
        """Links from the motions if they lead to the robot, else this user's own, else the unfitted mapping."""
        from syda_gym.routes.piloting.links import OwnLinks, RecordedLinks

        motions = self.motions
        if motions is not None:
            default = tuple(body for body in _PAPER_BODIES if body in motions.bodies)
            among = tuple(dict.fromkeys((self.operator, *(default if via is None else via), self.robot)))
            recorded = RecordedLinks(motions, method or "syda", preset, held_out, seed, among)
            if _connected(recorded.edges, self.operator, self.robot):
                self._links = recorded
                return
        elif method == "geometric" and preset is None:  # asked for by name: what needs no recordings
            self._take_unfitted()
            return
        own = OwnLinks(method, preset, seed)
        if _connected(own.edges, self.operator, self.robot):
            self._links = own
            where = "" if motions is None else f"{motions.name} holds no recordings of {self.robot}: "
            self.notices = (f"{where}your recordings of {self.operator} and {self.robot} are used", *own.notices)
            return
        self._take_unfitted()
        self.notices = (
            f"no recordings of you with {self.robot}: unfitted; `syda-gym record` improves it",
            *own.notices,
        )

    def _take_unfitted(self) -> None:
        from syda_gym.mappings.methods.unfitted import unfitted

        self._given = unfitted(*self._ends)

    def _take(self, mapping: Mapping) -> None:
        ends = (mapping.source.name, mapping.target.name)
        if ends != (self.operator, self.robot):
            raise MappingError(
                f"the mapping goes from {ends[0]!r} to {ends[1]!r}; expected {self.operator!r} to {self.robot!r}; "
                "set operator= and robot= accordingly"
            )
        self._given = mapping

    def _check(self, motions: Motions, via: Sequence[str] | None, held_out: Sequence[str]) -> None:
        for body in via or ():
            if body not in motions.bodies:
                raise OptionError(f"via: {motions.name} has no body {body!r}; {nearest_name(body, motions.bodies)}")
        known = {take.action for take in motions.takes}
        for action in held_out:
            if action not in known:
                raise OptionError(f"held_out: unknown action {action!r}; {nearest_name(action, known)}")
        if known <= set(held_out):
            raise OptionError("held_out names every action; at least one must be left to fit on")

    def _explicit(self, route: Sequence[str]) -> tuple[str, ...]:
        bodies = tuple(route)
        if self._given is not None and bodies == self._given.route:
            return bodies
        if len(bodies) < 2 or (bodies[0], bodies[-1]) != (self.operator, self.robot):
            raise RouteError(f"route {bodies} must lead from operator {self.operator!r} to robot {self.robot!r}")
        if len(set(bodies)) != len(bodies):
            raise RouteError(f"route {bodies} passes a body twice")
        if self._given is not None and self._given.card.rows:
            raise RouteError(f"the given mapping takes the route {self._given.route}; drop route={bodies}")
        known = self.fitted
        named = {name for pair in known for name in pair}
        for name in bodies:
            if named and name not in named:
                words = ">".join(bodies)
                raise RouteError(f"route {words}: no mapping leads from or to {name!r}; {nearest_name(name, named)}")
        for link in zip(bodies[:-1], bodies[1:], strict=True):
            if link not in known or self._given is not None:
                pairs = ", ".join(f"{a}>{b}" for a, b in known)
                own = (
                    ""
                    if self.motions is not None
                    else "; or name motions that hold it, such as the synthetic 'embedded'"
                )
                raise RouteError(
                    f"route {bodies}: no mapping for the link {link[0]}>{link[1]}; there are {pairs or 'none'}{own}"
                )
        return bodies

    def _ranked(self) -> list[Route]:
        from syda_gym.routes.routing import ranked_routes

        pairs = [(self._body(a), self._body(b)) for a, b in self.fitted]
        predictor = self._measured() if self.predictor == "measured" else self.predictor
        return ranked_routes(
            self._body(self.operator),
            self._body(self.robot),
            pairs,
            max_hops=_MAX_HOPS,
            directed=True,
            predictor=predictor,
        )

    def _measured(self) -> MeasuredBodies:
        """From the training errors of the fitted pairs, on frames that they have seen."""
        from syda_gym.routes.measured import MOST_TRAINING_FRAMES, landmark_gap, measured_bodies

        if self.motions is None or self._links is None:
            raise OptionError(
                "predictor='measured' needs recordings of the fitted pairs; name motions that hold them, or use "
                "predictor='dry_run'"
            )
        errors = {}
        for a, b in self.fitted:
            pair = self.motions.pair(a, b)
            seen = pair.without_actions(self._held_out) if self._held_out else pair
            rows = np.arange(len(seen))[:: max(1, len(seen) // MOST_TRAINING_FRAMES)]
            link = self._links.link(a, b)
            gap = landmark_gap(link.source, link.target, link(seen.source[rows]), seen.target[rows])
            errors[a, b] = gap / link.target.reach
        return measured_bodies(errors)

    def _planned(self, bodies: tuple[str, ...]) -> PlannedRoute:
        from syda_gym.routes.routing import BodyGraph

        known = [self._body(name) for name in bodies]
        try:
            graph = BodyGraph((), zip(known[:-1], known[1:], strict=True), directed=True)
            return PlannedRoute(bodies, float(graph.route(bodies).T))
        except SydaError:
            return PlannedRoute(bodies, float(np.nan))

    def _body(self, name: str) -> Embodiment:
        for end in self._ends:
            if self._links is None and end.name == name:
                return end
        return self._found(name) if self._links is None else self._links.body(name)

    def _found(self, name: str) -> Embodiment:
        if self.motions is not None and name in self.motions.bodies:
            return self.motions.bodies[name]
        return catalog.get(name)


def _name(body: str | Embodiment) -> str:
    return body.name if isinstance(body, Embodiment) else body


def _predictor(name: object) -> str:
    from syda_gym.routes.judges import PREDICTORS

    known = ["dry_run", "measured", *PREDICTORS]
    if not isinstance(name, str) or name not in known:
        raise OptionError(f"unknown predictor {name!r}; {nearest_name(str(name), known)}")
    return name


def _connected(edges: Sequence[tuple[str, str]], start: str, end: str) -> bool:
    """Whether a route of at most two links leads from one body to another."""
    if (start, end) in edges:
        return True
    return any(a == start and (b, end) in edges for a, b in edges)


def _method(mapping: object) -> str | None:
    """The method's name, ``None`` for ``auto``."""
    from syda_gym.mappings.fitting.fit import METHODS

    if mapping == AUTO:
        return None
    if not isinstance(mapping, str) or mapping not in METHODS:
        raise OptionError(
            f"mapping={mapping!r} is no method, no Mapping and no folder of mappings; "
            f"{nearest_name(str(mapping), [AUTO, *METHODS])}"
        )
    return mapping
