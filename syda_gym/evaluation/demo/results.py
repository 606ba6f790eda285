"""What the demo found, as plain data: chains that were played, and all that the report tells."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from syda_gym.embodiments.robot import Robot
from syda_gym.evaluation.chains import Route, name_of
from syda_gym.evaluation.demo.cast import Cast
from syda_gym.evaluation.episodes import EpisodeFigures, Recording
from syda_gym.evaluation.statistics import Estimate, clustered_estimate
from syda_gym.motions.clip import Motions

if TYPE_CHECKING:
    from syda_gym.evaluation.demo.residual_result import ResidualResult
    from syda_gym.mappings.mapping import Mapping
    from syda_gym.routes.route import Route as BestRoute

__all__ = ["ChainResult", "DemoResult"]


@dataclass(frozen=True, eq=False)
class ChainResult:
    """One chain, played.

    Attributes:
        route: its bodies.
        transferability: T of the chain as a whole, in the dry run.
        episodes: one a held-out clip.
        shown: a few recordings for the playback, with the mapping that drove each.
        seconds_per_frame: of the mapping, frame by frame.
        label: what a baseline is called; empty for a chain.
    """

    route: Route
    transferability: float
    episodes: tuple[EpisodeFigures, ...]
    shown: tuple[tuple[Recording, Mapping], ...]
    seconds_per_frame: float
    label: str = ""

    @property
    def name(self) -> str:
        """``adult>kid>pepper``, or what the baseline is called."""
        return self.label or name_of(self.route)

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
        cast: who played which role.
        held_out: groups of actions that the fits of their episodes had not seen.
        expected: every chain as the dry run saw it, before any fit.
        chosen: the one that it chose, with what ties with it.
        chains: every chain, played.
        baselines: the chosen chain's rivals, played.
        direct: the pair of the two ends, as if it had been recorded; ``None`` if it is the only way to go.
        models: number of mappings fitted.
        residual: the short residual run; ``None`` if it was left out.
        seconds: wall time of each stage.
        seed: of everything.
        report: path of the page.
    """

    motions: Motions
    robot: Robot
    cast: Cast
    held_out: tuple[tuple[str, ...], ...]
    expected: tuple[BestRoute, ...]
    chosen: BestRoute
    chains: tuple[ChainResult, ...]
    baselines: tuple[ChainResult, ...]
    direct: ChainResult | None
    models: int
    residual: ResidualResult | None
    seconds: dict[str, float]
    seed: int
    report: Path = field(default_factory=Path)
