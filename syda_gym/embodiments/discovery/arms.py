"""Arms found by themselves in any URDF: which joints they have, which side they are on, where they bend."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from syda_gym.embodiments.description import ArmDescription, RobotDescription
from syda_gym.embodiments.discovery.landmarks import find_landmarks
from syda_gym.embodiments.discovery.limbs import (
    Limb,
    find_limbs,
    is_movable,
    kind_by_name,
    movable_above,
    side_by_name,
)
from syda_gym.embodiments.discovery.orientation import body_axes
from syda_gym.embodiments.embodiment import SIDES, FloatArray, Side
from syda_gym.embodiments.kinematics.urdf import UrdfTree, read_urdf, zero_placements
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, nearest_name

__all__ = ["Found", "discover", "discover_robot", "search"]


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes:
        description: for ``Robot``.
        notes: what a person should know about the file and the search.
        left_out: joints of the arms' limbs that are not used, such as prismatic ones, gears and followers.
    """

    description: RobotDescription
    notes: tuple[str, ...]
    left_out: tuple[str, ...]


def discover_robot(
    urdf: str | os.PathLike[str],
    *,
    name: str | None = None,
    left: str | None = None,
    right: str | None = None,
    torso: str | None = None,
) -> Robot:
    """The robot of a URDF, its arms found as in ``discover``."""
    return Robot(discover(urdf, name=name, left=left, right=right, torso=torso))


def discover(
    urdf: str | os.PathLike[str],
    *,
    name: str | None = None,
    left: str | None = None,
    right: str | None = None,
    torso: str | None = None,
) -> RobotDescription:
    """Finds the arms of a robot.

    An arm is an unbranched run of at least two revolute joints that ends in a hand or at a tip. Names tell arms from
    legs and heads (shoulder, elbow, wrist against hip, knee, ankle); runs whose names say nothing count as arms if
    there are at most two. Names tell left from right, positions where names do not. Shoulder, elbow and wrist are where
    the joint axes say (``discovery.landmarks``), body axes follow from the shoulders (``discovery.orientation``).
    Check what was found: the description is meant to be edited.

    Args:
        urdf: path of the URDF; meshes are not needed.
        name: name of the robot; by default the file's.
        left: link at the end of the left arm, if the search finds the wrong one.
        right: link at the end of the right arm.
        torso: link in whose frame landmarks are expressed; by default the last one that both arms hang from.

    Returns:
        A description for ``Robot``, with one or two arms. ``height`` is the extent of the link origins, an estimate.

    Raises:
        EmbodimentError: not a URDF, no arm, more arms than can be told apart, unknown links.
    """
    return search(urdf, name=name, left=left, right=right, torso=torso).description


def search(
    urdf: str | os.PathLike[str],
    *,
    name: str | None = None,
    left: str | None = None,
    right: str | None = None,
    torso: str | None = None,
) -> Found:
    """``discover``, with what a person should know about the file and the search.

    Raises:
        EmbodimentError: as ``discover``.
    """
    path = Path(urdf)
    tree = read_urdf(path)
    placements = zero_placements(tree)
    if left is None and right is None:
        chosen = _arms_by_search(tree, placements)
    else:
        chosen = _arms_by_name(tree, {"left": left, "right": right})
    _refuse_cut_arms(tree, chosen)
    if torso is None:
        torso = _common_link(tree, [joints[0] for joints in chosen.values()])
    elif torso not in tree.links():
        raise EmbodimentError(f"{path.name} has no link {torso!r}; {nearest_name(torso, tree.links())}")
    tree.limits([joint for joints in chosen.values() for joint in joints])  # every faulty joint is named at once
    tips = {"left": left, "right": right}
    arms, failures = [], []
    for side, joints in chosen.items():
        try:
            arms.append(find_landmarks(tree, placements, side, joints, tips[side]))
        except EmbodimentError as error:
            failures.append(f"{error}{_prismatic_reason(tree, joints, chosen)}")
    if failures:
        raise EmbodimentError(" | ".join(failures))
    axes = _axes(tree, placements, arms)
    origins = np.array([placement[:3, 3] for placement in placements.values()])
    description = RobotDescription(
        name=name or path.stem,
        urdf=path.resolve(),
        torso=torso,
        height=max(float(np.ptp(origins @ axes[2])), 0.1),
        arms=tuple(arms),
        axes=_torso_axes(axes @ placements[torso][:3, :3]),
    )
    unused = _left_out(tree, arms)
    return Found(description, (*tree.notes, *_notes(tree, arms, chosen)), unused)


