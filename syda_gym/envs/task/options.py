"""TeleopOptions: everything a teleoperation environment can be told, checked at construction."""

from __future__ import annotations

import os
from collections.abc import Mapping as Dict
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.envs.task.disturbances import Disturbances
from syda_gym.envs.task.tracking import RewardWeights
from syda_gym.errors import OptionError, UnknownOptionError, nearest_name
from syda_gym.motions.clip import Motions
from syda_gym.simulation.backend import BACKENDS
from syda_gym.simulation.pictures.camera import CameraView
from syda_gym.simulation.rates import Rates

if TYPE_CHECKING:
    from syda_gym.mappings.mapping import Mapping

__all__ = ["ACTION_MODES", "REFERENCES", "STARTS", "SUCCESS_ERRORS", "TeleopOptions"]

ACTION_MODES = ("residual", "position")
"""Actions are corrections of the base command, or joint angles."""

REFERENCES = ("auto", "paired", "mapped")
"""Track the robot's own paired motion, or what the mapping makes of the undisturbed operator; ``auto``: the first where
operator and robot were recorded together."""

STARTS = ("first", "uniform", "failures")
"""Start frame: the clip's first, any, or more often where the landmark error is large."""


SUCCESS_ERRORS = {"paired": 0.036, "mapped": 0.008}
"""``success_error`` where it is not given, by reference [m]: the median over the training actions of the mean landmark
error of the base (adult to Pepper, nothing disturbed; ``scripts/build_leaderboard.py --calibrate``)."""


@dataclass(frozen=True)
class TeleopOptions:
    """Options of ``SydaTeleop-v0``, single and vectorised; see ``SydaTeleopEnv`` for what they do.

    Raises:
        OptionError: a value outside what is allowed; the message lists what is.
    """

    operator: str | Embodiment = "adult"
    robot: str | os.PathLike[str] | Embodiment = "pepper"
    route: str | Sequence[str] = "auto"
    predictor: str = "dry_run"
    mapping: str | os.PathLike[str] | Mapping = "syda"
    preset: str | None = None
    motions: str | os.PathLike[str] | Motions = "embedded"
    fps: float | None = None
    clips: Sequence[int | str] | None = None
    actions: Sequence[str] | None = None
    held_out: Sequence[str] = ()
    via: Sequence[str] | None = None
    fit_seed: int = 0
    reference: str = "auto"
    action_mode: str = "residual"
    residual_scale: float = 0.25
    preview: int = 0
    history: int = 0
    control_hz: float = 30.0
    physics_hz: float = 240.0
    physics: str = "bullet"
    self_collision: bool = False
    whole_body: bool = False
    reward: RewardWeights | Dict[str, Any] | None = None
    terminate_error: float | None = None
    success_error: float | None = None
    start: str = "first"
    disturbances: str | Disturbances | Dict[str, Any] | None = None
    camera: CameraView | Dict[str, Any] | None = None

    def __post_init__(self) -> None:
        Rates(self.control_hz, self.physics_hz)
        RewardWeights.resolve(self.reward)
        Disturbances.resolve(self.disturbances)
        CameraView.resolve(self.camera)
        for name, allowed in (
            ("action_mode", ACTION_MODES),
            ("reference", REFERENCES),
            ("physics", BACKENDS),
            ("start", STARTS),
        ):
            value = getattr(self, name)
            if value not in allowed:
                raise OptionError(f"{name}={value!r} is not allowed; {nearest_name(str(value), allowed)}")
        for name, low, high in (("preview", 0, 60), ("history", 0, 60), ("fit_seed", 0, 2**32 - 1)):
            _check_whole(name, getattr(self, name), low, high)
        _check_number("residual_scale", self.residual_scale, 1e-3, np.pi)
        if self.success_error is not None:
            _check_number("success_error", self.success_error, 1e-4, 10.0)
        if self.terminate_error is not None:
            _check_number("terminate_error", self.terminate_error, 1e-4, 10.0)
        for name in ("self_collision", "whole_body"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise OptionError(f"{name} must be True or False, got {getattr(self, name)!r}")
        if self.self_collision and self.physics == "servo":
            raise OptionError("physics='servo' knows no contacts; use physics='bullet' or self_collision=False")
        if not isinstance(self.held_out, Sequence) or isinstance(self.held_out, str):
            raise OptionError(f"held_out must be a list of action names, got {self.held_out!r}")

    @classmethod
    def of(cls, options: TeleopOptions | None, changes: Dict[str, Any]) -> TeleopOptions:
        """Options with some of them changed.

        Raises:
            UnknownOptionError: an unknown option; the message says which is nearest.
        """
        known = [field.name for field in fields(cls)]
        for name in changes:
            if name not in known:
                # In Python's words: TorchRL, for one, tries keywords and looks for this text.
                raise UnknownOptionError(
                    f"unknown option: got an unexpected keyword argument {name!r}; {nearest_name(name, known)}"
                )
        values = {} if options is None else {name: getattr(options, name) for name in known}
        return cls(**{**values, **changes})

    @property
    def rates(self) -> Rates:
        """Control and physics rate, the one source of truth about time."""
        return Rates(self.control_hz, self.physics_hz)

    @property
    def weights(self) -> RewardWeights:
        """Reward weights."""
        return RewardWeights.resolve(self.reward)

    @property
    def disturbed(self) -> Disturbances | None:
        """Disturbances, ``None`` if there are none."""
        return Disturbances.resolve(self.disturbances)


def _check_whole(name: str, value: Any, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not low <= value <= high:
        raise OptionError(f"{name} must be a whole number from {low} to {high}, got {value!r}")


def _check_number(name: str, value: Any, low: float, high: float) -> None:
    fine = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not fine or not low <= value <= high:
        raise OptionError(f"{name} must be a number from {low:.3g} to {high:.3g}, got {value!r}")
