"""ResidualConfig: every hyper-parameter of training a residual policy, and the presets that are shipped."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.agents.residual.costs import CostWeights
from syda_gym.errors import OptionError, StorageError, nearest_name
from syda_gym.files import asset

__all__ = ["ALGORITHMS", "STACK", "ResidualConfig", "preset_names"]

ALGORITHMS = ("ppo", "sac", "tqc")
"""PPO and SAC of Stable-Baselines3, TQC of sb3-contrib (extra ``train``)."""

STACK = "stack"
"""The base of a policy that stands on a predictor, which is trained first, on the tuned Kalman filter."""

_MAX_BYTES = 2**16  # of a configuration file


@dataclass(frozen=True)
class ResidualConfig:
    """Hyper-parameters.

    Attributes:
        algorithm: one of ``ALGORITHMS``.
        base: name of the rival below, as in ``classical.RIVALS``, or ``STACK``.
        base_settings: of that rival.
        steps: environment steps in all.
        robots: replayed at once.
        rollout: steps of each robot between two updates (PPO).
        batch: samples per gradient step.
        epochs: passes over a rollout (PPO); gradient steps per vector step (SAC, TQC).
        learning_rate: at the start; it falls linearly to zero.
        gamma: discount.
        gae_lambda: of the generalised advantage (PPO).
        clip_range: of the probability ratio (PPO).
        entropy: weight of the entropy (PPO).
        log_std: logarithm of the exploration's standard deviation at the start (PPO).
        buffer: transitions kept (SAC, TQC).
        learning_starts: steps before the first gradient (SAC, TQC).
        hidden: widths of the layers.
        each_arm: whether one network looks at each arm as if it were the left one, and learns from both; where the arms
            of a robot are no mirror images, it looks at the whole robot all the same.
        scale: largest correction [rad].
        smoothing: share of the old correction, 0 to below 1.
        cost: weights of the cost whose saving is rewarded.
        episodes: streams that are recorded for training.
        validation_episodes: streams that the best policy is chosen on.
        legs: parts of the training; after each the policy is judged, a checkpoint written, and the robots begin anew.
        patience: legs without improvement after which training stops; 0 never stops.

    Raises:
        OptionError: a value out of range.
    """

    algorithm: str = "ppo"
    base: str = "base"
    base_settings: Mapping[str, float] = field(default_factory=dict)
    steps: int = 200_000
    robots: int = 32
    rollout: int = 64
    batch: int = 512
    epochs: int = 8
    learning_rate: float = 1e-3
    gamma: float = 0.5
    gae_lambda: float = 0.9
    clip_range: float = 0.2
    entropy: float = 0.0
    log_std: float = -1.5
    buffer: int = 100_000
    learning_starts: int = 2_000
    hidden: tuple[int, ...] = (64, 64)
    each_arm: bool = False
    scale: float = 0.25
    smoothing: float = 0.0
    cost: CostWeights = field(default_factory=CostWeights)
    episodes: int = 256
    validation_episodes: int = 64
    legs: int = 8
    patience: int = 0

    def __post_init__(self) -> None:
        if self.algorithm not in ALGORITHMS:
            raise OptionError(f"unknown algorithm {self.algorithm!r}; {nearest_name(self.algorithm, ALGORITHMS)}")
        whole = ("steps", "robots", "rollout", "batch", "epochs", "buffer", "episodes", "validation_episodes", "legs")
        for name in whole:
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
                raise OptionError(f"{name} must be a whole number of at least 1, got {value!r}")
        for name, low, high in (
            ("learning_rate", 1e-8, 1.0),
            ("gamma", 0.0, 1.0),
            ("gae_lambda", 0.0, 1.0),
            ("clip_range", 1e-3, 10.0),
            ("log_std", -10.0, 2.0),
            ("scale", 1e-3, np.pi),
            ("smoothing", 0.0, 0.99),
            ("entropy", 0.0, 10.0),
        ):
            value = getattr(self, name)
            if not (isinstance(value, int | float | np.number) and low <= value <= high):
                raise OptionError(f"{name} must lie between {low:g} and {high:g}, got {value!r}")
        if self.patience < 0 or self.learning_starts < 0 or not self.hidden or min(self.hidden) < 1:
            raise OptionError("patience and learning_starts must not be negative; hidden needs positive widths")

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> ResidualConfig:
        """From plain data, as in a YAML preset or a bundle's card.

        Raises:
            OptionError: an unknown name; the message says which is nearest.
        """
        known = [f.name for f in fields(cls)]
        for name in values:
            if name not in known:
                raise OptionError(f"unknown hyper-parameter {name!r}; {nearest_name(str(name), known)}")
        given = dict(values)
        if "hidden" in given:
            given["hidden"] = tuple(int(width) for width in given["hidden"])
        if isinstance(given.get("cost"), Mapping):
            given["cost"] = CostWeights.of(given["cost"])
        return cls(**given)

    @classmethod
    def preset(cls, name: str, **changes: Any) -> ResidualConfig:
        """A shipped preset, with some values changed.

        Raises:
            OptionError: unknown preset or hyper-parameter.
        """
        import yaml

        if name not in preset_names():
            raise OptionError(f"unknown preset {name!r}; {nearest_name(name, preset_names())}")
        values = yaml.safe_load(asset("agents", "presets", f"{name}.yaml").read_text(encoding="utf-8"))
        return cls.of({**values, **changes})

    @classmethod
    def read(cls, path: str | os.PathLike[str], **changes: Any) -> ResidualConfig:
        """A YAML file of hyper-parameters, with some values changed.

        Raises:
            StorageError: no such file, too large, or not YAML.
            OptionError: unknown hyper-parameter or bad value.
        """
        import yaml

        file = Path(path)
        if not file.is_file() or file.stat().st_size > _MAX_BYTES:
            raise StorageError(f"no training configuration {file}: expected a short YAML file of hyper-parameters")
        try:
            values = yaml.safe_load(file.read_text(encoding="utf-8"))
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            raise StorageError(f"{file} is not valid YAML: {' '.join(str(error).split())}") from error
        if not isinstance(values, dict):
            raise OptionError(f"{file}: expected names and values, got {type(values).__name__}")
        try:
            return cls.of({**values, **changes})
        except (TypeError, ValueError) as error:
            raise OptionError(f"{file}: {error}") from error

    def as_dict(self) -> dict[str, Any]:
        """Plain data from which ``of`` makes an equal configuration."""
        return {**asdict(self), "hidden": list(self.hidden), "base_settings": dict(self.base_settings)}


def preset_names() -> tuple[str, ...]:
    """Names of the shipped presets."""
    return tuple(sorted(path.stem for path in asset("agents", "presets").glob("*.yaml")))
