"""Real people, no recordings: the unfitted mapping against the best possible pose and against mink.

    python scripts/benchmark_people.py --data FOLDER --out docs/results/people.json
    python scripts/benchmark_people.py --data FOLDER --robots URDF...     seven-joint arms too

``FOLDER`` holds ``kinect`` (CSV of Kinect joints) and ``bvh``; any recording that ``load_motions`` reads will do. Every
frame is scored by pinocchio alone: the mean angle, over both upper arms and forearms, between person and robot, in the
frame of shoulder line and vertical. The optimum is what an optimiser of scipy reaches within the joint limits, coupled
ones included, from many starts; as a sequence it is started at the frame before and keeps to the joint speeds.

mink needs the extra ``ik``; the robots of other makers the extra ``robots``.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
from scipy.optimize import minimize

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.files import write_json
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.mink_ik import MinkArmCoder
from syda_gym.mappings.limits import limit_speed
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.mappings.models.rotation import GeometricRegressor
from syda_gym.motions.loading import load_motions

FPS = 30.0
BENT, STEADY = 30.0, 15.0
"""A jump turns a joint by more than the first [deg] while no limb of the person turns by the second."""
STARTS = 5
"""Random poses from which the optimum is sought, beside rest and the optimum of the frame before."""
ROUND, SHARP = 0.05, 0.002
"""Angles [rad] below which the optimiser's cost is round; the second run begins where the best two of the first end."""
SEVEN = ("baxter", "tiago_dual", "tiago_pro", "centauro")


