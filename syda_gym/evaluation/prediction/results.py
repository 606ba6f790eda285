"""What the study of predictors found, as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from syda_gym.evaluation.statistics import Estimate
from syda_gym.routes.metric import Transferability

__all__ = ["PredictionStudy", "PredictorScore", "RouteResult"]

Names = tuple[str, ...]


@dataclass(frozen=True)
class PredictorScore:
    """How well a predictor ranks routes; 1 is perfect, 0 is chance.

    Attributes:
        name: the predictor.
        all: Spearman's correlation with minus the error over the target's arm length, over all routes.
        metres: the same with the error in metres.
        pairs: over single links alone.
        choice: over routes between the same two ends, mean over ends; this is what choosing a route needs.
        regret: how much larger the error of the route it prefers is than that of the best one, mean over ends, direct
            pairs left out because the question is which chain to take (0.1 = 10 %).
    """

    name: str
    all: Estimate
    metres: Estimate
    pairs: Estimate
    choice: Estimate
    regret: Estimate

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        fields = ("all", "metres", "pairs", "choice", "regret")
        return {"name": self.name, **{field: getattr(self, field).to_dict() for field in fields}}


@dataclass(frozen=True)
class RouteResult:
    """A chain of bodies and how well it carried held-out actions.

    Attributes:
        bodies: names from source to target.
        error: mean landmark error over the target's arm length.
        metres: mean landmark error [m].
        predicted: predictor to score, higher is better.
    """

    bodies: Names
    error: float
    metres: float
    predicted: dict[str, float]

    @property
    def hops(self) -> int:
        """Number of links."""
        return len(self.bodies) - 1


@dataclass(frozen=True)
class PredictionStudy:
    """What ``validate`` found.

    Attributes:
        motions: name of the recordings.
        synthetic: whether they were generated.
        bodies: who took part.
        method: of the fitted mappings.
        folds: groups of actions held out in turn.
        seed: of folds and fits.
        noise: body to high-frequency noise over arm length.
        links: ordered pair to its transferability, general definition.
        routes: every chain with its error and predictors.
        scores: every predictor with its rank correlations, best first.
        full_scores: the same over routes on which every body has both arms; a lost arm is easy to foresee and lifts
            every predictor that counts it. Empty if everybody has both.
    """

    motions: str
    synthetic: bool
    bodies: Names
    method: str
    folds: int
    seed: int
    noise: dict[str, float]
    links: dict[tuple[str, str], Transferability]
    routes: tuple[RouteResult, ...]
    scores: tuple[PredictorScore, ...]
    full_scores: tuple[PredictorScore, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Everything, JSON-able."""
        return {
            "motions": self.motions,
            "synthetic": self.synthetic,
            "bodies": list(self.bodies),
            "method": self.method,
            "folds": self.folds,
            "seed": self.seed,
            "noise": self.noise,
            "scores": [score.as_dict() for score in self.scores],
            "full_scores": [score.as_dict() for score in self.full_scores],
            "routes": [
                {"bodies": list(r.bodies), "error": r.error, "metres": r.metres, "predicted": r.predicted}
                for r in self.routes
            ],
        }
