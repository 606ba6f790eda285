"""Arms found by themselves in any URDF: which joints they have, which side they are on, where they bend."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from syda_gym.embodiments.discovery.limbs import Limb, find_limbs, is_movable, side_by_name
from syda_gym.embodiments.embodiment import SIDES, FloatArray, Side
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.urdf import UrdfTree, arm_chain, read_urdf, zero_placements
from syda_gym.embodiments.robot import ArmDescription, Robot, RobotDescription
from syda_gym.errors import EmbodimentError, nearest_name

__all__ = ["discover", "discover_robot"]

_TIP = re.compile(r"tool|tcp|tip|ee($|_)|eef|endpoint|end_effector|gripper|palm|hand|grasp|flange", re.I)
_SENSOR = re.compile(
    r"cam|imu|force|sensor|optical|marker|light|accelero|range|itb|virtual|collision|shape|(^|_)ft($|_)", re.I
)
_FINGER = re.compile(r"finger|thumb", re.I)
_SWINGING = 0.5  # a joint swings a point if its lever is at least this share of the longest one


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
    there are at most two. Names tell left from right, positions where names do not. The elbow is the joint that
    changes the distance from shoulder to tip most; shoulder and wrist are the nearest joints on its two sides that
    bend the arm rather than turn it about itself. Check what was found: the description is meant to be edited.

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
    path = Path(urdf)
    tree = read_urdf(path)
    placements = zero_placements(tree)
    if left is None and right is None:
        chosen = _arms_by_search(tree, placements)
    else:
        chosen = _arms_by_name(tree, {"left": left, "right": right})
    if torso is None:
        torso = _common_link(tree, [joints[0] for joints in chosen.values()])
    elif torso not in tree.links():
        raise EmbodimentError(f"{path.name} has no link {torso!r}; {nearest_name(torso, tree.links())}")
    tips = {"left": left, "right": right}
    arms = tuple(_describe(tree, placements, side, joints, tips[side]) for side, joints in chosen.items())
    origins = np.array([placement[:3, 3] for placement in placements.values()])
    up = _body_axes(tree, placements, chosen)[2]
    return RobotDescription(
        name=name or path.stem,
        urdf=path.resolve(),
        torso=torso,
        height=max(float(np.ptp(origins @ up)), 0.1),
        arms=arms,
        axes=_torso_axes(tree, placements, chosen, torso),
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


def _body_axes(tree: UrdfTree, placements: dict[str, FloatArray], arms: dict[Side, tuple[str, ...]]) -> FloatArray:
    """Rows: forward, left and up in the root's frame. ROS has them along x, y, z, but not every model does."""
    axes = np.eye(3)
    if len(arms) < 2:
        return axes
    # The middle of each arm, because the first joints of both may share one place on the breastbone.
    middle = {
        side: np.mean([placements[tree.joints[name].child][:3, 3] for name in joints], axis=0)
        for side, joints in arms.items()
    }
    lateral = middle["left"] - middle["right"]
    if np.linalg.norm(lateral) < 1e-3:
        return axes
    left = np.eye(3)[np.argmax(np.abs(lateral))] * np.sign(lateral[np.argmax(np.abs(lateral))])
    up = np.array([0.0, 0.0, 1.0])
    if abs(left @ up) > 0.5:  # a model whose z points sideways: up is where the arms are, seen from the rest
        origins = np.array([placement[:3, 3] for placement in placements.values()])
        rise = 0.5 * (middle["left"] + middle["right"]) - origins.mean(axis=0)
        rise -= left * (left @ rise)
        up = np.eye(3)[np.argmax(np.abs(rise))] * np.sign(rise[np.argmax(np.abs(rise))])
    return np.array([np.cross(left, up), left, up])


def _torso_axes(
    tree: UrdfTree, placements: dict[str, FloatArray], arms: dict[Side, tuple[str, ...]], torso: str
) -> tuple[tuple[float, float, float], ...] | None:
    """Rotation from the torso link's frame to body axes; ``None`` if they agree."""
    rotation = _body_axes(tree, placements, arms) @ placements[torso][:3, :3]
    if np.allclose(rotation, np.eye(3), atol=1e-3):
        return None
    rounded = np.where(np.abs(rotation - np.round(rotation)) < 1e-6, np.round(rotation), rotation)
    return tuple((float(row[0]), float(row[1]), float(row[2])) for row in rounded + 0.0)


