"""Alpha from recordings: how noisy a body's landmarks are, by what changes faster than a limb can."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from syda_gym.errors import MotionError, OptionError
from syda_gym.motions.clip import Motions

__all__ = ["alpha_from_noise", "high_frequency_noise", "sensor_noise"]

# Third differences of independent noise have the variance (1 + 9 + 9 + 1) sigma^2 (binomial coefficients squared).
_GAIN = np.sqrt(20.0)
_MEDIAN_TO_SIGMA = 0.6745
_DIFFERENCES = 3


def high_frequency_noise(clips: Iterable[ArrayLike]) -> float:
    """Standard deviation of measurement noise, from third differences in time.

    A limb's motion is smooth over three frames at 10 Hz and more, noise is not. The median makes the estimate blind to
    outliers and dropouts. Noise that is correlated in time is underestimated, for all bodies alike.

    Args:
        clips: positions ``(N, ...)`` [m] at the recording's own frame rate, one array per clip.

    Returns:
        Noise [m].

    Raises:
        MotionError: no clip has four frames.
    """
    rough = [np.diff(np.asarray(clip, dtype=np.float64), n=3, axis=0).ravel() for clip in clips if len(np.shape(clip))]
    rough = [part for part in rough if part.size]
    if not rough:
        raise MotionError("noise needs at least one clip of four frames; got none")
    return float(np.median(np.abs(np.concatenate(rough))) / (_MEDIAN_TO_SIGMA * _GAIN))


def sensor_noise(motions: Motions, names: Sequence[str] | None = None) -> dict[str, float]:
    """Noise of each body's landmarks in recordings [m], for ``sensor=`` of the dry run.

    What is correlated in time is not seen (see ``high_frequency_noise``), so that smoothed recordings look better than
    their sensor. A body without a clip of four frames is left out and keeps the default.

    Args:
        motions: recordings at their own frame rate.
        names: bodies; all by default.
    """
    found = {}
    for name in names or motions.bodies:
        body = motions.bodies[name]
        clips = [body.landmarks(clip.frames) for clip in motions.clips(name) if len(clip) > _DIFFERENCES]
        if clips:
            found[name] = high_frequency_noise(clips)
    return found


def alpha_from_noise(noise: Mapping[str, float], resolution: float = 0.005) -> dict[frozenset[str], float]:
    """Noise coefficients alpha = sigma_min / sigma_pair of all pairs (Eq. 10).

    The paper calls alpha the ratio of noise in the system and estimates it by hand (0.76 for the kid with Pepper).
    Here a pair's noise is the root of the summed squares of its bodies' noise, and sigma_min the least noisy pair's.

    Args:
        noise: body to noise, all in one unit, best over the arm's length.
        resolution: smaller noise counts as this much, so that a robot's exact encoders do not make everybody else
            look hopeless; half a percent of the arm's length by default.

    Returns:
        Pair of names to alpha in (0, 1].

    Raises:
        OptionError: fewer than two bodies, or a noise that is not positive.
    """
    names = list(noise)
    if len(names) < 2 or not all(np.isfinite(noise[name]) and noise[name] >= 0.0 for name in names):
        raise OptionError(f"alpha needs the noise of at least two bodies, finite and not negative; got {dict(noise)}")
    if not resolution > 0.0:
        raise OptionError(f"resolution must be positive, got {resolution}")
    floored = {name: max(value, resolution) for name, value in noise.items()}
    pairs = {
        frozenset((a, b)): float(np.hypot(floored[a], floored[b])) for i, a in enumerate(names) for b in names[i + 1 :]
    }
    least = min(pairs.values())
    return {pair: least / value for pair, value in pairs.items()}
