"""Causal windows: does a mapping gain from the last few frames, or does it only read the clock?

Recorded clips are short and start alike, so that a window of past frames tells how far the clip has come, and with that
the action's phase. A gain is believable only beside two controls: the bare frame index given to a model that has no
window, and the error on frames that lie well inside the clip. ``window_study`` always computes all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments import landmark_error
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.mappings.coding.window_coder import past_frames
from syda_gym.mappings.methods.arm_problem import ArmProblem, Coding
from syda_gym.mappings.models.linear import Ridge
from syda_gym.motions.clip import PairedMotions

__all__ = ["WindowRow", "window_study"]

_SHRINKAGE = 0.1
_LAG = 6
INSIDE = 8
"""First frame of a clip that counts as well inside it."""

Features = Callable[[PairedMotions, FloatArray], FloatArray]
"""What a variant sees: a part of the pair and its codes ``(N, K, D)`` to inputs ``(N, K, E)``."""


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

    def looking_back(part: PairedMotions, codes: FloatArray) -> FloatArray:
        return past_frames(codes, window, part.clip_rows())

    variants: dict[str, Features] = {
        "one frame": lambda part, codes: codes,
        f"window of {window}": looking_back,
        "control: one frame and its index": _with_index,
        f"control: window of {window} and index": lambda part, codes: _with_index(part, looking_back(part, codes)),
    }
    errors, times = _held_out(pair, list(variants.values()))
    scores = [(float(values.mean()), float(values[times >= INSIDE].mean())) for values in errors]
    base = scores[0]
    return [
        WindowRow(name, error, inside, 1.0 - error / base[0], 1.0 - inside / base[1])
        for name, (error, inside) in zip(variants, scores, strict=True)
    ]


def _with_index(part: PairedMotions, codes: FloatArray) -> FloatArray:
    """Codes beside powers of the frame index: all that a model could know of the clip's phase."""
    phase = part.times[:, None, None] / 30.0
    powers = np.concatenate([phase, phase**2, phase**3], axis=-1)
    return np.concatenate([codes, np.repeat(powers, codes.shape[1], axis=1)], axis=-1)


def _held_out(pair: PairedMotions, variants: Sequence[Features]) -> tuple[list[FloatArray], NDArray[np.int64]]:
    """Mean landmark errors of every variant ``(N,)`` [m] and the frame indices ``(N,)``, action by action."""
    errors: list[list[FloatArray]] = [[] for _ in variants]
    times = []
    for train, test in pair.folds("loao"):
        problem = ArmProblem.build(train, 0, Coding(_LAG))
        source, target = problem.source_coder, problem.target_coder
        outputs = problem.target.reshape(-1, problem.target.shape[-1])
        codes = source.encode(test.source)
        for found, features in zip(errors, variants, strict=True):
            inputs = features(train, problem.source)
            model = Ridge.fit(inputs.reshape(-1, inputs.shape[-1]), outputs, _SHRINKAGE)
            mapped = target.decode(model(features(test, codes)))
            found.append(landmark_error(test.target_body, mapped, test.target).mean(axis=1))
        times.append(test.times)
    return [np.concatenate(found) for found in errors], np.concatenate(times)
