"""Re-expressing an operator's recording as frames of a body that a mapping already knows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.errors import MotionError
from syda_gym.motions.clip import Motions

__all__ = ["conformed", "limb_directions_of"]


def limb_directions_of(body: Embodiment, frames: FloatArray) -> FloatArray:
    """Unit directions of upper arm and forearm in body axes.

    Args:
        body: whose frames.
        frames: ``(N, F)``.

    Returns:
        ``(N, arms, 2, 3)``; a limb without length points down.
    """
    links = np.diff(body.arm_points(frames), axis=2)
    lengths = np.linalg.norm(links, axis=-1, keepdims=True)
    return np.where(lengths > 1e-9, links / np.maximum(lengths, 1e-9), np.array([0.0, 0.0, -1.0]))


def conformed(motions: Motions, operator: str, body: HumanSkeleton) -> Motions:
    """The same motions with one human re-expressed as another one: same limb directions, the other's proportions.

    A mapping is fitted for a body of the catalog, say the adult; this is how your own recording becomes frames of it.

    Args:
        motions: hold ``operator``.
        operator: name of the human to re-express.
        body: as whom; it may have fewer arms.

    Returns:
        Motions in which ``body.name`` has taken the operator's place.

    Raises:
        MotionError: the operator is no human of these motions, or lacks an arm that ``body`` has.
    """
    source = motions.clips(operator)[0].body
    if not isinstance(source, HumanSkeleton):
        raise MotionError(f"{motions.name}: {operator!r} is a {source.kind}; only humans can be re-expressed")
    missing = [side for side in body.sides if side not in source.sides]
    if missing:
        raise MotionError(f"{motions.name}: {operator!r} has no {missing[0]} arm, which {body.name!r} needs")
    if body.name in motions.bodies and body.name != operator:
        raise MotionError(f"{motions.name} already has a body {body.name!r}; choose another name")
    arms = [source.sides.index(side) for side in body.sides]
    takes = []
    for take in motions.takes:
        if operator not in take.frames:
            takes.append(take)
            continue
        frames = {name: values for name, values in take.frames.items() if name != operator}
        filled = {name: marks for name, marks in take.filled.items() if name != operator}
        frames[body.name] = _rebuilt(source, body, take.frames[operator], arms)
        if operator in take.filled:
            marks = take.filled[operator].reshape(len(take.filled[operator]), len(source.sides), -1)
            filled[body.name] = marks[:, arms].reshape(len(marks), -1)
        takes.append(replace(take, frames=frames, filled=filled))
    bodies = {body.name if name == operator else name: b for name, b in motions.bodies.items()}
    bodies[body.name] = body
    notes = (*motions.notes, f"{operator} re-expressed as {body.name}: limb directions kept, proportions replaced")
    return replace(motions, takes=tuple(takes), bodies=bodies, notes=notes)


def _rebuilt(source: HumanSkeleton, body: HumanSkeleton, frames: FloatArray, arms: list[int]) -> FloatArray:
    limbs = limb_directions_of(source, frames)[:, arms]
    standing = body.arm_points(body.standing())[0]
    points = np.empty((len(frames), len(arms), 3, 3))
    points[:, :, 0] = standing[:, 0]
    points[:, :, 1] = points[:, :, 0] + body.upper_arm * limbs[:, :, 0]
    points[:, :, 2] = points[:, :, 1] + body.forearm * limbs[:, :, 1]
    return body.frames_from_points(points)
