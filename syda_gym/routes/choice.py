"""choose_mapping: from what a user names (bodies, method, route, data) to the mapping that drives the robot."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError, TeleoperationError
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions

__all__ = ["choose_mapping", "geometric_mapping"]


def choose_mapping(
    operator: str | Embodiment,
    robot: str | os.PathLike[str] | Embodiment,
    *,
    mapping: str | os.PathLike[str] = "syda",
    preset: str | None = None,
    route: str | Sequence[str] = "auto",
    motions: str | os.PathLike[str] | Motions = "embedded",
    seed: int = 0,
) -> tuple[Mapping, tuple[str, ...]]:
    """The mapping from an operator to a robot.

    Args:
        operator: who leads.
        robot: who follows: a name, or the path of a description.
        mapping: a method such as ``syda``; ``geometric``, which needs no recordings; a stored mapping, or a folder of
            them.
        preset: of the method.
        route: ``auto`` or the names of the bodies.
        motions: what is fitted on.
        seed: of fits.

    Returns:
        The mapping, and what a person should know about the choice: a robot of which no recordings exist is driven by
        the geometric mapping.

    Raises:
        SydaError: names, routes or files that do not exist; each says what would.
    """
    if Path(mapping).suffix in (".json", ".safetensors"):
        from syda_gym.mappings.storage import load_mapping

        return load_mapping(mapping), ()
    leader, follower = catalog.resolve(operator), catalog.resolve(robot)
    if not isinstance(follower, Robot):
        raise TeleoperationError(f"{follower.name!r} is a {follower.kind}; live commands need a robot such as 'pepper'")
    if mapping == "geometric" and preset is None:
        return geometric_mapping(leader, follower), ()
    stored = Path(mapping).is_dir()
    data = load_motions(motions)
    missing = [body.name for body in (leader, follower) if body.name not in data.bodies]
    if missing and not stored:
        note = (
            f"{data.name} holds no recordings of {' and '.join(missing)}; the geometric mapping is used. Record a pair "
            "with `syda-gym record` to do better"
        )
        return geometric_mapping(leader, follower), (note,)
    from syda_gym.routes.pilot import Pilot

    pilot = Pilot(data, leader.name, follower.name, mapping=mapping, preset=preset, seed=seed)
    return pilot.mapping(pilot.plan(route)[0].bodies), ()


def geometric_mapping(source: Embodiment, target: Robot) -> Mapping:
    """Points the robot's limbs as the operator's, without any recordings.

    Limb directions are taken over as they are in body axes and decoded by closed-form inverse kinematics within the
    joint limits. It knows no error bound.

    Args:
        source: who leads.
        target: who follows.

    Raises:
        MappingError: the bodies share no arm that could be driven.
    """
    from syda_gym.mappings.card import MappingCard, versions
    from syda_gym.mappings.coded_mapping import CodedMapping
    from syda_gym.mappings.coding.arm_coders import arm_coder, shared_arms
    from syda_gym.mappings.methods.arm_problem import main_width
    from syda_gym.mappings.models.heads import HeadedRegressor, fit_head
    from syda_gym.mappings.models.regressors import Regressor
    from syda_gym.mappings.models.rotation import GeometricRegressor

    from_sides, to_sides = shared_arms(source, target)
    frames = _varied(source)
    a = arm_coder(source, frames, from_sides)
    b = arm_coder(target, target.rest[None], to_sides)
    share = source.upper_arm / (source.upper_arm + source.forearm) if isinstance(source, HumanSkeleton) else 0.0
    regressor: Regressor = GeometricRegressor(np.eye(3), share, 0.0)
    codes, rest = a.encode(frames), b.encode(np.repeat(target.rest[None], len(frames), axis=0))
    widths = main_width(a), main_width(b)
    if (a.width, b.width) != widths:  # wrists and the like stay at rest
        head, back = fit_head(codes, rest[..., widths[1] :]), fit_head(rest, codes[..., widths[0] :])
        regressor = HeadedRegressor(regressor, head, back, *widths)
    card = MappingCard(
        method="geometric",
        preset="unfitted",
        seed=0,
        source=source.spec(),
        target=target.spec(),
        source_features=[f"{feature.name} [{feature.unit}]" for feature in source.features],
        target_features=[f"{feature.name} [{feature.unit}]" for feature in target.features],
        data="none",
        versions=versions(),
    )
    return CodedMapping(card, a, b, regressor)


def _varied(body: Embodiment) -> FloatArray:
    """A few frames of a body in different poses, for calibrating coders: ``(64, F)``."""
    rng = np.random.default_rng(0)
    if isinstance(body, Robot):
        return body.clamp(rng.uniform(body.lower, body.upper, (64, body.n_features)))
    if not isinstance(body, HumanSkeleton):
        raise MappingError(f"{body.name!r} is neither a human nor a robot; the geometric mapping needs one of them")
    points = np.repeat(body.arm_points(body.standing()), 64, axis=0)
    limbs = rng.normal(size=(64, len(body.sides), 2, 3))
    limbs *= body.arm_lengths[..., None] / np.linalg.norm(limbs, axis=-1, keepdims=True)
    points[:, :, 1] = points[:, :, 0] + limbs[:, :, 0]
    points[:, :, 2] = points[:, :, 1] + limbs[:, :, 1]
    return body.frames_from_points(points)
