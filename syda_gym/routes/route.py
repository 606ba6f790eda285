"""Route: a chain of bodies and what is expected of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from syda_gym.routes.metric import Transferability

__all__ = ["Route"]


@dataclass(frozen=True)
class Route:
    """A chain of bodies with its transferability.

    Attributes:
        bodies: names from source to target.
        T: transferability of the whole route: in the dry run that of the composed links, else the product of the links'
            (Eq. 11) times ``carried``.
        links: the transferability of each link.
        score: what it is ranked by, higher is better: minus the expected error over the arm's length in the dry run,
            else the product of the predictor along the route.
        tolerance: half-width of the band of ``score`` in which another route counts as equal.
        ties: other routes that cannot be told apart from it, best first (filled by ``best_route``).
        carried: share of the arms of both ends that every body on the way has; 0.5 if a one-armed body stands between
            two-armed ones.
        error: expected landmark error on unseen actions [m]; ``None`` outside the dry run.
        standard_error: of ``error``, over actions [m].
        note: why it cannot be judged; empty if it can.
    """

    bodies: tuple[str, ...]
    T: float
    links: tuple[Transferability, ...]
    score: float
    tolerance: float
    ties: tuple[Route, ...] = ()
    carried: float = 1.0
    error: float | None = None
    standard_error: float | None = None
    note: str = ""

    @property
    def hops(self) -> int:
        """Number of links."""
        return len(self.bodies) - 1

    def as_dict(self) -> dict[str, Any]:
        """Everything, JSON-able."""
        return {
            "bodies": list(self.bodies),
            "T": self.T,
            "score": self.score,
            "tolerance": self.tolerance,
            "error": self.error,
            "standard_error": self.standard_error,
            "hops": self.hops,
            "carried": self.carried,
            "note": self.note,
            "links": [link.as_dict() for link in self.links],
            "ties": [list(route.bodies) for route in self.ties],
        }

    def __str__(self) -> str:
        expected = "" if self.error is None else f"expected error {1000 * self.error:.0f} mm, "
        return f"{' -> '.join(self.bodies)} ({expected}T = {self.T:.4f})"
