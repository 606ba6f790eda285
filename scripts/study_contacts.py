"""The study of contacts: a network that is taught to keep clear, beside base, lead and projection, judged in Bullet.

    python scripts/study_contacts.py --out study-contacts --seeds 3                 # finished parts are kept
    python scripts/study_contacts.py --out study-contacts --seeds 3 --stages train  # one part

1. `tune`: the projection's margin, on training motions: least J among those with at least 80 % fewer contact steps.
2. `train`: a predictor on the tuned projection, by regression through the servo; overlap of the capsule model is paid
   for. Half of the episodes are training motions, half the same with smooth random detours, which touch more often.
3. `test`: once, in Bullet with self-collision, on gesture families that neither training nor selection saw. Bullet
   counts the contacts. Motions during which the base touches nothing count as free of contact.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical import make_rival
from syda_gym.agents.interface import Interface
from syda_gym.agents.predictor_training import PredictorConfig, train_predictor
from syda_gym.agents.projection import Projection, capsule_model
from syda_gym.agents.recording import Ground
from syda_gym.agents.rollout import EpisodeResult, evaluate
from syda_gym.agents.streams import Streams, join, score_streams
from syda_gym.envs.options import TeleopOptions
from syda_gym.files import asset, read_json, write_json
from syda_gym.mappings.limits import limit_speed
from syda_gym.mappings.storage import load_mapping
from syda_gym.motions.synthetic import generate

TRAIN = ("reach", "wave", "point", "lift", "circle", "push", "work")
VALIDATION = ("swing", "bow")
TEST = ("cross", "clap", "signal")
STAGES = ("tune", "train", "test", "report")
MARGINS = (0.0, 0.002, 0.005)
FEWER = 0.2  # share of the base's contact steps that may be left
DETOUR = (0.05, 0.25)  # rad, standard deviation of the random detours
KNOTS = 6
CONFIG = PredictorConfig(
    channels=32,
    iterations=1200,
    batch=24,
    window=40,
    bound=0.3,
    mirror=False,
    contact_weight=1.0,
)


def options(families: tuple[str, ...], seed: int, variants: int, **changes: Any) -> TeleopOptions:
    """Nothing but the motors' lag disturbs; the reference is what the mapping asks for, contact or not."""
    motions = generate(("adult",), seed=seed, families=families, variants=variants, noise=0.0)
    values: dict[str, Any] = {
        "mapping": load_mapping(asset("mappings", "adult-pepper")),
        "motions": motions,
        "reference": "mapped",
        "physics": "servo",
        "physics_hz": 60.0,
        "disturbances": "teleop:lag:test",
    }
    return TeleopOptions(**{**values, **changes})


def with_detours(streams: Streams, ground: Ground, rng: np.random.Generator) -> Streams:
    """The same episodes with smooth random detours of base command and reference alike."""
    base, robot = streams.base, ground.interface.robot
    episodes, steps, n = base.shape
    knots = rng.normal(0.0, 1.0, (episodes, KNOTS, n))
    detours = CubicSpline(np.arange(KNOTS), knots, axis=1)(np.linspace(0.0, KNOTS - 1.0, steps))
    moved = base + rng.uniform(*DETOUR, (episodes, 1, n)) * detours
    limited = limit_speed(robot, robot.clamp(moved.reshape(-1, n)).reshape(base.shape), 1.0 / ground.rates.dt)
    return replace(streams, base=limited, reference=limited)


def tune(out: Path) -> None:
    """The projection's margin, on training motions in the servo model."""
    path = out / "tuned.json"
    if path.is_file():
        return
    ground = Ground(options(TRAIN, 101, 1))
    clips = np.linspace(0, ground.clips - 1, 12).round().astype(int).tolist()
    streams, model = ground.record(clips=clips), capsule_model(ground.interface.robot)
    rows = {
        str(margin): score_streams(
            make_rival("projection_lead", ground.interface, margin=margin), streams, ground.rates, capsules=model
        )
        for margin in MARGINS
    }
    base = score_streams(BaseAlone(ground.interface), streams, ground.rates, capsules=model)
    allowed = [m for m in MARGINS if rows[str(m)].contact_steps <= FEWER * base.contact_steps]
    best = min(allowed or MARGINS[-1:], key=lambda margin: rows[str(margin)].objective)
    figures = {"base": base.as_dict(), **{name: figure.as_dict() for name, figure in rows.items()}}
    write_json(path, {"margin": best, "training_figures": figures})
    print(f"margin {best}", {name: (round(f["J"], 2), round(f["contact_steps"], 4)) for name, f in figures.items()})


