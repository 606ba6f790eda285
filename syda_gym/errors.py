"""The exceptions of the library: each says what was expected, what came and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = [
    "AgentError",
    "EmbodimentError",
    "MappingError",
    "MissingExtraError",
    "MotionError",
    "OptionError",
    "RouteError",
    "StorageError",
    "SydaError",
    "TeleoperationError",
    "UnknownOptionError",
    "nearest_name",
]


class SydaError(Exception):
    """Root of every exception that this library raises on purpose."""


class EmbodimentError(SydaError, ValueError):
    """A body is unknown or unusable: no such name, not a URDF, no arm, missing limits."""


class MotionError(SydaError, ValueError):
    """A recording is missing or malformed; the message names the file and the frame, sheet or line."""


class MappingError(SydaError, ValueError):
    """A mapping cannot be fitted, inverted, chained or applied."""


class RouteError(SydaError, ValueError):
    """A route names unknown bodies, has a missing link, or does not exist."""


class OptionError(SydaError, ValueError):
    """An option has a value outside what is allowed; the message lists what is allowed."""


class UnknownOptionError(OptionError, TypeError):
    """No option has that name; a ``TypeError`` in Python's own wording as well, which other libraries look for."""


class StorageError(SydaError, OSError):
    """A stored file is missing, corrupt, of another version, or does not match its card."""


class AgentError(SydaError, ValueError):
    """An agent cannot act here: other robot, other observation layout, corrupt bundle."""


class TeleoperationError(SydaError, RuntimeError):
    """A live source, sink or packet is unusable."""


class MissingExtraError(SydaError, ImportError):
    """A feature needs an optional dependency; the message names the extra to install."""

    def __init__(self, feature: str, extra: str) -> None:
        super().__init__(f"{feature} needs an optional dependency: pip install 'syda-gym[{extra}]'")
        self.feature = feature
        self.extra = extra


_MOST_NAMES = 40  # in one message; data sets have hundreds of clips


def nearest_name(name: str, known: Iterable[str]) -> str:
    """Says which known name is nearest, for error messages.

    Args:
        name: what the user wrote; its case does not matter.
        known: the names that would have worked.

    Returns:
        A sentence such as ``did you mean 'pepper'? Known: adult, kid, pepper``; of very many names the nearest ones are
        listed.
    """
    names = sorted(known)
    alike = {other.casefold(): other for other in reversed(names)}
    best = difflib.get_close_matches(name.casefold(), alike, n=1)
    hint = f"did you mean {alike[best[0]]!r}? " if best else ""
    if len(names) <= _MOST_NAMES:
        return f"{hint}Known: {', '.join(names) or 'none'}"
    near = difflib.get_close_matches(name.casefold(), alike, n=_MOST_NAMES // 2, cutoff=0.0)
    return f"{hint}Known: {', '.join(sorted(alike[other] for other in near))} and {len(names) - len(near)} more"
