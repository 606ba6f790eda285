"""Fit the constants of the servo model to Bullet and write ``syda_gym/assets/robots/servo.json``.

Run it from anywhere: ``python scripts/fit_servo.py [--robots pepper nao] [--check]``. For every arm joint it fits the
acceleration that the motors reach, and how a payload in the hand reduces it, on half of the embedded actions and on
jumps between random poses; ``--check`` measures the deviation of joint angles on the other actions, without fitting.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.files import asset, write_json
from syda_gym.motions.loading import load_motions
from syda_gym.simulation.backend import MotorConditions
from syda_gym.simulation.making import make_world
from syda_gym.simulation.rates import Rates
from syda_gym.simulation.servo import ServoConstants, ServoWorld

RATES = (Rates(30.0, 240.0), Rates(30.0, 60.0))
ACCELERATIONS = np.geomspace(5.0, 3000.0, 36)
PAYLOADS = (0.3, 0.6)


def motions_of(robot: str, held_out: bool) -> list[FloatArray]:
    """Command sequences at 30 Hz: embedded motions, and steps that drive the motors to their limits."""
    motions = load_motions("embedded", fps=30.0)
    actions = sorted({take.action for take in motions.takes})
    chosen = set(actions[1::2] if held_out else actions[0::2])
    return [take.frames[robot] for take in motions.takes if take.action in chosen][:: 2 if held_out else 4]


def steps_of(robot: Robot, seed: int) -> FloatArray:
    """Random reachable targets, each held for ten frames: jumps that saturate speed and acceleration."""
    rng = np.random.default_rng(seed)
    targets = robot.clamp(rng.uniform(robot.lower, robot.upper, (20, len(robot.lower))))
    return np.repeat(targets, 10, axis=0)


def play(world: object, commands: Sequence[FloatArray], conditions: MotorConditions) -> FloatArray:
    """Joint angles after every control step, sequences one below the other."""
    rows = []
    world.set_conditions(0, conditions)  # type: ignore[attr-defined]
    n = commands[0].shape[1]
    for sequence in commands:
        world.reset(np.array([0]), sequence[:1])  # type: ignore[attr-defined]
        for command in sequence:
            world.advance(command[None])  # type: ignore[attr-defined]
            rows.append(world.pose[0, :n].copy())  # type: ignore[attr-defined]
    return np.array(rows)


def fit_accelerations(robot: Robot, sequences: list[FloatArray], truth: dict[Rates, FloatArray]) -> FloatArray:
    """Best acceleration of each joint over a grid, both arms alike; all candidates are played at once.

    Joints do not influence each other in the servo model, so that each finds its own best candidate.
    """
    n, count = len(robot.lower), len(ACCELERATIONS)
    losses = np.zeros((count, n))
    for rates, measured in truth.items():
        world = ServoWorld(robot, rates, count)
        for index, acceleration in enumerate(ACCELERATIONS):
            world.set_constants(ServoConstants(np.full(n, acceleration), np.zeros(n)), index)
        row = 0
        for sequence in sequences:
            world.reset(np.arange(count), np.repeat(sequence[:1], count, axis=0))
            for command in sequence:
                world.advance(np.repeat(command[None], count, axis=0))
                losses += np.abs(world.pose[:, :n] - measured[row]) / len(measured)
                row += 1
    if len(robot.chains) == 2 and robot.chains[0].n_joints == robot.chains[1].n_joints:
        losses = losses + np.roll(losses, n // 2, axis=1)
    best: FloatArray = ACCELERATIONS[np.argmin(losses, axis=0)]
    return best


def fit(robot: Robot) -> dict[str, dict[str, float]]:
    """Constants of every arm joint."""
    sequences = [steps_of(robot, 0), *motions_of(robot.name, held_out=False)[:6]]
    found = {}
    for payload in (0.0, *PAYLOADS):
        conditions = MotorConditions(payload=payload)
        truth = {rates: play(make_world(robot, rates), sequences, conditions) for rates in RATES}
        found[payload] = fit_accelerations(robot, sequences, truth)
    growth = np.mean([np.maximum(found[0.0] / found[p] - 1.0, 0.0) / p for p in PAYLOADS], axis=0)
    return {
        joint: {"acceleration": round(float(a), 2), "payload": round(float(g), 3)}
        for joint, a, g in zip(robot.joint_names, found[0.0], growth, strict=True)
    }


def deviation(robot: Robot) -> dict[str, dict[str, float]]:
    """Mean and largest deviation from Bullet on held-out motions [degrees], per rate and payload."""
    sequences = motions_of(robot.name, held_out=True)
    result = {}
    for rates in RATES:
        for payload in (0.0, 0.3):
            conditions = MotorConditions(payload=payload)
            bullet = play(make_world(robot, rates), sequences, conditions)
            model = play(make_world(robot, rates, physics="servo"), sequences, conditions)
            error = np.degrees(np.abs(bullet - model))
            label = f"{rates.physics_hz:g} Hz, {rates.substeps} substeps, {payload} kg"
            result[label] = {"mean": float(error.mean()), "max": float(error.max()), "frames": len(error)}
    return result


def main() -> None:
    """Fits and writes, or checks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=["pepper", "nao"])
    parser.add_argument("--check", action="store_true", help="measure the deviation on held-out motions, do not fit")
    arguments = parser.parse_args()
    path = asset("robots", "servo.json")
    table = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {"robots": {}}
    for name in arguments.robots:
        robot = catalog.get(name)
        if not isinstance(robot, Robot):
            raise SystemExit(f"{name!r} is no robot")
        if arguments.check:
            for label, values in deviation(robot).items():
                print(f"{name:8s} {label}: mean {values['mean']:.4f} deg, max {values['max']:.3f} deg")
            continue
        table["robots"][name] = fit(robot)
        print(name, json.dumps(table["robots"][name], indent=1))
    if not arguments.check:
        table["made_by"] = "scripts/fit_servo.py"
        table["units"] = {"acceleration": "rad/s2", "payload": "relative growth of the inertia per kg"}
        write_json(path, table)


if __name__ == "__main__":
    main()