def _notes(tree: UrdfTree, arms: Sequence[ArmDescription], chosen: dict[Side, tuple[str, ...]]) -> list[str]:
    notes = []
    sliding = [name for joints in chosen.values() for name in _sliding_above(tree, joints)]
    if sliding:
        names = ", ".join(dict.fromkeys(sliding))
        notes.append(f"prismatic joints are not driven and stand still: {names}")
    followers = [
        name
        for arm in arms
        for name in tree.path_to(tree.joints[arm.joints[0]].parent, arm.tip) or ()
        if tree.joints[name].mimic is not None and tree.joints[name].type != "fixed"
    ]
    if followers:
        notes.append(f"joints that follow others (<mimic>) stand still: {', '.join(dict.fromkeys(followers))}")
    used = [name for arm in arms for name in arm.joints]
    unknown = [name for name in tree.placeholders if name in used]
    if unknown:
        notes.append(
            f"the efforts or speeds stated for {', '.join(unknown)} are placeholders that no motor has (such as 0, "
            "-1 or 1e9); taken as unknown"
        )
    return notes


def _left_out(tree: UrdfTree, arms: Sequence[ArmDescription]) -> tuple[str, ...]:
    """Movable joints at or below an arm's first joint, or right above it, that are not used."""
    used = {name for arm in arms for name in arm.joints}
    found = [
        name
        for name, joint in tree.joints.items()
        if name not in used
        and joint.type != "fixed"
        and any(tree.path_to(tree.joints[arm.joints[0]].child, joint.child) is not None for arm in arms)
    ]
    above = [name for arm in arms for name in _sliding_above(tree, arm.joints)]
    return tuple(dict.fromkeys([*above, *found]))


def _sliding_above(tree: UrdfTree, joints: Sequence[str]) -> list[str]:
    """Prismatic joints between the root and an arm."""
    return [name for name in movable_above(tree, joints[0]) if tree.joints[name].type == "prismatic"]


def _sliding_below(tree: UrdfTree, joints: Sequence[str]) -> tuple[str, str] | None:
    """A prismatic joint right behind an arm from which at least two turning joints go on, and the first of these."""
    last = tree.joints[joints[-1]].child
    for name in tree.joints:
        if not is_movable(tree, name) or tree.joints[name].type == "prismatic":
            continue
        if tree.path_to(last, tree.joints[name].child) is None:
            continue
        above = movable_above(tree, name)
        between = above[: above.index(joints[-1])] if joints[-1] in above else []
        sliding = [joint for joint in between if tree.joints[joint].type == "prismatic"]
        turning = [joint for joint in between if tree.joints[joint].type != "prismatic"]
        if sliding and turning and between[-1] in sliding:  # a gripper's jaws turn no further joints
            return sliding[-1], turning[-1]
    return None


def _prismatic_reason(tree: UrdfTree, joints: Sequence[str], chosen: dict[Side, tuple[str, ...]]) -> str:
    """Why an arm may be but a wrist: it hangs on prismatic joints, which are not driven."""
    sliding = _sliding_above(tree, joints)[::-1]
    if not sliding:
        return ""
    names = ", ".join(sliding)
    return f". It hangs on the prismatic joints {names}, which slide and are not driven: arms are made of turning ones"


def _refuse_cut_arms(tree: UrdfTree, chosen: dict[Side, tuple[str, ...]]) -> None:
    """An arm with a prismatic joint between turning ones would be found from there on only."""
    for side, joints in chosen.items():
        above = movable_above(tree, joints[0])
        others = {name for other, theirs in chosen.items() if other != side for name in movable_above(tree, theirs[0])}
        own = [name for name in above if name not in others] if len(chosen) > 1 else above
        below = _sliding_below(tree, joints)
        if below:
            raise EmbodimentError(
                f"{tree.path.name}: the {side} arm has the prismatic joint {below[0]!r} between {joints[-1]!r} and "
                f"{below[1]!r}; arms are made of turning joints. Make it fixed, or name arms without it"
            )
        slides = [name for name in own if tree.joints[name].type == "prismatic"]
        turns = [
            name
            for name in own
            if tree.joints[name].type != "prismatic" and slides and above.index(name) > above.index(slides[0])
        ]
        named = [name for name in turns if kind_by_name([name, tree.joints[name].child]) == "arm"]
        if slides and (named or (len(chosen) > 1 and turns)):
            raise EmbodimentError(
                f"{tree.path.name}: the {side} arm has the prismatic joint {slides[0]!r} between "
                f"{(named or turns)[0]!r} and {joints[0]!r}; arms are made of turning joints. "
                "Make it fixed, or name arms without it"
            )


