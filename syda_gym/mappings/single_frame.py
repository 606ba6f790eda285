"""SingleFrame: one frame through a fitted mapping with as little around the arithmetic as possible.

Live use maps frame by frame. There numpy and checks that suit whole clips cost several times what the arithmetic does;
here the limbs are encoded in plain floats, the whole model is one affine map, and the output is checked once.
"""

from __future__ import annotations

import math
from typing import Any

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.mappings.coding.arm_coders import HumanArmCoder, RobotArmCoder
from syda_gym.mappings.coding.coders import Coder
from syda_gym.mappings.models.regressors import Regressor

__all__ = ["SingleFrame"]


class SingleFrame:
    """A human's frame to a robot's, for affine models between arm codes.

    Args:
        source_coder: encodes the human.
        regressor: whatever the model, what it does as one frame's codes pass.
        target_coder: decodes the robot.
    """

    def __init__(self, source_coder: HumanArmCoder, regressor: Regressor, target_coder: RobotArmCoder) -> None:
        self._encode = source_coder.encode_one
        self._coder = target_coder
        self._regressor = regressor
        self._shape = (source_coder.body.n_features,)
        affine = regressor.affine()
        self._affine = affine if affine is not None and len(affine[0]) == source_coder.width else None

    @classmethod
    def of(cls, source_coder: Coder, regressor: Regressor, target_coder: Coder) -> SingleFrame | None:
        """The short way through these parts, ``None`` where there is none."""
        if type(source_coder) is HumanArmCoder and type(target_coder) is RobotArmCoder:
            return cls(source_coder, regressor, target_coder)
        return None

    def __call__(self, frame: FloatArray) -> FloatArray | None:
        """Joint angles ``(n,)`` [rad] within the limits, ``None`` for a frame that deserves a closer look."""
        rows = self._codes(frame)
        return None if rows is None else self._coder.decode_one(rows)

    def follow(self, frame: FloatArray, memory: Any, dt: float | None, limited: bool) -> tuple[FloatArray, Any] | None:
        """The same for the next frame of a clip, with the memory after it."""
        rows = self._codes(frame)
        return None if rows is None else self._coder.follow_one(rows, memory, dt, limited)

    def _codes(self, frame: FloatArray) -> list[list[float]] | None:
        """Codes of the robot, ``None`` if something is unusual about the frame or about them."""
        if frame.shape != self._shape or not math.isfinite(sum(frame.tolist())):
            return None
        codes = self._encode(frame)
        affine = self._affine
        mapped = self._regressor(codes) if affine is None else codes @ affine[0] + affine[1]
        rows: list[list[float]] = mapped.tolist()
        return rows if all([math.isfinite(sum(row)) for row in rows]) else None
