"""WHICH WAY to go: transferability of any body to any other, and the routes that deserve trust.

The package itself is the function: ``syda_gym.transferability("adult", "pepper")`` measures one pair, and
``syda_gym.transferability.best_route(...)`` chooses among chains.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from syda_gym.transferability.metric import Transferability as Transferability
    from syda_gym.transferability.metric import transferability as transferability
    from syda_gym.transferability.routing import Route as Route
    from syda_gym.transferability.routing import best_route as best_route
    from syda_gym.transferability.routing import ranked_routes as ranked_routes
    from syda_gym.transferability.suggestion import spanning_pairs as spanning_pairs
    from syda_gym.transferability.suggestion import suggest as suggest

_LAZY = {
    "Transferability": "metric",
    "transferability": "metric",
    "Route": "routing",
    "best_route": "routing",
    "ranked_routes": "routing",
    "spanning_pairs": "suggestion",
    "suggest": "suggestion",
}

__all__ = [
    "Route",
    "Transferability",
    "best_route",
    "ranked_routes",
    "spanning_pairs",
    "suggest",
    "transferability",
]


class _CallableModule(ModuleType):
    """A package that is also its main function, so that both spellings of the documentation work."""

    def __call__(self, *args: Any, **options: Any) -> Transferability:
        """Calls ``metric.transferability``."""
        from syda_gym.transferability.metric import transferability as measure

        return measure(*args, **options)

    def __getattr__(self, name: str) -> Any:
        if name not in _LAZY:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        from importlib import import_module

        return getattr(import_module(f"{self.__name__}.{_LAZY[name]}"), name)


sys.modules[__name__].__class__ = _CallableModule
