"""What the demo's residual run gave: agents on the held-out actions, and how that is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.evaluation.chains import Route, name_of
from syda_gym.evaluation.demo.known import without_unknown
from syda_gym.evaluation.episodes import EpisodeFigures, Recording
from syda_gym.evaluation.report import BarPlot, Column, CurvePlot, Headline, PlaybackChain, Table, Text
from syda_gym.evaluation.report.model import Block, Cell
from syda_gym.evaluation.statistics import Estimate, clustered_estimate

if TYPE_CHECKING:
    from syda_gym.agents.residual.residual_training import Trained
    from syda_gym.mappings.mapping import Mapping

__all__ = ["AgentResult", "ResidualResult"]


@dataclass(frozen=True, eq=False)
class AgentResult:
    """One agent on the held-out actions.

    Attributes:
        name: of the agent.
        episodes: figures against the recorded motion.
        tracking: mean landmark distance of each episode from what the mapping asked for [m].
        costs: the objective ``J`` of each episode against what the mapping asked for: what the policy is trained for.
        recordings: of each episode.
    """

    name: str
    episodes: tuple[EpisodeFigures, ...]
    tracking: tuple[float, ...]
    costs: tuple[float, ...]
    recordings: tuple[Recording, ...]

    def estimate(self, values: Sequence[float]) -> Estimate:
        """Interquartile mean with an interval over actions."""
        return clustered_estimate(values, [episode.action for episode in self.episodes])


@dataclass(frozen=True, eq=False)
class ResidualResult:
    """What the short run gave.

    Attributes:
        route: of the chain below.
        mapping: that chain.
        held_out: actions that neither the mapping nor the policy had seen.
        trained: the policy and how it learnt.
        untrained_is_base: whether the untrained policy gave exactly the base's trajectories.
        agents: base, lead, tuned Kalman filter, predictor and residual; the residual last.
    """

    route: Route
    mapping: Mapping
    held_out: tuple[str, ...]
    trained: Trained
    untrained_is_base: bool
    agents: tuple[AgentResult, ...]

    def agent(self, name: str) -> AgentResult:
        """The result of one agent."""
        return next(agent for agent in self.agents if agent.name == name)

    def best_other(self) -> AgentResult:
        """The agent with the least mean J but for the residual."""
        return min((one for one in self.agents if one.name != "residual"), key=lambda one: float(np.mean(one.costs)))

    def change(self) -> Estimate:
        """Change of J from the best of the others to the residual, episode by episode, interval over actions."""
        other, policy = self.best_other(), self.agent("residual")
        return policy.estimate([after - before for after, before in zip(policy.costs, other.costs, strict=True)])

    def headline(self) -> Headline:
        """The residual against the best of the others in one number."""
        other, policy = self.best_other(), self.agent("residual")
        before, after = (agent.estimate(agent.costs).value for agent in (other, policy))  # as in the table
        change = self.change()
        return Headline(
            f"Residual: J against {other.name}, the best of the others",
            f"{100 * (after / before - 1):+.1f} %",
            f"J {before:.2f} to {after:.2f} on unseen actions; change {_words(change)}",
            "good" if change.high < 0 else "plain" if change.low <= 0 else "warn",
        )

    def table(self) -> Table:
        """Every agent beside the base."""
        columns = [
            Column("Agent"),
            Column("J", "", 2, 1, "what it is trained for: mm + 0.05 mrad + jitter, against the mapping"),
            Column("Tracking error", "mm", 2, 1000, "landmarks from where the mapping asked them to be"),
            Column("Landmark error", "cm", 2, 100, "landmarks from the recorded motion"),
            Column("Joint error", "deg", 2, 180 / np.pi, "against the recorded motion"),
            Column("Jitter", "mm/frame³", 2, 1000),
            Column("Reward", "", 1),
        ]
        rows: list[list[Cell]] = [
            [
                agent.name,
                agent.estimate(agent.costs),
                agent.estimate(agent.tracking),
                agent.estimate([episode.landmark_error for episode in agent.episodes]),
                agent.estimate([episode.joint_error for episode in agent.episodes]),
                agent.estimate([episode.jitter for episode in agent.episodes]),
                agent.estimate([episode.reward for episode in agent.episodes]),
            ]
            for agent in self.agents
        ]
        equal = "equals the base bit for bit" if self.untrained_is_base else "differs from the base: a fault"
        note = (
            f"{name_of(self.route)} on {len(self.held_out)} held-out actions "
            f"({len(self.agents[0].episodes)} episodes) in Bullet. The untrained policy {equal}. The policy "
            "stands on the predictor and is trained to follow what the mapping asks for: against the recorded motion "
            "there remains the mapping's error on unseen actions, which no agent can know."
        )
        return Table("Every agent on unseen actions", columns, rows, note)

    def blocks(self) -> list[Block]:
        """The report's section."""
        change = self.change()
        verdict = "an improvement" if change.high < 0 else "a loss" if change.low > 0 else "no difference shown"
        series = {
            agent.name: [
                agent.estimate([episode.landmark_error for episode in agent.episodes]),
                agent.estimate(agent.tracking),
            ]
            for agent in self.agents
        }
        steps = [leg.steps / 1000 for leg in self.trained.history]
        curve = {
            "residual": [Estimate.exactly(leg.policy.objective) for leg in self.trained.history],
            "what it stands on": [Estimate.exactly(leg.base.objective) for leg in self.trained.history],
        }
        groups = ["from the recorded motion", "from what the mapping asked for"]
        return [
            Text(
                f"J of the residual minus that of {self.best_other().name!r}, the best of the others, episode by "
                f"episode: {_words(change)}: {verdict}."
            ),
            self.table(),
            BarPlot("Distance of the robot's landmarks", "mm", groups, series, 1000.0),
            CurvePlot(
                "How the policy learnt", "thousand steps", "J", steps, curve, 1.0,
                "On validation actions, kept apart from the training ones, in the servo model.",
            ),
        ]  # fmt: skip

    def playback(self) -> list[PlaybackChain]:
        """The residual's first episodes for the playback."""
        from syda_gym.evaluation.demo.playback import playback_chain

        name = f"{name_of(self.route)} + residual"
        return [playback_chain(name, one, self.mapping) for one in self.agent("residual").recordings[:2]]

    def to_dict(self) -> dict[str, Any]:
        """As JSON-able data."""
        return {
            "route": list(self.route),
            "held_out": list(self.held_out),
            "untrained_is_base": self.untrained_is_base,
            "best_other": self.best_other().name,
            "change_j": self.change().to_dict(),
            "agents": {
                agent.name: {
                    "tracking_m": list(agent.tracking),
                    "j": list(agent.costs),
                    **without_unknown([episode.to_dict() for episode in agent.episodes]),
                }
                for agent in self.agents
            },
        }


def _words(change: Estimate) -> str:
    return f"{change.value:+.2f} (95 % interval {change.low:+.2f} to {change.high:+.2f})"
