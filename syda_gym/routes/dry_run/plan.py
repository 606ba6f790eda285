"""Plan: the motion that an operator means to do, as limb directions over time, before anything is recorded."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import fingerprint
from syda_gym.motions.clip import Motions

__all__ = ["FPS", "MOST_CLIPS", "SECONDS", "Plan", "limb_directions", "plan_from_motions"]

FPS = 15.0
"""Of imitation; enough for joint speeds to matter, and few enough frames for seconds of work."""

SECONDS = 6.0
"""A clip is cut after so much: long recordings would otherwise decide alone."""

MOST_CLIPS = 32
"""With 8 clips the prediction loses .04 of rank correlation, with more than 32 it gains nothing."""

_LEAST_FRAMES = 4


@dataclass(frozen=True, eq=False)
class Plan:
    """What the operator means to do.

    Attributes:
        clips: limb directions per clip ``(T, 2, 2, 3)`` at ``FPS``: arm (left, right), limb (upper arm, forearm), unit
            vector in body axes. Clips keep the tempo of their recording, because joint speeds are part of the question.
        actions: what is done in each clip; folds hold out whole actions.
    """

    clips: tuple[FloatArray, ...]
    actions: tuple[str, ...]

    def __post_init__(self) -> None:
        if len(self.clips) != len(self.actions) or not self.clips:
            raise MotionError(f"a plan needs one action per clip and at least one clip, got {len(self.clips)} clips")
        for clip, action in zip(self.clips, self.actions, strict=True):
            if clip.ndim != 4 or clip.shape[1:] != (2, 2, 3) or len(clip) < 2 or not np.isfinite(clip).all():
                raise MotionError(
                    f"planned clip of {action!r}: expected finite limb directions (T >= 2, 2, 2, 3), got {clip.shape}"
                )

    @cached_property
    def fingerprint(self) -> str:
        """Of every number in it."""
        return fingerprint("plan", *self.actions, *(clip.tobytes() for clip in self.clips))

    def __add__(self, other: Plan) -> Plan:
        """Both plans' clips."""
        return Plan((*self.clips, *other.clips), (*self.actions, *other.actions))

    def __len__(self) -> int:
        """Number of clips."""
        return len(self.clips)


def limb_directions(body: Embodiment, frames: FloatArray, fps: float) -> FloatArray:
    """Limb directions ``(T, 2, 2, 3)`` at ``FPS`` of recorded frames, turned so that the body faces forward.

    Args:
        body: with two arms.
        frames: ``(N, F)`` in time order.
        fps: of ``frames``.

    Raises:
        MotionError: a body without two arms, or fewer than four frames.
    """
    if len(body.sides) != 2:
        raise MotionError(f"a plan needs a performer with two arms, {body.name!r} has {' and '.join(body.sides)}")
    if len(frames) < _LEAST_FRAMES:
        raise MotionError(f"a planned clip needs at least {_LEAST_FRAMES} frames, got {len(frames)}")
    points = body.arm_points(frames)
    across = points[:, 0, 0] - points[:, 1, 0]
    flat = np.maximum(np.hypot(across[:, 0], across[:, 1]), 1e-9)[:, None, None]
    cosine, sine = across[:, 1][:, None, None] / flat, across[:, 0][:, None, None] / flat
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    facing = np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)
    directions = _unit(np.diff(facing, axis=2))
    times = np.arange(int(min(SECONDS, (len(directions) - 1) / fps) * FPS) + 1) / FPS * fps
    if len(times) < 2:
        raise MotionError(f"a clip of {len(frames)} frames at {fps:g} Hz is shorter than two frames at {FPS:g} Hz")
    before = np.minimum(times.astype(int), len(directions) - 2)
    weight = (times - before)[:, None, None, None]
    return _unit(directions[before] * (1.0 - weight) + directions[before + 1] * weight)


def plan_from_motions(motions: Motions, body: str, *, most: int = MOST_CLIPS, seed: int = 0) -> Plan:
    """The clips of one body as a plan.

    Args:
        motions: recordings, real or synthetic.
        body: who performs them.
        most: clips at most; of more, some are drawn.
        seed: of the draw.

    Raises:
        MotionError: the motions hold no usable clip of that body.
    """
    takes = [take for take in motions.takes if body in take.frames and not take.mirrored]
    takes = [take for take in takes if len(take.frames[body]) >= _LEAST_FRAMES]
    if not takes:
        raise MotionError(
            f"{motions.name} holds no clip of {body!r} with {_LEAST_FRAMES} frames or more, so nothing can be planned; "
            f"it has {', '.join(motions.bodies)}"
        )
    order = np.random.default_rng(seed).permutation(len(takes))[:most]
    chosen = [takes[index] for index in order]
    performer = motions.bodies[body]
    clips = [limb_directions(performer, take.frames[body], take.fps) for take in chosen]
    return Plan(tuple(clips), tuple(take.action for take in chosen))


def joined(plans: Iterable[Plan]) -> Plan:
    """One plan of several."""
    found = list(plans)
    total = found[0]
    for plan in found[1:]:
        total = total + plan
    return total


def _unit(vectors: FloatArray) -> FloatArray:
    scaled: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    return scaled
