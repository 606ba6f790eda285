"""Measures the embedded motions and writes the figures that docs/motions.md quotes to docs/results/motions.json."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.files import asset, write_json
from syda_gym.motions import Motions, PairedMotions, describe, load_motions
from syda_gym.motions.pairing.conform import limb_directions_of
from syda_gym.simulation.collision.self_collision import SelfCollision

PAIRS = (("adult", "pepper"), ("kid", "pepper"), ("stiff", "pepper"), ("adult", "kid"), ("pepper", "adult"))
RIDGE = 0.1


def main() -> None:
    """Writes the results file."""
    motions = load_motions("embedded")
    target = Path(__file__).parents[1] / "docs" / "results" / "motions.json"
    results: dict[str, Any] = {
        "command": "python scripts/measure_motions.py",
        "what": "mean distance over elbows and wrists [m], leave-one-action-out over all embedded actions",
        "asset_megabytes": asset("motions", "embedded.npz").stat().st_size / 1e6,
        "bodies": [
            {"name": b.name, "height": b.height, "fastest": b.fastest, "filled": b.filled}
            for b in describe(motions).bodies
        ],
        "self_contact": {name: self_contact(motions, name) for name in ("pepper", "nao")},
        "pairs": [difficulty(motions, *names) for names in PAIRS],
    }
    write_json(target, results)
    print(target.read_text())


def difficulty(motions: Motions, source: str, target: str) -> dict[str, Any]:
    """Errors of three simple predictors of limb directions [m]."""
    pair = motions.pair(source, target)
    x, y = (
        limb_directions_of(body, frames).reshape(len(pair), -1)
        for body, frames in ((pair.source_body, pair.source), (pair.target_body, pair.target))
    )
    ridge, constant, worst = [], [], 0.0
    for mask in pair.fold_masks("loao"):
        ones = np.ones((len(x), 1))
        design = np.hstack([x, ones])
        train = design[~mask]
        weights = np.linalg.solve(train.T @ train + RIDGE * np.eye(train.shape[1]), train.T @ y[~mask])
        error = distance(pair, design[mask] @ weights, y[mask])
        worst = max(worst, error)
        ridge.append(error)
        constant.append(distance(pair, np.repeat(y[~mask].mean(axis=0)[None], mask.sum(), axis=0), y[mask]))
    return {
        "source": source,
        "target": target,
        "fixed_axes": distance(pair, x, y),
        "ridge": float(np.mean(ridge)),
        "ridge_worst_action": worst,
        "mean_pose": float(np.mean(constant)),
    }


def self_contact(motions: Motions, name: str) -> float:
    """Share of every third frame in which the robot's arms touch its own body."""
    robot = motions.bodies[name]
    if not isinstance(robot, Robot):
        raise TypeError(f"{name} is no robot")
    check = SelfCollision(robot, margin=0.0)
    touching = [check.touches(frame) for clip in motions.clips(name) for frame in clip.frames[::3]]
    return float(np.mean(touching))


def distance(pair: PairedMotions, predicted: FloatArray, truth: FloatArray) -> float:
    """Mean distance of elbows and wrists from the shoulder for limb directions ``(N, 12)``, in the target's size."""

    def points(limbs: FloatArray) -> FloatArray:
        limbs = limbs.reshape(len(limbs), -1, 2, 3)
        limbs = limbs / np.linalg.norm(limbs, axis=-1, keepdims=True)
        return np.cumsum(limbs * pair.target_body.arm_lengths[:, :, None], axis=2)

    return float(np.linalg.norm(points(predicted) - points(truth), axis=-1).mean())


if __name__ == "__main__":
    main()
