"""The limbs of a kinematic tree: serial runs of revolute joints, told apart into arms, legs and others by name."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray, Side
from syda_gym.embodiments.kinematics.urdf import UrdfTree

__all__ = ["Limb", "find_limbs", "is_movable", "kind_by_name", "movable_above", "side_by_name"]

_ARM_WORDS = re.compile(r"arm|shoulder|elbow|wrist|hand|gripper|clavicle|scapula|humerus|tool")
_LEG_WORDS = re.compile(r"leg|hip|knee|ankle|foot|feet|thigh|calf|shank|toe|haa|hfe|kfe|wheel|hock")
_OTHER_WORDS = re.compile(r"head|neck|eye|cam|laser|velodyne|torso|waist|spine|lumbar|thora|cervical|rotor|prop"
                          r"|finger|thumb|index|pinky|trunk|chest|pan_tilt|antenna")  # fmt: skip
_HAND_JOINT = re.compile(r"hand|finger|gripper|thumb|index|middle|ring|pinky|little|jaw|claw|grasp|knuckle", re.I)
_GEAR = re.compile(r"gear|pulley|spur|rotor|motor_shaft", re.I)
_UPRIGHT = re.compile(r"yaw|roll|pitch", re.I)
_SIDES = {
    side: re.compile(
        rf"(^|[_\W])({side}|{side.title()}|{side.upper()})([_\W\d]|$)|(^|[_\W])({c}|{c.upper()}|{c}f|{c}h)([_\W]|$)"
        rf"|^({side}|{side.title()})|{side.title()}(?=[A-Z_]|$)|^{c.upper()}(?=[A-Z][a-zA-Z])"
    )
    for side, c in (("left", "l"), ("right", "r"))
}

_FINGER_SHARE = 0.6  # what hangs below a limb is a hand if it is shorter than this share of it


@dataclass(frozen=True)
class Limb:
    """A serial run of revolute joints without a branch.

    Attributes:
        joints: names from the body outward; joints of a hand at the end are left out.
        last_link: the link behind the last joint.
        kind: ``arm``, ``leg``, ``other`` or ``unknown``, by the words in the names.
        length: way along the joint origins [m].
    """

    joints: tuple[str, ...]
    last_link: str
    kind: str
    length: float


def find_limbs(tree: UrdfTree, placements: dict[str, FloatArray]) -> list[Limb]:
    """All limbs with at least two joints, apart from fingers and waists.

    Args:
        tree: the URDF.
        placements: homogeneous transforms ``(4, 4)`` of every link at the zero pose.
    """
    below = _children(tree)
    runs = _runs(tree, below)
    lengths = {run[0]: _length(tree, placements, run, below) for run in runs}
    limbs = []
    for run in runs:
        hanging = [lengths[child] for child in below[run[-1]] if child in lengths]
        joints = _without_hand(run)
        if len(joints) < 2 or any(length > _FINGER_SHARE * lengths[run[0]] for length in hanging):
            continue
        kind = _kind(tree, joints)
        limbs.append(Limb(joints, tree.joints[joints[-1]].child, kind, lengths[run[0]]))
    # A finger hangs below another limb; a hand of several joints is no arm of its own.
    inner = {joint for limb in limbs for joint in limb.joints}
    return [limb for limb in limbs if not inner & set(movable_above(tree, limb.joints[0]))]


def movable_above(tree: UrdfTree, joint: str) -> list[str]:
    """Movable joints between the root and a joint, the nearest first."""
    link, found = tree.joints[joint].parent, []
    while link in tree.parent_joint:
        name = tree.parent_joint[link]
        if is_movable(tree, name):
            found.append(name)
        link = tree.joints[name].parent
    return found


def is_movable(tree: UrdfTree, name: str) -> bool:
    """Whether a joint moves by itself: neither fixed, nor locked by equal limits, nor the mimic of another."""
    joint = tree.joints[name]
    if joint.type not in ("revolute", "continuous", "prismatic") or joint.mimic is not None:
        return False
    limit = joint.limit
    return joint.type == "continuous" or limit is None or limit.lower is None or limit.lower != limit.upper


def side_by_name(names: Iterable[str]) -> Side | None:
    """``left`` or ``right`` if the names say so, ``None`` if they do not or disagree."""
    votes = 0
    for name in names:
        votes += bool(_SIDES["left"].search(name)) - bool(_SIDES["right"].search(name))
    return "left" if votes > 0 else "right" if votes < 0 else None


def _children(tree: UrdfTree) -> dict[str, list[str]]:
    """Movable joint to the movable joints next below it, all others counted as fixed."""
    below: dict[str, list[str]] = {name: [] for name in tree.joints if is_movable(tree, name)}
    for name in below:
        above = movable_above(tree, name)
        if above:
            below[above[0]].append(name)
    return _without_leaves(tree, below)


def _without_leaves(tree: UrdfTree, below: dict[str, list[str]]) -> dict[str, list[str]]:
    """Leaves beside the road taken out: a motor's gear, a flap or a cover drives nothing and cuts no arm.

    A leaf is a joint with no joint below it. It counts as one of those if its name says so, or if another joint beside
    it leads on through at least two joints that are no hand's.
    """
    leaves: set[str] = set()
    for children in below.values():
        onward = [child for child in children if _depth(below, child) >= 2 and not _HAND_JOINT.search(child)]
        ends = [child for child in children if not below[child] and not _is_side(tree, child)]
        gears = [
            child for child in children if not below[child] and _GEAR.search(f"{child} {tree.joints[child].child}")
        ]
        if len(onward) == 1:
            leaves.update(ends)
        if len(gears) < len(children):
            leaves.update(gears)
    return {name: [c for c in children if c not in leaves] for name, children in below.items() if name not in leaves}


def _depth(below: dict[str, list[str]], joint: str) -> int:
    """Joints on the longest way from a joint outward, itself included."""
    count, level = 0, [joint]
    while level:
        count, level = count + 1, [child for name in level for child in below[name]]
    return count


def _is_side(tree: UrdfTree, joint: str) -> bool:
    """Whether a name says head or leg: on a waist these are no leaves of an arm."""
    return kind_by_name([joint, tree.joints[joint].child]) in ("leg", "other")


def _runs(tree: UrdfTree, below: dict[str, list[str]]) -> list[tuple[str, ...]]:
    """Maximal unbranched runs of revolute joints."""
    parent = {child: name for name, children in below.items() for child in children}
    turning = {name for name in below if tree.joints[name].type != "prismatic"}

    def continues(name: str) -> bool:
        above = parent.get(name)
        return above in turning and len(below[above]) == 1

    runs = []
    for name in below:
        if name not in turning or continues(name):
            continue
        run = [name]
        while len(below[run[-1]]) == 1 and below[run[-1]][0] in turning:
            run.append(below[run[-1]][0])
        runs.append(tuple(run))
    return runs


def _length(
    tree: UrdfTree, placements: dict[str, FloatArray], run: tuple[str, ...], below: dict[str, list[str]]
) -> float:
    """Way along the joint origins of a run, to the farthest link fixed behind it [m]."""
    origins = np.array([placements[tree.joints[name].child][:3, 3] for name in run])
    last = tree.joints[run[-1]].child
    ends = [placements[link][:3, 3] for link in tree.links() if _fixed_behind(tree, last, link)]
    tail = max((float(np.linalg.norm(end - origins[-1])) for end in ends), default=0.0)
    return float(np.linalg.norm(np.diff(origins, axis=0), axis=1).sum()) + tail


def _fixed_behind(tree: UrdfTree, last: str, link: str) -> bool:
    path = tree.path_to(last, link)
    return path is not None and not any(is_movable(tree, name) for name in path)


def _without_hand(run: tuple[str, ...]) -> tuple[str, ...]:
    joints = list(run)
    # A joint of the hand opens or closes it; a gripper that yaws, rolls or pitches is a wrist.
    while len(joints) > 2 and _HAND_JOINT.search(joints[-1]) and not _UPRIGHT.search(joints[-1]):
        joints.pop()
    return tuple(joints)


def _kind(tree: UrdfTree, joints: tuple[str, ...]) -> str:
    return kind_by_name([part for name in joints for part in (name, tree.joints[name].child)])


def kind_by_name(names: Iterable[str]) -> str:
    """``arm``, ``leg``, ``other`` or ``unknown``, by the words in the names of joints and links."""
    words = [name.lower() for name in names]
    counts = {
        kind: sum(bool(pattern.search(word)) for word in words)
        for kind, pattern in (("arm", _ARM_WORDS), ("leg", _LEG_WORDS), ("other", _OTHER_WORDS))
    }
    best = max(counts, key=lambda kind: counts[kind])
    return best if counts[best] else "unknown"
