"""Tries every two-armed robot of the package example-robot-data, and any folder of robots, and says how right it is.

Usage: python scripts/study_robots.py [FOLDER ...] [--table docs/robots-found.md] [--pictures FOLDER] [--only NAME ...]

For every robot: what was found; whether elbow and wrist lie on the axes that bend them; how far the limbs point from a
person's, beside the best that its joints allow; the same as a sequence at the joints' speeds; how far PyBullet's
landmarks are from the kinematics, standing still and waving; and how often a limit or a speed is broken.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover
from syda_gym.embodiments.discovery.example_robots import example_urdfs
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.urdf import placements_at, read_urdf
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.reading.source import ROBOT_ENDINGS
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import SydaError
from syda_gym.files import write_text
from syda_gym.mappings.limits import limit_speed
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.motions.loading import load_motions
from syda_gym.simulation.making import make_world
from syda_gym.simulation.plain_body import weak_joints
from syda_gym.simulation.rates import Rates
from syda_gym.teleoperation.setup.robot_picture import draw_robot
from syda_gym.teleoperation.setup.robot_setup import describe_robot
from syda_gym.teleoperation.setup.verdict import judge_robot

WAVE, FPS, POSES, STARTS = "wave_side", 30.0, 48, 6

HEADER = """# Robots of other makers

