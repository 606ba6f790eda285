"""The work of one cell: fit without the held-out actions, play or map the held-out ones, return plain numbers."""

from __future__ import annotations

import json
import math
import time
from collections import OrderedDict
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.embodiments.embodiment import landmark_error
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import AgentError, MappingError
from syda_gym.evaluation.benchmark.cells import Cell
from syda_gym.evaluation.benchmark.config import split_method
from syda_gym.evaluation.chains import Links, action_groups
from syda_gym.evaluation.episodes import FIGURES, Recording, figures_of_all, latency, make_env, play_all
from syda_gym.evaluation.pools import Tell, Work
from syda_gym.evaluation.remembering import Remembering
from syda_gym.motions.clip import Motions, PairedMotions

if TYPE_CHECKING:
    from syda_gym.agents.agent import Agent
    from syda_gym.mappings.mapping import Mapping
    from syda_gym.simulation.capsules import CapsuleModel

__all__ = ["COLUMNS", "Worker", "folds_of", "open_work"]

COLUMNS = (
    "kind", "route", "method", "agent", "disturbance", "seed", "actions", "draw", "fold", "motion", "action", "frames",
    *FIGURES, "landmarks",
)  # fmt: skip
"""Columns of the results, one row an episode (or a mapped clip); ``landmarks`` holds each landmark's error [m]."""

_SHOWN_HZ = 15.0  # of the frames kept for the playback
_KEPT_LINKS = 4  # sets of fitted links that a worker remembers


def folds_of(motions: Motions, folds: int | str) -> list[tuple[str, ...]]:
    """Groups of actions over the whole data set, so that fits are shared by every chain."""
    return action_groups([take.action for take in motions.takes], folds)


def open_work(motions: Motions) -> Work:
    """What a worker of a pool does with a cell; see ``evaluation.pools``."""
    return Worker(motions).run


