"""What is known of episodes, as JSON: a figure that is no number is left out, and it is said why."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["without_unknown"]

_REASONS = {
    "bound": "the mapping promises no error bound",
    "coverage": "the mapping promises no error bound that could hold or not",
}


def without_unknown(episodes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Episodes without the figures that are no numbers, because NaN is not JSON.

    Args:
        episodes: figures by name.

    Returns:
        ``episodes``, and if figures were left out ``left_out``: their names and why.
    """
    kept = [{name: value for name, value in episode.items() if _known(value)} for episode in episodes]
    missing = sorted({name for episode in episodes for name, value in episode.items() if not _known(value)})
    said = {name: _REASONS.get(name, "could not be computed") for name in missing}
    return {"episodes": kept, **({"left_out": said} if said else {})}


def _known(value: Any) -> bool:
    return not isinstance(value, float) or math.isfinite(value)