def _arms_by_search(tree: UrdfTree, placements: dict[str, FloatArray]) -> dict[Side, tuple[str, ...]]:
    limbs = find_limbs(tree, placements)
    arms = [limb for limb in limbs if limb.kind == "arm"] or [limb for limb in limbs if limb.kind == "unknown"]
    if not arms:
        found = ", ".join(f"{limb.joints[0]}..{limb.joints[-1]} ({limb.kind})" for limb in limbs) or "no limb"
        locked = [n for n, j in tree.joints.items() if j.type == "revolute" and not is_movable(tree, n) and not j.mimic]
        also = f" {len(locked)} joints are locked by equal limits, e.g. {locked[0]!r}." if locked else ""
        raise EmbodimentError(
            f"{tree.path.name} has no arm: expected a run of revolute joints that ends in a hand or tip, found {found}."
            f"{also} Name the last link of an arm: left=LINK and/or right=LINK"
        )
    sides: dict[Side, tuple[str, ...]] = {}
    for limb in arms:
        side = _side(tree, placements, limb, alone=len(arms) == 1)
        if side in sides:
            ends = ", ".join(arm.last_link for arm in arms)
            raise EmbodimentError(
                f"{tree.path.name} has {len(arms)} limbs that may be arms, ending at {ends}; say which two: "
                "left=LINK, right=LINK"
            )
        sides[side] = limb.joints
    return {side: sides[side] for side in SIDES if side in sides}


def _arms_by_name(tree: UrdfTree, tips: dict[Side, str | None]) -> dict[Side, tuple[str, ...]]:
    paths: dict[Side, list[str]] = {}
    for side, link in tips.items():
        if link is None:
            continue
        if link not in tree.links():
            raise EmbodimentError(f"{tree.path.name} has no link {link!r}; {nearest_name(link, tree.links())}")
        paths[side] = _turning_path(tree, link)
        if len(paths[side]) < 2:
            raise EmbodimentError(
                f"{tree.path.name}: {len(paths[side])} revolute joints lead to {link!r}; an arm needs at least two"
            )
    shared = set.intersection(*(set(path) for path in paths.values())) if len(paths) == 2 else set()
    if any(shared >= set(path) for path in paths.values()):
        raise EmbodimentError(f"{tree.path.name}: left {tips['left']!r} and right {tips['right']!r} are one arm")
    return {side: tuple(name for name in path if name not in shared) for side, path in paths.items()}


def _turning_path(tree: UrdfTree, link: str) -> list[str]:
    """Revolute joints that lead to a link without a prismatic one between them."""
    path: list[str] = []
    while link in tree.parent_joint:
        name = tree.parent_joint[link]
        if is_movable(tree, name):
            if tree.joints[name].type == "prismatic":
                break
            path.append(name)
        link = tree.joints[name].parent
    return path[::-1]


def _side(tree: UrdfTree, placements: dict[str, FloatArray], limb: Limb, alone: bool) -> Side:
    named = side_by_name([*limb.joints, *(tree.joints[name].child for name in limb.joints)])
    if named is not None:
        return named
    lateral = float(placements[tree.joints[limb.joints[0]].child][1, 3])
    if alone and abs(lateral) < 0.02:
        return "right"
    return "left" if lateral > 0.0 else "right"


def _common_link(tree: UrdfTree, firsts: Sequence[str]) -> str:
    """The last link that all arms hang from."""
    roads = []
    for joint in firsts:
        road = [tree.joints[joint].parent]
        while road[-1] in tree.parent_joint:
            road.append(tree.joints[tree.parent_joint[road[-1]]].parent)
        roads.append(road)
    link: str = next(link for link in roads[0] if all(link in road for road in roads[1:]))
    return link


def _axes(tree: UrdfTree, placements: dict[str, FloatArray], arms: Sequence[ArmDescription]) -> FloatArray:
    """Forward, left and up in the root's frame."""
    shoulders = []
    for arm in arms:
        frame = placements[arm.shoulder]
        shoulders.append(frame[:3, 3] + frame[:3, :3] @ np.array(arm.point_offsets[0]))
    middles = [np.mean([placements[tree.joints[name].child][:3, 3] for name in arm.joints], axis=0) for arm in arms]
    return body_axes(tree, placements, shoulders, middles, find_limbs(tree, placements))


def _torso_axes(rotation: FloatArray) -> tuple[tuple[float, float, float], ...] | None:
    """Rotation from the torso link's frame to body axes; ``None`` if they agree."""
    if np.allclose(rotation, np.eye(3), atol=1e-3):
        return None
    rounded = np.where(np.abs(rotation - np.round(rotation)) < 1e-6, np.round(rotation), rotation)
    return tuple((float(row[0]), float(row[1]), float(row[2])) for row in rounded + 0.0)
