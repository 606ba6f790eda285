"""WHICH WAY to go: how well one body can stand in for another, and the chain of mappings to take; plays nothing.

Stands above ``mappings``, because routes are rehearsed with them. ``syda_gym.transferability``, ``best_route`` and
``ranked_routes`` are the functions of this room that most users need.
"""

from syda_gym.routes.metric import Transferability, transferability
from syda_gym.routes.route import Route
from syda_gym.routes.routing import best_route, ranked_routes
from syda_gym.routes.suggestion import spanning_pairs, suggest

__all__ = [
    "Route",
    "Transferability",
    "best_route",
    "ranked_routes",
    "spanning_pairs",
    "suggest",
    "transferability",
]
