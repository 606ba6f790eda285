"""The demo's short residual run: trained on the fitted actions, compared with its rivals on the held-out ones.

It is trained on the robot's own recorded motion and judged on actions that neither it nor the mapping has seen, beside
the analytic lead, which undoes the motors' lag by formula.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.embodiments.embodiment import landmark_error
from syda_gym.evaluation.chains import Links, Route, name_of
from syda_gym.evaluation.episodes import EpisodeFigures, Recording, figures_of_all, make_env, play_all
from syda_gym.evaluation.report import BarPlot, Column, CurvePlot, Headline, PlaybackChain, Table, Text
from syda_gym.evaluation.report.model import Block, Cell
from syda_gym.evaluation.statistics import Estimate, clustered_estimate
from syda_gym.motions.clip import Motions

if TYPE_CHECKING:
    from syda_gym.agents.agent import Agent
    from syda_gym.agents.config import ResidualConfig
    from syda_gym.agents.training import Trained
    from syda_gym.mappings.mapping import Mapping

__all__ = ["AgentResult", "ResidualResult", "train_and_compare"]

PRESET = "short"
"""Hyper-parameters of the demo: about ten seconds of training in the servo model."""


@dataclass(frozen=True, eq=False)
class AgentResult:
    """One agent on the held-out actions.

    Attributes:
        name: of the agent.
        episodes: figures against the recorded motion.
        tracking: mean landmark distance of each episode from what the mapping asked for [m].
        recordings: of each episode.
    """

    name: str
    episodes: tuple[EpisodeFigures, ...]
    tracking: tuple[float, ...]
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
        agents: base alone, analytic lead and residual.
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

    def change(self) -> Estimate:
        """Change of the landmark error from base to residual [m], episode by episode, interval over actions."""
        base, policy = self.agent("base"), self.agent("residual")
        pairs = zip(policy.episodes, base.episodes, strict=True)
        return base.estimate([after.landmark_error - before.landmark_error for after, before in pairs])

    def headline(self) -> Headline:
        """Base against residual in one number."""
        base, policy = (
            self.agent(name).estimate([episode.landmark_error for episode in self.agent(name).episodes]).value
            for name in ("base", "residual")
        )
        change = self.change()
        return Headline(
            "Residual: landmark error",
            f"{100 * (policy / base - 1):+.0f} %",
            f"{100 * base:.2f} to {100 * policy:.2f} cm on unseen actions; change {_words(change)}",
            "good" if change.high < 0 else "plain" if change.low <= 0 else "warn",
        )

    def table(self) -> Table:
        """Every agent beside the base."""
        columns = [
            Column("Agent"),
            Column("Tracking error", "mm", 2, 1000, "landmarks from where the mapping asked them to be"),
            Column("Landmark error", "cm", 2, 100, "landmarks from the recorded motion"),
            Column("Joint error", "deg", 2, 180 / np.pi, "against the recorded motion"),
            Column("Jitter", "mm/frame³", 2, 1000),
            Column("Reward", "", 1),
        ]
        rows: list[list[Cell]] = [
            [
                agent.name,
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
            f"({len(self.agents[0].episodes)} episodes) in Bullet. The untrained policy {equal}. The lead knows the "
            "motors' lag exactly; what is left is the mapping's error on unseen actions."
        )
        return Table("Base, lead and residual on unseen actions", columns, rows, note)

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
            "residual": [Estimate.exactly(leg.policy.landmark_mm) for leg in self.trained.history],
            "base alone": [Estimate.exactly(leg.base.landmark_mm) for leg in self.trained.history],
        }
        groups = ["from the recorded motion", "from what the mapping asked for"]
        return [
            Text(
                "Landmark error of the residual minus that of the base, episode by episode: "
                f"{_words(change)}: {verdict}."
            ),
            self.table(),
            BarPlot("Distance of the robot's landmarks", "mm", groups, series, 1000.0),
            CurvePlot(
                "How the policy learnt", "thousand steps", "landmark error [mm]", steps, curve, 1.0,
                "On validation streams of the training actions, in the servo model.",
            ),
        ]  # fmt: skip

    def playback(self) -> list[PlaybackChain]:
        """The residual's first episodes for the playback."""
        from syda_gym.evaluation.demo_report import playback_chain

        name = f"{name_of(self.route)} + residual"
        return [playback_chain(name, one, self.mapping) for one in self.agent("residual").recordings[:2]]

    def to_dict(self) -> dict[str, Any]:
        """As JSON-able data."""
        return {
            "route": list(self.route),
            "held_out": list(self.held_out),
            "untrained_is_base": self.untrained_is_base,
            "change_m": self.change().to_dict(),
            "agents": {
                agent.name: {
                    "tracking_m": list(agent.tracking),
                    "episodes": [episode.to_dict() for episode in agent.episodes],
                }
                for agent in self.agents
            },
        }


