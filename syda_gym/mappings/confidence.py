"""Confidence: how wrong a mapping may be, and how unlike its training a frame is."""

from __future__ import annotations

from collections.abc import Mapping as Dict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MappingError
from syda_gym.files import shortened
from syda_gym.mappings.models.scaling import Scaler
from syda_gym.mappings.spreading import spread_out

__all__ = ["Confidence", "action_maximum", "fit_confidence", "gain"]

_ANCHORS = 200
_QUANTILE = 0.9
_FAMILIAR = 0.99
_LARGEST_BOUND = 10.0  # m
_NEXT_ACTION = 0.95
_LONGEST = 20.0  # of a logarithm; nothing is farther


class Confidence:
    """An error bound [m] and a Gaussian-process style difficulty.

    The bound is constant: the largest over the training actions of each action's own 90 % quantile of the mean landmark
    error, every action predicted by a model that never saw it (``action_maximum``). A pooled quantile covers hard
    actions badly, because errors differ between actions more than within them.

    The difficulty of a frame is 1 - k(frame, nearest anchor), k being a Gaussian kernel on standardised codes and the
    anchors a spread-out subset of the training codes. Frames farther than 95 % of further
    actions would reach with all but 1 % of their frames (as the training actions tell of each other) are out of
    distribution; with one action, which tells nothing of others, no frame is.

    Args:
        bound: error bound [m], ``None`` where no action could be held out.
        gain: how much the mapping enlarges small landmark displacements.
        scale: standardisation of codes.
        anchors: ``(A, D)`` standardised codes.
        width: of the kernel, in standardised units.
        threshold: difficulty above which a frame is out of distribution.
    """

    def __init__(
        self,
        bound: float | None,
        gain: float,
        scale: Scaler,
        anchors: FloatArray,
        width: float,
        threshold: float,
    ) -> None:
        self.bound = bound
        self.gain = gain
        self.scale = scale
        self.anchors = anchors
        self.width = width
        self.threshold = threshold

    def difficulty(self, codes: FloatArray) -> FloatArray:
        """Difficulty 0 to 1 of codes ``(N, K, D)``: the worst of the K, ``(N,)``."""
        distance = _nearest(self.scale(codes).reshape(-1, codes.shape[-1]), self.anchors)
        values: FloatArray = 1.0 - np.exp(-0.5 * (distance / self.width) ** 2)
        worst: FloatArray = values.reshape(codes.shape[:-1]).max(axis=-1)
        return worst

    def unfamiliar(self, codes: FloatArray) -> NDArray[np.bool_]:
        """Which frames are out of distribution, ``(N,)``."""
        result: NDArray[np.bool_] = self.difficulty(codes) > self.threshold
        return result

    def arrays(self, name: str) -> dict[str, FloatArray]:
        """The fitted arrays under ``name.``."""
        return {f"{name}.anchors": self.anchors, **self.scale.arrays(f"{name}.scale")}

    def settings(self) -> dict[str, Any]:
        """The fitted numbers, JSON-able."""
        return {"bound": self.bound, "gain": self.gain, "width": self.width, "threshold": self.threshold}

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Dict[str, FloatArray], name: str) -> Confidence:
        """Rebuilds what ``settings`` and ``arrays`` gave.

        Raises:
            MappingError: a number out of its range; a negative bound or a threshold that is no number would switch off
                the slowing down of the live loop.
        """
        bound = settings["bound"]
        anchors, scale = arrays[f"{name}.anchors"], Scaler.restore(arrays, f"{name}.scale")
        if anchors.ndim != 2 or anchors.shape[1] != len(scale.mean) or not len(anchors):
            raise MappingError(
                f"{name}: anchors of shape {anchors.shape} do not fit codes of {len(scale.mean)} numbers"
            )
        return cls(
            None if bound is None else _within(f"{name}.bound", bound, 0.0, _LARGEST_BOUND),
            _within(f"{name}.gain", settings["gain"], 0.0, 1e6),
            scale,
            anchors,
            _within(f"{name}.width", settings["width"], 1e-12, 1e12),
            _within(f"{name}.threshold", settings["threshold"], 0.0, 1.0),
        )


