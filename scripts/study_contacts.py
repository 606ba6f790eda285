"""The study of contacts: a policy on top of the projection, beside base, lead and projection, judged in Bullet.

    python scripts/study_contacts.py --out study-contacts --seeds 2

Trained in the servo model with the capsule model's distances; tested in Bullet with self-collision on motions of
gesture families that training never saw. Motions during which the base never touches anything count as free of contact.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical import make_rival
from syda_gym.agents.config import ResidualConfig
from syda_gym.agents.interface import Interface
from syda_gym.agents.recording import Ground
from syda_gym.agents.rollout import EpisodeResult, evaluate
from syda_gym.agents.training import train_residual
from syda_gym.envs.options import TeleopOptions
from syda_gym.files import asset, read_json, write_json
from syda_gym.mappings.storage import load_mapping
from syda_gym.motions.synthetic import generate

TRAIN = ("reach", "wave", "point", "lift", "circle", "push", "work")
TEST = ("cross", "clap", "signal", "swing")
PHYSICS_HZ = 240.0


def options(families: tuple[str, ...], seed: int, variants: int, **changes: Any) -> TeleopOptions:
    """Nothing but the motors' lag disturbs; the reference is what the mapping asks for, contact or not."""
    motions = generate(("adult",), seed=seed, families=families, variants=variants, noise=0.0)
    values: dict[str, Any] = {
        "mapping": load_mapping(asset("mappings", "adult-pepper")),
        "motions": motions,
        "reference": "mapped",
        "physics": "servo",
        "physics_hz": PHYSICS_HZ,
        "disturbances": "teleop:lag:test",
    }
    return TeleopOptions(**{**values, **changes})


def train(out: Path, seeds: int, steps: int) -> None:
    """One policy per seed."""
    ground: Ground | None = None
    for seed in range(seeds):
        if (out / f"policy-{seed}.json").is_file():
            continue
        ground = ground or Ground(options(TRAIN, 101, 2, physics_hz=60.0))
        config = ResidualConfig.preset("contact", steps=steps)
        began = time.process_time()
        trained = train_residual(ground, config, seed=seed)
        seconds = round(time.process_time() - began, 1)
        curve = [{"steps": leg.steps, **leg.policy.as_dict()} for leg in trained.history]
        save_agent(
            trained.agent,
            out / f"policy-{seed}",
            training={"seed": seed, "config": config.as_dict(), "cpu_seconds": seconds},
            figures={"validation_curve": curve},
        )
        print(f"policy {seed}: {seconds} s of CPU", [(p["steps"], round(p["J"], 2), p["contact_steps"]) for p in curve])


def judge(out: Path) -> None:
    """Every agent on the test motions, in Bullet with self-collision."""
    test = options(TEST, 103, 1, physics="bullet", self_collision=True)
    robot_ground = Ground(options(TEST, 103, 1))
    interface: Interface = robot_ground.interface
    agents = {
        "base": make_rival("base", interface),
        "lead": make_rival("lead", interface),
        "projection": make_rival("projection", interface, margin=0.008),
        "projection_lead": make_rival("projection_lead", interface, margin=0.008),
    }
    agents |= {path.stem: load_agent(path, interface) for path in sorted(out.glob("policy-*.json"))}
    results = evaluate(test, agents, seed=9000)
    free = np.array([result.contacts.max() == 0 for result in results["base"]])
    write_json(out / "test.json", {name: _rows(found, free) for name, found in results.items()})


def _rows(found: list[EpisodeResult], free: np.ndarray[Any, np.dtype[np.bool_]]) -> list[dict[str, Any]]:
    return [{"motion": r.motion, "free": bool(f), **r.figures.as_dict()} for r, f in zip(found, free, strict=True)]


def report(out: Path) -> None:
    """Prints the table of the study."""
    rows = read_json(out / "test.json")
    base = rows["base"]
    print("| agent | contact steps | against base | error on free motions | J, all motions |")
    print("|---|---|---|---|---|")
    for name, found in rows.items():
        touched, touched_base = (np.mean([r["contact_steps"] for r in x]) for x in (found, base))
        free = [np.mean([r["landmark_mm"] for r in x if r["free"]]) for x in (found, base)]
        print(
            f"| {name} | {100 * touched:.1f} % | {100 * (touched / touched_base - 1):+.0f} % | "
            f"{free[0]:.2f} mm ({100 * (free[0] / free[1] - 1):+.0f} %) | {np.mean([r['J'] for r in found]):.2f} |"
        )


def main() -> None:
    """Trains what is missing, judges, prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("study-contacts"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=100_000)
    given = parser.parse_args()
    train(given.out, given.seeds, given.steps)
    judge(given.out)
    report(given.out)


if __name__ == "__main__":
    main()
