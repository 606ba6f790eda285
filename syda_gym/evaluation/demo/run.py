"""The demo: whom to pair a new operator with, asked beforehand and checked afterwards, as ``syda-gym demo`` runs it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, nearest_name
from syda_gym.evaluation.chains import Links, Route, action_groups, name_of, robots_of
from syda_gym.evaluation.demo.baselines import BASELINES, baseline
from syda_gym.evaluation.demo.cast import Cast, cast_of, with_guests
from syda_gym.evaluation.demo.results import ChainResult, DemoResult
from syda_gym.evaluation.episodes import EpisodeFigures, Recording, figures_of_all, latency, make_env, play_all
from syda_gym.locks import locked_folder
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

if TYPE_CHECKING:
    from syda_gym.agents.agent import Agent
    from syda_gym.mappings.mapping import Mapping
    from syda_gym.routes.route import Route as BestRoute

__all__ = ["run_demo"]

Progress = Callable[[str, float], None]
"""Told the name of the stage and its finished fraction."""

_FEW_ACTIONS = 12  # up to so many actions each is left out once; with more, one fifth is held out


def run_demo(
    motions: str | os.PathLike[str] | Motions = "embedded",
    out: str | os.PathLike[str] = "demo",
    *,
    robot: str | None = None,
    seed: int = 0,
    residual: bool = True,
    command: str = "",
    progress: Progress | None = None,
) -> DemoResult:
    """Asks the dry run with whom a new operator should be paired, then fits and plays every choice, and reports.

    Args:
        motions: what ``load_motions`` takes.
        out: folder for report, plots, picture and film; created if need be.
        robot: who is driven; the first robot of the motions if ``None``.
        seed: of everything random.
        residual: whether to train the residual.
        command: the command line, for the report.
        progress: told stage and finished fraction.

    Raises:
        SydaError: unusable motions or folder; nothing half-written stays behind.
    """
    tell = progress or (lambda stage, done: None)
    with locked_folder(out) as folder:
        return _run(motions, folder, robot, seed, residual, command, tell)


def _run(
    motions: str | os.PathLike[str] | Motions,
    folder: Path,
    robot: str | None,
    seed: int,
    residual: bool,
    command: str,
    tell: Progress,
) -> DemoResult:
    from syda_gym.evaluation.demo.report import write_demo_report

    clock = _Clock(tell)
    with clock("load"):
        data = with_guests(load_motions(motions))
        driven = _robot(data, robot)
        cast = cast_of(data, driven)
        groups = _groups(data, cast.operator, driven.name, seed)
    with clock("transferability"):
        expected, chosen = _rehearse(data, cast, tell)
    fitted = Links(data, seed=seed, groups=groups)
    ridge = Links(data, "ridge", seed=seed, groups=groups)
    contenders: list[tuple[Route, str, Any]] = [(route, "", fitted.chain) for route in cast.routes]
    if cast.between:
        contenders.append((cast.direct, "", fitted.chain))
    contenders += [
        (
            cast.direct,
            f"{name} ({name_of(chosen.bodies)})" if name == "ridge" else name,
            _answers(name, data, chosen, ridge),
        )
        for name in BASELINES
    ]
    with clock("fit"):
        edges = list(dict.fromkeys(edge for route, label, _ in contenders if not label for edge in _edges(route)))
        for done, edge in enumerate(edges):
            tell("fit", done / len(edges))
            fitted.link(*edge, groups[0])
    with clock("play"):
        played = []
        products = {route.bodies: float(route.T) for route in expected}
        for done, (route, label, answer) in enumerate(contenders):
            tell("play", done / len(contenders))
            played.append(_play_chain(data, route, label, answer, groups, products.get(route, float("nan")), seed))
    learned = None
    if residual:
        from syda_gym.evaluation.demo.residual import train_and_compare

        with clock("residual"):
            route = chosen.bodies
            apart = groups[0] if len(groups) == 1 else _third(data.pair(route[0], route[-1]).action_names, seed)
            known = fitted if apart in fitted.groups else None
            learned = train_and_compare(
                data, route, apart, seed, links=known, folder=folder, progress=lambda done: tell("residual", done)
            )
    chains = [one for one in played if not one.label]
    direct = chains.pop() if cast.between else None
    result = DemoResult(
        data, driven, cast, tuple(groups), tuple(expected), chosen, tuple(chains),
        tuple(one for one in played if one.label), direct, fitted.count(), learned, clock.seconds, seed,
    )  # fmt: skip
    with clock("report"):
        page = write_demo_report(result, folder, command=command, progress=lambda done: tell("report", done))
    return DemoResult(**{**result.__dict__, "report": page})


def _rehearse(motions: Motions, cast: Cast, tell: Progress) -> tuple[list[BestRoute], BestRoute]:
    """Every chain in the dry run, best first, and the best one with its ties."""
    from syda_gym.routes.routing import best_route, ranked_routes

    bodies = motions.bodies
    pairs = [(bodies[a], bodies[b]) for a, b in dict.fromkeys(edge for route in cast.routes for edge in _edges(route))]
    ends = bodies[cast.operator], bodies[cast.robot]
    ranked = ranked_routes(*ends, pairs, max_hops=2, directed=True)
    tell("transferability", 0.7)
    return ranked, best_route(*ends, pairs, max_hops=2, directed=True)


def _answers(name: str, motions: Motions, chosen: BestRoute, ridge: Links) -> Callable[..., Mapping]:
    """A baseline as a function of route and held-out actions."""

    def answer(route: Route, held_out: Sequence[str]) -> Mapping:
        return baseline(name, motions, chosen.bodies, ridge, held_out)

    return answer


class _Clock:
    """Times stages and tells when they begin and end."""

    def __init__(self, tell: Progress) -> None:
        self._tell = tell
        self.seconds: dict[str, float] = {}
        self._stage, self._start = "", 0.0

    def __call__(self, stage: str) -> _Clock:
        self._stage = stage
        return self

    def __enter__(self) -> None:
        self._start = time.perf_counter()
        self._tell(self._stage, 0.0)

    def __exit__(self, *error: object) -> None:
        self.seconds[self._stage] = time.perf_counter() - self._start
        if error[0] is None:
            self._tell(self._stage, 1.0)


def _robot(motions: Motions, name: str | None) -> Robot:
    known = robots_of(motions)
    if not known:
        raise OptionError(f"{motions.name} holds no robot's motion; the demo drives a robot")
    if name is not None and name not in known:
        raise OptionError(f"{motions.name} has no robot {name!r}; {nearest_name(name, known)}")
    body = motions.bodies[name or ("pepper" if "pepper" in known else known[0])]
    assert isinstance(body, Robot)
    return body


def _groups(motions: Motions, operator: str, robot: str, seed: int) -> list[tuple[str, ...]]:
    """Few actions: each is left out once. Many: one fifth of them, spread over the families, is held out."""
    pair = motions.pair(operator, robot)
    names = list(pair.action_names)
    if len(names) <= _FEW_ACTIONS:
        return action_groups(names)
    rng = np.random.default_rng(seed)
    by_family: dict[str, list[str]] = {}
    for name in (names[i] for i in rng.permutation(len(names))):
        by_family.setdefault(motions.families.get(name, name), []).append(name)
    families = sorted(by_family)
    order = [families[i] for i in rng.permutation(len(families))]
    picked = [by_family[family][0] for family in order][: len(names) // 5]
    return [tuple(sorted(picked))]


def _third(actions: Sequence[str], seed: int) -> tuple[str, ...]:
    """A third of the actions, which the policy's training leaves out."""
    picked = np.random.default_rng(seed).permutation(len(actions))[: max(1, len(actions) // 3)]
    return tuple(sorted(actions[i] for i in picked))


def _edges(route: Sequence[str]) -> list[tuple[str, str]]:
    return list(zip(route[:-1], route[1:], strict=True))


def _play_chain(
    motions: Motions,
    route: Route,
    label: str,
    answer: Callable[..., Mapping],
    groups: Sequence[tuple[str, ...]],
    product: float,
    seed: int,
) -> ChainResult:
    episodes: list[EpisodeFigures] = []
    shown: list[tuple[Recording, Mapping]] = []
    seconds = []
    for index, group in enumerate(groups):
        mapping = answer(route, group)
        env = make_env(mapping, motions, group, self_collision=True)
        try:
            recordings = list(play_all(env, base_alone(env), seed))
            episodes += figures_of_all(recordings, env.robot, mapping)
            for recording in recordings:
                if len(shown) < 3 and recording.action not in {one.action for one, _ in shown}:
                    shown.append((recording, mapping))
            if index == 0:
                seconds.append(latency(mapping, None, recordings[0].operator))
        finally:
            env.close()
    return ChainResult(route, product, tuple(episodes), tuple(shown), float(np.median(seconds)), label)


def base_alone(env: Any) -> Agent:
    """The agent that passes on the base command."""
    from syda_gym.agents.agent import BaseAlone
    from syda_gym.agents.interface import Interface

    return BaseAlone(Interface.of(env))
