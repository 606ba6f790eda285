"""unfitted: the mapping without any recording, which is what ``general`` starts from."""

from __future__ import annotations

import os

import numpy as np

from syda_gym.embodiments.catalog import resolve
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError
from syda_gym.mappings.card import MappingCard, versions
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.arm_coders import arm_coder, shared_arms
from syda_gym.mappings.methods.arm_problem import main_width, upper_share
from syda_gym.mappings.models.heads import HeadedRegressor, fit_head
from syda_gym.mappings.models.regressors import Regressor
from syda_gym.mappings.models.rotation import GeometricRegressor

__all__ = ["PRESET", "unfitted"]

PRESET = "unfitted"
"""Preset on the cards of mappings that no recording went into."""

_POSES = 64


def unfitted(source: str | os.PathLike[str] | Embodiment, target: str | os.PathLike[str] | Embodiment) -> CodedMapping:
    """Points one body's limbs as the other's, without any recordings.

    Limb directions are taken over as they are in body axes. A robot is decoded by inverse kinematics within its joint
    limits, its other joints stay at rest; a human gets limbs of its own lengths. It maps both ways, finds no frame
    unfamiliar, and knows no error bound.

    Args:
        source: who leads: a body, its name, or the path of a robot's description.
        target: who follows, likewise.

    Returns:
        The mapping; its card says ``geometric``, ``unfitted``.

    Raises:
        EmbodimentError: one body alone, or bodies without an arm that could drive or be driven.

    Example:
        >>> import syda_gym
        >>> adult = syda_gym.embodiment("adult")
        >>> syda_gym.unfitted(adult, "pepper")(adult.standing()).shape
        (10,)
    """
    source, target = resolve(source), resolve(target)
    if source == target:
        raise EmbodimentError(f"{source.name!r} cannot drive itself; name two bodies")
    for body, role in ((source, "drive"), (target, "be driven")):
        if not isinstance(body, HumanSkeleton | Robot) or not body.sides:
            raise EmbodimentError(
                f"{body.name!r} has no arm that could {role}; the geometric mapping takes humans and robots with arms"
            )
    from_sides, to_sides = shared_arms(source, target)
    a, b = arm_coder(source, _calibration(source), from_sides), arm_coder(target, _calibration(target), to_sides)
    regressor: Regressor = GeometricRegressor(np.eye(3), upper_share(a), upper_share(b))
    widths = main_width(a), main_width(b)
    if (a.width, b.width) != widths:  # wrists and the like stay at rest, whatever the other body does
        moved = [coder.encode(_poses(coder.body)) for coder in (a, b)]
        rests = [coder.encode(_rest(coder.body)) for coder in (a, b)]
        head = fit_head(moved[0], rests[1][..., widths[1] :])
        back = fit_head(moved[1], rests[0][..., widths[0] :])
        regressor = HeadedRegressor(regressor, head, back, *widths)
    card = MappingCard(
        method="geometric",
        preset=PRESET,
        seed=0,
        source=source.spec(),
        target=target.spec(),
        source_features=[f"{feature.name} [{feature.unit}]" for feature in source.features],
        target_features=[f"{feature.name} [{feature.unit}]" for feature in target.features],
        data="none",
        versions=versions(),
        note="no recordings, hence no error bound",
    )
    return CodedMapping(card, a, b, regressor)


def _rest(body: Embodiment) -> FloatArray:
    """The pose in which a body waits, ``(64, F)``."""
    rest = body.rest if isinstance(body, Robot) else body.standing()  # type: ignore[attr-defined]
    return np.repeat(np.asarray(rest, dtype=np.float64)[None], _POSES, axis=0)


def _calibration(body: Embodiment) -> FloatArray:
    """Frames from which a coder learns what the body itself says: its rest, or its limbs' lengths."""
    return _rest(body) if isinstance(body, Robot) else _poses(body)


def _poses(body: Embodiment) -> FloatArray:
    """Different poses of a body, ``(64, F)``."""
    rng = np.random.default_rng(0)
    if isinstance(body, Robot):
        return body.clamp(rng.uniform(body.lower, body.upper, (_POSES, body.n_features)))
    assert isinstance(body, HumanSkeleton)
    points = np.repeat(body.arm_points(body.standing()), _POSES, axis=0)
    limbs = rng.normal(size=(_POSES, len(body.sides), 2, 3))
    limbs *= body.arm_lengths[..., None] / np.linalg.norm(limbs, axis=-1, keepdims=True)
    points[:, :, 1] = points[:, :, 0] + limbs[:, :, 0]
    points[:, :, 2] = points[:, :, 1] + limbs[:, :, 1]
    return body.frames_from_points(points)
