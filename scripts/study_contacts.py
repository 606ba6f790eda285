"""The study of contacts: a network that is taught to keep clear, beside base, lead and projection, judged in Bullet.

    python scripts/study_contacts.py --out study-contacts --seeds 3                 # finished parts are kept
    python scripts/study_contacts.py --out study-contacts --seeds 3 --stages train  # one part

1. `tune`: the projection's margin, on training motions, in Bullet with self-collision: least J among the margins with
   at least 85 % fewer contact steps than the base.
2. `train`: predictors on the tuned projection, by regression through the servo; coming nearer than a reserve in the
   capsule model is paid for. Half of the episodes are training motions, half the same with smooth random detours, which
   touch more often. Weight and reserve are chosen on validation motions like the margin: in Bullet, by the same rule.
3. `test`: once, in Bullet with self-collision, on gesture families that neither training nor selection saw. Bullet
   counts the contacts. Motions during which the base touches nothing count as free of contact.
"""

from __future__ import annotations

import argparse
import shutil
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical.projection import Projection, capsule_model
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.figures import Figures
from syda_gym.agents.interface import Interface
from syda_gym.agents.predictor.predictor_training import PredictorConfig, train_predictor
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
STAGES = ("tune", "train", "test", "report")
MARGINS = (0.0, 0.004, 0.006, 0.008, 0.012, 0.016, 0.024)
PENALTIES = ((1.0, 0.75), (3.0, 1.0))  # contact weight, and the reserve as a share of the projection's margin
FEWER = 0.15  # share of the base's contact steps that may be left where settings are chosen
DETOUR = (0.05, 0.25)  # rad, standard deviation of the random detours
KNOTS = 6
CONFIG = PredictorConfig(
    channels=32,
    iterations=1200,
    batch=24,
    window=40,
    bound=0.3,
    mirror=False,
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
    """The projection's margin, on training motions."""
    path = out / "tuned.json"
    if path.is_file():
        return
    judged = in_bullet(TRAIN, 101)
    interface = Ground(options(TRAIN, 101, 1, physics_hz=240.0)).interface
    agents = {"base": make_rival("base", interface)}
    agents |= {str(margin): make_rival("projection_lead", interface, margin=margin) for margin in MARGINS}
    found = {name: mean_of(results) for name, results in evaluate(judged, agents, seed=9000).items()}
    margin = choose(found["base"], {str(m): found[str(m)] for m in MARGINS})
    write_json(path, {"margin": float(margin), "training_figures": {k: f.as_dict() for k, f in found.items()}})


def train(out: Path, seeds: int) -> None:
    """One network per seed, and for the first one per penalty as well, among which validation motions choose."""
    margin = float(read_json(out / "tuned.json")["margin"])
    for index in range(len(PENALTIES)):
        _train(out / f"penalty-{index}", margin, index, 0)
    chosen = _choose_penalty(out, margin)
    for seed in range(seeds):
        if seed:
            _train(out / f"network-{seed}", margin, chosen, seed)
        else:
            for suffix in (".safetensors", ".json"):
                shutil.copyfile(out / f"penalty-{chosen}{suffix}", out / f"network-0{suffix}")


def _train(path: Path, margin: float, penalty: int, seed: int) -> None:
    if path.with_suffix(".json").is_file():
        return
    weight, share = PENALTIES[penalty]
    config = replace(CONFIG, contact_weight=weight, contact_margin=share * margin)
    grounds = (Ground(options(TRAIN, 101, 1)), Ground(options(VALIDATION, 102, 1)))
    rng = np.random.default_rng(seed)
    streams = [ground.record(seed=seed) for ground in grounds]
    taught, held = (join([s, with_detours(s, g, rng)]) for s, g in zip(streams, grounds, strict=True))
    interface, began = grounds[0].interface, time.process_time()
    base = Projection(interface, BaseAlone(interface), margin=margin)
    trained = train_predictor(base, taught, held, grounds[0].rates, config, seed=seed)
    seconds = round(time.process_time() - began, 1)
    curve = [figures.as_dict() for figures in trained.history]
    save_agent(
        trained.agent,
        path,
        training={"seed": seed, "config": dict(vars(config)), "cpu_seconds": seconds},
        figures={"validation": curve[trained.best], "untrained": curve[0], "validation_curve": curve},
    )
    print(f"{path.name}: {seconds} s of CPU", [(round(p["J"], 3), round(p["contact_steps"], 4)) for p in curve])


def _choose_penalty(out: Path, margin: float) -> int:
    """The penalty whose network is best on validation motions in Bullet."""
    path = out / "validation.json"
    if not path.is_file():
        interface = Ground(options(VALIDATION, 102, 1, physics_hz=240.0)).interface
        agents = {"base": make_rival("base", interface)}
        agents["projection_lead"] = make_rival("projection_lead", interface, margin=margin)
        agents |= {str(i): load_agent(out / f"penalty-{i}", interface) for i in range(len(PENALTIES))}
        results = evaluate(in_bullet(VALIDATION, 102), agents, seed=9000)
        found = {name: mean_of(episodes) for name, episodes in results.items()}
        chosen = int(choose(found["base"], {str(i): found[str(i)] for i in range(len(PENALTIES))}))
        write_json(path, {"penalty": chosen, "validation_figures": {k: f.as_dict() for k, f in found.items()}})
    return int(read_json(path)["penalty"])


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
    results = evaluate(in_bullet(TEST, 103), agents, seed=9000)
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