What `syda-gym robot add` makes, without any hint, of the robots in the PyPI package
[`example-robot-data`](https://pypi.org/project/example-robot-data/) {version} (`pip install 'syda-gym[robots]'`):
{two} of its {all} URDFs have two arms. The others are quadrupeds, drones, single arms and hands, and files without
joints. Below them the made-up robots of the tests (`tests/embodiments/discovery/cases`), each one kind of trap.

```console
python scripts/study_robots.py tests/embodiments/discovery/cases --table docs/robots-found.md
```

- **off axis**: the farther of elbow and wrist from the axis that bends there [mm]; 0 is right. *tip*: a wrist that no
  joint bends, such as the end of the forearm's shape.
- **points**: mean angle between a person's limbs and the robot's over {poses} poses of the embedded adult, **best** the
  least that its joints allow (the best of {starts} searches with all joints free), in degrees.
- **sequence**: the same over the action `{wave}` at 30 frames a second, keeping to the joints' speeds; behind it the
  best of frame by frame.
- **still, wave**: how far PyBullet's landmarks are from the kinematics': the largest after standing for three seconds,
  and the mean over that action, lag of the motors included [mm]. *weak*: gravity alone asks more of a motor than the
  effort that the file states.
- **broken**: commands beyond a limit or a speed.
- **add**: processor time of finding, judging and drawing [s].

<!-- numbers: this page, written by scripts/study_robots.py -->

| robot | joints | elbow, wrist (left) | off axis | points (best) | sequence (best) | still, wave | broken | add |
|---|---|---|---|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Finding:
    """One row of the table; ``refused`` is the reason where there is no robot."""

    name: str
    row: str = ""
    refused: str = ""


def off_axis(robot: Robot) -> tuple[float, bool]:
    """Distance of elbow and wrist from the nearest axis beyond which the arm bends [m]; whether a wrist has none."""
    tree = read_urdf(robot.urdf)
    places = placements_at(tree, {k: v for k, v in robot.description.rest.items() if k not in robot.joint_names})
    worst, ends = 0.0, False
    for arm in robot.description.arms:
        for point in ("elbow", "wrist"):
            link = getattr(arm, point)
            frame = places[link]
            place = frame[:3, 3] + frame[:3, :3] @ np.array(arm.offsets.get(point, (0.0, 0.0, 0.0)))
            joint = tree.parent_joint.get(link, "")
            if joint not in arm.joints or (point == "wrist" and link == arm.elbow):
                ends = True  # the end of a forearm, or a fixed link behind it
                continue
            axis = frame[:3, :3] @ tree.joints[joint].axis
            worst = max(worst, float(np.linalg.norm(np.cross(place - frame[:3, 3], axis))))
    return worst, ends


def angles_between(robot: Robot, frames: FloatArray, wanted: FloatArray) -> FloatArray:
    """Angles between limbs ``(N, arms, 2)`` [degrees]."""
    reached = np.diff(robot.arm_points(frames), axis=2)
    cosine = np.sum(reached * wanted, axis=-1) / np.linalg.norm(reached, axis=-1) / np.linalg.norm(wanted, axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def best_angles(robot: Robot, wanted: FloatArray, starts: int = STARTS) -> FloatArray:
    """Least mean angle of each pose and arm that all joints within their limits can reach, ``(N, arms)`` [degrees].

    Projected Levenberg-Marquardt steps on the limbs' directions over all joints, from the solver's answer and from
    random poses, all at once.
    """
    rng = np.random.default_rng(0)
    found = np.zeros(wanted.shape[:2])
    solved = LimbIK.of(robot).solve(wanted)
    goals = wanted / np.linalg.norm(wanted, axis=-1, keepdims=True)
    for arm, (chain, part) in enumerate(zip(robot.chains, robot.arm_slices, strict=True)):
        shape = (starts - 1, len(wanted), chain.n_joints)
        guesses = np.concatenate([solved[None, :, part], rng.uniform(chain.lower, chain.upper, shape)])
        q = np.clip(guesses.reshape(-1, chain.n_joints), chain.lower, chain.upper)
        goal = np.tile(goals[:, arm].reshape(len(wanted), 6), (starts, 1))
        residual, jacobian = _directions(chain, q, goal)
        damping = np.full(len(q), 1e-2)
        for _ in range(60):
            gradient = np.einsum("nij,ni->nj", jacobian, residual)
            stuck = ((q <= chain.lower) & (gradient > 0)) | ((q >= chain.upper) & (gradient < 0))
            free = np.where(stuck[:, None], 0.0, jacobian)
            normal = np.einsum("nij,nik->njk", free, free) + damping[:, None, None] * np.eye(q.shape[1])
            step = np.linalg.solve(normal, -np.where(stuck, 0.0, gradient)[..., None])[..., 0]
            trial = np.clip(q + step, chain.lower, chain.upper)
            new, slope = _directions(chain, trial, goal)
            better = (new**2).sum(axis=1) < (residual**2).sum(axis=1)
            q, residual = np.where(better[:, None], trial, q), np.where(better[:, None], new, residual)
            jacobian = np.where(better[:, None, None], slope, jacobian)
            damping = np.clip(np.where(better, 0.3, 4.0) * damping, 1e-7, 1e3)
        chords = np.linalg.norm(residual.reshape(starts, len(wanted), 2, 3), axis=-1)
        angles = np.degrees(2.0 * np.arcsin(np.clip(chords / 2.0, 0.0, 1.0))).mean(axis=-1)
        found[:, arm] = angles.min(axis=0)
    return found


def _directions(chain: ArmChain, q: FloatArray, goal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit limb directions minus the wanted ones ``(N, 6)``, and their derivatives ``(N, 6, n)``."""
    points, jacobians = chain.jacobians(q)
    limbs, slopes = np.diff(points[:, :3], axis=1), np.diff(jacobians[:, :3], axis=1)
    lengths = np.linalg.norm(limbs, axis=-1, keepdims=True)
    unit = limbs / lengths
    across = (slopes - unit[..., None] * np.einsum("nli,nlij->nlj", unit, slopes)[:, :, None]) / lengths[..., None]
    return unit.reshape(len(q), 6) - goal, across.reshape(len(q), 6, -1)


def poses(robot: Robot, frames: FloatArray) -> FloatArray:
    """Limb directions of the adult for the robot's sides, ``(N, arms, 2, 3)``."""
    adult = catalog.get("adult")
    points = adult.arm_points(frames)[:, [adult.sides.index(side) for side in robot.sides]]
    return np.diff(points, axis=2)


def in_bullet(robot: Robot, commands: FloatArray) -> tuple[float, float]:
    """Largest landmark error of standing still for three seconds, and mean one over commands, both [m]."""
    world = make_world(robot, Rates(int(FPS), 240))
    n = robot.n_features
    try:
        for _ in range(90):
            world.advance(robot.rest[None])
        still = np.linalg.norm(world.pose[0, n:].reshape(-1, 3) - robot.landmarks(robot.rest)[0], axis=1).max()
        world.reset(np.array([0]), commands[:1])
        errors = []
        for command, wanted in zip(commands, robot.landmarks(commands), strict=True):
            world.advance(command[None])
            errors.append(np.linalg.norm(world.pose[0, n:].reshape(-1, 3) - wanted, axis=1).mean())
    finally:
        world.close()
    return float(still), float(np.mean(errors))


def study(name: str, path: Path, folder: Path | None) -> Finding:
    """Everything about one file."""
    start = time.process_time()
    try:
        description, _ = describe_robot(path, name)
        robot = Robot(description)
        verdict = judge_robot(robot)
        picture = (folder or Path(tempfile.gettempdir())) / f"{name}.png"
        draw_robot(robot, picture, title=f"{np.degrees(verdict.error):.1f} degrees: {verdict.word}")
        added = time.process_time() - start
        motions = load_motions("embedded", FPS)
        everything = np.concatenate([take.frames["adult"] for take in motions.takes if "adult" in take.frames])
        wanted = poses(robot, everything[np.linspace(0, len(everything) - 1, POSES).astype(int)])
        points = angles_between(robot, LimbIK.of(robot).solve(wanted), wanted).mean()
        best = best_angles(robot, wanted).mean()
        wave = next(t for t in motions.takes if t.action == WAVE and "adult" in t.frames).frames["adult"]
        mapped = robot.clamp(unfitted(catalog.get("adult"), robot)(wave))
        sequence = limit_speed(robot, mapped, FPS)
        every = max(1, len(wave) // 16)
        sequence_error = angles_between(robot, sequence, poses(robot, wave)).mean()
        sequence_best = best_angles(robot, poses(robot, wave)[::every], 3).mean()
        speeds = np.abs(np.diff(sequence, axis=0)) * FPS
        broken = int(robot.violations(sequence).sum() + (speeds > robot.speed + 1e-6).sum())
        still, waving = in_bullet(robot, sequence)
        weak = " weak" if weak_joints(robot, sequence) else ""
    except SydaError as error:
        return Finding(name, refused=str(error))
    worst, ends = off_axis(robot)
    arm = robot.description.arms[0]
    row = (
        f"| {name} | {len(arm.joints)} | `{arm.elbow}`, `{arm.wrist}` | {1000 * worst:.1f}{' tip' if ends else ''} | "
        f"{points:.1f} ({best:.1f}) | {sequence_error:.1f} ({sequence_best:.1f}) | "
        f"{1000 * still:.1f}, {1000 * waving:.0f}{weak} | {broken} | {added:.1f} |\n"
    )
    return Finding(name, row)


def two_armed(urdfs: dict[str, Path]) -> dict[str, Path]:
    """Those in which two arms are found."""
    found = {}
    for name, path in urdfs.items():
        try:
            if len(discover(path).arms) == 2:
                found[name] = path
        except SydaError:
            continue
    return found


def main() -> None:
    """Prints and writes the table."""
    from importlib.metadata import version

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path, help="folders of further robots")
    parser.add_argument("--table", type=Path, help="write the table as Markdown")
    parser.add_argument("--pictures", type=Path, help="write the picture of every robot into this folder")
    parser.add_argument("--only", nargs="*", help="names of robots to try")
    parser.add_argument("--no-examples", action="store_true", help="the folders alone")
    arguments = parser.parse_args()
    urdfs = {} if arguments.no_examples else example_urdfs()
    robots = two_armed(urdfs)
    count = len(robots)
    for folder in arguments.folders:
        robots |= {f.name.split(".")[0]: f for f in sorted(folder.iterdir()) if f.suffix.lower() in ROBOT_ENDINGS}
    if arguments.only:
        robots = {name: path for name, path in robots.items() if name in arguments.only}
    findings = []
    for name, path in robots.items():
        start = time.perf_counter()
        findings.append(study(name, path, arguments.pictures))
        told = findings[-1].row.strip() or f"{name} refused: {findings[-1].refused}"
        print(f"{time.perf_counter() - start:5.1f} s  {told}", flush=True)
    text = HEADER.format(
        version="" if arguments.no_examples else version("example-robot-data"),
        two=count, all=len(urdfs), poses=POSES, starts=STARTS, wave=WAVE,
    )  # fmt: skip
    text += "".join(finding.row for finding in findings)
    refused = [finding for finding in findings if finding.refused]
    if refused:
        text += "\nRefused, with the reason:\n\n"
        text += "".join(
            f"- `{f.name}`: {f.refused.replace(str(robots[f.name].parent), '').lstrip('/')}\n" for f in refused
        )
    if arguments.table:
        write_text(arguments.table, text)


if __name__ == "__main__":
    main()
