"""What one worker of the bed's study computes: a session's fits and errors, or one predictor's values of all routes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.limb_ik.solver import LimbIK
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, SydaError, nearest_name
from syda_gym.evaluation.pools import Tell
from syda_gym.evaluation.prediction.bed import SPEED_SHARE, TestBed, recorded_angles
from syda_gym.evaluation.prediction.trial import BedFrames, fit_all, held_out_errors
from syda_gym.files import fingerprint
from syda_gym.motions.loading import load_motions
from syda_gym.routes.dry_run.imitation import Retargeter, track
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.plan import FPS, Plan
from syda_gym.routes.dry_run.positions import TOP_SPEED
from syda_gym.routes.dry_run.rehearsal import DEPTH_CAMERA, Rehearsal
from syda_gym.routes.measured import fit_options
from syda_gym.routes.metric import Transferability, transferability

__all__ = ["DRY_RUNS", "BedJob", "BedSettings", "bed_routes", "open_bed"]

Names = tuple[str, ...]

_MIDDLING_GAIN = 0.72

_FORMATS = {"session": "1", "dry_run": "3", "T": "1"}  # of what is computed; another one is computed anew


@dataclass(frozen=True, eq=False)
class BedSettings:
    """What the study does with a bed.

    Attributes:
        bed: bodies and motion.
        folds: groups of actions held out in turn.
        fps: frames per second that are fitted.
        max_hops: longest chain.
        method: of the fits.
        preset: of the method.
        seed: of folds, fits and predictors.
    """

    bed: TestBed
    folds: int = 4
    fps: float = 5.0
    max_hops: int = 2
    method: str = "syda"
    preset: str | None = None
    seed: int = 0

    def key(self, job: BedJob) -> str:
        """Everything that decides what a job gives."""
        bodies = [_mark(body) for body in self.bed.bodies.values()]
        numbers = (self.folds, self.fps, self.max_hops, self.method, self.preset, self.seed)
        return fingerprint("bed", _FORMATS[job.kind], *bodies, self.bed.plan.fingerprint, repr(numbers), repr(job))


def _mark(body: Embodiment) -> str:
    """Everything of a body that counts; where its files lie does not."""
    if not isinstance(body, Robot):
        return json.dumps(body.spec(), sort_keys=True, default=str)
    arrays = [body.lower, body.upper, body.speed, body.rest]
    for chain in body.chains:
        arrays += [chain.rotations, chain.offsets, chain.axes, chain.point_offsets]
    return fingerprint(body.name, *(array.tobytes() for array in arrays))


@dataclass(frozen=True)
class BedJob:
    """One piece of work.

    Attributes:
        kind: ``session``, ``dry_run`` or ``T``.
        what: number of the session, name of the dry run, or definition.
    """

    kind: str
    what: str

    @property
    def name(self) -> str:
        """For its file."""
        return f"{self.kind}-{self.what}".replace(" ", "_")


def bed_routes(bodies: Names, max_hops: int) -> list[Names]:
    """Every route of up to ``max_hops`` links, shortest first."""
    return [route for hops in range(1, max_hops + 1) for route in permutations(bodies, hops + 1)]


def open_bed(settings: BedSettings) -> Callable[[BedJob, Tell], dict[str, Any]]:
    """The work of one worker."""

    def work(job: BedJob, tell: Tell) -> dict[str, Any]:
        start = time.process_time()
        kinds = {"session": _session, "dry_run": _dry_run, "T": _terms}
        found = kinds[job.kind](settings, job.what, tell)
        return {**found, "cpu_seconds": time.process_time() - start}

    return work


def _session(settings: BedSettings, what: str, tell: Tell) -> dict[str, Any]:
    """Fits every pair of one session and scores every route on the held-out actions."""
    names = tuple(settings.bed.bodies)
    together = settings.bed.session(int(what))
    table = BedFrames.of(load_motions(together, fps=settings.fps), names)
    if not 2 <= settings.folds <= len(table.distinct):
        raise OptionError(f"folds must be between 2 and the number of actions, {len(table.distinct)}")
    groups = np.array_split(np.random.default_rng(settings.seed).permutation(table.distinct), settings.folds)
    share = {"fit": (0.0, 0.8), "chains": (0.8, 0.2)}

    def progress(stage: str, done: float) -> None:
        begin, length = share[stage]
        tell(begin + length * done)

    options = fit_options(settings.preset, settings.fps) if settings.method == "syda" else {}
    fits = fit_all(table, groups, settings.method, settings.preset, settings.seed, options, progress)
    training, errors = held_out_errors(table, groups, fits, settings.max_hops, progress)
    reach = {name: body.reach for name, body in table.bodies.items()}
    routes = {">".join(route): metres / reach[route[-1]] for route, metres in errors.items()}
    return {"errors": routes, "training": {">".join(pair): error for pair, error in training.items()}}


def _dry_run(settings: BedSettings, what: str, tell: Tell) -> dict[str, Any]:
    """Expected error of every route by one variant of the dry run."""
    if what not in DRY_RUNS:
        raise OptionError(f"unknown dry run {what!r}; {nearest_name(what, DRY_RUNS)}")
    together = DRY_RUNS[what](settings)
    routes = bed_routes(tuple(settings.bed.bodies), settings.max_hops)
    values, spread = {}, {}
    for done, route in enumerate(routes):
        score = together.score(route)
        values[">".join(route)] = score.relative
        spread[">".join(route)] = score.T
        if done % 100 == 0:
            tell(done / len(routes))
    return {"errors": values, "T": spread}


def _terms(settings: BedSettings, what: str, tell: Tell) -> dict[str, Any]:
    """Terms of every ordered pair by a definition; pairs that it does not know are left out."""
    bodies = settings.bed.bodies
    found: dict[str, dict[str, float]] = {}
    pairs = list(permutations(bodies, 2))
    for done, (a, b) in enumerate(pairs):
        tell(done / len(pairs))
        try:
            if what == "paper":
                link: Transferability = transferability(bodies[a], bodies[b], "paper")
            else:
                link = transferability(bodies[a], bodies[b], "general", seed=settings.seed)
        except SydaError:
            continue
        found[f"{a}>{b}"] = {"T": link.T, "C": link.C, "L": link.L, "coverage": link.coverage}
    return {"links": found}


def _plain(settings: BedSettings, plan: Plan | None = None, **options: Any) -> Rehearsal:
    return Rehearsal(settings.bed.bodies, plan or settings.bed.plan, seed=settings.seed, **options)


def _sensors(settings: BedSettings, factor: float) -> Rehearsal:
    people = {name: factor * DEPTH_CAMERA for name, body in settings.bed.bodies.items() if body.kind == "human"}
    return _plain(settings, sensor=people)


def _faster(plan: Plan, factor: float) -> Plan:
    """The same motion at ``factor`` times the tempo."""
    clips = []
    for clip in plan.clips:
        at = np.arange(max(2, int((len(clip) - 1) / factor) + 1)) * factor
        at = np.minimum(at, len(clip) - 1.0)
        before = np.minimum(at.astype(int), len(clip) - 2)
        weight = (at - before)[:, None, None, None]
        mixed = clip[before] * (1.0 - weight) + clip[before + 1] * weight
        clips.append(mixed / np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1e-9))
    return Plan(tuple(clips), plan.actions)


def _half(plan: Plan) -> Plan:
    """Every other action alone."""
    kept = sorted(set(plan.actions))[::2]
    places = [k for k, action in enumerate(plan.actions) if action in kept]
    return Plan(tuple(plan.clips[k] for k in places), tuple(plan.actions[k] for k in places))


def _without_speeds(robot: Robot, index: int, wanted: FloatArray) -> FloatArray:
    """As the default, by motors that know no limit."""
    return _limbs(robot, index, _followed(robot, index, wanted, limited=False))


def _lagging(robot: Robot, index: int, wanted: FloatArray) -> FloatArray:
    """As the default, late as the bed's robots are: a middling gain, and a share of the joints' speeds."""
    angles = _followed(robot, index, wanted, limited=True)
    most = SPEED_SHARE * np.minimum(robot.speed[robot.arm_slices[index]], TOP_SPEED) / FPS
    for frame in range(1, angles.shape[1]):
        step = _MIDDLING_GAIN * (angles[:, frame] - angles[:, frame - 1])
        angles[:, frame] = angles[:, frame - 1] + np.clip(step, -most, most)
    return _limbs(robot, index, angles)


def _followed(robot: Robot, index: int, wanted: FloatArray, *, limited: bool) -> FloatArray:
    """Angles ``(K, T, n)`` of one arm that the library's solver leads."""
    solver = LimbIK.of(robot)
    both = np.repeat(wanted[:, :, None], len(robot.sides), axis=2)
    angles, _ = solver.follow(both, solver.begin(len(wanted)), 1.0 / FPS, limited=limited)
    return np.array(angles[:, :, robot.arm_slices[index]])


