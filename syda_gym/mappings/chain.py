"""ChainMapping: mappings in series (Section 3.2 of the paper)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MappingError, RouteError
from syda_gym.mappings.card import MappingCard
from syda_gym.mappings.mapping import Mapping

__all__ = ["ChainMapping"]


class ChainMapping(Mapping):
    """Applies its links in turn; a link that is itself a chain is unfolded.

    The error bound adds the links' bounds, each scaled by how much the later links enlarge small displacements.

    Args:
        links: mappings, each starting at the body where the one before ends.

    Attributes:
        links: the unfolded links.

    Raises:
        RouteError: two links do not meet; the message names the missing link.
        MappingError: no link.
    """

    def __init__(self, links: Sequence[Mapping]) -> None:
        self.links: tuple[Mapping, ...]
        flat: list[Mapping] = []
        for link in links:
            flat.extend(link.links if isinstance(link, ChainMapping) else (link,))
        if not flat:
            raise MappingError("a chain needs at least one mapping")
        for before, after in zip(flat[:-1], flat[1:], strict=True):
            if before.target != after.source:
                detail = (
                    f"a mapping from {before.target.name!r} to {after.source.name!r} is missing"
                    if before.target.name != after.source.name
                    else f"the two {after.source.name!r} differ in size or features"
                )
                raise RouteError(f"cannot chain {' > '.join(before.route)} with {' > '.join(after.route)}: {detail}")
        self.links = tuple(flat)
        self.source = flat[0].source
        self.target = flat[-1].target

    @property
    def card(self) -> MappingCard:
        """A card that sums up the links."""
        first, last = self.links[0].card, self.links[-1].card
        return MappingCard(
            method=_joined(link.method for link in self.links),
            preset=_joined(link.preset for link in self.links),
            seed=first.seed,
            source=first.source,
            target=last.target,
            source_features=first.source_features,
            target_features=last.target_features,
            data="+".join(link.card.data for link in self.links),
            rows=sum(link.card.rows for link in self.links),
            actions=sorted({action for link in self.links for action in link.card.actions}),
            options={"chain": [link.card.to_json() for link in self.links]},
            versions=last.versions,
        )

    @property
    def route(self) -> tuple[str, ...]:
        """Names of the bodies that motion passes."""
        return (self.source.name, *(link.target.name for link in self.links))

    @property
    def window(self) -> int:
        """How many past frames each output looks at: the links' windows add up."""
        return sum(link.window for link in self.links)

    def raw(self, frames: FloatArray) -> FloatArray:
        """Applies the links in turn; only the last one is left without joint limits."""
        for link in self.links[:-1]:
            frames = link(frames)
        return self.links[-1].raw(frames)

    def begin(self) -> tuple[Any, ...]:
        """What each link remembers."""
        return tuple(link.begin() for link in self.links)

    def follow(
        self, frames: ArrayLike, memory: Any, dt: float | None = None, *, limited: bool = True, skip: int = 0
    ) -> tuple[FloatArray, Any]:
        """Each link follows the one before it; see ``Mapping.follow``.

        Raises:
            MappingError: ``skip`` for links that remember; a ``stream.FrameStream`` looks back link by link.
        """
        if skip:
            raise MappingError("a chain cannot skip frames; use syda_gym.mappings.stream.FrameStream")
        current: FloatArray = np.atleast_2d(np.asarray(frames, dtype=np.float64))
        memories = []
        for link, remembered in zip(self.links, memory, strict=True):
            current, after = link.follow(current, remembered, dt, limited=limited)
            memories.append(after)
        return current, tuple(memories)

    def inverse(self) -> ChainMapping:
        """The inverses of the links, in reverse order.

        Raises:
            MappingError: a link has no inverse; the message names it.
        """
        return ChainMapping([link.inverse() for link in reversed(self.links)])

    def error_bound(self, frames: ArrayLike) -> FloatArray:
        """Sum of the links' bounds [m], each carried through the later links by their gain, ``(N,)``."""
        current = self.source.check(frames)
        total = np.zeros(len(current))
        for link in self.links:
            total = total * _gain(link) + link.error_bound(current)
            current = link(current)
        return total

    def difficulty(self, frames: ArrayLike) -> FloatArray:
        """The largest difficulty on the way, ``(N,)``."""
        values: FloatArray = np.max([link.difficulty(x) for link, x in self._inputs(frames)], axis=0)
        return values

    def unfamiliar(self, frames: ArrayLike) -> NDArray[np.bool_]:
        """Which frames are out of distribution for any link, ``(N,)``."""
        values: NDArray[np.bool_] = np.any([link.unfamiliar(x) for link, x in self._inputs(frames)], axis=0)
        return values

    def _inputs(self, frames: ArrayLike) -> list[tuple[Mapping, FloatArray]]:
        current, result = self.source.check(frames), []
        for link in self.links:
            result.append((link, current))
            current = link(current)
        return result


def _gain(link: Mapping) -> float:
    confidence = getattr(link, "confidence", None)
    return float(confidence.gain) if confidence is not None else 1.0


def _joined(names: Iterable[str]) -> str:
    return "+".join(dict.fromkeys(names))


Mapping.in_series = ChainMapping