def train_and_compare(
    motions: Motions,
    route: Sequence[str],
    held_out: Sequence[str],
    seed: int = 0,
    *,
    config: ResidualConfig | None = None,
    links: Links | None = None,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[float], None] | None = None,
) -> ResidualResult:
    """Trains a residual on all other actions and plays base, lead and residual on the held-out ones.

    Args:
        motions: the data set.
        route: the chain that gives the base command.
        held_out: actions for the comparison.
        seed: of the fits, the training and the episodes.
        config: hyper-parameters; the preset ``PRESET`` if ``None``.
        links: fitted links to take the chain from; fitted anew if ``None``.
        folder: where ``residual.safetensors`` and ``residual.json`` are stored; nowhere if ``None``.
        progress: told the finished fraction.
    """
    from syda_gym.agents.agent import BaseAlone
    from syda_gym.agents.bundle import save_agent
    from syda_gym.agents.classical import Lead
    from syda_gym.agents.config import ResidualConfig
    from syda_gym.agents.residual import ResidualPolicy
    from syda_gym.agents.training import train_residual

    tell = progress or (lambda done: None)
    mapping = (links or Links(motions, seed=seed, groups=[tuple(held_out)])).chain(route, held_out)
    training = [name for name in motions.pair(route[0], route[-1]).action_names if name not in held_out]
    options: dict[str, Any] = {"operator": route[0], "robot": route[-1], "mapping": mapping, "motions": motions}
    settings = config or ResidualConfig.preset(PRESET)
    trained = train_residual(
        {**options, "actions": training},
        settings,
        seed=seed,
        progress=lambda done: tell(0.8 * done),
    )
    interface = trained.agent.interface
    agents: dict[str, Agent] = {
        "base": BaseAlone(interface),
        "lead": Lead(interface, BaseAlone(interface)),
        "residual": trained.agent,
    }
    results = []
    for place, (name, agent) in enumerate(agents.items()):
        results.append(_played(mapping, motions, held_out, name, agent, seed))
        tell(0.8 + 0.2 * (place + 1) / len(agents))
    untrained = ResidualPolicy.untrained(interface, BaseAlone(interface), scale=settings.scale)
    equal = _same_start(mapping, motions, held_out, untrained, results[0].recordings[0], seed)
    result = ResidualResult(tuple(route), mapping, tuple(held_out), trained, equal, tuple(results))
    if folder is not None:
        save_agent(
            trained.agent,
            os.path.join(folder, "residual"),
            mapping=mapping.card.to_json(),
            training={"config": settings.as_dict(), "seed": seed, "actions": training},
            figures={"held_out": list(held_out), "change_m": result.change().to_dict()},
        )
    return result


def _played(
    mapping: Mapping, motions: Motions, held_out: Sequence[str], name: str, agent: Agent, seed: int
) -> AgentResult:
    """An environment of its own for every agent: after a contact Bullet does not start again from the same bits."""
    env = make_env(mapping, motions, held_out, self_collision=True)
    try:
        recordings = tuple(play_all(env, agent, seed))
        tracking = tuple(float(landmark_error(env.robot, one.q, one.base).mean()) for one in recordings)
        figures = tuple(figures_of_all(recordings, env.robot, mapping))
        return AgentResult(name, figures, tracking, recordings)
    finally:
        env.close()


def _same_start(
    mapping: Mapping, motions: Motions, held_out: Sequence[str], agent: Agent, expected: Recording, seed: int
) -> bool:
    """Whether an agent's first episode equals a recorded one bit for bit."""
    env = make_env(mapping, motions, held_out, self_collision=True)
    try:
        return bool(np.array_equal(next(iter(play_all(env, agent, seed))).q, expected.q))
    finally:
        env.close()


def _words(change: Estimate) -> str:
    return f"{1000 * change.value:+.1f} mm (95 % interval {1000 * change.low:+.1f} to {1000 * change.high:+.1f})"