def _limbs(robot: Robot, index: int, angles: FloatArray) -> FloatArray:
    """Unit directions ``(K, T, 2, 3)`` of angles ``(K, T, n)`` of one arm."""
    clips, frames = angles.shape[:2]
    limbs = np.diff(robot.chains[index].points(angles.reshape(clips * frames, -1))[:, :3], axis=1)
    unit = limbs / np.maximum(np.linalg.norm(limbs, axis=-1, keepdims=True), 1e-9)
    return np.asarray(unit).reshape(clips, frames, 2, 3)


def _as_recorded(robot: Robot, index: int, wanted: FloatArray) -> FloatArray:
    """The bed's own recording procedure, with the weights of no session that is recorded."""
    both = [np.repeat(clip[:, None], len(robot.sides), axis=1) for clip in wanted]
    found = recorded_angles(robot, both, 10_000)
    return _limbs(robot, index, np.stack([q[:, robot.arm_slices[index]] for q in found]))


def _retargeted(settings: BedSettings, retargeter: str | Retargeter) -> Rehearsal:
    return _plain(settings, retargeter=retargeter)


DRY_RUNS: dict[str, Callable[[BedSettings], Rehearsal]] = {
    "planned motion": _plain,
    "shipped motions": lambda settings: _plain(settings, default_plan()),
    "shipped motions at tempo 3": lambda settings: _plain(settings, _faster(default_plan(), 3.0)),
    "half of the planned actions": lambda settings: _plain(settings, _half(settings.bed.plan)),
    "planned motion at half tempo": lambda settings: _plain(settings, _faster(settings.bed.plan, 0.5)),
    "planned motion at double tempo": lambda settings: _plain(settings, _faster(settings.bed.plan, 2.0)),
    "sensors half as noisy": lambda settings: _sensors(settings, 0.5),
    "sensors twice as noisy": lambda settings: _sensors(settings, 2.0),
    "without joint speeds": lambda settings: _retargeted(settings, _without_speeds),
    "tracked by Gauss-Newton steps": lambda settings: _retargeted(settings, track),
    "limbs pointed with lag": lambda settings: _retargeted(settings, _lagging),
    "limbs pointed": lambda settings: _retargeted(settings, "limbs"),
    "led by positions": lambda settings: _retargeted(settings, "positions"),
    "recording procedure known": lambda settings: _retargeted(settings, _as_recorded),
}
"""Variants of the dry run; the first is the default."""
