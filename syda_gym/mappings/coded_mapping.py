"""CodedMapping: encode a frame, regress its code, decode the result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MappingError
from syda_gym.mappings.card import MappingCard
from syda_gym.mappings.coding.coders import Coder
from syda_gym.mappings.coding.window_coder import WindowCoder
from syda_gym.mappings.mapping import Mapping
from syda_gym.mappings.models.regressors import Regressor
from syda_gym.mappings.single_frame import SingleFrame

if TYPE_CHECKING:
    from syda_gym.mappings.confidence import Confidence

__all__ = ["CodedMapping"]


class CodedMapping(Mapping):
    """The one shape of all fitted mappings: source coder, regressor, target coder.

    Args:
        card: where it comes from.
        source_coder: code of the source's frames.
        target_coder: code of the target's frames.
        regressor: maps codes.
        confidence: error bound and difficulty of this direction, if fitted.
        confidence_back: the same for the inverse direction.
    """

    def __init__(
        self,
        card: MappingCard,
        source_coder: Coder,
        target_coder: Coder,
        regressor: Regressor,
        confidence: Confidence | None = None,
        confidence_back: Confidence | None = None,
    ) -> None:
        self.source = source_coder.body
        self.target = target_coder.body
        self.source_coder = source_coder
        self.target_coder = target_coder
        self.regressor = regressor
        self.confidence = confidence
        self.confidence_back = confidence_back
        self._card = card
        self._single = SingleFrame.of(source_coder, regressor, target_coder)

    @property
    def card(self) -> MappingCard:
        """Where the mapping comes from."""
        return self._card

    @property
    def window(self) -> int:
        """How many past frames each output looks at."""
        return self.source_coder.window if isinstance(self.source_coder, WindowCoder) else 0

    def raw(self, frames: FloatArray) -> FloatArray:
        """Encodes, regresses, decodes; joint limits are not enforced."""
        return self.target_coder.decode(self.regressor(self.source_coder.encode(frames)))

    def begin(self) -> Any:
        """What the target's coder remembers."""
        return self.target_coder.begin()

    def follow(
        self, frames: ArrayLike, memory: Any, dt: float | None = None, *, limited: bool = True, skip: int = 0
    ) -> tuple[FloatArray, Any]:
        """Encodes and regresses each frame, and decodes them in time order; see ``Mapping.follow``."""
        array = np.atleast_2d(np.asarray(frames, dtype=np.float64))
        if len(array) == 1 and self._single is not None:
            found = self._single.follow(array[0], memory, dt, limited)
            if found is not None:
                return found[0][None], found[1]
        codes = self.regressor(self.source_coder.encode(self.source.check(array)))[skip:]
        if not np.isfinite(codes).all():
            raise MappingError(f"{self!r} gave values that are not finite; fit it again on more varied frames")
        mapped, memory = self.target_coder.follow(codes, memory, dt, limited)
        return self._within_limits(mapped), memory

    def inverse(self) -> CodedMapping:
        """The mapping back, by the same model.

        Raises:
            MappingError: the model has no inverse.
        """
        return CodedMapping(
            self._card.reversed(),
            self.target_coder,
            self.source_coder,
            self.regressor.inverse(),
            self.confidence_back,
            self.confidence,
        )

    def error_bound(self, frames: ArrayLike) -> FloatArray:
        """A constant bound on the mean landmark error [m] of each frame, ``(N,)``.

        Raises:
            MappingError: the mapping was fitted without a bound.
        """
        frames = self.source.check(frames)
        bound = None if self._card.unfitted else self._confidence().bound
        if bound is None:
            raise MappingError(
                f"{self!r} has no error bound: it takes at least two actions to hold one out; "
                "fit on recordings of more actions"
            )
        return np.full(len(frames), bound)

    def difficulty(self, frames: ArrayLike) -> FloatArray:
        """Distance from the frames of the fit, 0 to 1, ``(N,)``; 0 where nothing was fitted."""
        if self._card.unfitted:
            return np.zeros(len(self.source.check(frames)))
        return self._confidence().difficulty(self.source_coder.encode(self.source.check(frames)))

    def unfamiliar(self, frames: ArrayLike) -> NDArray[np.bool_]:
        """Which frames are out of the distribution of the fit, ``(N,)``; none where nothing was fitted."""
        if self._card.unfitted:
            return np.zeros(len(self.source.check(frames)), dtype=bool)
        return self._confidence().unfamiliar(self.source_coder.encode(self.source.check(frames)))

    def __repr__(self) -> str:
        note = f", {self._card.note}" if self._card.note else ""
        return f"{super().__repr__()[:-1]}{note})"

    def _one(self, frame: FloatArray) -> FloatArray:
        mapped = self._single(frame) if self._single is not None else None
        # Whatever is unusual takes the long way, which says what is wrong.
        return super()._one(frame) if mapped is None else mapped

    def _confidence(self) -> Confidence:
        if self.confidence is None:
            raise MappingError(f"{self!r} was fitted without a confidence; fit with confidence=True")
        return self.confidence
