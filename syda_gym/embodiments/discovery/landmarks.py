"""find_landmarks: shoulder, elbow and wrist of an arm, from where its axes lie.

A link's origin may slide along the joint's axis without any difference in how the robot moves, so origins say little.
What does not slide is the axes themselves: the shoulder is where the axes meet that swing the upper arm, the elbow the
point of its axis that is nearest to the upper arm's line, the wrist where the axis that swings the hand meets the
forearm's line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syda_gym.embodiments.description import ArmDescription, Point
from syda_gym.embodiments.discovery.ends import ArmEnd, arm_end
from syda_gym.embodiments.discovery.lines import Line
from syda_gym.embodiments.embodiment import FloatArray, Side
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.embodiments.kinematics.urdf import UrdfTree, arm_chain
from syda_gym.errors import EmbodimentError

__all__ = ["find_landmarks"]

_SWINGING = 0.5  # a joint swings a point if its lever is at least this share of the longest one
_SAME = 2e-3  # m; a point this near to its link's origin is the origin
_SHORT = 0.12  # an upper arm or forearm shorter than this share of the arm is none
_BEYOND = 0.25  # a wrist lies at least this share of the forearm beyond the elbow


def find_landmarks(
    tree: UrdfTree, placements: dict[str, FloatArray], side: Side, joints: Sequence[str], tip: str | None
) -> ArmDescription:
    """Describes an arm.

    The elbow is the joint that changes the distance from shoulder to end most, on average over the joint limits; the
    shoulder is sought anew for every joint that may be the elbow.

    Args:
        tree: the robot.
        placements: of every link at the zero pose ``(4, 4)``, root frame.
        side: which arm.
        joints: its joints from the body outward.
        tip: the link at its end, if somebody named it.

    Raises:
        EmbodimentError: nothing bends the arm, or it ends at the elbow and nothing says how long the forearm is.
    """
    arm = _Axes(tree, placements, side, tuple(joints))
    end = _end(tree, placements, arm, tip)
    elbow = arm.elbow(end)
    shoulder_joint, shoulder = arm.shoulder(elbow)
    elbow_place = arm.elbow_place(elbow, shoulder_joint, shoulder)
    wrist_joint, wrist = arm.wrist(elbow, elbow_place, end)
    upper = float(np.linalg.norm(elbow_place - shoulder))
    fore = float(np.linalg.norm((end.place if wrist is None else wrist) - elbow_place))
    if min(upper, fore) < _SHORT * (upper + fore):
        _refuse(tree, arm, elbow, end, upper, fore)
    found = {
        "shoulder": _carried(placements, arm.links[shoulder_joint], shoulder),
        "elbow": _carried(placements, arm.links[elbow], elbow_place),
        "wrist": (end.link, end.offset) if wrist is None else _carried(placements, arm.links[wrist_joint], wrist),
        "tip": (end.link, end.offset),
    }
    return ArmDescription(
        side=side,
        joints=tuple(joints),
        shoulder=found["shoulder"][0],
        elbow=found["elbow"][0],
        wrist=found["wrist"][0],
        tip=found["tip"][0],
        offsets={name: _rounded(offset) for name, (_, offset) in found.items() if np.linalg.norm(offset) > _SAME},
    )


class _Axes:
    """The axes of one arm at the zero pose, and what follows from where they lie."""

    def __init__(self, tree: UrdfTree, placements: dict[str, FloatArray], side: Side, joints: tuple[str, ...]) -> None:
        self.joints = joints
        self.side = side
        self.links = [tree.joints[name].child for name in joints]
        self.lines = [
            Line(placements[link][:3, 3], placements[link][:3, :3] @ tree.joints[name].axis)
            for link, name in zip(self.links, joints, strict=True)
        ]
        self._tree, self._placements = tree, placements
        parent = tree.joints[joints[0]].parent
        self._to_parent = np.linalg.inv(placements[parent])
        last = self.links[-1]
        self._chain: ArmChain = arm_chain(tree, parent, side, joints, (self.links[0], last, last, last))

    def elbow(self, end: ArmEnd) -> int:
        """The joint that changes the distance from the shoulder to the end most.

        The shoulder follows from the elbow, so both are sought in turn, from where the first axes meet.
        """
        joint, place = 0, self._first_place()
        elbow = -1
        for _ in range(4):
            before, elbow = elbow, self._bending(joint, place, end)
            if elbow == before:
                break
            joint, place = self.shoulder(elbow)
        return elbow

    def _first_place(self) -> FloatArray:
        for other in self.lines[1:]:
            foot = self.lines[0].foot(other)
            if foot is not None:
                return foot
        return self.lines[0].point

    def _bending(self, joint: int, place: FloatArray, end: ArmEnd) -> int:
        """The joint beyond ``joint`` that changes the distance from ``place``, which rides on it, to the end most."""
        last = len(self.joints) - 1
        chain = replace(
            self._chain,
            point_joints=(joint, last),
            point_offsets=np.array([self._in_link(joint, place), self._in_link(last, end.place)]),
        )
        q = np.random.default_rng(0).uniform(chain.lower, chain.upper, (512, chain.n_joints))
        places, jacobians = chain.jacobians(q)
        way = places[:, 1] - places[:, 0]
        way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        effect = np.abs(np.einsum("ni,nij->nj", way, jacobians[:, 1] - jacobians[:, 0])).mean(axis=0)
        effect[: joint + 1] = 0.0
        if not effect.max() > 1e-6:
            raise EmbodimentError(
                f"{self._tree.path.name}: no joint of the {self.side} arm ({', '.join(self.joints)}) bends it: its end "
                f"{end.link!r} keeps its distance from the shoulder. {_ADVICE}"
            )
        return int(np.argmax(effect))

    def shoulder(self, elbow: int) -> tuple[int, FloatArray]:
        """The joint that carries the shoulder of an elbow, and its place: where the axes meet that swing the elbow."""
        about = self._roughly(elbow)
        levers = np.array([self.lines[i].distance(about) for i in range(elbow)])
        if not levers.max() > 1e-6:
            return 0, self.lines[0].nearest(about)
        swinging = [int(i) for i in np.flatnonzero(levers >= _SWINGING * levers.max())]
        last = swinging[-1]
        # Joints that turn the upper arm about itself meet the others in the shoulder as well.
        twists = [i for i in range(elbow) if i not in swinging and levers[i] < 0.2 * levers.max()]
        for other in (*swinging[-2::-1], *(i for i in twists if i > last), *(i for i in twists if i < last)):
            foot = self.lines[last].foot(self.lines[other])
            if foot is not None:
                return last, foot
        return last, self.lines[last].nearest(about)

    def elbow_place(self, elbow: int, shoulder_joint: int, shoulder: FloatArray) -> FloatArray:
        """The point of the elbow's axis that is nearest to the line of upper arm or forearm."""
        line = self.lines[elbow]
        for other in range(elbow - 1, shoulder_joint, -1):
            foot = line.foot(self.lines[other])
            if foot is not None:
                return foot
        length = line.distance(shoulder)
        if elbow + 1 < len(self.lines):  # a joint that turns the forearm about itself
            foot = line.foot(self.lines[elbow + 1])
            if foot is not None and line.gap(self.lines[elbow + 1]) < 0.3 * length:
                return foot
        return line.nearest(shoulder)

    def wrist(self, elbow: int, place: FloatArray, end: ArmEnd) -> tuple[int, FloatArray | None]:
        """The first joint beyond the elbow that swings the hand, or turns it far down the forearm; and its place."""
        reach = float(np.linalg.norm(end.place - place))
        after = range(elbow + 1, len(self.lines))
        levers = {i: self.lines[i].distance(place) for i in after}
        longest = max(levers.values(), default=0.0)
        for i in after:
            if levers[i] > max(_SWINGING * longest, _BEYOND * reach):
                return i, self._meeting(i, elbow, place)
        twisting = [i for i in after if _BEYOND * reach < self._down(i, place, end) <= 1.1 * reach]
        return (twisting[-1], self.lines[twisting[-1]].point) if twisting else (-1, None)

    def _meeting(self, wrist: int, elbow: int, place: FloatArray) -> FloatArray:
        """Where the wrist's axis meets the forearm's line, or the next axis of the wrist."""
        line = self.lines[wrist]
        for other in [*range(wrist - 1, elbow, -1), *range(wrist + 1, len(self.lines))]:
            foot = line.foot(self.lines[other])
            if foot is not None:
                return foot
        return line.nearest(place)

    def _down(self, joint: int, place: FloatArray, end: ArmEnd) -> float:
        way = end.place - place
        return float((self.lines[joint].point - place) @ way) / max(float(np.linalg.norm(way)), 1e-9)

    def _roughly(self, elbow: int) -> FloatArray:
        """A point of the elbow's axis near the arm, before the shoulder is known."""
        line = self.lines[elbow]
        for other in (elbow - 1, elbow + 1):
            if 0 <= other < len(self.lines):
                foot = line.foot(self.lines[other])
                if foot is not None:
                    return foot
        return line.nearest(self.lines[elbow - 1].point)

    def _in_link(self, joint: int, place: FloatArray) -> FloatArray:
        frame = self._placements[self.links[joint]]
        inside: FloatArray = frame[:3, :3].T @ (place - frame[:3, 3])
        return inside


