"""Who plays in the demo: a new operator, never paired with the robot, and the bodies that could stand between."""

from __future__ import annotations

from dataclasses import dataclass, replace

from syda_gym.embodiments.parametric import parametric_human
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError
from syda_gym.motions.clip import Motions

__all__ = ["FRAIL", "Cast", "cast_of", "with_frail"]

FRAIL = "frail"
"""A person who moves every arm angle by a fifth of the healthy range: synthetic, and only in the demo."""

_OPERATOR = "tall"
_BETWEEN = ("adult", "nao", FRAIL, "left_only")
_MOST = 4


@dataclass(frozen=True)
class Cast:
    """The roles.

    Attributes:
        operator: the new one; pretended never to have been recorded with the robot.
        robot: who is driven.
        between: bodies recorded with both, one of which may stand between.
    """

    operator: str
    robot: str
    between: tuple[str, ...]

    @property
    def routes(self) -> tuple[tuple[str, ...], ...]:
        """The chains to choose from; the direct pair alone if nobody can stand between."""
        if not self.between:
            return (self.direct,)
        return tuple((self.operator, name, self.robot) for name in self.between)

    @property
    def direct(self) -> tuple[str, ...]:
        """The pair that would have to be recorded otherwise."""
        return (self.operator, self.robot)


def with_frail(motions: Motions) -> Motions:
    """The embedded motions with one person more, performing the same takes; others are returned as they are."""
    from syda_gym.motions.synthetic.generator import EMBEDDED_SEED, EMBEDDED_VARIANTS, generate

    if not motions.synthetic or not motions.name.startswith("embedded") or FRAIL in motions.bodies:
        return motions
    body = parametric_human(FRAIL, stature=1.60, mobility=0.2)
    more = generate((body,), seed=EMBEDDED_SEED, variants=EMBEDDED_VARIANTS)
    own = {take.recording: take for take in more.takes}
    if any(take.recording not in own for take in motions.takes):
        return motions  # embedded ones of another making; nobody can join them
    takes = tuple(
        replace(
            take,
            frames={**take.frames, FRAIL: own[take.recording].frames[FRAIL]},
            filled={**take.filled, **own[take.recording].filled},
        )
        for take in motions.takes
        if not take.mirrored
    )
    return replace(motions, takes=takes, bodies={**motions.bodies, FRAIL: body})


def cast_of(motions: Motions, robot: Robot) -> Cast:
    """Gives the roles: the demo's own on the embedded motions, else the first person recorded with the robot.

    Raises:
        OptionError: nobody was recorded with the robot.
    """
    pairs = {frozenset(pair) for pair in motions.pairs}

    def between(operator: str) -> list[str]:
        return [
            name
            for name in motions.bodies
            if name not in (operator, robot.name)
            and frozenset((operator, name)) in pairs
            and frozenset((name, robot.name)) in pairs
        ]

    people = [
        name for name, body in motions.bodies.items() if body.kind == "human" and frozenset((name, robot.name)) in pairs
    ]
    if not people:
        raise OptionError(f"{motions.name}: no human was recorded together with {robot.name!r}; the demo needs a pair")
    operator = _OPERATOR if FRAIL in motions.bodies and _OPERATOR in people else people[0]
    known = between(operator)
    wanted = [name for name in _BETWEEN if name in known] if FRAIL in motions.bodies else known
    return Cast(operator, robot.name, tuple(wanted[:_MOST]))
