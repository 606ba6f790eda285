"""Embodiment: a body with its own features, from which landmarks in metres follow."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.errors import EmbodimentError

__all__ = ["ARM_POINTS", "SIDES", "Embodiment", "Feature", "FloatArray", "Side", "landmark_error"]

FloatArray = NDArray[np.float64]
Side = Literal["left", "right"]

SIDES: tuple[Side, Side] = ("left", "right")
ARM_POINTS = ("shoulder", "elbow", "wrist")


@dataclass(frozen=True)
class Feature:
    """One number of a frame: its name and its unit, ``m`` or ``rad``."""

    name: str
    unit: str


class Embodiment(ABC):
    """A human or a robot with its own joints (the paper says *agent*).

    A frame is a vector of ``n_features`` numbers that this body alone understands: landmark positions [m] in the
    recording's own origin and axes for a human, joint angles [rad] in the robot's joint order for a robot. Points are
    returned in *body axes* (x forward, y left, z up) about the body's own origin, in metres.

    Attributes:
        name: the name in the catalog.
        features: one ``Feature`` per column of a frame.
        sides: the arms this body has, left before right.
        height: stature [m].
    """

    name: str
    features: tuple[Feature, ...]
    sides: tuple[Side, ...]
    height: float

    @property
    def n_features(self) -> int:
        """Number of columns of a frame."""
        return len(self.features)

    @property
    def landmark_names(self) -> tuple[str, ...]:
        """Names of the landmarks that errors are measured on: elbow and wrist of each arm, left before right."""
        return tuple(f"{side}_{point}" for side in self.sides for point in ARM_POINTS[1:])

    @property
    @abstractmethod
    def kind(self) -> Literal["human", "robot"]:
        """What kind of body this is."""

    @property
    @abstractmethod
    def arm_lengths(self) -> FloatArray:
        """Nominal upper-arm and forearm lengths [m], shape ``(arms, 2)``."""

    @property
    def reach(self) -> float:
        """Nominal distance from shoulder to wrist of a stretched arm [m], mean over the arms."""
        return float(self.arm_lengths.sum(axis=1).mean())

    @abstractmethod
    def arm_points(self, frames: ArrayLike) -> FloatArray:
        """Shoulder, elbow and wrist of each arm.

        Args:
            frames: ``(N, F)`` or ``(F,)``.

        Returns:
            ``(N, arms, 3, 3)``: arm, point (shoulder, elbow, wrist), xyz [m] in body axes.

        Raises:
            EmbodimentError: the frames do not fit this body.
        """

    @abstractmethod
    def mirror(self, frames: ArrayLike) -> FloatArray:
        """Left-right mirror image of the frames, shape kept."""

    @abstractmethod
    def spec(self) -> dict[str, Any]:
        """A JSON-able description from which ``catalog.from_spec`` builds an equal body."""

    def landmarks(self, frames: ArrayLike) -> FloatArray:
        """The points that errors are measured on: ``(N, 2 * arms, 3)`` [m], ordered as ``landmark_names``."""
        points = self.arm_points(frames)[:, :, 1:]
        return points.reshape(len(points), -1, 3)

    def check(self, frames: ArrayLike, what: str = "frames") -> FloatArray:
        """Returns frames as a finite float64 array ``(N, F)`` or says what is wrong with them.

        Args:
            frames: ``(N, F)``, or one frame ``(F,)`` that becomes ``(1, F)``.
            what: how the error message calls them.

        Raises:
            EmbodimentError: wrong number of columns, or values that are not finite.
        """
        array = np.asarray(frames, dtype=np.float64)
        if array.ndim == 1:
            array = array[None]
        if array.ndim != 2 or array.shape[1] != self.n_features:
            names = ", ".join(feature.name for feature in self.features)
            raise EmbodimentError(
                f"{what} of {self.name!r}: expected shape (N, {self.n_features}) with columns {names}; "
                f"got {np.shape(frames)}"
            )
        if not np.isfinite(array).all():
            row, column = np.argwhere(~np.isfinite(array))[0]
            raise EmbodimentError(
                f"{what} of {self.name!r}: frame {row}, feature {self.features[column].name!r} is "
                f"{array[row, column]}; fill or drop gaps before mapping"
            )
        return array

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Embodiment) and self.spec() == other.spec()

    def __hash__(self) -> int:
        return hash((type(self).__name__, self.name))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, features={self.n_features}, reach={self.reach:.3f} m)"


def landmark_error(body: Embodiment, predicted: ArrayLike, target: ArrayLike) -> FloatArray:
    """Euclidean distance between predicted and target landmarks, in the target body's own frame.

    This is the error E of the paper's Tables 2 to 4 before averaging.

    Args:
        body: the body that both belong to.
        predicted: frames ``(N, F)``.
        target: frames ``(N, F)``.

    Returns:
        ``(N, 2 * arms)`` distances [m], columns as ``body.landmark_names``.

    Raises:
        EmbodimentError: wrong shapes or values that are not finite.
    """
    first = body.landmarks(body.check(predicted, "predicted frames"))
    second = body.landmarks(body.check(target, "target frames"))
    if first.shape != second.shape:
        raise EmbodimentError(f"{len(first)} predicted frames against {len(second)} target frames of {body.name!r}")
    distances: FloatArray = np.linalg.norm(first - second, axis=-1)
    return distances
