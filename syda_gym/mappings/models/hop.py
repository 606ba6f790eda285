"""Residual regressors: an identity, or another regressor, plus a shrunk correction; and means of several regressors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MappingError
from syda_gym.mappings.models.linear import Ridge
from syda_gym.mappings.models.regressors import Affine, Arrays, Regressor, restore_regressor

__all__ = ["HopRegressor", "MeanRegressor", "TwoWay"]


class HopRegressor(Regressor):
    """Between bodies of one kind: the same code plus a mean offset plus a hard-shrunk ridge of what remains.

    Two humans' arm codes already mean the same; learning the hop freely only learns one recording session's habits.
    """

    kind = "hop"

    def __init__(self, correction: Ridge, correction_back: Ridge) -> None:
        self.correction = correction
        self.correction_back = correction_back

    @classmethod
    def fit(cls, source: FloatArray, target: FloatArray, shrinkage: float) -> HopRegressor:
        """Fits rows ``(N, D)`` to rows ``(N, D)``, both ways."""
        return cls(Ridge.fit(source, target - source, shrinkage), Ridge.fit(target, source - target, shrinkage))

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Codes plus correction."""
        return codes + self.correction(codes)

    def affine(self) -> Affine:
        """Identity plus correction."""
        slope, offset = self.correction.affine()
        return np.eye(len(slope)) + slope, offset

    def inverse(self) -> HopRegressor:
        """The correction of the way back."""
        return HopRegressor(self.correction_back, self.correction)

    def arrays(self) -> Arrays:
        """Both corrections."""
        parts = (("there", self.correction), ("back", self.correction_back))
        return {f"{name}/{key}": value for name, part in parts for key, value in part.arrays().items()}

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> HopRegressor:
        """Rebuilds both corrections."""
        return cls(Ridge.restore({}, _below(arrays, "there/")), Ridge.restore({}, _below(arrays, "back/")))


class MeanRegressor(Regressor):
    """The mean of several regressors, each on its own columns of the code.

    A member may be fitted to the residual of the geometric image (``on_identity``): it then adds its correction to the
    unit directions of the source's code.

    Args:
        members: regressors.
        columns: first and one-past-last input column of each.
        on_identity: per member, whether the source's own directions are added.
    """

    kind = "mean"

    def __init__(
        self, members: Sequence[Regressor], columns: Sequence[tuple[int, int]], on_identity: Sequence[bool]
    ) -> None:
        self.members = list(members)
        self.columns = [(int(a), int(b)) for a, b in columns]
        self.on_identity = [bool(flag) for flag in on_identity]

    def __call__(self, codes: FloatArray) -> FloatArray:
        """Mean over the members."""
        total: FloatArray | float = 0.0
        for member, (start, stop), identity in zip(self.members, self.columns, self.on_identity, strict=True):
            total = total + member(codes[..., start:stop])
            if identity:
                total = total + codes[..., -6:]
        return np.asarray(total / len(self.members))

    def arrays(self) -> Arrays:
        """Numbers of all members."""
        return {f"{i}/{key}": value for i, member in enumerate(self.members) for key, value in member.arrays().items()}

    def settings(self) -> dict[str, Any]:
        """Kinds and columns."""
        return {
            "members": [{"kind": member.kind, "settings": member.settings()} for member in self.members],
            "columns": [list(pair) for pair in self.columns],
            "on_identity": self.on_identity,
        }

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> MeanRegressor:
        """Rebuilds the members."""
        members = [restore_regressor(entry, _below(arrays, f"{i}/")) for i, entry in enumerate(settings["members"])]
        columns = [(int(a), int(b)) for a, b in settings["columns"]]
        if not members or not len(members) == len(columns) == len(settings["on_identity"]):
            raise MappingError("a mean needs as many columns as members")
        return cls(members, columns, settings["on_identity"])


class TwoWay(Regressor):
    """Two regressors, one for each direction, so that a model without an inverse of its own still maps back.

    Args:
        there: from source to target.
        back: from target to source.
    """

    kind = "two_way"

    def __init__(self, there: Regressor, back: Regressor) -> None:
        self.there = there
        self.back = back

    def __call__(self, codes: FloatArray) -> FloatArray:
        """The forward regressor."""
        return self.there(codes)

    def affine(self) -> Affine | None:
        """That of the forward regressor."""
        return self.there.affine()

    def inverse(self) -> TwoWay:
        """The two exchanged."""
        return TwoWay(self.back, self.there)

    def arrays(self) -> Arrays:
        """Numbers of both."""
        parts = (("there", self.there), ("back", self.back))
        return {f"{name}/{key}": value for name, part in parts for key, value in part.arrays().items()}

    def settings(self) -> dict[str, Any]:
        """Kinds and settings of both."""
        return {
            name: {"kind": part.kind, "settings": part.settings()}
            for name, part in (("there", self.there), ("back", self.back))
        }

    @classmethod
    def restore(cls, settings: dict[str, Any], arrays: Arrays) -> TwoWay:
        """Rebuilds both."""
        there = restore_regressor(settings["there"], _below(arrays, "there/"))
        return cls(there, restore_regressor(settings["back"], _below(arrays, "back/")))


def _below(arrays: Arrays, prefix: str) -> Arrays:
    return {name[len(prefix) :]: value for name, value in arrays.items() if name.startswith(prefix)}