class Worker:
    """Computes cells one after the other and remembers the fits of the last few batches.

    The same cell gives the same rows bit by bit, whatever was computed before and wherever it runs on one machine.

    Args:
        motions: the data set.
    """

    def __init__(self, motions: Motions) -> None:
        self._motions = motions
        self._links: OrderedDict[tuple[Any, ...], Links] = OrderedDict()
        self._capsules: dict[str, CapsuleModel] = {}
        _single_thread()

    def run(self, cell: Cell, tell: Tell = lambda fraction: None) -> dict[str, Any]:
        """The rows of a cell and how long things took.

        Args:
            cell: what to compute.
            tell: told the finished fraction.

        Returns:
            ``rows``: dictionaries with the keys of ``COLUMNS``, numbers that are not finite as ``None``;
            ``timing``: seconds of fits and episodes, of everything together (``processor``: of processor time), and
            the latency of one frame; ``shown``: the first episode's frames for the report's playback.
        """
        start, processor = time.perf_counter(), time.process_time()
        shown: list[dict[str, Any]] = []
        rows, timing = self._efficiency(cell, tell) if cell.kind == "efficiency" else self._episodes(cell, shown, tell)
        timing["seconds"] = time.perf_counter() - start
        timing["processor"] = time.process_time() - processor
        return {"cell": cell.to_dict(), "rows": rows, "timing": timing, "shown": shown}

    def _episodes(
        self, cell: Cell, shown: list[dict[str, Any]], tell: Tell
    ) -> tuple[list[dict[str, Any]], dict[str, float]]:
        settings = json.loads(cell.settings)
        links = self._links_of(cell.method, cell.seed, settings)
        pair = self._motions.pair(cell.route[0], cell.route[-1])
        rows: list[dict[str, Any]] = []
        timing = {"fit": 0.0, "play": 0.0, "latency": 0.0}
        folds = _folds(links, pair)
        for place, (fold, group) in enumerate(folds):
            tell(0.5 * (bool(place) + place / len(folds)))
            start = time.perf_counter()
            # The first fold fits the links of all; that may be most of the work.
            mapping = links.chain(cell.route, group, None if place else lambda fitted: tell(0.5 * fitted))
            fitted = time.perf_counter()
            timing["fit"] += fitted - start
            if isinstance(mapping.target, Robot):
                rows += self._play(cell, settings, mapping, fold, group, timing, shown)
            else:
                rows += _map(cell, mapping, pair.only_actions(group), fold)
            timing["play"] += time.perf_counter() - fitted
        return rows, timing

    def _play(
        self,
        cell: Cell,
        settings: dict[str, Any],
        mapping: Mapping,
        fold: int,
        group: Sequence[str],
        timing: dict[str, float],
        shown: list[dict[str, Any]],
    ) -> list[dict[str, Any]]:
        bullet = settings["physics"] == "bullet" and settings["self_collision"]
        options = {
            "disturbances": None if cell.disturbance == "none" else cell.disturbance,
            "physics": settings["physics"],
            "self_collision": bullet,
            "control_hz": settings["control_hz"],
            "success_error": settings["success_error"],
        }
        remembering = Remembering(mapping)
        env = make_env(remembering, self._motions, group, **options)
        try:
            agent = self._agent(cell, settings, mapping, group, env)
            capsules = None if bullet else self._capsules_of(env.robot)
            recordings = list(play_all(env, agent, cell.seed))
            figures = figures_of_all(recordings, env.robot, remembering, capsules)
            if not shown:
                shown.append(_shown(recordings[0], mapping, figures[0].bound))
            if fold == 0:
                observation, _ = env.reset(seed=cell.seed)
                agent.reset(1, cell.seed)
                timing["latency"] = latency(mapping, agent, recordings[0].operator, observation)
            return [_row(cell, fold, one.to_dict()) for one in figures]
        finally:
            env.close()

    def _capsules_of(self, robot: Robot) -> CapsuleModel:
        from syda_gym.simulation.capsules import CapsuleModel

        if robot.name not in self._capsules:
            self._capsules[robot.name] = CapsuleModel(robot)
        return self._capsules[robot.name]

    def _agent(self, cell: Cell, settings: dict[str, Any], mapping: Mapping, group: Sequence[str], env: Any) -> Agent:
        from syda_gym.agents.bundle import load_agent
        from syda_gym.agents.classical.rivals import RIVALS, make_rival
        from syda_gym.agents.interface import Interface

        if cell.agent in RIVALS:
            return make_rival(cell.agent, Interface.of(env))
        if cell.agent != "residual":
            return load_agent(cell.agent, env)
        from syda_gym.agents.residual.config import ResidualConfig
        from syda_gym.agents.residual.residual_training import train_residual

        known = self._motions.pair(cell.route[0], cell.route[-1]).action_names
        training = [name for name in known if name not in group]
        if not training:
            raise AgentError("a residual needs actions to train on, but every action is held out")
        options = {
            "operator": cell.route[0],
            "robot": cell.route[-1],
            "mapping": mapping,
            "motions": self._motions,
            "actions": training,
            "reference": "mapped",
            "control_hz": settings["control_hz"],
            "disturbances": None if cell.disturbance == "none" else cell.disturbance,
        }
        return train_residual(options, ResidualConfig(steps=settings["residual_steps"]), seed=cell.seed).agent

    def _efficiency(self, cell: Cell, tell: Tell) -> tuple[list[dict[str, Any]], dict[str, float]]:
        """Fits the new body's link on a few actions and everything else on all, and maps the held-out actions."""
        settings = json.loads(cell.settings)
        links = self._links_of(cell.method, cell.seed, settings)
        pair = self._motions.pair(cell.route[0], cell.route[-1])
        edges = list(zip(cell.route[:-1], cell.route[1:], strict=True))
        new = 0 if cell.new_body == cell.route[0] else len(edges) - 1
        folds = _folds(links, pair)
        start = time.perf_counter()
        scarce = self._scarce(cell, links, edges[new], [group for _, group in folds], settings)
        timing = {"fit": time.perf_counter() - start, "play": 0.0, "latency": 0.0}
        rows: list[dict[str, Any]] = []
        for place, ((_, group), few) in enumerate(zip(folds, scarce, strict=True)):
            tell(0.5 + 0.5 * place / len(folds))
            chain = [few if i == new else links.link(*edge, group) for i, edge in enumerate(edges)]
            rows += _map(cell, _joined(chain), pair.only_actions(group), folds[place][0])
        return rows, timing

    def _scarce(
        self, cell: Cell, links: Links, edge: tuple[str, str], groups: list[tuple[str, ...]], settings: dict[str, Any]
    ) -> list[Mapping]:
        """The new body's link for every fold, fitted on ``cell.actions`` of the actions that remain."""
        from syda_gym.mappings.fitting.fit import fit_many

        pair = links.pair(*edge)
        training = []
        for fold, group in enumerate(groups):
            left = [name for name in pair.action_names if name not in group]
            if cell.actions > len(left):
                raise MappingError(
                    f"{edge[0]}>{edge[1]} has {len(left)} actions beside the held-out ones, "
                    f"{cell.actions} were asked for"
                )
            order = np.random.default_rng([cell.draw, fold]).permutation(len(left))
            training.append(pair.only_actions([left[i] for i in order[: cell.actions]]))
        method, preset = split_method(cell.method)
        options = settings.get("fit", {}).get(cell.method, {})
        return list(fit_many(training, method, preset, [cell.seed] * len(training), **options))

    def _links_of(self, method: str, seed: int, settings: dict[str, Any]) -> Links:
        options = settings.get("fit", {}).get(method, {})
        key = (method, seed, settings["folds"], json.dumps(options, sort_keys=True))
        if key not in self._links:
            name, preset = split_method(method)
            groups = folds_of(self._motions, settings["folds"])
            self._links[key] = Links(self._motions, name, preset, seed, groups=groups, **options)
            while len(self._links) > _KEPT_LINKS:
                self._links.popitem(last=False)
        self._links.move_to_end(key)
        return self._links[key]


