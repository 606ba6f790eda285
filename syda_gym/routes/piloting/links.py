"""Where the mappings of a route come from: stored files, recordings that are fitted, or what this user has of both."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import MappingError, StorageError, SydaError
from syda_gym.files import asset, read_json, user_folder
from syda_gym.mappings.fitting.fit import METHODS, fit
from syda_gym.mappings.mapping import Mapping
from syda_gym.mappings.storage import load_mapping
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import resampled
from syda_gym.motions.recordings import recorded

__all__ = ["FIT_FPS", "Links", "OwnLinks", "RecordedLinks", "StoredLinks", "own_mappings_folder"]

FIT_FPS = 10.0
"""Mappings are fitted on frames at most this dense; neighbours at 30 Hz are near-duplicates."""

Edge = tuple[str, str]

_MAX_FITS = 64
_fits: OrderedDict[tuple[object, ...], Mapping] = OrderedDict()


def own_mappings_folder() -> Path:
    """Where ``syda-gym fit`` keeps mappings: ``$SYDA_GYM_HOME/mappings`` or ``~/.syda_gym/mappings``."""
    return user_folder("mappings")


class Links(ABC):
    """Mappings between pairs of bodies, made when they are asked for."""

    @property
    @abstractmethod
    def edges(self) -> tuple[Edge, ...]:
        """Pairs with a mapping, in the directions that work."""

    @abstractmethod
    def body(self, name: str) -> Embodiment:
        """A body by name, as these links know it."""

    @abstractmethod
    def link(self, a: str, b: str) -> Mapping:
        """The mapping from ``a`` to ``b``, one of ``edges``."""


class RecordedLinks(Links):
    """Fits a pair's recordings when it is first asked for; kept within the process.

    A mapping that comes with the package is taken where it was fitted to the same frames by the same method.

    Args:
        motions: the recordings.
        method: of ``mappings.METHODS``.
        preset: of the method.
        held_out: actions that no fit may see.
        seed: of fits.
        among: bodies that matter; all if ``None``.
    """

    def __init__(
        self,
        motions: Motions,
        method: str,
        preset: str | None = None,
        held_out: Sequence[str] = (),
        seed: int = 0,
        among: Sequence[str] | None = None,
    ) -> None:
        self.motions = motions
        self.method, self.preset = method, preset or METHODS[method].default
        self.held_out, self.seed = tuple(sorted(held_out)), seed
        self._among = set(motions.bodies if among is None else among)

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Pairs that were recorded together, both ways."""
        found = [pair for pair in self.motions.pairs if set(pair) <= self._among]
        return tuple([*found, *((b, a) for a, b in found)])

    def body(self, name: str) -> Embodiment:
        """From the motions, else from the catalog."""
        return self.motions.bodies[name] if name in self.motions.bodies else catalog.get(name)

    def link(self, a: str, b: str) -> Mapping:
        """Fitted, or shipped where that is the same."""
        pair = self.motions.pair(a, b)
        key = (pair.fingerprint, a, b, self.method, self.preset, self.held_out, self.seed)
        if key not in _fits:
            sparse = resampled(self.motions, FIT_FPS).pair(a, b) if pair.fps > FIT_FPS else pair
            data = sparse.without_actions(self.held_out) if self.held_out else sparse
            marks = {data.fingerprint} if self.held_out else {data.fingerprint, pair.fingerprint}
            shipped = _shipped(a, b, self.method, self.preset, marks) if self.seed == 0 else None
            _fits[key] = shipped or fit(data, method=self.method, preset=self.preset, seed=self.seed)
        _fits.move_to_end(key)
        while len(_fits) > _MAX_FITS:
            _fits.popitem(last=False)
        return _fits[key]


class StoredLinks(Links):
    """Every stored mapping of a folder, and the inverses of those that have one where nothing else serves.

    Args:
        folder: with ``*.safetensors`` and their cards.

    Raises:
        StorageError: no mapping, an unreadable one, or two between the same bodies.
    """

    def __init__(self, folder: Path) -> None:
        paths = sorted(folder.glob("*.safetensors"))
        if not paths:
            raise StorageError(f"{folder} holds no mapping (*.safetensors with *.json); fit and save some first")
        found: dict[Edge, Mapping] = {}
        for path in paths:
            mapping = load_mapping(path)
            ends = (mapping.source.name, mapping.target.name)
            if ends in found:
                raise StorageError(f"{folder} holds two mappings from {ends[0]!r} to {ends[1]!r}; keep one")
            found[ends] = mapping
        self._found = _with_inverses(found)

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Pairs with a file, or with one for the other direction that inverts."""
        return tuple(self._found)

    def body(self, name: str) -> Embodiment:
        """From a mapping's card, else from the catalog."""
        return _body_of(self._found, name) or catalog.get(name)

    def link(self, a: str, b: str) -> Mapping:
        """As stored."""
        return self._found[a, b]


class OwnLinks(Links):
    """What this user recorded: mappings that ``syda-gym fit`` stored, and data sets of ``syda-gym record``.

    A stored mapping comes first. Whatever cannot be read is left out with a notice, because a live start must not fail
    over an old file.

    Args:
        method: by which recordings are fitted; ``None`` for stored mappings and else the default.
        preset: of the method.
        seed: of fits.

    Attributes:
        notices: what was left out.
    """

    def __init__(self, method: str | None = None, preset: str | None = None, seed: int = 0) -> None:
        found = recorded()
        notices = list(found.notices)
        self._fits = None if found.motions is None else RecordedLinks(found.motions, method or "syda", preset, (), seed)
        stored: dict[Edge, Mapping] = {}
        for path in sorted(own_mappings_folder().glob("*.safetensors")) if method is None else ():
            try:
                mapping = load_mapping(path)
            except SydaError as error:
                notices.append(f"{path} left out: {error}")
                continue
            stored[mapping.source.name, mapping.target.name] = mapping
        self._stored = _with_inverses(stored)
        self.notices = tuple(notices)

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Pairs that were stored or recorded."""
        fitted = () if self._fits is None else self._fits.edges
        return tuple(dict.fromkeys((*self._stored, *fitted)))

    def body(self, name: str) -> Embodiment:
        """From stored mappings, from recordings, else from the catalog."""
        stored = _body_of(self._stored, name)
        if stored is not None:
            return stored
        return catalog.get(name) if self._fits is None else self._fits.body(name)

    def link(self, a: str, b: str) -> Mapping:
        """Stored, else fitted."""
        if (a, b) in self._stored:
            return self._stored[a, b]
        assert self._fits is not None
        return self._fits.link(a, b)


def _with_inverses(found: dict[Edge, Mapping]) -> dict[Edge, Mapping]:
    inverses: dict[Edge, Mapping] = {}
    for (a, b), mapping in found.items():
        try:
            inverses[b, a] = mapping.inverse()
        except MappingError:
            continue
    return {**inverses, **found}


def _body_of(found: dict[Edge, Mapping], name: str) -> Embodiment | None:
    for (a, b), mapping in found.items():
        if name in (a, b):
            return mapping.source if name == a else mapping.target
    return None


def _shipped(a: str, b: str, method: str, preset: str, data: set[str]) -> Mapping | None:
    """A mapping of the package that was fitted to the same frames by the same method."""
    for path in sorted(asset("mappings").glob("*.json")):
        links = read_json(path).get("links", [])
        if len(links) != 1:
            continue
        card = links[0]["card"]
        if (card["method"], card["preset"]) != (method, preset):
            continue
        ends = (card["source"]["name"], card["target"]["name"])
        if ends == (a, b) and card["data"] in data:
            return load_mapping(path)
    return None
