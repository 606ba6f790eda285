"""The study of agents: tunes rivals, trains predictors and residual policies, touches the test motions once, in Bullet.

    python scripts/study_agents.py --out study --seeds 5            # everything, resumable: finished parts are kept
    python scripts/study_agents.py --out study --stages evaluate report

Motions are generated: training, validation and test motions are of different gesture families; tuning, training and
selection never see the test families or the test level of disturbances. Every part is written as soon as it is done, so
that an interrupted study goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent, BaseAlone
from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical import CONTACT_RIVALS, RIVALS, make_rival
from syda_gym.agents.config import ResidualConfig
from syda_gym.agents.figures import Figures
from syda_gym.agents.interface import Interface
from syda_gym.agents.predictor_training import PredictorConfig, train_predictor
from syda_gym.agents.recording import Ground
from syda_gym.agents.rollout import EpisodeResult, evaluate
from syda_gym.agents.streams import score_streams
from syda_gym.agents.training import train_on_streams
from syda_gym.agents.tuning import tune
from syda_gym.envs.options import TeleopOptions
from syda_gym.files import asset, read_json, write_json
from syda_gym.mappings.mapping import Mapping
from syda_gym.mappings.storage import load_mapping
from syda_gym.motions.clip import Motions
from syda_gym.motions.synthetic import generate

TRAIN = ("reach", "wave", "point", "lift", "circle", "push", "work")
VALIDATION = ("swing", "bow")
TEST = ("cross", "clap", "signal")
CELLS = ("lag", "noise", "latency", "noise+latency", "full")
PREDICTED = ("full", "noise", "latency", "noise+latency")
LATE = ("latency", "noise+latency", "full")  # cells whose predictor stands on the Kalman filter
PHYSICS_HZ = 60.0


@dataclass(frozen=True)
class Size:
    """How much of everything; ``small`` is for trying the script."""

    variants: int = 4
    episodes: int = 200
    tuning_episodes: int = 40
    validation_episodes: int = 24
    budget: int = 20
    iterations: int = 300
    steps: int = 300_000
    test_variants: int = 1


SIZES = {"full": Size(), "small": Size(1, 48, 12, 8, 3, 24, 20_000, 1)}


class Study:
    """Motions, mapping and folders of one study.

    Args:
        out: where everything is written.
        seeds: number of seeds per learned condition.
        size: of ``SIZES``.
        route: bodies from the operator to the robot.
    """

    def __init__(self, out: Path, seeds: int, size: str, route: tuple[str, ...]) -> None:
        self.out, self.seeds, self.size = out, seeds, SIZES[size]
        self.route = route
        self.mapping = self._mapping(route)
        self._grounds: dict[tuple[str, str], Ground] = {}

    def _mapping(self, route: tuple[str, ...]) -> Mapping:
        """The shipped mappings in series; what agents repair is measured against the same mapping, undisturbed."""
        links = [load_mapping(asset("mappings", f"{a}-{b}")) for a, b in zip(route[:-1], route[1:], strict=True)]
        mapping = links[0]
        for link in links[1:]:
            mapping = mapping >> link
        return mapping

    def options(self, motions: Motions, cell: str, level: str, **changes: Any) -> TeleopOptions:
        """Options of the environment; the reference is the mapping of the undisturbed operator."""
        values: dict[str, Any] = {
            "operator": self.route[0],
            "robot": self.route[-1],
            "mapping": self.mapping,
            "motions": motions,
            "reference": "mapped",
            "physics": "servo",
            "physics_hz": PHYSICS_HZ,
            "disturbances": f"teleop:{cell}:{level}",
        }
        return TeleopOptions(**{**values, **changes})

    def ground(self, part: str, cell: str) -> Ground:
        """Training or validation motions under a cell's range of disturbances."""
        if (part, cell) not in self._grounds:
            known = next((g for (p, _), g in self._grounds.items() if p == part), None)
            if known is None:
                motions = self.motions(part)
                known = Ground(self.options(motions, cell, "train"))
            ground = object.__new__(Ground)
            ground.__dict__.update(known.__dict__)
            ground.options = replace(known.options, disturbances=f"teleop:{cell}:train")
            self._grounds[part, cell] = ground
        return self._grounds[part, cell]

    def motions(self, part: str) -> Motions:
        """Clean motions of the operator; the disturbances bring the noise."""
        families = {"train": TRAIN, "validation": VALIDATION, "test": TEST}[part]
        seed = {"train": 101, "validation": 102, "test": 103}[part]
        variants = {"train": self.size.variants, "validation": 2, "test": self.size.test_variants}[part]
        return generate((self.route[0],), seed=seed, families=families, variants=variants, noise=0.0, name=part)

    def folder(self, cell: str) -> Path:
        """Where a cell's agents are."""
        return self.out / cell.replace("+", "-")

    def rivals(self, cell: str) -> dict[str, Agent]:
        """The tuned rivals of a cell."""
        stored = read_json(self.folder(cell) / "rivals.json")
        interface = self.ground("validation", cell).interface
        return {name: make_rival(name, interface, **entry["settings"]) for name, entry in stored.items()}

    def best_rival(self, cell: str) -> str:
        """The rival with the least objective on the validation motions."""
        stored = read_json(self.folder(cell) / "rivals.json")
        return min(stored, key=lambda name: float(stored[name]["validation"]["J"]))


