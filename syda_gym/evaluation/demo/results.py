"""What the demo found, as plain data: chains that were played, and all that the report tells."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from syda_gym.embodiments.robot import Robot
from syda_gym.evaluation.chains import Route, name_of
from syda_gym.evaluation.episodes import EpisodeFigures, Recording
from syda_gym.evaluation.statistics import Estimate, clustered_estimate
from syda_gym.motions.clip import Motions

if TYPE_CHECKING:
    from syda_gym.evaluation.demo.residual_result import ResidualResult
    from syda_gym.mappings.mapping import Mapping
    from syda_gym.routes.metric import Transferability
    from syda_gym.routes.route import Route as BestRoute

__all__ = ["ChainResult", "DemoResult"]


@dataclass(frozen=True, eq=False)
class ChainResult:
    """One chain, played.

    Attributes:
        route: its bodies.
        transferability: product along the route (Eq. 11).
        episodes: one a held-out clip.
        shown: a few recordings for the playback, with the mapping that drove each.
        seconds_per_frame: of the mapping, frame by frame.
    """

    route: Route
    transferability: float
    episodes: tuple[EpisodeFigures, ...]
    shown: tuple[tuple[Recording, Mapping], ...]
    seconds_per_frame: float

    @property
    def name(self) -> str:
        """``adult>kid>pepper``."""
        return name_of(self.route)

    def figure(self, name: str) -> Estimate:
        """Interquartile mean over episodes; the interval is over actions, for the next user will do other ones."""
        values = [float(getattr(episode, name)) for episode in self.episodes]
        return clustered_estimate(values, [episode.action for episode in self.episodes])

    def part(self, name: str, index: int) -> Estimate:
        """The same for one landmark or joint of ``landmarks`` or ``joints``."""
        values = [float(getattr(episode, name)[index]) for episode in self.episodes]
        return clustered_estimate(values, [episode.action for episode in self.episodes])


@dataclass(frozen=True, eq=False)
class DemoResult:
    """Everything the demo found.

    Attributes:
        motions: what it ran on.
        robot: who was driven.
        held_out: groups of actions that the fits of their episodes had not seen.
        links: transferability of every link, ``general`` definition.
        paper_links: the same by the paper's definition, where it knows both bodies.
        chosen: the best route by transferability for each operator.
        chains: every chain, played.
        models: number of mappings fitted.
        residual: the short residual run; ``None`` if it was left out.
        seconds: wall time of each stage.
        seed: of everything.
        report: path of the page.
    """

    motions: Motions
    robot: Robot
    held_out: tuple[tuple[str, ...], ...]
    links: dict[tuple[str, str], Transferability]
    paper_links: dict[tuple[str, str], Transferability]
    chosen: dict[str, BestRoute]
    chains: tuple[ChainResult, ...]
    models: int
    residual: ResidualResult | None
    seconds: dict[str, float]
    seed: int
    report: Path = field(default_factory=Path)
