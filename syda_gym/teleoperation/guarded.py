"""GuardedMapping: one live frame through a mapping or chain, together with what the mapping thinks of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import SydaError, TeleoperationError
from syda_gym.mappings.chain import ChainMapping
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.mapping import Mapping

__all__ = ["GuardedMapping", "Mapped"]

_EVERY = 3


class Mapped(NamedTuple):
    """One mapped frame: joint angles ``(n,)`` [rad], error bound [m] (NaN if unknown), out of distribution."""

    angles: FloatArray
    bound: float
    unfamiliar: bool


class GuardedMapping:
    """Walks a mapping's links once per frame and collects bound and familiarity on the way.

    Asking a chain for its image, its bound and its familiarity one after the other would walk it three times.

    Args:
        mapping: ends at a robot.

    Attributes:
        bounded: whether the mapping knows an error bound.
        notices: what the mapping cannot tell, for the screen.

    Raises:
        TeleoperationError: the mapping does not end at a robot, or fails on the most ordinary frame.
    """

    def __init__(self, mapping: Mapping) -> None:
        if not isinstance(mapping.target, Robot):
            raise TeleoperationError(
                f"{mapping!r} ends at {mapping.target.name!r}, which is no robot; choose a route that ends at one"
            )
        if mapping.window:
            raise TeleoperationError(
                f"{mapping!r} looks at {mapping.window} past frames; live teleoperation maps single frames: fit "
                "without window"
            )
        self.mapping = mapping
        self.robot: Robot = mapping.target
        self.links = mapping.links if isinstance(mapping, ChainMapping) else (mapping,)
        self.notices: list[str] = []
        self.bounded = self._knows("error_bound", "no error bound: the robot is not slowed by it")
        self._familiar = self._knows("unfamiliar", "no familiarity: unusual poses are not slowed")
        self._count = 0
        self._unfamiliar = False
        self.reset()
        self._gains = [_gain(link) for link in self.links]
        self._bounds = [_constant_bound(link) for link in self.links]
        try:
            self(_usual(mapping.source))
        except (SydaError, ArithmeticError, ValueError) as error:
            raise TeleoperationError(f"{mapping!r} cannot map a person who stands still: {error}") from error
        self._count = 0
        self.reset()

    def reset(self) -> None:
        """Forgets the frames before: the next one begins a new motion."""
        self._memories = [link.begin() for link in self.links]

    def __call__(self, frame: FloatArray, dt: float | None = None) -> Mapped:
        """Maps one frame ``(F,)`` of the mapping's source, ``dt`` [s] after the one before (``Mapping.follow``).

        Raises:
            SydaError: whatever the mapping raises on a frame that it cannot take.
        """
        # Familiarity changes slowly; a look at every third frame is enough and saves time.
        look = self._familiar and self._count % _EVERY == 0
        self._count += 1
        mapped = self.walk(frame, look, dt)
        if look:
            self._unfamiliar = mapped.unfamiliar
        return mapped._replace(unfamiliar=self._unfamiliar)

    def walk(self, frame: FloatArray, look: bool, dt: float | None = None) -> Mapped:
        """The same, but without a count: familiarity is told only of frames at which one looks.

        Without ``dt`` the frames before do not count either.

        Raises:
            SydaError: whatever the mapping raises on a frame that it cannot take.
        """
        current, bound, unfamiliar, memories = frame, 0.0, False, []
        for link, memory, gain, constant in zip(self.links, self._memories, self._gains, self._bounds, strict=True):
            if self.bounded:
                bound = bound * gain + (float(link.error_bound(current)[0]) if constant is None else constant)
            unfamiliar = unfamiliar or (look and bool(link.unfamiliar(current)[0]))
            if dt is None:
                current = link(current)
            else:
                rows, memory = link.follow(current, memory, dt)
                current = rows[0]
            memories.append(memory)
        if not math.isfinite(sum(current.tolist())):
            raise TeleoperationError(f"{self.mapping!r} gave joint angles that are not finite")
        self._memories = memories
        return Mapped(current, bound if self.bounded else float("nan"), unfamiliar)

    def _knows(self, question: str, notice: str) -> bool:
        """Whether every link answers; links that were fitted on too little, or not fitted at all, do not."""
        for link in self.links:
            try:
                answer = getattr(link, question)(_usual(link.source))
            except SydaError:
                answer = np.array([np.nan])
            if not np.isfinite(answer).all():
                self.notices.append(f"{' > '.join(link.route)}: {notice}")
                return False
        return True


def _usual(body: Embodiment) -> FloatArray:
    """A frame ``(F,)`` that every body can take: a robot at rest, a person standing."""
    if isinstance(body, Robot):
        rest: FloatArray = body.rest
        return rest
    if isinstance(body, HumanSkeleton):
        return body.standing()
    return np.zeros(body.n_features)


def _gain(link: Mapping) -> float:
    """How much a link enlarges a displacement that enters it."""
    confidence = getattr(link, "confidence", None)
    return float(confidence.gain) if confidence is not None else 1.0


def _constant_bound(link: Mapping) -> float | None:
    """The bound of a link that has one and the same for every frame; ``None`` where the frame must be asked."""
    return link.confidence.bound if isinstance(link, CodedMapping) and link.confidence is not None else None
