"""Who plays in the demo: a new operator, never paired with the robot, and the bodies that could stand between."""

from __future__ import annotations

from dataclasses import dataclass, replace

from syda_gym.embodiments.parametric import parametric_human
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError
from syda_gym.mappings.limits import limit_speed
from syda_gym.motions.clip import Motions, Take

__all__ = ["FRAIL", "SLOW", "Cast", "cast_of", "traits", "with_guests"]

FRAIL = "frail"
"""A person who moves every arm angle by a fifth of the healthy range: synthetic, and only in the demo."""

SLOW = "slow_nao"
"""A NAO whose motors turn at a tenth of their speed (41 degrees a second at the shoulder's roll), led along NAO's own
motions: it lags wherever it cannot keep up. Synthetic, and only in the demo."""

_OPERATOR = "tall"
_BETWEEN = ("adult", SLOW, FRAIL, "left_only")
_MOST = 4
_SLOW_SHARE = 0.1
_MODEL = "nao"  # whose body the slow robot has
_TRAITS = {SLOW: "a slow robot", FRAIL: "a person of limited mobility", "left_only": "a person tracked with one arm"}


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


def traits(name: str) -> str:
    """The body's name, with what is special about it."""
    return f"{name} ({_TRAITS[name]})" if name in _TRAITS else name


def with_guests(motions: Motions) -> Motions:
    """The embedded motions with a frail person and a slow robot more, in the same takes; others as they are."""
    from syda_gym.motions.synthetic.generator import EMBEDDED_SEED, EMBEDDED_VARIANTS, generate

    if not motions.synthetic or not motions.name.startswith("embedded") or FRAIL in motions.bodies:
        return motions
    model = motions.bodies.get(_MODEL)
    if not isinstance(model, Robot):
        return motions
    frail = parametric_human(FRAIL, stature=1.60, mobility=0.2)
    more = generate((frail,), seed=EMBEDDED_SEED, variants=EMBEDDED_VARIANTS)
    own = {take.recording: take for take in more.takes}
    if any(take.recording not in own for take in motions.takes):
        return motions  # embedded ones of another making; nobody can join them
    slow = _slowed(model)
    takes = tuple(_joined(take, own[take.recording], slow) for take in motions.takes if not take.mirrored)
    return replace(motions, takes=takes, bodies={**motions.bodies, FRAIL: frail, SLOW: slow})


def _slowed(model: Robot) -> Robot:
    slow = Robot(replace(model.description, name=SLOW))
    slow.speed = _SLOW_SHARE * model.speed
    return slow


def _joined(take: Take, frail: Take, slow: Robot) -> Take:
    led = {SLOW: limit_speed(slow, take.frames[_MODEL], take.fps)}
    return replace(
        take,
        frames={**take.frames, FRAIL: frail.frames[FRAIL], **led},
        filled={**take.filled, **frail.filled},
    )


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