def _folds(links: Links, pair: PairedMotions) -> list[tuple[int, tuple[str, ...]]]:
    """The groups that have actions of a pair, with their numbers, and only those actions."""
    known = set(pair.action_names)
    chosen = [tuple(name for name in group if name in known) for group in links.groups]
    return list(enumerate(group for group in chosen if group))


def _map(cell: Cell, mapping: Mapping, test: PairedMotions, fold: int) -> list[dict[str, Any]]:
    """Rows of a chain that is not played: one a clip, by the mapping alone."""
    rows = []
    for clip in test.clips():
        predicted = mapping(clip.source.frames)
        errors = landmark_error(mapping.target, predicted, clip.target.frames)
        try:
            bound = mapping.error_bound(clip.source.frames)
            covered, width = float((errors.mean(axis=1) <= bound).mean()), float(bound.mean())
        except MappingError:
            covered, width = math.nan, math.nan
        figures: dict[str, Any] = {name: math.nan for name in FIGURES}
        mean = float(errors.mean())
        figures |= {
            "motion": clip.name,
            "action": clip.source.action,
            "frames": len(clip),
            "landmark_error": mean,
            "mapping_error": mean,
            "landmarks": tuple(errors.mean(axis=0).tolist()),
            "coverage": covered,
            "bound": width,
        }
        rows.append(_row(cell, fold, figures))
    return rows


def _shown(recording: Recording, mapping: Mapping, bound: float) -> dict[str, Any]:
    """A recording small enough to be stored: frames of every body at 15 Hz, rounded to a tenth of a millimetre."""
    stride = max(1, round(recording.fps / _SHOWN_HZ))
    frames = [recording.operator[::stride]]
    for link in list(getattr(mapping, "links", (mapping,)))[:-1]:
        frames.append(link(frames[-1]))
    frames.append(recording.q[::stride])
    return {
        "motion": recording.motion,
        "fps": recording.fps / stride,
        "frames": [np.round(part, 4).tolist() for part in frames],
        "reference": np.round(recording.reference[::stride], 4).tolist(),
        "error": np.round(recording.landmark_error.mean(axis=1)[::stride], 4).tolist(),
        "bound": round(bound, 4) if math.isfinite(bound) else None,
    }


def _row(cell: Cell, fold: int, figures: dict[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "kind": cell.kind,
        "route": ">".join(cell.route),
        "method": cell.method,
        "agent": cell.agent,
        "disturbance": cell.disturbance,
        "seed": cell.seed,
        "actions": cell.actions,
        "draw": cell.draw,
        "fold": fold,
    }
    row |= {name: figures[name] for name in ("motion", "action", "frames", *FIGURES)}
    row["success"] = None if isinstance(row["success"], float) else int(row["success"])
    row["landmarks"] = list(figures["landmarks"])
    return {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in row.items()}


def _joined(links: list[Mapping]) -> Mapping:
    from syda_gym.mappings.chain import ChainMapping

    return links[0] if len(links) == 1 else ChainMapping(links)


def _single_thread() -> None:
    """More threads would not be faster on such small arrays, and might change the last bits."""
    import torch

    torch.set_num_threads(1)