class Bones:
    """One arm of a robot by pinocchio: directions of upper arm and forearm in body axes, and their derivatives.

    Args:
        robot: for the names of joints and links, the coupled limits, the torso's axes, and speeds.
        index: of the arm.
    """

    def __init__(self, robot: Robot, index: int) -> None:
        arm = robot.description.arms[index]
        whole = pinocchio.buildModelFromUrdf(str(robot.urdf))
        locked = [whole.getJointId(name) for name in whole.names[1:] if name not in arm.joints]
        self.model = pinocchio.buildReducedModel(whole, locked, pinocchio.neutral(whole))
        self.data = self.model.createData()
        joints = [self.model.joints[self.model.getJointId(name)] for name in arm.joints]
        self.places = [(joint.idx_q, joint.nq, joint.idx_v) for joint in joints]
        self.links = [self.model.getFrameId(link) for link in (arm.shoulder, arm.elbow, arm.wrist)]
        self.offsets = [np.array(offset) for offset in arm.point_offsets[:3]]
        pinocchio.framesForwardKinematics(self.model, self.data, pinocchio.neutral(self.model))
        torso = self.data.oMf[self.model.getFrameId(robot.description.torso)].rotation
        axes = np.eye(3) if robot.description.axes is None else np.array(robot.description.axes)
        self.turn = axes @ torso.T
        names, part = robot.joint_names, robot.arm_slices[index]
        self.lower, self.upper = robot.lower[part].copy(), robot.upper[part].copy()
        self.rest, self.speed = robot.clamp(robot.rest)[0, part], robot.speed[part].copy()
        self.coupled = [
            (names.index(c.joint) - part.start, names.index(c.by) - part.start, c)
            for c in robot.description.coupled_limits
            if c.joint in names[part] and c.by in names[part]
        ]

    def directions(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Unit vectors ``(2, 3)`` and their derivatives ``(2, 3, n)``."""
        full = np.zeros(self.model.nq)
        for (at, size, _), angle in zip(self.places, q, strict=True):
            full[at : at + size] = angle if size == 1 else (np.cos(angle), np.sin(angle))
        pinocchio.computeJointJacobians(self.model, self.data, full)
        pinocchio.updateFramePlacements(self.model, self.data)
        world = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        columns = [place[2] for place in self.places]
        points, slopes = [], []
        for link, offset in zip(self.links, self.offsets, strict=True):
            place, jacobian = self.data.oMf[link], pinocchio.getFrameJacobian(self.model, self.data, link, world)
            lever = place.rotation @ offset
            points.append(self.turn @ (place.translation + lever))
            slopes.append(self.turn @ (jacobian[:3] - pinocchio.skew(lever) @ jacobian[3:])[:, columns])
        found, derivatives = [], []
        for limb in range(2):
            along = points[limb + 1] - points[limb]
            length = np.linalg.norm(along)
            along = along / length
            slope = (slopes[limb + 1] - slopes[limb]) / length
            found.append(along)
            derivatives.append(slope - np.outer(along, along @ slope))
        return np.array(found), np.array(derivatives)

    def box(self, before: FloatArray | None, dt: float) -> tuple[FloatArray, FloatArray]:
        """Limits, or what speeds leave of them after a frame."""
        if before is None:
            return self.lower, self.upper
        return np.maximum(self.lower, before - self.speed * dt), np.minimum(self.upper, before + self.speed * dt)

    def pose(self, x: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, list[tuple[int, float]]]:
        """Angles from variables: a governed joint is given as its share of the range that is left to it."""
        q, scales = x.copy(), []
        for joint, by, limit in self.coupled:
            a = max(low[joint], np.interp(q[by], limit.at, limit.lower))
            b = min(high[joint], np.interp(q[by], limit.at, limit.upper))
            q[joint] = a + x[joint] * max(b - a, 0.0)
            scales.append((joint, max(b - a, 0.0)))
        return q, scales

    def best(self, wanted: FloatArray, starts: Sequence[FloatArray], before: FloatArray | None = None) -> FloatArray:
        """The pose with the least mean angle to ``wanted`` ``(2, 3)`` that the optimiser finds from the starts."""
        low, high = self.box(before, 1.0 / FPS)
        bounds = [(float(a), float(b)) for a, b in zip(low, high, strict=True)]
        for joint, _, _ in self.coupled:
            bounds[joint] = (0.0, 1.0)
        runs = []
        for start in starts:
            x = np.clip(start, low, high)
            for joint, _, _ in self.coupled:
                span = high[joint] - low[joint]
                x[joint] = (x[joint] - low[joint]) / span if span > 0.0 else 0.0
            run = minimize(self._cost, x, (wanted, low, high, ROUND), "L-BFGS-B", jac=True, bounds=bounds)
            runs.append((float(run.fun), run.x))
            if run.fun < 2.0 * ROUND + 1e-6:
                break  # exact
        found, least = starts[0], np.inf
        for _, x in sorted(runs, key=lambda run: run[0])[:2]:
            sharp = minimize(self._cost, x, (wanted, low, high, SHARP), "L-BFGS-B", jac=True, bounds=bounds).x
            for variables in (x, sharp):
                q, _ = self.pose(variables, low, high)
                miss = float(_angles(self.directions(q)[0], wanted).mean())
                if miss < least:
                    found, least = q, miss
        return found

    def _cost(
        self, x: FloatArray, wanted: FloatArray, low: FloatArray, high: FloatArray, smooth: float
    ) -> tuple[float, FloatArray]:
        q, scales = self.pose(x, low, high)
        found, slope = self.directions(q)
        total, gradient = 0.0, np.zeros(len(q))
        for limb in range(2):
            cosine = float(np.clip(found[limb] @ wanted[limb], -1.0, 1.0))
            angle = np.arccos(cosine)
            ratio = 1.0 if angle < 1e-6 else angle / np.sqrt(max(1.0 - cosine**2, 1e-16))
            total += np.sqrt(angle**2 + smooth**2)
            gradient -= ratio / np.sqrt(angle**2 + smooth**2) * (wanted[limb] @ slope[limb])
        for (joint, by, _), (_, scale) in zip(self.coupled, scales, strict=True):
            nudge = 1e-6  # how the governed joint goes along with its governor
            moved = x.copy()
            moved[by] += nudge
            gradient[by] += gradient[joint] * (self.pose(moved, low, high)[0][joint] - q[joint]) / nudge
            gradient[joint] *= scale
        return total, gradient


def _angles(found: FloatArray, wanted: FloatArray) -> FloatArray:
    across = np.linalg.norm(np.cross(found, wanted), axis=-1)
    return np.degrees(np.arctan2(across, np.sum(found * wanted, axis=-1)))


def wanted_directions(body: HumanSkeleton, frames: FloatArray) -> FloatArray:
    """The person's limbs ``(N, 2, 2, 3)`` in the frame of shoulder line and vertical."""
    points = (frames.reshape(len(frames), 2, 3, 3) @ body.axes.T).astype(np.float64)
    line = points[:, 0, 0] - points[:, 1, 0]
    left = line * (1.0, 1.0, 0.0)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    forward = np.cross(left, (0.0, 0.0, 1.0))
    basis = np.stack([forward, left, np.broadcast_to((0.0, 0.0, 1.0), left.shape)], axis=1)
    limbs = np.einsum("nij,nabj->nabi", basis, np.diff(points, axis=2))
    return np.asarray(limbs / np.linalg.norm(limbs, axis=-1, keepdims=True))


def optimum(arms: Sequence[Bones], wanted: FloatArray, fast: bool) -> FloatArray:
    """The best poses of every frame ``(N, n)``; ``fast`` keeps to the joint speeds from frame to frame."""
    frames = []
    for index, arm in enumerate(arms):
        rng = np.random.default_rng(0)
        spread = list(rng.uniform(arm.lower, arm.upper, (STARTS, len(arm.lower))))
        path: list[FloatArray] = []
        for row in wanted[:, index]:
            if fast and path:
                low, high = arm.box(path[-1], 1.0 / FPS)
                starts = [path[-1], rng.uniform(low, high)]
                path.append(arm.best(row, starts, path[-1]))
            else:
                path.append(arm.best(row, [*path[-1:], arm.rest, *spread]))
        frames.append(np.array(path))
    return np.concatenate(frames, axis=1)


def off(arms: Sequence[Bones], frames: FloatArray, wanted: FloatArray) -> float:
    """Mean angle [deg] between the limbs of the poses and those wanted."""
    n = len(arms[0].lower)
    found = np.array([[arm.directions(q[n * k : n * (k + 1)])[0] for k, arm in enumerate(arms)] for q in frames])
    return float(_angles(found, wanted).mean())


def moving(robot: Robot, frames: FloatArray, wanted: FloatArray) -> dict[str, float]:
    """How poses move from frame to frame before any limiter."""
    steps = np.abs(np.diff(frames, axis=0))
    turned = _angles(wanted[1:], wanted[:-1]).max(axis=(1, 2))
    jumps = ((np.degrees(steps).max(axis=1) > BENT) & (turned < STEADY)).sum()
    return {
        "over_speed": float((steps > robot.speed / FPS * (1 + 1e-9)).any(axis=1).mean()),
        "jumps": int(jumps),
        "jumps_per_1000": 1e3 * float(jumps) / max(len(steps), 1),
    }


def recordings(data: Path) -> dict[str, tuple[HumanSkeleton, FloatArray]]:
    """Every clip of every person at 30 Hz.

    Raises:
        SystemExit: there are none.
    """
    found: dict[str, tuple[HumanSkeleton, FloatArray]] = {}
    files = sorted(path for folder in ("kinect", "bvh") for path in (data / folder).glob("*.*"))
    for file in files:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            motions = load_motions(file, FPS)
        for name, body in motions.bodies.items():
            if isinstance(body, HumanSkeleton) and len(body.sides) == 2:
                for number, clip in enumerate(motions.clips(name)):
                    found[file.name + (f" {number}" if number else "")] = (body, clip.frames)
    if not found:
        raise SystemExit(
            f"no recordings of people in {data}: expected folders kinect (CSV) and bvh, for example from "
            "github.com/microsoft/LabanotationSuite and the CMU motion-capture clips of github.com/facebookresearch/"
            "fairmotion"
        )
    return found


def rivals(body: HumanSkeleton, robot: Robot) -> dict[str, CodedMapping]:
    """mink, with limb directions as they are and after the rotation that fits the embedded motions."""
    from syda_gym.mappings.fitting.fit import fit

    mapping = unfitted(body, robot)
    fitted = fit(load_motions("embedded", fps=5.0).pair("adult", "pepper"), method="mink")
    assert isinstance(mapping, CodedMapping)
    assert isinstance(fitted, CodedMapping)
    coder = MinkArmCoder(robot, mapping.target_coder.settings(), mapping.target_coder.arrays())
    share = float(body.upper_arm / (body.upper_arm + body.forearm))
    found = {}
    for name, rotation in (("mink", np.eye(3)), ("mink, Procrustes", _rotation(fitted))):
        regressor = _with_rotation(mapping, GeometricRegressor(rotation, share, 0.0))
        found[name] = CodedMapping(mapping.card, mapping.source_coder, coder, regressor)
    return found


def _rotation(mapping: CodedMapping) -> FloatArray:
    arrays = mapping.regressor.arrays()
    return next(value for name, value in arrays.items() if name.endswith("rotation"))


def _with_rotation(mapping: CodedMapping, main: GeometricRegressor) -> Any:
    """The unfitted mapping's model with another rotation."""
    import copy

    twin = copy.copy(mapping.regressor)
    inner = next((name for name, value in vars(twin).items() if isinstance(value, GeometricRegressor)), None)
    if inner is None:
        return main
    setattr(twin, inner, main)
    return twin


def person(robot: Robot, arms: Sequence[Bones], body: HumanSkeleton, frames: FloatArray, every: int) -> dict[str, Any]:
    """All figures of one recording; the optimum of single frames is sought at ``every`` so many of them."""
    wanted = wanted_directions(body, frames)
    mapping = unfitted(body, robot)
    followed = mapping.follow(frames, mapping.begin(), 1.0 / FPS, limited=False)[0]
    single = mapping(frames)
    sequence = mapping.sequence(frames, FPS)
    some = slice(None, None, every)
    best = off(arms, optimum(arms, wanted[some], fast=False), wanted[some])
    result: dict[str, Any] = {
        "frames": len(frames),
        "optimum": best,
        "optimum_in_sequence": off(arms, optimum(arms, wanted, fast=True), wanted),
        "unfitted": {
            "single": off(arms, single, wanted),
            "single_above": off(arms, single[some], wanted[some]) - best,
            "sequence": off(arms, sequence, wanted),
            "sequence_above": off(arms, sequence[some], wanted[some]) - best,
            "sequence_unlimited": off(arms, followed, wanted),
            **moving(robot, sequence, wanted),
            "unlimited": moving(robot, followed, wanted),
            "single_frames": moving(robot, single, wanted),
        },
    }
    for name, rival in rivals(body, robot).items():
        poses = rival(frames)
        result[name] = {
            "single": off(arms, poses, wanted),
            "sequence": off(arms, limit_speed(robot, poses, FPS), wanted),
            **moving(robot, poses, wanted),
        }
    return result


def straight_arms(robot: Robot, noise: float = 0.01) -> dict[str, float]:
    """Standard deviation [deg] of every joint with both arms held straight under noise [m], from ten seconds on."""
    body = catalog.get("adult")
    assert isinstance(body, HumanSkeleton)
    rng, worst = np.random.default_rng(0), {}
    poses = {"forward": ((1, 0.1, -0.1), (1, 0, 0)), "hanging": ((0, 0.1, -1), (0.1, 0.05, -1))}
    for name, limbs in poses.items():
        points = np.repeat(body.arm_points(body.standing()), 600, axis=0)
        for side, sign in enumerate((1.0, -1.0)):
            for limb, (x, y, z) in enumerate(limbs):
                along = np.array([x, sign * y, z]) / np.linalg.norm((x, y, z))
                points[:, side, limb + 1] = points[:, side, limb] + body.arm_lengths[side, limb] * along
        points = points + rng.normal(0.0, noise, points.shape)
        path = unfitted(body, robot).sequence(body.frames_from_points(points), FPS)
        spread = np.degrees(path[300:].std(axis=0))
        for joint, value in zip(robot.joint_names, spread, strict=True):
            if joint.endswith("ElbowYaw"):
                worst[f"{name} {joint}"] = float(value)
    return worst


def other_robots(urdfs: Sequence[str], people: dict[str, tuple[HumanSkeleton, FloatArray]]) -> dict[str, Any]:
    """Sequences on arms with more joints against the warm-started optimum under the same speeds."""
    robots = {Path(urdf).stem: Robot(discover(urdf)) for urdf in urdfs}
    try:
        from syda_gym.embodiments.discovery.example_robots import two_armed_robots

        known = two_armed_robots()
        robots.update({name: Robot(known[name]) for name in known if any(part in name for part in SEVEN)})
    except ImportError:
        print("example-robot-data is not installed: its robots are left out")
    result: dict[str, Any] = {}
    for name, robot in robots.items():
        arms, rows = [Bones(robot, 0), Bones(robot, 1)], []
        for body, frames in people.values():
            wanted = wanted_directions(body, frames[:150])
            path = LimbIK.of(robot).sequence(wanted, FPS)
            rows.append((off(arms, path, wanted), off(arms, optimum(arms, wanted, fast=True), wanted)))
        ours, best = np.mean(rows, axis=0)
        result[name] = {"sequence": ours, "optimum_in_sequence": best, "above": ours - best}
        print(f"{name:28s} {ours:6.2f} {best:6.2f}", flush=True)
    return result


def solver_speed(robot: Robot, people: dict[str, tuple[HumanSkeleton, FloatArray]]) -> dict[str, float]:
    """Processor time of one frame [ms] in the solver alone, and of mink in the same process."""
    body, frames = next(iter(people.values()))
    wanted, ik = wanted_directions(body, frames), LimbIK.of(robot)
    ik.follow(wanted[None, :1], ik.begin(), 1.0 / FPS)

    def one_by_one() -> None:
        state = ik.begin()
        for row in wanted:
            _, state = ik.follow(row[None, None], state, 1.0 / FPS)

    rival = rivals(body, robot)["mink"]
    rival(frames[:1])
    spent = {name: _spent(job) / len(frames) for name, job in (
        ("one_frame_ms", one_by_one),
        ("batch_ms", lambda: ik.sequence(wanted, FPS)),
        ("independent_ms", lambda: ik.solve(wanted)),
        ("mink_ms", lambda: rival(frames)),
    )}  # fmt: skip
    return {
        **{name: 1e3 * value for name, value in spent.items()},
        "times_mink": spent["mink_ms"] / spent["one_frame_ms"],
    }


def _spent(job: Callable[[], object]) -> float:
    before = time.process_time()
    job()
    return time.process_time() - before


def summary(files: dict[str, Any]) -> dict[str, Any]:
    """Means over files, and the worst file."""
    rows = list(files.values())

    def mean(*keys: str) -> float:
        return float(np.mean([_at(row, keys) for row in rows]))

    return {
        "files": len(rows),
        "frames": int(sum(row["frames"] for row in rows)),
        "optimum": mean("optimum"),
        "optimum_in_sequence": mean("optimum_in_sequence"),
        **{
            name: {key: mean(name, key) for key in ("single", "sequence", "over_speed", "jumps_per_1000")}
            for name in ("unfitted", "mink", "mink, Procrustes")
        },
        "single_above": mean("unfitted", "single_above"),
        "sequence_above": mean("unfitted", "sequence_above"),
        "worst_single_above": max(row["unfitted"]["single_above"] for row in rows),
        "worst_sequence_above": max(row["unfitted"]["sequence_above"] for row in rows),
        "unlimited": {key: mean("unfitted", "unlimited", key) for key in ("over_speed", "jumps_per_1000")},
    }


def _at(row: dict[str, Any], keys: Sequence[str]) -> float:
    value: Any = row
    for key in keys:
        value = value[key]
    return float(value)


def main() -> None:
    """Measures and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with kinect and bvh")
    parser.add_argument("--robot", default="pepper")
    parser.add_argument("--robots", nargs="*", metavar="URDF", help="further URDFs, beside those of example-robot-data")
    parser.add_argument("--every", type=int, default=3, help="the optimum of single frames is sought at every n-th")
    parser.add_argument("--out", type=Path, help="results file")
    given = parser.parse_args()
    people, robot = recordings(given.data), catalog.resolve(given.robot)
    assert isinstance(robot, Robot)
    arms, files = [Bones(robot, 0), Bones(robot, 1)], {}
    for name, (body, frames) in people.items():
        files[name] = row = person(robot, arms, body, frames, given.every)
        ours = row["unfitted"]
        print(
            f"{name:32s} optimum {row['optimum']:5.2f} sequence {row['optimum_in_sequence']:5.2f}  "
            f"unfitted {ours['single']:5.2f} sequence {ours['sequence']:5.2f} over {ours['over_speed']:.3f} "
            f"jumps {ours['jumps']}  mink {row['mink']['single']:5.2f} {row['mink']['sequence']:5.2f}",
            flush=True,
        )
    result = {
        "robot": robot.name,
        "summary": summary(files),
        "straight_arms_yaw_std_deg": straight_arms(robot),
        "speed": solver_speed(robot, people),
        "files": files,
    }
    if given.robots is not None:
        result["other_robots"] = other_robots(given.robots, people)
    for name, value in result.items():
        if name != "files":
            print(name, value)
    if given.out is not None:
        write_json(given.out, result)


if __name__ == "__main__":
    main()
