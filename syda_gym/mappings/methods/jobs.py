"""FitJob: one pair and one seed to fit, checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MappingError
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.models.autoencoder_training import Progress
from syda_gym.motions.clip import PairedMotions

__all__ = ["FitJob", "Fitter", "check_pair"]

_LEAST_FRAMES = 10
_LEAST_MOTION = 1e-3  # m


@dataclass(frozen=True)
class FitJob:
    """One mapping to fit.

    Attributes:
        pair: the paired frames.
        preset: preset of the method.
        seed: of everything random.
        options: the method's options.
    """

    pair: PairedMotions
    preset: str
    seed: int
    options: dict[str, Any] = field(default_factory=dict)


Fitter = Callable[[Sequence[FitJob], Progress | None], list[CodedMapping]]
"""Fits several jobs of one method and preset, together where that is faster."""


def check_pair(pair: PairedMotions) -> None:
    """Refuses frames from which nothing can be learnt.

    Raises:
        MappingError: fewer than 10 frames, a body that does not move, or motion along one line only.
    """
    if len(pair) < _LEAST_FRAMES:
        raise MappingError(f"{pair!r}: a fit needs at least {_LEAST_FRAMES} paired frames; record more motion")
    _check_motion(pair.source_body, pair.source, "source")
    _check_motion(pair.target_body, pair.target, "target")


def _check_motion(body: Embodiment, frames: FloatArray, role: str) -> None:
    rows = frames[:: max(1, len(frames) // 2000)]
    points = body.landmarks(rows).reshape(len(rows), -1)
    spread = points.std(axis=0)
    if spread.max() < _LEAST_MOTION:
        raise MappingError(
            f"the {role} frames of {body.name!r} are constant (largest movement {1000 * spread.max():.3f} mm); "
            "record the arms moving"
        )
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if len(singular) < 2 or singular[1] < 1e-6 * singular[0]:
        raise MappingError(
            f"the {role} frames of {body.name!r} all lie on one line (rank 1): the features are deficient; "
            "record motion in more than one direction"
        )