def tune_rivals(study: Study) -> None:
    """Fits every rival to every cell on training motions, and notes its figures on validation motions."""
    for cell in CELLS:
        path = study.folder(cell) / "rivals.json"
        if path.is_file():
            continue
        train, validation = study.ground("train", cell), study.ground("validation", cell)
        streams = train.record(study.size.tuning_episodes, seed=zlib.crc32(cell.encode()), clips=_spread(train, study))
        judged = validation.record(study.size.validation_episodes, seed=7)
        found = {}
        for name in [name for name in RIVALS if name not in CONTACT_RIVALS]:
            began = time.perf_counter()

            def score(agent: Agent) -> Figures:
                return score_streams(agent, streams, train.rates)  # noqa: B023 (used within this turn only)

            tuned = tune(name, train.interface, score, budget=study.size.budget)
            figures = score_streams(tuned.build(train.interface), judged, train.rates)
            found[name] = {
                "settings": dict(tuned.settings),
                "training": tuned.figures.as_dict(),
                "validation": figures.as_dict(),
                "seconds": round(time.perf_counter() - began, 1),
            }
            print(f"{cell:14} {name:14} J {figures.objective:6.2f}", flush=True)
        write_json(path, found)


def train_predictors(study: Study) -> None:
    """One predictor per cell and seed."""
    for seed in range(study.seeds):
        for cell in PREDICTED:
            path = study.folder(cell) / f"predictor-{seed}.json"
            if path.is_file():
                continue
            train, validation = study.ground("train", cell), study.ground("validation", cell)
            base: Agent = BaseAlone(train.interface)
            if cell in LATE:
                lead = study.rivals(cell)["kalman"]
                base = lead.base if lead.base is not None else lead
            began = time.perf_counter()
            trained = train_predictor(
                base,
                train.record(study.size.episodes, seed=1000 + seed),
                validation.record(study.size.validation_episodes, seed=7),
                train.rates,
                PredictorConfig(iterations=study.size.iterations),
                seed=seed,
            )
            seconds = round(time.perf_counter() - began, 1)
            curve = [figures.as_dict() for figures in trained.history]
            _store(study, cell, f"predictor-{seed}", trained.agent, seed, seconds, curve)
            print(f"{cell:14} predictor {seed}: J {curve[trained.best]['J']:.2f} in {seconds} s", flush=True)


