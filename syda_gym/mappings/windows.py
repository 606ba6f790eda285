"""Causal windows: does a mapping gain from the last few frames, or does it only read the clock?

Recorded clips are short and start alike, so that a window of past frames tells how far the clip has come, and with that
the action's phase. A gain is believable only beside two controls: the bare frame index given to a model that has no
window, and the error on frames that lie well inside the clip. ``window_study`` always computes all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.mappings.arm_problem import ArmProblem, assemble
from syda_gym.mappings.linear import Ridge
from syda_gym.motions.clip import PairedMotions

__all__ = ["WindowRow", "past_frames", "window_study"]

_SHRINKAGE = 0.1
_LAG = 6
INSIDE = 8
"""First frame of a clip that counts as well inside it."""

Features = Callable[[PairedMotions, FloatArray], FloatArray]


@dataclass(frozen=True)
class WindowRow:
    """One variant of the study.

    Attributes:
        name: the variant.
        error: mean landmark error of held-out actions [m].
        inside: the same over frames from ``INSIDE`` on [m].
        gain: relative gain over the single frame, 0.1 for 10 %.
        gain_inside: the same over frames from ``INSIDE`` on.
    """

    name: str
    error: float
    inside: float
    gain: float
    gain_inside: float


def past_frames(pair: PairedMotions, codes: FloatArray, window: int) -> FloatArray:
    """Codes beside those of the ``window`` frames before, within each clip; the first frame is held.

    Args:
        pair: tells clips apart.
        codes: ``(N, K, D)``.
        window: frames to look back.

    Returns:
        ``(N, K, D (1 + window))``.
    """
    parts = [codes]
    for back in range(1, window + 1):
        shifted = np.empty_like(codes)
        for rows in pair.clip_rows():
            shifted[rows] = codes[rows[np.maximum(np.arange(len(rows)) - back, 0)]]
        parts.append(shifted)
    return np.concatenate(parts, axis=-1)


def window_study(pair: PairedMotions, window: int = 4) -> list[WindowRow]:
    """Leave-one-action-out errors of a ridge with and without a causal window, and the phase controls.

    Args:
        pair: whole clips of several actions.
        window: frames to look back, at least 1.

    Returns:
        Rows for one frame, the window, one frame with the bare frame index (a control: it must not win), and the window
        with the frame index.

    Raises:
        OptionError: ``window`` is below 1.
    """
    if window < 1:
        raise OptionError(f"window must be at least 1 frame, got {window}")

    def indexed(part: PairedMotions, codes: FloatArray) -> FloatArray:
        phase = part.times[:, None, None] / 30.0
        powers = np.concatenate([phase, phase**2, phase**3], axis=-1)
        return np.concatenate([codes, np.repeat(powers, codes.shape[1], axis=1)], axis=-1)

    variants: dict[str, Features] = {
        "one frame": lambda part, codes: codes,
        f"window of {window}": lambda part, codes: past_frames(part, codes, window),
        "control: one frame and its index": indexed,
        f"control: window of {window} and index": lambda part, codes: indexed(part, past_frames(part, codes, window)),
    }
    scores = {name: _score(pair, features) for name, features in variants.items()}
    base = scores["one frame"]
    return [
        WindowRow(name, error, inside, 1.0 - error / base[0], 1.0 - inside / base[1])
        for name, (error, inside) in scores.items()
    ]


def _score(pair: PairedMotions, features: Features) -> tuple[float, float]:
    errors, times = [], []
    for train, test in pair.folds("loao"):
        problem = ArmProblem.build(train, 0, _LAG)
        source, target, _ = assemble(problem, Ridge.fit(*problem.rows, _SHRINKAGE))
        inputs = features(train, problem.source)
        model = Ridge.fit(
            inputs.reshape(-1, inputs.shape[-1]), problem.target.reshape(-1, problem.target.shape[-1]), _SHRINKAGE
        )
        mapped = target.decode(model(features(test, source.encode(test.source))))
        errors.append(landmark_error(test.target_body, mapped, test.target).mean(axis=1))
        times.append(test.times)
    error, time = np.concatenate(errors), np.concatenate(times)
    return float(error.mean()), float(error[time >= INSIDE].mean())
