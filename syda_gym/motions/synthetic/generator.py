"""The embedded default motions: generated from a seed, nobody's recording.

Every take is one action performed together by several bodies, frame by frame, each with its own proportions, posture
bias, timing lag and style; humans are watched by a simulated depth camera with noise and dropouts, robots stay within
their joint limits and speeds. The motions stand in for recordings so that everything works without any; results on them
say how methods compare, not how well a real person would be followed.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import OptionError, nearest_name
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.synthetic.actions import ACTIONS, FAMILIES, REST, Action
from syda_gym.motions.synthetic.performance import Performer, Score

__all__ = ["BODIES", "EMBEDDED_SEED", "EMBEDDED_VARIANTS", "TEMPOS", "generate"]

BODIES = ("adult", "kid", "pepper", "nao", "tall", "child", "long_arms", "stiff", "left_only")
"""Who performs the embedded motions."""

EMBEDDED_SEED = 20240
EMBEDDED_VARIANTS = 2

TEMPOS = (1.0, 1.35, 0.75)
"""Relative speeds, one after the other over the variants of an action."""

_PAUSE = 0.35  # s of rest at either end
_PACE = 0.42  # s per arm length of wrist travel


def generate(
    bodies: Sequence[str | Embodiment] = BODIES,
    *,
    seed: int = EMBEDDED_SEED,
    actions: Sequence[str] | None = None,
    families: Sequence[str] | None = None,
    variants: int = EMBEDDED_VARIANTS,
    noise: float = 1.0,
    variety: float = 1.0,
    tempo: float = 1.0,
    fps: float = 30.0,
    name: str = "synthetic",
) -> Motions:
    """Generates synthetic motions of several bodies that perform together.

    What a body does in a take depends on seed, body, action and variant alone: leaving others out changes nothing.

    Args:
        bodies: names in the catalog, or bodies.
        seed: everything random follows from it.
        actions: names out of ``actions.ACTIONS``; all by default.
        families: keep only actions of these families.
        variants: takes per action; they differ in tempo, leading arm, repeats and in the poses themselves.
        noise: factor on camera noise and dropouts of humans; 0 gives clean motions.
        variety: factor on differences between bodies in style, lag and precision.
        tempo: factor on the speed of everything.
        fps: frames per second.
        name: of the data set.

    Returns:
        Motions marked as synthetic, with the family of each action.

    Raises:
        OptionError: unknown action or family, or a number out of range.
        EmbodimentError: unknown body.
    """
    chosen = _chosen(actions, families)
    for label, value, low, high in (
        ("variants", variants, 1, 10_000),
        ("noise", noise, 0.0, 10.0),
        ("variety", variety, 0.0, 3.0),
        ("tempo", tempo, 0.1, 3.0),
        ("fps", fps, 1.0, 1000.0),
    ):
        if not low <= value <= high:
            raise OptionError(f"{label} must be between {low} and {high}, got {value}")
    resolved = [catalog.resolve(body) for body in bodies]
    names = [body.name for body in resolved]
    if not names or len(set(names)) != len(names):
        raise OptionError(f"bodies must be at least one and distinct, got {names}")
    performers = [Performer(body, seed, noise, variety) for body in resolved]
    takes = [_take(performers, action, variant, seed, tempo, fps) for action in chosen for variant in range(variants)]
    return Motions(
        name,
        tuple(takes),
        {body.name: body for body in resolved},
        families={action.name: action.family for action in chosen},
        synthetic=True,
    )


def _chosen(actions: Sequence[str] | None, families: Sequence[str] | None) -> list[Action]:
    for action in actions or ():
        if action not in FAMILIES:
            raise OptionError(f"unknown action {action!r}; {nearest_name(action, FAMILIES)}")
    known = sorted(set(FAMILIES.values()))
    for family in families or ():
        if family not in known:
            raise OptionError(f"unknown family {family!r}; {nearest_name(family, known)}")
    chosen = [
        action
        for action in ACTIONS
        if (actions is None or action.name in actions) and (families is None or action.family in families)
    ]
    if not chosen:
        raise OptionError("the choice of actions and families leaves nothing to perform")
    return chosen


def _take(performers: Sequence[Performer], action: Action, variant: int, seed: int, tempo: float, fps: float) -> Take:
    recording = f"{action.name}-{variant + 1:02d}"
    score = _score(action, variant, seed, tempo)
    frames: dict[str, FloatArray] = {}
    filled = {}
    for performer in performers:
        frames[performer.body.name], held = performer.perform(score, recording, fps)
        if held is not None and held.any():
            filled[performer.body.name] = held
    return Take(recording, action.name, fps, frames, filled=filled)


def _score(action: Action, variant: int, seed: int, tempo: float) -> Score:
    """Key poses over time: rest, the action's cycle as often as fits into a few seconds, rest."""
    rng = np.random.default_rng([seed, zlib.crc32(action.name.encode()), variant])
    lead, other = _table(action.lead), _table(action.other)
    shift = rng.normal(0.0, 0.035, (2, 3))
    lead[:, :3] += shift[0] + rng.normal(0.0, 0.025, lead[:, :3].shape)
    other[:, :3] += shift[1] + rng.normal(0.0, 0.025, other[:, :3].shape)
    speed = tempo * TEMPOS[variant % len(TEMPOS)] * rng.uniform(0.92, 1.08)
    cycle = _durations(np.vstack([lead, lead[:1]]), np.vstack([other, other[:1]]), speed)
    wanted = rng.uniform(3.2, 4.7) / tempo
    repeats = max(1, round(float((wanted - 2 * _PAUSE) / cycle.sum())))
    rest = _table([REST])
    lead, other = (np.vstack([rest, rest, *[arm] * repeats, rest, rest]) for arm in (lead, other))
    steps = _durations(lead, other, speed)
    steps[0] = steps[-1] = _PAUSE
    times = np.concatenate([[0.0], np.cumsum(steps)])
    left, right = (other, lead) if variant % 2 == 0 else (lead, other)
    return Score(times, left, right, float(times[-1]))


def _table(poses: Sequence[tuple[float, ...]]) -> FloatArray:
    return np.array([(*pose, 0.0)[:4] for pose in poses], dtype=np.float64)


def _durations(lead: FloatArray, other: FloatArray, speed: float) -> FloatArray:
    """Seconds between key poses: by the longer way of both wrists; equal poses are held."""
    way = np.maximum(*(np.linalg.norm(np.diff(arm[:, :3], axis=0), axis=1) for arm in (lead, other)))
    result: FloatArray = (0.14 + _PACE * np.sqrt(way)) / speed
    return result