_ADVICE = (
    "If the file ends at the elbow, say where the wrist is: a link there (left=LINK, right=LINK), or in a description "
    "`wrist: {link: FOREARM, offset: [x, y, z]}`"
)


def _end(tree: UrdfTree, placements: dict[str, FloatArray], arm: _Axes, tip: str | None) -> ArmEnd:
    if tip is None:
        return arm_end(tree, placements, arm.links[-1], arm.lines[-1])
    if arm.lines[-1].distance(placements[tip][:3, 3]) > 1e-6 or tip != arm.links[-1]:
        return ArmEnd(tip, np.zeros(3), placements[tip][:3, 3], "link")
    found = arm_end(tree, placements, arm.links[-1], arm.lines[-1])
    return found if found.source in ("shape", "mass") else ArmEnd(tip, np.zeros(3), placements[tip][:3, 3], "link")


def _refuse(tree: UrdfTree, arm: _Axes, elbow: int, end: ArmEnd, upper: float, fore: float) -> None:
    last = ""
    if end.source == "none":
        last = f"; nothing reaches beyond the last joint {arm.joints[-1]!r}: no link, no shape and no mass"
    raise EmbodimentError(
        f"{tree.path.name}: the {arm.side} arm ({', '.join(arm.joints)}) has no upper arm and forearm: its elbow would "
        f"be {arm.joints[elbow]!r}, with {1000 * upper:.0f} mm to the shoulder and {1000 * fore:.0f} mm to the end"
        f"{last}. {_ADVICE}"
    )


def _carried(placements: dict[str, FloatArray], link: str, place: FloatArray) -> tuple[str, FloatArray]:
    frame = placements[link]
    offset: FloatArray = frame[:3, :3].T @ (place - frame[:3, 3])
    return link, offset if float(np.linalg.norm(offset)) > _SAME else np.zeros(3)


def _rounded(offset: FloatArray) -> Point:
    x, y, z = (round(float(value), 6) + 0.0 for value in offset)
    return (x, y, z)
