"""MappingCard: the passport of a mapping, stored beside its weights as JSON."""

from __future__ import annotations

import importlib.metadata
import platform
from dataclasses import asdict, dataclass, field
from typing import Any

from syda_gym.errors import StorageError
from syda_gym.motions.clip import PairedMotions

__all__ = ["CARD_FORMAT", "MappingCard", "card_of", "versions"]

CARD_FORMAT = 1
"""Version of the layout of cards; a file of another version is refused."""


@dataclass(frozen=True)
class MappingCard:
    """Where a mapping comes from.

    Attributes:
        method: name in ``fitting.METHODS``.
        preset: preset of the method.
        seed: seed of the fit.
        source: ``Embodiment.spec()`` of the source body.
        target: ``Embodiment.spec()`` of the target body.
        source_features: names and units of the source's columns.
        target_features: names and units of the target's columns.
        data: fingerprint of the paired frames.
        rows: number of paired frames.
        actions: distinct actions among them.
        inverted: whether this is the inverse of the fitted direction.
        options: options given to ``fit``.
        versions: of Python and of the packages that matter for the numbers.
        note: what a person should know of it in a few words: that it has no error bound, and why; often empty.
        format: layout of the card.
    """

    method: str
    preset: str
    seed: int
    source: dict[str, Any]
    target: dict[str, Any]
    source_features: list[str]
    target_features: list[str]
    data: str = ""
    rows: int = 0
    actions: list[str] = field(default_factory=list)
    inverted: bool = False
    options: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    note: str = ""
    format: int = CARD_FORMAT

    @property
    def unfitted(self) -> bool:
        """Whether no recording went into the mapping."""
        return self.rows == 0

    def to_json(self) -> dict[str, Any]:
        """The card as JSON-able values."""
        return asdict(self)

    @classmethod
    def from_json(cls, value: Any, where: str) -> MappingCard:
        """Rebuilds a card.

        Args:
            value: what ``to_json`` gave.
            where: the file, for messages.

        Raises:
            StorageError: not a card, or a card of another format.
        """
        if not isinstance(value, dict) or value.get("format") != CARD_FORMAT:
            raise StorageError(
                f"{where}: expected a mapping card of format {CARD_FORMAT}, got "
                f"{value.get('format') if isinstance(value, dict) else type(value).__name__}; fit and save again"
            )
        try:
            return cls(**value)
        except TypeError as error:
            raise StorageError(f"{where}: not a mapping card: {error}; fit and save again") from error

    def reversed(self) -> MappingCard:
        """The card of the inverse direction."""
        values = self.to_json()
        values["source"], values["target"] = self.target, self.source
        values["source_features"], values["target_features"] = self.target_features, self.source_features
        values["inverted"] = not self.inverted
        return MappingCard(**values)


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that matter for the numbers."""
    found = {"python": platform.python_version()}
    for package in ("syda-gym", "numpy", "scipy", "torch"):
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def card_of(pair: PairedMotions, method: str, preset: str, seed: int, options: dict[str, Any]) -> MappingCard:
    """The card of a mapping that is fitted to ``pair``."""
    source, target = pair.source_body, pair.target_body
    return MappingCard(
        method=method,
        preset=preset,
        seed=int(seed),
        source=source.spec(),
        target=target.spec(),
        source_features=[f"{f.name} [{f.unit}]" for f in source.features],
        target_features=[f"{f.name} [{f.unit}]" for f in target.features],
        data=pair.fingerprint,
        rows=len(pair),
        actions=list(pair.action_names),
        options=dict(options),
        versions=versions(),
    )
