"""The study of unknown dynamics: policies that read their history, beside rivals tuned for the same, in Bullet.

    python scripts/study_dynamics.py --out study-dynamics --seeds 5                 # finished parts are kept
    python scripts/study_dynamics.py --out study-dynamics --seeds 5 --stages tune   # one part

Motors at 65 to 100 % of their gain and speed, up to 0.6 kg in each hand and friction that eats up to 30 % of the effort
are drawn anew for every episode and change within it (``disturbances="dynamics"``); nobody is told.

1. `tune`: lead, Kalman filter with lead and adaptive lead, on training motions, in Bullet.
2. `predict`: a predictor per seed, by regression through the motors as each episode has them, the tuned lead on top.
3. `policy`: PPO per seed, with the last base commands and joint angles in its observation, on the rival that is best on
   validation motions in Bullet. The best of its legs by validation is kept, the untrained one among them.
4. `test`: once, in Bullet, on gesture families that neither training nor selection saw, several draws a motion.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent
from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical.rivals import RIVALS, Range, make_rival
from syda_gym.agents.classical.tuning import tune
from syda_gym.agents.figures import Figures
from syda_gym.agents.interface import Interface
from syda_gym.agents.predictor.predictor_training import PredictorConfig, train_predictor
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.residual.residual_training import train_on_streams
from syda_gym.agents.rollout import evaluate, mean_of
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import Streams
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.files import asset, read_json, write_json
from syda_gym.mappings.storage import load_mapping
from syda_gym.motions.synthetic.generator import generate

TRAIN = ("reach", "point", "lift", "push", "work", "circle")
VALIDATION = ("swing", "bow", "wave")
TEST = ("cross", "clap", "signal")
TEST_MOTIONS = 103  # seed
STAGES = ("tune", "predict", "policy", "test", "report")
RANGES = {
    "lead": {"strength": Range(0.5, 2.0)},
    "kalman": {**RIVALS["kalman"].ranges, "strength": Range(0.5, 2.0)},
    "adaptive_lead": {**RIVALS["adaptive_lead"].ranges, "strength": Range(0.7, 1.5)},
}
"""A lead may be stronger than the nominal one here, since motors are never stronger than nominal."""

BUDGET = {"lead": 10, "kalman": 32, "adaptive_lead": 48}
EVERY = 1  # of the training motions, for tuning: with a third of them two jumps of the mapping decided
HISTORY = 4
VARIANTS = 4
EPISODES = 160
HELD = 48
DRAWS = 2
VALIDATION_DRAWS = 6  # one motion, in which the mapping jumps, differs by ten in J from one robot to the next
LEARNED = ("predictor", "policy")
BAR = 0.95
PREDICTOR = {"iterations": 400, "rounds": 4, "bound": 0.3}
POLICY = {
    "base": "base", "steps": 80_000, "legs": 4, "learning_rate": 4e-4, "scale": 0.15, "smoothing": 0.5,
    "log_std": -3.0, "rollout": 64, "batch": 2048,
}  # fmt: skip
"""What differs from the preset ``teleop``: smaller corrections and less exploration, whose noise costs more than the
error that is left to repair."""


def options(families: tuple[str, ...], seed: int, variants: int, **changes: Any) -> TeleopOptions:
    """The reference is what the mapping asks for; nothing but the robot itself is unknown."""
    values: dict[str, Any] = {
        "mapping": load_mapping(asset("mappings", "adult-pepper")),
        "motions": generate(("adult",), seed=seed, families=families, variants=variants, noise=0.0),
        "reference": "mapped",
        "physics": "servo",
        "physics_hz": 60.0,
        "history": HISTORY,
        "disturbances": "dynamics:train",
    }
    return TeleopOptions(**{**values, **changes})


def in_bullet(families: tuple[str, ...], seed: int, level: str = "train") -> TeleopOptions:
    """Motions as they are judged."""
    return options(families, seed, 1, physics="bullet", physics_hz=240.0, disturbances=f"dynamics:{level}")


def interface_of(families: tuple[str, ...], seed: int) -> Interface:
    """Of the environments that are judged in."""
    return Ground(options(families, seed, 1, physics_hz=240.0)).interface


def tune_rivals(out: Path) -> None:
    """Settings of the rivals, on training motions in Bullet."""
    judged, interface = in_bullet(TRAIN, 101), interface_of(TRAIN, 101)
    clips = range(0, Ground(options(TRAIN, 101, 1)).clips, EVERY)

    def score(agent: Agent) -> Figures:
        return mean_of(evaluate(judged, {"agent": agent}, clips=clips, seed=9000)["agent"])

    for name, ranges in RANGES.items():
        path = out / "tuned" / f"{name}.json"
        if not path.is_file():
            found = tune(name, interface, score, budget=BUDGET[name], ranges=ranges)
            about = {"settings": dict(found.settings), "figures": found.figures.as_dict(), "tried": found.tried}
            write_json(path, about)
            print(name, about, flush=True)


def rivals(out: Path, interface: Interface) -> dict[str, Agent]:
    """The base and the tuned rivals."""
    agents = {"base": make_rival("base", interface)}
    for name in RANGES:
        agents[name] = make_rival(name, interface, **read_json(out / "tuned" / f"{name}.json")["settings"])
    return agents


def lessons(seed: int) -> tuple[Ground, Streams, Streams]:
    """Episodes to learn from and episodes to choose by."""
    ground, held = Ground(options(TRAIN, 101, VARIANTS)), Ground(options(VALIDATION, 102, 1))
    return ground, ground.record(EPISODES, seed=2 * seed), held.record(HELD, seed=2 * seed + 1)


def predict(out: Path, seeds: int) -> None:
    """One predictor per seed."""
    strength = float(read_json(out / "tuned" / "lead.json")["settings"]["strength"])
    for seed in range(seeds):
        path = out / f"predictor-{seed}"
        if path.with_suffix(".json").is_file():
            continue
        ground, taught, held = lessons(seed)
        began, config = time.process_time(), PredictorConfig(**PREDICTOR, strength=strength)
        below = make_rival("base", ground.interface)
        trained = train_predictor(below, taught, held, ground.rates, config, seed=seed)
        curve = [figures.objective for figures in trained.history]
        about = {"seed": seed, "cpu_seconds": round(time.process_time() - began, 1), "validation_J_in_servo": curve}
        save_agent(trained.agent, path, training=about, figures={})
        print(path.name, about, flush=True)


def validate(out: Path, seeds: int) -> dict[str, float]:
    """J of every rival on the validation motions in Bullet."""
    path = out / "validation.json"
    if not path.is_file():
        interface = interface_of(VALIDATION, 102)
        agents = rivals(out, interface)
        agents |= {f"predictor-{seed}": load_agent(out / f"predictor-{seed}", interface) for seed in range(seeds)}
        found = evaluate(in_bullet(VALIDATION, 102), agents, draws=VALIDATION_DRAWS, seed=9000)
        write_json(path, {name: mean_of(results).as_dict() for name, results in found.items()})
    return {name: float(figures["J"]) for name, figures in read_json(path).items()}


def below_policy(out: Path, seed: int, seeds: int, interface: Interface) -> Agent:
    """What a policy stands on: the best on validation motions, the predictors by their mean."""
    found = validate(out, seeds)
    predictors = float(np.mean([found.pop(f"predictor-{index}") for index in range(seeds)]))
    best = min(found, key=lambda name: found[name])
    if predictors < found[best]:
        return load_agent(out / f"predictor-{seed}", interface)
    return rivals(out, interface)[best]


def train_policies(out: Path, seeds: int, only: int | None = None) -> None:
    """One policy per seed, or that of one seed."""
    for seed in range(seeds) if only is None else [only]:
        path = out / f"policy-{seed}"
        if path.with_suffix(".json").is_file():
            continue
        ground, taught, held = lessons(seed)
        began, config = time.process_time(), ResidualConfig.preset("teleop", **POLICY)
        below = below_policy(out, seed, seeds, ground.interface)
        trained = train_on_streams(below, taught, held, ground.rates, config, seed=seed)
        curve = [leg.policy.objective for leg in trained.history]
        about = {
            "seed": seed, "cpu_seconds": round(time.process_time() - began, 1), "config": config.as_dict(),
            "kept_leg": trained.best, "validation_J_in_servo": curve,
        }  # fmt: skip
        save_agent(trained.agent, path, training=about, figures={})
        print(path.name, about, flush=True)


def judge(out: Path, seeds: int, motions: int, only: str | None = None) -> None:
    """Every agent on the test motions of a seed, or one of them, in Bullet; what was played is kept agent by agent."""
    interface, judged = interface_of(TEST, motions), in_bullet(TEST, motions, "test")
    names = list(rivals(out, interface)) + [f"{kind}-{seed}" for kind in LEARNED for seed in range(seeds)]
    for name in names if only is None else [only]:
        path = played(out, motions) / f"{name}.json"
        if not path.is_file():
            agent = load_agent(out / name, interface) if name not in RIVALS else rivals(out, interface)[name]
            results = evaluate(judged, {name: agent}, draws=DRAWS, seed=9000)[name]
            write_json(path, [{"motion": result.motion, **result.figures.as_dict()} for result in results])
            print(name, mean_of(results).as_dict(), flush=True)


def played(out: Path, motions: int) -> Path:
    """Folder of what was played on the test motions of a seed."""
    return out / "test" if motions == TEST_MOTIONS else out / f"test-{motions}"


def report(out: Path, seeds: int, motions: int) -> None:
    """Prints the table of the study and writes everything that is known."""
    folder = played(out, motions)
    rows = {name: read_json(folder / f"{name}.json") for name in ("base", *RANGES)}
    for kind in LEARNED:
        found_by_seed = [read_json(folder / f"{kind}-{seed}.json") for seed in range(seeds)]
        rows[kind] = [row for found in found_by_seed for row in found]
    listed = [name for name in rows if name not in ("policy", "adaptive_lead")]
    best = min(listed, key=lambda name: float(np.mean([row["J"] for row in rows[name]])))
    table = {name: _summary(found, rows[best]) for name, found in rows.items()}
    result = {
        "command": f"python scripts/study_dynamics.py --out study-dynamics --seeds {seeds} --test-motions {motions}",
        "bar": BAR,
        "best_rival": best,
        "test_in_bullet": table,
        "validation_in_bullet": read_json(out / "validation.json"),
        "tuned": {name: read_json(out / "tuned" / f"{name}.json") for name in RANGES},
        "predictors": [read_json(out / f"predictor-{seed}.json")["training"] for seed in range(seeds)],
        "policies": [read_json(out / f"policy-{seed}.json")["training"] for seed in range(seeds)],
        "policy_stands_on": read_json(out / "policy-0.json")["stack"],
        "test_motions": rows,
    }
    write_json(out / ("table.json" if motions == TEST_MOTIONS else f"table-{motions}.json"), result)
    print(f"| agent | landmark error [mm] | joint error [mrad] | jitter | J | of {best} | median over motions |")
    print("|---|---|---|---|---|---|---|")
    for name, row in table.items():
        print(
            f"| {name} | {row['landmark_mm']:.2f} | {row['joint_mrad']:.2f} | {row['jitter']:.2f} | {row['J']:.2f} | "
            f"{row['ratio']:.3f} ({row['ratio_low']:.3f} to {row['ratio_high']:.3f}) | {row['median_ratio']:.3f} |"
        )


def _summary(found: list[dict[str, Any]], rival: list[dict[str, Any]]) -> dict[str, float]:
    """Means, and J against the best rival's on the same episodes, with an interval over motions."""
    names = ("landmark_mm", "joint_mrad", "jitter", "J")
    means = {key: float(np.mean([row[key] for row in found])) for key in names}
    motions = sorted({row["motion"] for row in found})
    mine, theirs = (
        np.array([np.mean([row["J"] for row in rows if row["motion"] == motion]) for motion in motions])
        for rows in (found, rival)
    )
    rng = np.random.default_rng(0)
    draws = rng.integers(len(motions), size=(2000, len(motions)))
    low, high = np.quantile(mine[draws].mean(axis=1) / theirs[draws].mean(axis=1), (0.025, 0.975))
    ratio = float(mine.mean() / theirs.mean())
    median = float(np.median(mine / theirs))
    return {**means, "ratio": ratio, "ratio_low": float(low), "ratio_high": float(high), "median_ratio": median}


def main() -> None:
    """Does what is missing and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("study-dynamics"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--test-motions", type=int, default=TEST_MOTIONS, help="seed of the generated test motions")
    parser.add_argument("--stages", nargs="+", choices=STAGES, default=STAGES)
    given = parser.parse_args()
    stages = {
        "tune": lambda: tune_rivals(given.out),
        "predict": lambda: predict(given.out, given.seeds),
        "policy": lambda: train_policies(given.out, given.seeds),
        "test": lambda: judge(given.out, given.seeds, given.test_motions),
        "report": lambda: report(given.out, given.seeds, given.test_motions),
    }
    for stage in given.stages:
        stages[stage]()


if __name__ == "__main__":
    main()
