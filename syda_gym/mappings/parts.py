"""What mappings are assembled from, by the names under which it is stored."""

from __future__ import annotations

from typing import Any

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import StorageError, nearest_name
from syda_gym.mappings.arm_coders import HumanArmCoder, RobotArmCoder
from syda_gym.mappings.coders import Arrays, Coder, PositionCoder, QuaternionCoder
from syda_gym.mappings.geometric import GeometricRegressor
from syda_gym.mappings.heads import HeadedRegressor
from syda_gym.mappings.linear import KernelRidge, Nearest, Ridge
from syda_gym.mappings.mink_ik import MinkArmCoder
from syda_gym.mappings.regressors import DirectRegressor, DualRegressor, Regressor
from syda_gym.mappings.residual import HopRegressor, MeanRegressor, TwoWay
from syda_gym.mappings.window_coder import WindowCoder

__all__ = ["CODERS", "REGRESSORS", "restore_coder", "restore_regressor"]

CODERS = {
    coder.kind: coder
    for coder in (PositionCoder, QuaternionCoder, HumanArmCoder, RobotArmCoder, MinkArmCoder, WindowCoder)
}
"""Kind to class."""

REGRESSORS: dict[str, type[Regressor]] = {
    model.kind: model
    for model in (
        DualRegressor,
        DirectRegressor,
        Ridge,
        KernelRidge,
        Nearest,
        HeadedRegressor,
        HopRegressor,
        MeanRegressor,
        TwoWay,
        GeometricRegressor,
    )
}
"""Kind to class."""


def restore_coder(entry: dict[str, Any], body: Embodiment, arrays: Arrays) -> Coder:
    """Rebuilds a coder from its stored kind, settings and arrays.

    Raises:
        StorageError: an unknown kind.
    """
    kind = str(entry["kind"])
    if kind not in CODERS:
        raise StorageError(f"unknown coder {kind!r}; {nearest_name(kind, CODERS)}")
    return CODERS[kind](body, entry["settings"], arrays)


def restore_regressor(entry: dict[str, Any], arrays: Arrays) -> Regressor:
    """Rebuilds a regressor from its stored kind, settings and arrays.

    Raises:
        StorageError: an unknown kind.
    """
    kind = str(entry["kind"])
    if kind not in REGRESSORS:
        raise StorageError(f"unknown model {kind!r}; {nearest_name(kind, REGRESSORS)}")
    return REGRESSORS[kind].restore(entry["settings"], arrays)