def fit_confidence(codes: FloatArray, actions: NDArray[np.str_], bound: float | None, enlargement: float) -> Confidence:
    """Fits the difficulty to training codes and attaches the bound.

    Args:
        codes: ``(N, K, D)``.
        actions: ``(N,)``.
        bound: error bound [m].
        enlargement: see ``gain``.
    """
    rows = codes.reshape(-1, codes.shape[-1])
    labels = np.repeat(actions, codes.shape[1])
    scale = Scaler.fit(rows)
    standard = scale(rows)
    anchors = spread_out(standard, _ANCHORS)
    names = np.unique(labels)
    if len(names) > 1:
        apart = [_nearest(standard[labels == name], spread_out(standard[labels != name], _ANCHORS)) for name in names]
        held_out, far = np.concatenate(apart), _farthest(apart)
    else:
        # Its own frames lie on the anchors: how far another action would be is anyone's guess, so none is flagged.
        held_out, far = np.linalg.norm(standard - standard.mean(axis=0), axis=1), np.inf
    width = max(float(np.median(held_out)), 1e-3)
    threshold = float(1.0 - np.exp(-0.5 * (max(far, 1e-3) / width) ** 2))
    return Confidence(
        bound, enlargement, scale, anchors, width, threshold if far == np.inf else min(threshold, 1 - 1e-9)
    )


def _farthest(apart: list[FloatArray]) -> float:
    """How far frames of one more action may lie: a one-sided prediction limit over actions.

    Actions differ more than the frames of one, and few actions say little about the next. So each action's own 99 %
    quantile of distances (log) is one observation, and Student's t tells where the next one may be.
    """
    from scipy.stats import t

    logs = np.log([max(float(np.quantile(distances, _FAMILIAR)), 1e-3) for distances in apart])
    count = len(logs)
    beyond = float(t.ppf(_NEXT_ACTION, count - 1)) * float(logs.std(ddof=1)) * np.sqrt(1.0 + 1.0 / count)
    return float(np.exp(min(logs.mean() + beyond, _LONGEST)))


def _within(name: str, value: Any, low: float, high: float) -> float:
    number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else float("nan")
    if not low <= number <= high:
        raise MappingError(f"{name} must be a number between {low:g} and {high:g}, got {shortened(value, 60)}")
    return number


def action_maximum(errors: FloatArray, actions: NDArray[np.str_]) -> float:
    """The largest of the actions' own 90 % quantiles.

    Args:
        errors: ``(N,)`` mean landmark errors [m] of held-out predictions.
        actions: ``(N,)``.

    Returns:
        The bound [m].
    """
    return max(float(np.quantile(errors[actions == name], _QUANTILE)) for name in np.unique(actions))


def gain(source: Embodiment, target: Embodiment, frames: FloatArray, mapped: FloatArray) -> float:
    """How much a mapping enlarges small displacements: median ratio of landmark distances between like frames.

    Args:
        source: body of ``frames``.
        target: body of ``mapped``.
        frames: ``(N, F_source)``.
        mapped: ``(N, F_target)``, the mapped frames.
    """
    count = min(len(frames), 400)
    rows = np.linspace(0, len(frames) - 1, count).astype(int)
    before, after = source.landmarks(frames[rows]), target.landmarks(mapped[rows])
    moved = np.linalg.norm(before[:, None] - before[None], axis=-1).mean(axis=-1)
    result = np.linalg.norm(after[:, None] - after[None], axis=-1).mean(axis=-1)
    near = (moved > 0.02) & (moved < 0.15)
    return float(np.median(result[near] / moved[near])) if near.sum() >= 10 else target.reach / source.reach


def _nearest(rows: FloatArray, anchors: FloatArray) -> FloatArray:
    """Distance of each row to the nearest anchor."""
    result = np.empty(len(rows))
    squares = np.sum(anchors**2, axis=1)
    for start in range(0, len(rows), 4096):
        part = rows[start : start + 4096]
        distance = np.sum(part**2, axis=1)[:, None] + squares - 2.0 * part @ anchors.T
        result[start : start + 4096] = np.sqrt(np.maximum(distance.min(axis=1), 0.0))
    return result
