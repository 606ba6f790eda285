"""What mappings are assembled from, by the names under which it is stored."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from syda_gym.mappings.coders import Coder, PositionCoder, QuaternionCoder
from syda_gym.mappings.regressors import DirectRegressor, DualRegressor, Regressor

__all__ = ["CODERS", "REGRESSORS"]

CODERS: dict[str, Callable[..., Coder]] = {cls.kind: cls for cls in (PositionCoder, QuaternionCoder)}
"""Kind to class; called with body, settings and arrays."""

REGRESSORS: dict[str, type[Regressor] | Any] = {cls.kind: cls for cls in (DualRegressor, DirectRegressor)}
"""Kind to class; rebuilt by ``restore(settings, arrays)``."""
