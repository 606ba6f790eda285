"""Mapping: a function from frames of one body to frames of another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError, OptionError
from syda_gym.mappings.card import MappingCard
from syda_gym.mappings.limits import limit_speed
from syda_gym.motions.clip import PairedMotions

__all__ = ["Mapping", "map_clips"]


class Mapping(ABC):
    """Takes raw frames of ``source`` and gives raw frames of ``target``.

    A mapping carries its own calibration, scaling and encoding. Joint angles that it returns always obey the
    robot's joint limits, coupled ones included.

    Attributes:
        source: the body whose frames it takes.
        target: the body whose frames it gives.
    """

    in_series: ClassVar[Callable[[tuple[Mapping, Mapping]], Mapping]]  # what ``>>`` makes; ``chain`` enters it here

    source: Embodiment
    target: Embodiment

    @property
    @abstractmethod
    def card(self) -> MappingCard:
        """Where the mapping comes from."""

    @property
    def method(self) -> str:
        """Name of the method, as in ``fitting.METHODS``."""
        return self.card.method

    @property
    def preset(self) -> str:
        """Preset of the method."""
        return self.card.preset

    @property
    def route(self) -> tuple[str, ...]:
        """Names of the bodies that motion passes, source and target included."""
        return (self.source.name, self.target.name)

    @property
    def window(self) -> int:
        """How many past frames each output looks at; 0 for a mapping of single frames."""
        return 0

    @abstractmethod
    def raw(self, frames: FloatArray) -> FloatArray:
        """Maps without enforcing joint limits (for counting violations).

        Args:
            frames: ``(N, F_source)``, already checked.

        Returns:
            ``(N, F_target)``.
        """

    @abstractmethod
    def inverse(self) -> Mapping:
        """The mapping from ``target`` to ``source`` by the same model.

        Raises:
            MappingError: the model has no inverse.
        """

    @abstractmethod
    def error_bound(self, frames: ArrayLike) -> FloatArray:
        """A bound on the mean landmark error of each frame [m], see ``confidence.Confidence``.

        Args:
            frames: ``(N, F_source)`` or ``(F_source,)``.

        Returns:
            ``(N,)`` [m].

        Raises:
            MappingError: the mapping was fitted without a bound.
        """

    @abstractmethod
    def difficulty(self, frames: ArrayLike) -> FloatArray:
        """How far each frame lies from the frames of the fit: 0 (familiar) to 1 (unlike all), ``(N,)``.

        It ranks frames within an action; it is a warning light, not a scale for the bound.
        """

    @abstractmethod
    def unfamiliar(self, frames: ArrayLike) -> NDArray[np.bool_]:
        """Which frames are out of the distribution of the fit, ``(N,)``."""

    def __call__(self, frames: ArrayLike) -> FloatArray:
        """Maps frames.

        Args:
            frames: ``(N, F_source)`` or one frame ``(F_source,)``. A mapping with a ``window`` takes one clip in time
                order; frame by frame it is used through ``stream.FrameStream``.

        Returns:
            ``(N, F_target)`` or ``(F_target,)``, within the target's joint limits.

        Raises:
            EmbodimentError: the frames are not frames of ``source``, or hold values that are not finite.
            MappingError: a single frame for a mapping with a window.
        """
        array = np.asarray(frames, dtype=np.float64)
        return self._one(array) if array.ndim == 1 else self._within_limits(self.raw(self.source.check(array)))

    def sequence(self, frames: ArrayLike, fps: float) -> FloatArray:
        """Maps a motion as ``follow`` does, and limits the joint speeds causally.

        Frame by frame, a ``stream.FrameStream`` with the same ``fps`` does the same.

        Args:
            frames: ``(N, F_source)`` in time order, one clip.
            fps: frames per second.

        Returns:
            ``(N, F_target)`` within joint limits and joint speed limits.

        Raises:
            OptionError: ``fps`` is not positive.
        """
        if not (np.isfinite(fps) and fps > 0.0):
            raise OptionError(f"fps must be positive, got {fps}")
        mapped, _ = self.follow(np.atleast_2d(np.asarray(frames, dtype=np.float64)), self.begin(), 1.0 / fps)
        return limit_speed(self.target, mapped, fps) if isinstance(self.target, Robot) else mapped

    def begin(self) -> Any:
        """What ``follow`` remembers before the first frame of a clip."""
        return None

    def follow(
        self, frames: ArrayLike, memory: Any, dt: float | None = None, *, limited: bool = True, skip: int = 0
    ) -> tuple[FloatArray, Any]:
        """Maps frames in time order: among equally good joint angles the nearest to those of the frame before.

        Args:
            frames: ``(N, F_source)``, the next frames of a clip.
            memory: from ``begin`` or the call before; a value that no call changes.
            dt: time between frames [s]; without it joint speeds do not hold.
            limited: whether the joints that follow limbs keep to their speeds.
            skip: how many frames at the beginning are only looked back at, by a mapping with a window.

        Returns:
            ``(N - skip, F_target)`` within the target's joint limits, and the memory after them. How many frames come
            in one call makes no difference. A mapping that remembers nothing maps each frame for itself.

        Raises:
            EmbodimentError: the frames are not frames of ``source``, or hold values that are not finite.
        """
        return self(np.atleast_2d(np.asarray(frames, dtype=np.float64)))[skip:], memory

    def __rshift__(self, after: Mapping) -> Mapping:
        """``a >> b``: the chain that applies ``a``, then ``b``."""
        if not isinstance(after, Mapping):
            return NotImplemented
        return Mapping.in_series((self, after))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({' > '.join(self.route)}, method={self.method!r}, preset={self.preset!r})"

    def _one(self, frame: FloatArray) -> FloatArray:
        """One frame ``(F,)``, not yet checked."""
        if self.window:
            raise MappingError(
                f"{self!r} looks at the {self.window} frames before: give a clip (N, {self.source.n_features}) in time "
                "order, or map frame by frame with syda_gym.mappings.stream.FrameStream"
            )
        result: FloatArray = self._within_limits(self.raw(self.source.check(frame)))[0]
        return result

    def _within_limits(self, frames: FloatArray) -> FloatArray:
        if not np.isfinite(frames).all():
            raise MappingError(f"{self!r} gave values that are not finite; fit it again on more varied frames")
        return self.target.clamp(frames) if isinstance(self.target, Robot) else frames


def map_clips(mapping: Mapping, pair: PairedMotions, *, raw: bool = False) -> FloatArray:
    """Maps a pair's source frames, clip by clip where the mapping has a window.

    Args:
        mapping: from the pair's source body.
        pair: the frames.
        raw: leave joint limits unenforced.

    Returns:
        ``(N, F_target)`` in the pair's row order.
    """

    def mapped(frames: FloatArray) -> FloatArray:
        return mapping.raw(mapping.source.check(frames)) if raw else mapping(frames)

    if not mapping.window:
        return mapped(pair.source)
    result = np.empty((len(pair), mapping.target.n_features))
    for rows in pair.clip_rows():
        result[rows] = mapped(pair.source[rows])
    return result
