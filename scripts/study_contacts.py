"""The study of contacts: sliding along the body and a policy below it, beside base, lead and projection, in Bullet.

    python scripts/study_contacts.py --out study-contacts --seeds 3                 # finished parts are kept
    python scripts/study_contacts.py --out study-contacts --seeds 3 --stages train  # one part

1. `tune`: margins of projection and of sliding, each with a lead, on every third training motion, in Bullet with
   self-collision: least J among the margins with at least 95 % fewer contact steps than the base.
2. `train`: policies by PPO on the lead, which are paid for what they save against the lead alone and pay for every step
   that comes near contact in the capsule model, so dearly that touching counts for more than following. Half of the
   episodes are training motions, half the same with smooth random detours, which touch more often. Behind them stands
   the tuned sliding.
3. `validate`: whether a policy or none is taken, on validation motions, in Bullet, by the same rule.
4. `test`: once, in Bullet with self-collision, on gesture families that neither training nor selection saw. Bullet
   counts the contacts. A motion is a success if nothing touches in it; those during which the base touches nothing
   count as free of contact.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from syda_gym.agents.agent import Agent
from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical.projection import capsule_model
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.classical.sliding import Sliding
from syda_gym.agents.figures import Figures
from syda_gym.agents.interface import Interface
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.residual.residual_training import train_on_streams
from syda_gym.agents.rollout import EpisodeResult, evaluate, mean_of
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import Streams, join
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.files import asset, read_json, write_json
from syda_gym.mappings.limits import limit_speed
from syda_gym.mappings.storage import load_mapping
from syda_gym.motions.synthetic.generator import generate

TRAIN = ("reach", "wave", "point", "lift", "circle", "push", "work")
VALIDATION = ("swing", "bow")
TEST = ("cross", "clap", "signal")
STAGES = ("tune", "train", "validate", "test", "report")
MARGINS = {
    "projection_lead": (0.006, 0.008, 0.012),
    "sliding_lead": (0.0005, 0.001, 0.002),
}
"""Margins that are tried [m]. Sliding looks at the shapes themselves, the projection at capsules inside them."""

FEWER = 0.05  # share of the base's contact steps that may be left where settings are chosen; elsewhere more will be
DETOUR = (0.05, 0.25)  # rad, standard deviation of the random detours
KNOTS = 6
EVERY = 3  # of the training motions, for tuning
BARS = {"fewer": 0.8, "J_against_projection_lead": 1.0}
CHANGES = {"base": "lead", "base_settings": {}, "steps": 40_000, "robots": 64, "rollout": 32}
"""What differs from the preset ``contact``."""


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


def in_bullet(families: tuple[str, ...], seed: int) -> TeleopOptions:
    """Motions as they are judged: in Bullet, where shapes that graze each other count as touching."""
    return options(families, seed, 1, physics="bullet", physics_hz=240.0, self_collision=True)


def choose(base: Figures, settings: Mapping[str, Figures]) -> str:
    """The setting of least ``J`` among those that leave few contact steps; of fewest contact steps if none does."""
    allowed = [name for name, figures in settings.items() if figures.contact_steps <= FEWER * base.contact_steps]
    if not allowed:
        return min(settings, key=lambda name: settings[name].contact_steps)
    return min(allowed, key=lambda name: settings[name].objective)


def tune(out: Path) -> None:
    """The margins, on training motions; what was played is kept rival by rival."""
    path = out / "tuned.json"
    if path.is_file():
        return
    judged = in_bullet(TRAIN, 101)
    ground = Ground(options(TRAIN, 101, 1, physics_hz=240.0))
    names = {"base": ("base", {})} | {
        f"{name} {margin}": (name, {"margin": margin}) for name, tried in MARGINS.items() for margin in tried
    }
    found = {}
    for label, (name, settings) in names.items():
        part = out / "tuning" / f"{label}.json"
        if not part.is_file():
            clips = range(0, ground.clips, EVERY)
            agent = make_rival(name, ground.interface, **settings)
            results = evaluate(judged, {label: agent}, clips=clips, seed=9000)[label]
            write_json(part, mean_of(results).as_dict())
            print(label, read_json(part), flush=True)
        found[label] = _figures(read_json(part))
    margins = {}
    for name, tried in MARGINS.items():
        margins[name] = float(choose(found["base"], {str(m): found[f"{name} {m}"] for m in tried}))
    write_json(path, {"margins": margins, "training_figures": {k: f.as_dict() for k, f in found.items()}})


def train(out: Path, seeds: int) -> None:
    """One policy per seed."""
    for seed in range(seeds):
        path = out / f"policy-{seed}"
        if path.with_suffix(".json").is_file():
            continue
        grounds = (Ground(options(TRAIN, 101, 1)), Ground(options(VALIDATION, 102, 1)))
        rng = np.random.default_rng(seed)
        streams = [ground.record(seed=seed) for ground in grounds]
        taught, held = (join([s, with_detours(s, g, rng)]) for s, g in zip(streams, grounds, strict=True))
        interface, began = grounds[0].interface, time.process_time()
        config = ResidualConfig.preset("contact", **CHANGES)
        below = make_rival(config.base, interface, **config.base_settings)
        trained = train_on_streams(below, taught, held, grounds[0].rates, config, seed=seed)
        seconds = round(time.process_time() - began, 1)
        curve = [leg.policy.as_dict() for leg in trained.history]
        save_agent(
            trained.agent,
            path,
            training={"seed": seed, "config": config.as_dict(), "cpu_seconds": seconds},
            figures={"validation": curve[trained.best], "untrained": curve[0], "validation_curve": curve},
        )
        print(f"{path.name}: {seconds} s of CPU", [(round(p["J"], 3), round(p["contact_steps"], 4)) for p in curve])


def stacks(out: Path, seeds: int, interface: Interface) -> dict[str, Agent]:
    """Everybody who is judged, with the margins that were tuned."""
    margins = read_json(out / "tuned.json")["margins"]
    agents = {"base": make_rival("base", interface), "lead": make_rival("lead", interface)}
    agents["projection"] = make_rival("projection", interface, margin=margins["projection_lead"])
    agents |= {name: make_rival(name, interface, margin=margin) for name, margin in margins.items()}
    for seed in range(seeds):
        policy = load_agent(out / f"policy-{seed}", interface)
        agents[f"policy-{seed}"] = Sliding(interface, policy, margin=margins["sliding_lead"])
    return agents


def validate(out: Path, seeds: int) -> None:
    """Whether a policy is better below the sliding than none, on validation motions in Bullet."""
    path = out / "validation.json"
    if path.is_file():
        return
    interface = Ground(options(VALIDATION, 102, 1, physics_hz=240.0)).interface
    results = evaluate(in_bullet(VALIDATION, 102), stacks(out, seeds, interface), seed=9000)
    found = {name: mean_of(episodes) for name, episodes in results.items()}
    candidates = [name for name in found if name.startswith(("policy-", "sliding_lead"))]
    chosen = choose(found["base"], {name: found[name] for name in candidates})
    write_json(path, {"chosen": chosen, "validation_figures": {k: f.as_dict() for k, f in found.items()}})


def judge(out: Path, seeds: int, only: str | None = None) -> None:
    """Every agent on the test motions, or one of them, in Bullet with self-collision; kept agent by agent."""
    interface = Ground(options(TEST, 103, 1, physics_hz=240.0)).interface
    for name, agent in stacks(out, seeds, interface).items():
        path = out / "test" / f"{name}.json"
        if path.is_file() or only not in (None, name):
            continue
        found = evaluate(in_bullet(TEST, 103), {name: agent}, seed=9000)[name]
        write_json(path, {"rows": _rows(found), "capsules_against_bullet": _agreement(found, interface)})
        print(name, mean_of(found), flush=True)


def _figures(values: Mapping[str, float]) -> Figures:
    return Figures(**{key: value for key, value in values.items() if key != "J"})


def _rows(found: list[EpisodeResult]) -> list[dict[str, Any]]:
    return [{"motion": result.motion, **result.figures.as_dict()} for result in found]


def _agreement(results: list[EpisodeResult], interface: Interface) -> dict[str, float]:
    """How often the capsule model and Bullet agree on whether anything touches, step by step."""
    clear = capsule_model(interface.robot).clearance(np.concatenate([r.q for r in results]))
    touching = np.concatenate([r.contacts for r in results]) > 0
    return {
        "steps": len(touching),
        "bullet_touches": float(touching.mean()),
        "capsules_touch": float((clear < 0.0).mean()),
        "agree": float(((clear < 0.0) == touching).mean()),
        "agree_beyond_2_mm": float(((clear < 0.0) == touching)[np.abs(clear) > 0.002].mean()),
    }


def report(out: Path, seeds: int) -> None:
    """Prints the table of the study and writes everything that is known."""
    tuned, validated = (read_json(out / f"{name}.json") for name in ("tuned", "validation"))
    interface = Ground(options(TEST, 103, 1)).interface
    tested = {name: read_json(out / "test" / f"{name}.json") for name in stacks(out, seeds, interface)}
    rows = {name: part["rows"] for name, part in tested.items()}
    table = {name: _summary(found, rows["base"]) for name, found in rows.items()}
    policies = [name for name in rows if name.startswith("policy-")]
    if policies:
        table["policies, mean of seeds"] = {
            key: float(np.mean([table[name][key] for name in policies])) for key in table["base"]
        }
    rival = table["projection_lead"]["J"]
    result = {
        "command": f"python scripts/study_contacts.py --out study-contacts --seeds {seeds}",
        "bars": BARS,
        "margins": tuned["margins"],
        "chosen_on_validation": validated["chosen"],
        "test_in_bullet": table,
        "J_against_projection_lead": {name: row["J"] / rival for name, row in table.items()},
        "tuning_on_training_motions_in_bullet": tuned["training_figures"],
        "validation_in_bullet": validated["validation_figures"],
        "policies": [read_json(out / f"policy-{seed}.json")["training"] for seed in range(seeds)],
        "capsules_against_bullet": tested["lead"]["capsules_against_bullet"],
        "test_motions": rows,
    }
    write_json(out / "table.json", result)
    print("| agent | landmark error [mm] | jitter | J | steps in contact | fewer than base | motions without contact |")
    print("|---|---|---|---|---|---|---|")
    for name, row in table.items():
        print(
            f"| {name} | {row['landmark_mm']:.2f} | {row['jitter']:.2f} | {row['J']:.2f} | "
            f"{100 * row['contact_steps']:.2f} % | {100 * row['fewer']:.0f} % | {100 * row['success']:.0f} % |"
        )


def _summary(found: list[dict[str, Any]], base: list[dict[str, Any]]) -> dict[str, float]:
    means = {
        key: float(np.mean([row[key] for row in found]))
        for key in ("landmark_mm", "joint_mrad", "jitter", "contact_steps", "J")
    }
    touched = float(np.mean([row["contact_steps"] for row in base]))
    free = [row["landmark_mm"] for row, plain in zip(found, base, strict=True) if not plain["contact_steps"]]
    success = float(np.mean([row["contact_steps"] == 0.0 for row in found]))
    return {
        **means,
        "fewer": 1.0 - means["contact_steps"] / touched,
        "success": success,
        "free_mm": float(np.mean(free)),
    }


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
        "validate": lambda: validate(given.out, given.seeds),
        "test": lambda: judge(given.out, given.seeds),
        "report": lambda: report(given.out, given.seeds),
    }
    for stage in given.stages:
        stages[stage]()


if __name__ == "__main__":
    main()