def train(out: Path, seeds: int) -> None:
    """One network per seed."""
    margin = float(read_json(out / "tuned.json")["margin"])
    grounds: tuple[Ground, Ground] | None = None
    for seed in range(seeds):
        if (out / f"network-{seed}.json").is_file():
            continue
        grounds = grounds or (Ground(options(TRAIN, 101, 1)), Ground(options(VALIDATION, 102, 1)))
        rng = np.random.default_rng(seed)
        streams = [ground.record(seed=seed) for ground in grounds]
        streams = [join([s, with_detours(s, g, rng)]) for s, g in zip(streams, grounds, strict=True)]
        interface, began = grounds[0].interface, time.process_time()
        base = Projection(interface, BaseAlone(interface), margin=margin)
        trained = train_predictor(base, *streams, grounds[0].rates, CONFIG, seed=seed)
        seconds = round(time.process_time() - began, 1)
        curve = [figures.as_dict() for figures in trained.history]
        save_agent(
            trained.agent,
            out / f"network-{seed}",
            training={"seed": seed, "config": dict(vars(CONFIG)), "cpu_seconds": seconds},
            figures={"validation": curve[trained.best], "base": curve[0], "validation_curve": curve},
        )
        print(f"seed {seed}: {seconds} s of CPU", [(round(p["J"], 3), round(p["contact_steps"], 4)) for p in curve])


def test(out: Path, seeds: int) -> None:
    """Every agent on the test motions, in Bullet with self-collision."""
    path = out / "test.json"
    if path.is_file():
        return
    margin = float(read_json(out / "tuned.json")["margin"])
    ground = Ground(options(TEST, 103, 1, physics_hz=240.0))
    interface: Interface = ground.interface
    agents = {
        "base": make_rival("base", interface),
        "lead": make_rival("lead", interface),
        "projection": make_rival("projection", interface, margin=margin),
        "projection_lead": make_rival("projection_lead", interface, margin=margin),
    }
    agents |= {f"network-{seed}": load_agent(out / f"network-{seed}", interface) for seed in range(seeds)}
    judged = options(TEST, 103, 1, physics="bullet", physics_hz=240.0, self_collision=True)
    results = evaluate(judged, agents, seed=9000)
    free = np.array([result.contacts.max() == 0 for result in results["base"]])
    rows = {name: _rows(found, free) for name, found in results.items()}
    write_json(
        path, {"rows": rows, "capsules_against_bullet": _agreement(results["base"] + results["lead"], interface)}
    )


def _rows(found: list[EpisodeResult], free: np.ndarray[Any, np.dtype[np.bool_]]) -> list[dict[str, Any]]:
    return [{"motion": r.motion, "free": bool(f), **r.figures.as_dict()} for r, f in zip(found, free, strict=True)]


def _agreement(results: list[EpisodeResult], interface: Interface) -> dict[str, float]:
    """How often the capsule model and Bullet agree on whether anything touches, over steps of base and lead."""
    clear = capsule_model(interface.robot).clearance(np.concatenate([r.q for r in results]))
    touching = np.concatenate([r.contacts for r in results]) > 0
    return {
        "steps": len(touching),
        "bullet_touches": float(touching.mean()),
        "capsules_touch": float((clear < 0.0).mean()),
        "agree": float(((clear < 0.0) == touching).mean()),
        "agree_beyond_2_mm": float(((clear < 0.0) == touching)[np.abs(clear) > 0.002].mean()),
    }


def report(out: Path) -> None:
    """Prints the table of the study and writes its means."""
    rows = read_json(out / "test.json")["rows"]
    networks = [name for name in rows if name.startswith("network-")]
    table = {name: _summary(found, rows["base"]) for name, found in rows.items()}
    mean = {key: float(np.mean([table[name][key] for name in networks])) for key in table["base"]}
    table["network, mean of seeds"] = mean
    write_json(out / "table.json", table)
    print("| agent | landmark error [mm] | jitter | J | steps in contact | fewer than base | error on free motions |")
    print("|---|---|---|---|---|---|---|")
    for name, row in table.items():
        print(
            f"| {name} | {row['landmark_mm']:.2f} | {row['jitter']:.2f} | {row['J']:.2f} | "
            f"{100 * row['contact_steps']:.2f} % | {100 * row['fewer']:.0f} % | {row['free_mm']:.2f} mm |"
        )


def _summary(found: list[dict[str, Any]], base: list[dict[str, Any]]) -> dict[str, float]:
    means = {
        key: float(np.mean([row[key] for row in found]))
        for key in ("landmark_mm", "joint_mrad", "jitter", "contact_steps", "J")
    }
    touched = float(np.mean([row["contact_steps"] for row in base]))
    free = [row["landmark_mm"] for row in found if row["free"]]
    return {**means, "fewer": 1.0 - means["contact_steps"] / touched, "free_mm": float(np.mean(free))}


def main() -> None:
    """Does what is missing and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("study-contacts"))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--stages", nargs="+", choices=STAGES, default=STAGES)
    given = parser.parse_args()
    stages = {
        "tune": lambda: tune(given.out),
        "train": lambda: train(given.out, given.seeds),
        "test": lambda: test(given.out, given.seeds),
        "report": lambda: report(given.out),
    }
    for stage in given.stages:
        stages[stage]()


if __name__ == "__main__":
    main()