def train_residuals(study: Study) -> None:
    """Residual policies on the best rival of the full suite."""
    cell = "full"
    for seed in range(study.seeds):
        if (study.folder(cell) / f"residual-{seed}.json").is_file():
            continue
        train, validation = study.ground("train", cell), study.ground("validation", cell)
        base = study.rivals(cell)[study.best_rival(cell)]
        began = time.perf_counter()
        trained = train_on_streams(
            base,
            train.record(study.size.episodes, seed=2000 + seed),
            validation.record(study.size.validation_episodes, seed=7),
            train.rates,
            ResidualConfig.preset("teleop", steps=study.size.steps, legs=5),
            seed=seed,
        )
        seconds = round(time.perf_counter() - began, 1)
        curve = [{"steps": leg.steps, **leg.policy.as_dict()} for leg in trained.history]
        _store(study, cell, f"residual-{seed}", trained.agent, seed, seconds, curve)
        print(f"{cell:14} residual {seed}: J {curve[trained.best]['J']:.2f} in {seconds} s", flush=True)


def evaluate_all(study: Study) -> None:
    """The one look at the test motions: every agent of every cell, in Bullet."""
    motions = study.motions("test")
    for cell, level in [*((cell, "test") for cell in CELLS), ("full", "harsh")]:
        path = study.folder(cell) / f"test-{level}.json"
        if path.is_file():
            continue
        agents = study.rivals(cell)
        interface = study.ground("validation", cell).interface
        agents |= {p.stem: load_agent(p, interface) for p in sorted(study.folder(cell).glob("predictor-*.json"))}
        full = study.rivals("full")[study.best_rival("full")]
        agents["full_rival"] = full
        agents |= {p.stem: load_agent(p, interface) for p in sorted(study.folder("full").glob("residual-*.json"))}
        if cell != "full":
            agents |= {
                f"full_{p.stem}": load_agent(p, interface)
                for p in sorted(study.folder("full").glob("predictor-*.json"))
            }
        options = study.options(motions, cell, level, physics="bullet")
        results = evaluate(options, agents, draws=1, seed=5000)
        rows = {
            name: [
                {"motion": r.motion, "action": r.action, "feasible": _feasible(r, interface), **r.figures.as_dict()}
                for r in found
            ]
            for name, found in results.items()
        }
        write_json(path, rows)
        print(f"{cell} {level}: {len(next(iter(rows.values())))} episodes each of {len(agents)} agents", flush=True)


def stored_seeds(folder: Path) -> list[Path]:
    """Cards of the trained agents of a cell."""
    return sorted(folder.glob("*-[0-9].json"))


def _spread(ground: Ground, study: Study) -> list[int]:
    """Training clips spread over all actions."""
    return np.linspace(0, ground.clips - 1, min(study.size.tuning_episodes, ground.clips)).round().astype(int).tolist()


def _feasible(result: EpisodeResult, interface: Interface) -> bool:
    """Whether the reference keeps the joints' speed limits; where it jumps, no agent can follow."""
    fastest = np.abs(np.diff(result.reference, axis=0)).max(axis=0)
    return bool((fastest <= interface.robot.speed * interface.dt).all())


def _store(
    study: Study, cell: str, name: str, agent: Agent, seed: int, seconds: float, curve: list[dict[str, Any]]
) -> None:
    training = {
        "script": "scripts/study_agents.py",
        "cell": cell,
        "seed": seed,
        "seconds": seconds,
        "route": list(study.route),
        "size": json.loads(json.dumps(study.size.__dict__)),
        "families": list(TRAIN),
    }
    save_agent(
        agent,
        study.folder(cell) / name,
        mapping={"route": list(study.route), "method": "syda", "preset": "general", "motions": "embedded"},
        training=training,
        figures={"validation_curve": curve},
    )


def main() -> None:
    """Runs the stages that are asked for."""
    stages: dict[str, Callable[[Study], None]] = {
        "tune": tune_rivals,
        "predict": train_predictors,
        "residual": train_residuals,
        "evaluate": evaluate_all,
    }
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("study"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--size", choices=sorted(SIZES), default="full")
    parser.add_argument("--route", nargs="+", default=["adult", "pepper"])
    parser.add_argument("--stages", nargs="+", choices=sorted(stages), default=list(stages))
    given = parser.parse_args()
    study = Study(given.out, given.seeds, given.size, tuple(given.route))
    for stage in given.stages:
        stages[stage](study)


if __name__ == "__main__":
    main()
