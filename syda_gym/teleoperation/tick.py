"""What goes into the loop and what comes out: plain values that a journal can hold exactly."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError, nearest_name

__all__ = ["CONTROLS", "RESTRAINING", "Decision", "LoopSettings", "State", "Tick"]

CONTROLS = ("pause", "resume", "stop", "release", "calibrate", "rest")
"""What an operator may ask for: hold; go on; emergency stop; end the emergency stop; calibrate anew; ease to rest."""

RESTRAINING = frozenset({"stop", "pause", "rest"})
"""What makes a robot safer, and is therefore obeyed from whomever it comes and however late."""


class State(StrEnum):
    """What the loop is doing."""

    CALIBRATING = "calibrating"
    FOLLOWING = "following"
    HOLDING = "holding"
    EASING = "easing"
    RESTING = "resting"
    PAUSED = "paused"
    STOPPED = "stopped"


@dataclass(frozen=True)
class LoopSettings:
    """Everything that decides how frames become commands, beside the mapping.

    Attributes:
        rate: commands per second while no frame drives the loop.
        calibration: seconds of standing; 0 trusts the source.
        axes: the source's axes, see ``calibration.AXES``.
        cutoff: lowest cutoff of the One-Euro filter [Hz]; 0 switches the filter off.
        beta: growth of the cutoff with speed [Hz per rad/s].
        speed: share of the joints' speed limits that may be used.
        acceleration: greatest acceleration of every joint [rad/s^2]; ``None`` for full speed within 0.2 s.
            0.7 of it are planned with; the rest is for commands that leave late.
        jerk: greatest jerk of every joint [rad/s^3]; ``None`` for no limit. Where the robot must brake to keep clear of
            a limit or of itself, the acceleration counts and the jerk does not.
        ease: share of the speed limits on the way to rest.
        soft_start: seconds over which the speed grows when following begins.
        silence: seconds without a good frame until the robot holds.
        hold: further seconds until it eases to rest.
        bound_slow: error bound [m] from which the robot slows; ``None`` for 0.75 of the robot's reach.
        bound_hold: error bound [m] from which it holds; ``None`` for 1.25 of it.
        unfamiliar: speed factor for poses unlike all that the mapping was fitted on.
        self_collision: distance [m] that links keep; negative switches the check off.

    Raises:
        OptionError: a value outside its range.
    """

    rate: float = 30.0
    calibration: float = 2.0
    axes: str = "kinect"
    cutoff: float = 2.0
    beta: float = 3.0
    speed: float = 1.0
    acceleration: float | None = None
    jerk: float | None = None
    ease: float = 0.2
    soft_start: float = 1.0
    silence: float = 0.25
    hold: float = 1.0
    bound_slow: float | None = None
    bound_hold: float | None = None
    unfamiliar: float = 0.5
    self_collision: float = 0.005

    def __post_init__(self) -> None:
        ranges = {
            "rate": (1.0, 1000.0),
            "cutoff": (0.0, 1000.0),
            "beta": (0.0, 1000.0),
            "speed": (0.01, 1.0),
            "ease": (0.01, 1.0),
            "soft_start": (0.0, 60.0),
            "silence": (0.01, 60.0),
            "hold": (0.0, 3600.0),
            "unfamiliar": (0.01, 1.0),
        }
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise OptionError(f"{name} must be between {low:g} and {high:g}, got {value}")
        for name, low, high in (("acceleration", 0.1, 1e4), ("jerk", 1.0, 1e6)):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise OptionError(f"{name} must be between {low:g} and {high:g}, or None, got {value}")

    def to_json(self) -> dict[str, Any]:
        """All values by name."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> LoopSettings:
        """Rebuilds settings.

        Raises:
            OptionError: an unknown name.
        """
        known = set(cls.__dataclass_fields__)
        for name in values:
            if name not in known:
                raise OptionError(f"unknown setting {name!r}; {nearest_name(name, known)}")
        return cls(**values)


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """Everything that one step of the loop may look at.

    Attributes:
        now: the loop's clock [s], never going back.
        frame: a new frame ``(F,)`` of the source, or ``None``.
        sent: the sender's own time of the frame [s], or ``None``.
        tracking: confidence of the source in the frame, 0 to 1.
        controls: requests out of ``CONTROLS``, in order.
        left: when the command before had left, at the latest [s, the loop's clock], or ``None`` if not known.
        leaving: when it left at the earliest [s], or ``None``.
        position: joint angles ``(n,)`` [rad] that the robot says it has, asked at a release, or ``None``.
    """

    now: float
    frame: FloatArray | None = None
    sent: float | None = None
    tracking: float = 1.0
    controls: tuple[str, ...] = ()
    left: float | None = None
    leaving: float | None = None
    position: FloatArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What the loop decided.

    Attributes:
        now: the tick's time [s].
        state: what the loop is doing.
        command: joint angles to send ``(n,)`` [rad].
        bound: error bound of the frame [m], NaN without a mapped frame.
        factor: speed factor in [0, 1].
        reasons: why the robot is slowed, held or a frame was dropped; empty if all is well.
        frame_used: whether the tick's frame moved the target.
    """

    now: float
    state: State
    command: FloatArray
    bound: float = float("nan")
    factor: float = 1.0
    reasons: tuple[str, ...] = field(default=())
    frame_used: bool = False
