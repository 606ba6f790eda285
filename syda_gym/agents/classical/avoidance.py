"""Avoidance: references that keep clear of contact, from which a policy learns to keep clear in time and smoothly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.classical.projection import Projection
from syda_gym.agents.interface import Interface
from syda_gym.agents.streams.streams import Streams
from syda_gym.embodiments.embodiment import FloatArray

__all__ = ["avoiding"]

_ROUNDS = 4


def avoiding(streams: Streams, interface: Interface, *, margin: float = 0.015, width: float = 2.0) -> Streams:
    """The same streams with a reference that is near the old one, free of contact and smooth.

    Projection alone jumps where the nearest obstacle changes and acts at the last moment. So the change that it makes
    to the reference is smoothed over time with a Gaussian, which needs the future and is therefore no agent, and the
    result is projected again, a few times over. A causal network that is trained on it (``train_predictor``) learns to
    begin the detour before the contact.

    Args:
        streams: episodes.
        interface: whose robot.
        margin: clearance that is kept [m].
        width: standard deviation of the Gaussian in control steps.

    Returns:
        Streams that differ in ``reference`` only; episodes without contact keep theirs bit for bit.
    """
    projection = Projection(interface, BaseAlone(interface), margin=margin)
    robot, shape = interface.robot, streams.reference.shape
    wanted = streams.reference
    result = projection.project(wanted.reshape(-1, shape[-1])).reshape(shape)
    touched = (result != wanted).any(axis=(1, 2))
    for _ in range(_ROUNDS if touched.any() else 0):
        smooth = wanted[touched] + _smoothed(result[touched] - wanted[touched], width)
        free = projection.project(robot.clamp(smooth.reshape(-1, shape[-1])))
        result[touched] = free.reshape(smooth.shape)
    return replace(streams, reference=result)


def _smoothed(values: FloatArray, width: float) -> FloatArray:
    """Gaussian filter along the second axis."""
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, width, axis=1, mode="nearest"))
