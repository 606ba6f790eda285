"""Cells: the smallest pieces of a benchmark that are computed, stored and never computed twice."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from syda_gym.evaluation.benchmark.config import BenchmarkConfig, split_method
from syda_gym.evaluation.chains import Route, name_of
from syda_gym.evaluation.provenance import made_by
from syda_gym.files import fingerprint
from syda_gym.motions.clip import Motions

__all__ = ["FORMAT", "Cell", "cells_of", "data_fingerprint", "efficiency_cells"]

FORMAT = 1
"""Version of stored results; others are refused."""


@dataclass(frozen=True)
class Cell:
    """One piece of work; everything in it decides the numbers.

    Attributes:
        kind: ``"episodes"`` or ``"efficiency"``.
        route: bodies of the chain.
        method: mapping method, with its preset behind a colon.
        agent: who acts.
        disturbance: ``none`` or a preset.
        seed: of fits, training and episodes.
        actions: paired actions of the new body (``efficiency`` only).
        new_body: which end of the route is new (``efficiency`` only).
        draw: which random choice of actions (``efficiency`` only).
        settings: what else of the configuration decides the numbers, as JSON text.
        data: fingerprint of the motions.
        made: fingerprint of the versions and the code that compute it (``provenance.made_by``).
    """

    kind: str
    route: Route
    method: str
    agent: str
    disturbance: str
    seed: int
    settings: str
    data: str
    made: str = ""
    actions: int = 0
    new_body: str = ""
    draw: int = 0

    @property
    def key(self) -> str:
        """A name for its file: 16 hex digits of all that decides its numbers."""
        return fingerprint(json.dumps(asdict(self), sort_keys=True))

    @property
    def batch(self) -> tuple[str, str, int]:
        """Cells of one batch share fitted links, so that one worker takes them all."""
        return (self.kind, self.method, self.seed)

    @property
    def name(self) -> str:
        """For people: ``adult>pepper, syda, base, none, seed 0``."""
        extra = f", {self.actions} actions of {self.new_body}, draw {self.draw}" if self.kind == "efficiency" else ""
        return f"{name_of(self.route)}, {self.method}, {self.agent}, {self.disturbance}, seed {self.seed}{extra}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON-able data."""
        return {**asdict(self), "route": list(self.route)}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Cell:
        """Back from ``to_dict``."""
        return cls(**{**values, "route": tuple(values["route"])})


def cells_of(config: BenchmarkConfig, motions: Motions) -> list[Cell]:
    """Every cell of a benchmark, ordered by batch.

    Chains that end in a human have no episodes; they are scored by the mapping alone, with the agent ``base`` and no
    disturbance. Where nothing depends on the seed, only the first one is computed: the others would be copies.
    """
    data, made = data_fingerprint(motions), made_by()
    settings = {agent: _settings(config, agent) for agent in (*config.agents, "base")}
    cells = []
    for method in config.methods:
        for seed in config.seeds:
            for route in config.expand_routes(motions):
                played = motions.bodies[route[-1]].kind == "robot"
                for agent in config.agents if played else ("base",):
                    for disturbance in config.disturbances if played else ("none",):
                        if seed == config.seeds[0] or _random(method, agent, disturbance):
                            cells.append(
                                Cell("episodes", route, method, agent, disturbance, seed, settings[agent], data, made)
                            )
    unique = list(dict.fromkeys(cells))
    return [*unique, *efficiency_cells(config, data, made)]


def efficiency_cells(config: BenchmarkConfig, data: str, made: str) -> list[Cell]:
    """The cells of the sample-efficiency curve: the chain and the direct pair for every number of actions."""
    plan = config.efficiency
    if plan is None:
        return []
    direct = (plan.chain[0], plan.chain[-1])
    settings = json.dumps({"folds": config.folds, "fps": config.fps, "fit": _fit_options(config, plan.method)})
    seeds = config.seeds if _random(plan.method, "base", "none") else config.seeds[:1]
    return [
        Cell("efficiency", route, plan.method, "base", "none", seed, settings, data, made, count, plan.new_body, draw)
        for seed in seeds
        for draw in range(plan.draws)
        for count in plan.actions
        for route in (plan.chain, direct)
    ]


def data_fingerprint(motions: Motions) -> str:
    """16 hex digits that identify bodies and frames."""
    parts: list[bytes | str] = []
    for name, body in motions.bodies.items():
        parts.append(json.dumps([name, body.spec()], sort_keys=True))
    for take in motions.takes:
        parts.append(f"{take.recording}|{take.action}|{take.fps!r}|{take.mirrored}")
        for name in sorted(take.frames):
            parts += [name, take.frames[name].tobytes()]
    return fingerprint(*parts)


def _random(method: str, agent: str, disturbance: str) -> bool:
    """Whether the numbers of a cell depend on its seed."""
    from syda_gym.agents.classical.rivals import RIVALS
    from syda_gym.mappings.fitting.fit import METHODS

    return METHODS[split_method(method)[0]].seeded or agent not in RIVALS or disturbance != "none"


def _settings(config: BenchmarkConfig, agent: str) -> str:
    names = ("folds", "fps", "physics", "self_collision", "control_hz", "success_error")
    values: dict[str, Any] = {name: getattr(config, name) for name in names}
    values["fit"] = {method: dict(config.fit.get(method, {})) for method in config.fit}
    if "residual" in config.agents:
        values["residual_steps"] = config.residual_steps
    values |= _bundle(agent)
    return json.dumps(values, sort_keys=True)


def _bundle(agent: str) -> dict[str, str]:
    """What an agent's bundle holds: another one under the same name gives other numbers."""
    base = Path(agent).with_suffix("") if Path(agent).suffix in (".json", ".safetensors") else Path(agent)
    files = [base.with_name(f"{base.name}{suffix}") for suffix in (".json", ".safetensors")] if base.name else []
    if not any(file.is_file() for file in files):
        return {}
    return {"bundle": fingerprint(*(file.read_bytes() for file in files if file.is_file()))}


def _fit_options(config: BenchmarkConfig, method: str) -> dict[str, Any]:
    return {method: dict(config.fit[method])} if method in config.fit else {}
