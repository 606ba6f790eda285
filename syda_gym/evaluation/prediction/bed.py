"""The test bed: bodies that can fail, and sessions in which they are recorded by a procedure that no predictor knows.

People imitate the planned motion with their own style, timing and range, watched by a noisy depth camera
(``Performer``). Robots are not recorded by the dry run's solver: wrists and elbows are led to *positions* in the
operator's proportions, with a pull towards the robot's own rest, a gain below one (so that it lags) and joint speeds
below the motors'. Weights, gain and habits are drawn anew in every session.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray, Side
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, OptionError, nearest_name
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.synthetic.performance import Performer
from syda_gym.routes.dry_run.plan import FPS, Plan
from syda_gym.routes.dry_run.positions import Pace, led_by_positions

__all__ = ["HUMANS", "ROBOTS", "SPEED_SHARE", "TestBed", "bed_bodies", "recorded_angles"]

HUMANS = ("adult", "kid", "stiff", "long_arms")
"""People of the bed: two sizes, one of limited mobility, one of other proportions."""

ROBOTS = (
    "pepper", "nao", "alex_sake_hands", "baxter", "centauro", "g1_29dof_rev_1_0", "icub", "pr2", "romeo",
    "talos_full_v2", "tiago_dual",
)  # fmt: skip
"""Robots of the bed: one of every family of ``example-robot-data`` with two arms, Pepper and NAO."""

SPEED_SHARE = 0.9
"""Of a joint's top speed, that robots use when they are recorded."""


def bed_bodies(humans: Sequence[str] = HUMANS, robots: Sequence[str] = ROBOTS) -> dict[str, Embodiment]:
    """Bodies by name: of the catalog, or robots of ``example-robot-data``.

    Raises:
        MissingExtraError: a robot of other makers is asked for, and the package is not installed.
        OptionError: an unknown name.
    """
    from syda_gym.embodiments.discovery.example_robots import two_armed_robots

    known = set(catalog.names())
    found = two_armed_robots() if not {*humans, *robots} <= known else {}
    bodies: dict[str, Embodiment] = {}
    for name in (*humans, *robots):
        if name not in known and name not in found:
            raise OptionError(f"no body {name!r} for the bed; {nearest_name(name, [*known, *found])}")
        bodies[name] = catalog.get(name) if name in known else Robot(found[name])
    return bodies


@dataclass(frozen=True, eq=False)
class _Played:
    """A planned clip as something to perform."""

    clip: FloatArray

    @property
    def seconds(self) -> float:
        return len(self.clip) / FPS

    def directions(self, times: FloatArray, side: Side) -> FloatArray:
        path = self.clip[:, 0 if side == "left" else 1]
        at = np.clip(np.asarray(times) * FPS, 0.0, len(path) - 1.0)
        before = np.minimum(at.astype(int), len(path) - 2)
        weight = (at - before)[:, None, None]
        mixed: FloatArray = path[before] * (1.0 - weight) + path[before + 1] * weight
        unit: FloatArray = mixed / np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1e-9)
        return unit


@dataclass(frozen=True, eq=False)
class TestBed:
    """Bodies and what they are asked to do.

    Attributes:
        bodies: name to body.
        plan: the operator's motion.
        name: of the motions.
    """

    bodies: Mapping[str, Embodiment]
    plan: Plan
    name: str = "bed"

    __test__ = False  # not a test, whatever pytest thinks of the name

    def session(self, seed: int) -> Motions:
        """Everybody recorded together, with the styles, lags and noise of one session.

        Args:
            seed: of the session; the same one gives the same bits.

        Raises:
            EmbodimentError: a body that is neither human nor robot.
        """
        frames = {name: self._recorded(name, body, seed) for name, body in self.bodies.items()}
        takes = [
            Take(f"clip{k:02d}", action, FPS, {name: clips[k] for name, clips in frames.items()})
            for k, action in enumerate(self.plan.actions)
        ]
        return Motions(f"{self.name}, session {seed}", tuple(takes), dict(self.bodies), {}, True)

    def _recorded(self, name: str, body: Embodiment, seed: int) -> list[FloatArray]:
        performer = Performer(body, seed)
        played = [_Played(clip) for clip in self.plan.clips]
        labels = [f"clip{k:02d}" for k in range(len(played))]
        if body.kind == "human":
            return [performer.perform(clip, label, FPS)[0] for clip, label in zip(played, labels, strict=True)]
        if not isinstance(body, Robot):
            raise EmbodimentError(f"{name!r} is a {body.kind}; only humans and robots are recorded")
        meant = [performer.directions(clip, label, FPS) for clip, label in zip(played, labels, strict=True)]
        return recorded_angles(body, meant, seed)


def recorded_angles(robot: Robot, meant: Sequence[FloatArray], seed: int) -> list[FloatArray]:
    """Joint angles of a robot that is led by positions, all clips side by side.

    Args:
        robot: who.
        meant: per clip limb directions ``(T, arms, 2, 3)`` at the plan's rate.
        seed: of the session's weights and gain.

    Returns:
        Per clip ``(T, n)`` [rad], within joint limits and joint speeds.
    """
    rng = np.random.default_rng([seed, zlib.crc32(robot.name.encode()), 7])
    elbow, pull, gain = rng.uniform(0.2, 0.6), 10.0 ** rng.uniform(-2.5, -1.7), rng.uniform(0.55, 0.9)
    longest = max(len(clip) for clip in meant)
    together = np.stack([np.concatenate([c, np.repeat(c[-1:], longest - len(c), axis=0)]) for c in meant])
    angles = np.zeros((len(meant), longest, len(robot.joint_names)))
    for arm, part in enumerate(robot.arm_slices):
        pace = Pace(gain, SPEED_SHARE, 1)
        angles[:, :, part] = led_by_positions(robot, arm, together[:, :, arm], np.sqrt([elbow, 1.0]), pull, pace)
    return [robot.clamp(angles[k, : len(clip)]) for k, clip in enumerate(meant)]
