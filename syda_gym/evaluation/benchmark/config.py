"""BenchmarkConfig: what a benchmark shall compute, read from YAML and checked before anything runs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from syda_gym.errors import OptionError, StorageError, nearest_name
from syda_gym.evaluation.chains import Route, all_routes, check_route, robots_of
from syda_gym.files import read_yaml
from syda_gym.motions.clip import Motions

__all__ = ["BenchmarkConfig", "EfficiencyConfig", "split_method"]

_MAX_SEEDS = 10_000
_MAX_DRAWS = 1_000


@dataclass(frozen=True)
class EfficiencyConfig:
    """The sample-efficiency curve: error against the number of paired actions of a new body.

    Attributes:
        chain: route through which the new body reaches the robot; its ends also make the direct pair.
        new_body: the end of the chain that is new; its first or its last body.
        actions: numbers of paired actions to try.
        draws: random choices of actions for each number.
        method: of the fits, with a preset behind a colon if need be.
    """

    chain: Route
    new_body: str
    actions: tuple[int, ...] = (1, 2, 3, 4, 6, 8)
    draws: int = 3
    method: str = "syda"

    def __post_init__(self) -> None:
        object.__setattr__(self, "chain", _route(self.chain))
        object.__setattr__(self, "actions", _whole_numbers("efficiency.actions", self.actions, 1))
        _whole("efficiency.draws", self.draws, 1, _MAX_DRAWS)
        split_method(self.method)
        if len(self.chain) < 3 or self.new_body not in (self.chain[0], self.chain[-1]):
            raise OptionError(
                f"efficiency: chain {'>'.join(self.chain)} needs an intermediate body, and new_body "
                f"{self.new_body!r} must be its first or last body"
            )


@dataclass(frozen=True)
class BenchmarkConfig:
    """Everything that decides the numbers of a benchmark.

    Attributes:
        motions: what ``load_motions`` takes.
        fps: frame rate to assume or to resample to.
        routes: names such as ``adult>kid>pepper``, or ``"all"``.
        operators: where routes begin if ``routes`` is ``"all"``; all humans if empty.
        robots: where they end; all robots if empty.
        via: bodies that routes may pass; all if ``None``.
        max_hops: most links of a route.
        methods: mapping methods, with a preset behind a colon: ``syda``, ``syda:paper``, ``direct``.
        agents: ``base``, the classical rivals, ``residual`` (trained for each fold), or a stored agent's path.
        disturbances: ``none`` or presets such as ``teleop:full:test``.
        seeds: seeds, or their number.
        folds: ``"loao"`` to leave each action out once, or a number of groups of actions.
        baseline: method that the others are compared with; the first one if empty.
        physics: ``bullet`` or ``servo``.
        self_collision: whether the physics knows self-collisions (``bullet`` only).
        control_hz: control steps per second.
        success_error: mean landmark error up to which an episode counts as a success [m].
        residual_steps: training steps of the agent ``residual``.
        fit: further options of the fits, by method.
        efficiency: the sample-efficiency curve; left out if ``None``.

    Raises:
        OptionError: an unknown key or a value out of range; the message names the nearest key and what is allowed.
    """

    motions: str = "embedded"
    fps: float | None = None
    routes: str | tuple[Route, ...] = "all"
    operators: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()
    via: tuple[str, ...] | None = None
    max_hops: int = 2
    methods: tuple[str, ...] = ("syda",)
    agents: tuple[str, ...] = ("base",)
    disturbances: tuple[str, ...] = ("none",)
    seeds: tuple[int, ...] = (0,)
    folds: int | str = "loao"
    baseline: str = ""
    physics: str = "bullet"
    self_collision: bool = True
    control_hz: float = 30.0
    success_error: float = 0.1
    residual_steps: int = 100_000
    fit: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    efficiency: EfficiencyConfig | None = None

    def __post_init__(self) -> None:
        from syda_gym.envs.task.disturbances import Disturbances
        from syda_gym.envs.task.options import TeleopOptions

        for name in ("operators", "robots", "methods", "agents", "disturbances"):
            object.__setattr__(self, name, _names(name, getattr(self, name)))
        if self.via is not None:
            object.__setattr__(self, "via", _names("via", self.via))
        if self.routes != "all":
            given = [self.routes] if isinstance(self.routes, str) else self.routes
            object.__setattr__(self, "routes", tuple(_route(route) for route in given))
        given_seeds: Any = self.seeds  # YAML brings a number as well as a list
        seeds = range(min(given_seeds, _MAX_SEEDS + 1)) if isinstance(given_seeds, int) else given_seeds
        object.__setattr__(self, "seeds", _whole_numbers("seeds", seeds, 0))
        if len(self.seeds) > _MAX_SEEDS:
            raise OptionError(f"seeds: at most {_MAX_SEEDS} can be asked for at once")
        plan: Any = self.efficiency
        if isinstance(plan, Mapping):
            object.__setattr__(self, "efficiency", _build(EfficiencyConfig, plan, "efficiency."))
        _whole("max_hops", self.max_hops, 1)
        _whole("residual_steps", self.residual_steps, 1)
        if self.folds != "loao":
            _whole("folds", self.folds, 2)
        for method in self.methods:
            split_method(method)
        if self.baseline and self.baseline not in self.methods:
            raise OptionError(
                f"baseline {self.baseline!r} is none of the methods; {nearest_name(self.baseline, self.methods)}"
            )
        for method in self.fit:
            if method not in self.methods:
                raise OptionError(f"fit: {method!r} is none of the methods; {nearest_name(str(method), self.methods)}")
        for agent in self.agents:
            _check_agent(agent)
        for name in self.disturbances:
            if name != "none":
                Disturbances.resolve(name)
        # The environment's own checks, so that a bad value is found before the first fit.
        TeleopOptions(
            physics=self.physics,
            self_collision=self.self_collision and self.physics == "bullet",
            control_hz=self.control_hz,
            success_error=self.success_error,
        )

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> BenchmarkConfig:
        """From plain data.

        Raises:
            OptionError: an unknown key; the message says which is nearest.
        """
        built: BenchmarkConfig = _build(cls, values, "")
        return built

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> BenchmarkConfig:
        """Reads YAML.

        Raises:
            StorageError: no such file, too large, or not YAML.
            OptionError: unknown keys or bad values.
        """
        file = Path(path)
        if not file.is_file():
            raise StorageError(f"no benchmark configuration {file}; write one, see docs/benchmark.md")
        data = read_yaml(file, "a benchmark configuration (short YAML)")
        if not isinstance(data, dict):
            raise OptionError(f"{file}: expected keys and values, got {type(data).__name__}")
        try:
            return cls.of(data)
        except OptionError as error:
            raise OptionError(f"{file}: {error}") from error

    def as_dict(self) -> dict[str, Any]:
        """Plain data from which ``of`` makes an equal configuration."""
        values = asdict(self)
        if self.routes != "all":
            values["routes"] = [">".join(route) for route in self.routes]
        if self.efficiency is not None:
            values["efficiency"]["chain"] = ">".join(self.efficiency.chain)
        return _plain(values)  # type: ignore[no-any-return]

    def expand_routes(self, motions: Motions) -> list[Route]:
        """The routes to play on some motions.

        Raises:
            RouteError: a route that the motions do not allow.
        """
        if self.routes != "all":
            return [check_route(motions, route) for route in self.routes]
        humans = [name for name, body in motions.bodies.items() if body.kind == "human"]
        return all_routes(
            motions, list(self.operators) or humans, list(self.robots) or robots_of(motions), self.max_hops, self.via
        )


def split_method(text: str) -> tuple[str, str | None]:
    """``syda:paper`` into method and preset.

    Raises:
        OptionError: unknown method or preset.
    """
    from syda_gym.mappings.fitting.fit import METHODS

    method, _, preset = text.partition(":")
    if method not in METHODS:
        raise OptionError(f"unknown method {method!r}; {nearest_name(method, METHODS)}")
    if preset and preset not in METHODS[method].presets:
        raise OptionError(
            f"method {method!r} has no preset {preset!r}; {nearest_name(preset, METHODS[method].presets)}"
        )
    return method, preset or None


def _is_bundle(name: str) -> bool:
    try:
        return bool(Path(name).name) and Path(name).with_suffix(".safetensors").is_file()
    except OSError:  # a name longer than the file system takes
        return False


def _check_agent(name: str) -> None:
    from syda_gym.agents.classical.rivals import RIVALS

    known = [*RIVALS, "residual"]
    if name in known or _is_bundle(name):
        return
    raise OptionError(f"unknown agent {name!r}, and no stored agent of that name; {nearest_name(name, known)}")


def _build(kind: type[Any], values: Mapping[str, Any], prefix: str) -> Any:
    known = [entry.name for entry in fields(kind)]
    for name in values:
        if name not in known:
            raise OptionError(f"unknown key {prefix + str(name)!r}; {nearest_name(str(name), known)}")
    try:
        return kind(**values)
    except TypeError as error:
        raise OptionError(f"{prefix or 'benchmark'}: {error}") from error


def _names(what: str, value: Any) -> tuple[str, ...]:
    given = [value] if isinstance(value, str) else value
    if not isinstance(given, Sequence) or not all(isinstance(name, str) for name in given):
        raise OptionError(f"{what} must be a list of names, got {value!r}")
    if what in ("methods", "agents", "disturbances") and not given:
        raise OptionError(f"{what} must name at least one")
    return tuple(dict.fromkeys(given))


def _route(value: Any) -> Route:
    bodies = tuple(part.strip() for part in value.split(">")) if isinstance(value, str) else tuple(value)
    if len(bodies) < 2 or not all(isinstance(body, str) and body for body in bodies):
        raise OptionError(f"a route is written as adult>kid>pepper, got {value!r}")
    return bodies


def _whole(what: str, value: Any, low: int, high: int | None = None) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < low:
        raise OptionError(f"{what} must be a whole number of at least {low}, got {value!r}")
    if high is not None and value > high:
        raise OptionError(f"{what} must be at most {high}, got {value!r}")


def _whole_numbers(what: str, values: Any, low: int) -> tuple[int, ...]:
    if isinstance(values, str) or not isinstance(values, Sequence) or not values:
        raise OptionError(f"{what} must be a list of whole numbers, got {values!r}")
    for value in values:
        _whole(what, value, low)
    return tuple(dict.fromkeys(values))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple | list) else value