def _describe(
    tree: UrdfTree, placements: dict[str, FloatArray], side: Side, joints: tuple[str, ...], tip: str | None
) -> ArmDescription:
    links = [tree.joints[name].child for name in joints]
    tip = tip or _tip(tree, placements, links[-1])
    chain = arm_chain(tree, tree.joints[joints[0]].parent, side, joints, (links[0], links[0], tip, tip))
    origins = np.array([placements[link][:3, 3] for link in links])
    axes = np.array([placements[link][:3, :3] @ axis for link, axis in zip(links, chain.axes, strict=True)])
    end = placements[tip][:3, 3]
    elbow = _elbow(chain)
    return ArmDescription(
        side=side,
        joints=joints,
        shoulder=links[_shoulder(origins, axes, elbow)],
        elbow=links[elbow],
        wrist=_wrist(links, origins, axes, elbow, end) or tip,
        tip=tip,
    )


def _tip(tree: UrdfTree, placements: dict[str, FloatArray], last: str) -> str:
    """The link that ends the arm: a tool, palm or hand fixed behind the last joint, else the last link."""
    origin = placements[last][:3, 3]
    fixed = [link for link in sorted(tree.links()) if _fixed_to(tree, last, link) and not _SENSOR.search(link)]
    named = [link for link in fixed if _TIP.search(link) and not _FINGER.search(link)]
    distances = {link: float(np.linalg.norm(placements[link][:3, 3] - origin)) for link in named or fixed}
    best = max(distances, key=lambda link: distances[link], default=last)
    return best if distances.get(best, 0.0) > 1e-6 else last


def _fixed_to(tree: UrdfTree, last: str, link: str) -> bool:
    path = tree.path_to(last, link)
    return bool(path) and all(tree.joints[name].type == "fixed" for name in path or ())


def _elbow(chain: ArmChain) -> int:
    """The joint that changes the distance from the first joint to the tip most, on average over the joint limits."""
    rng = np.random.default_rng(0)
    q = rng.uniform(chain.lower, chain.upper, (512, chain.n_joints))
    points, jacobians = chain.jacobians(q)
    arm = points[:, 3] - chain.offsets[0]
    length = np.linalg.norm(arm, axis=1, keepdims=True)
    direction = arm / np.maximum(length, 1e-9)
    effect = np.abs(np.einsum("ni,nij->nj", direction, jacobians[:, 3])).mean(axis=0)
    if not effect.max() > 1e-9:
        raise EmbodimentError(
            f"no joint of the {chain.side} arm ({', '.join(chain.joints)}) bends it: its tip keeps its distance from "
            "the shoulder. Name a link beyond the wrist: left=LINK or right=LINK"
        )
    return int(np.argmax(effect))


def _shoulder(origins: FloatArray, axes: FloatArray, elbow: int) -> int:
    """Last joint before the elbow that swings it; the ones that turn the upper arm about itself have no lever."""
    if elbow == 0:
        return 0
    levers = _levers(origins[:elbow], axes[:elbow], origins[elbow])
    return int(np.flatnonzero(levers >= _SWINGING * levers.max())[-1])


def _wrist(links: list[str], origins: FloatArray, axes: FloatArray, elbow: int, end: FloatArray) -> str | None:
    """First joint after the elbow that swings the hand, or the last one well down the forearm; ``None`` for the tip."""
    reach = float(np.linalg.norm(end - origins[elbow]))
    after = [i for i in range(elbow + 1, len(links)) if np.linalg.norm(origins[i] - origins[elbow]) > 0.25 * reach]
    if not after:
        return None
    levers = _levers(origins[after], axes[after], origins[elbow])
    swinging = np.flatnonzero(levers > max(_SWINGING * float(levers.max()), 0.1 * reach))
    return links[after[int(swinging[0]) if len(swinging) else -1]]


def _levers(origins: FloatArray, axes: FloatArray, point: FloatArray) -> FloatArray:
    """Distance of a point from each joint axis [m]."""
    levers: FloatArray = np.linalg.norm(np.cross(axes, point - origins), axis=1)
    return levers
