"""Training of the default stack: a predictor on the tuned Kalman filter, then a residual policy on the predictor.

Nothing is judged beside the base alone: base, lead, tuned Kalman filter and predictor play the same validation
episodes, of actions that nobody was trained on, and the verdict compares with the best of them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from syda_gym.agents.agent import Agent
from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical.projection import capsule_model
from syda_gym.agents.classical.rivals import CONTACT_RIVALS, Lead, make_rival
from syda_gym.agents.classical.tuned import tuned_rival
from syda_gym.agents.figures import Figures
from syda_gym.agents.predictor.predictor_training import PredictorConfig, train_predictor
from syda_gym.agents.residual.config import STACK, ResidualConfig
from syda_gym.agents.residual.costs import CostWeights
from syda_gym.agents.residual.residual_training import Trained, train_on_streams
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import Streams, score_streams

__all__ = ["Comparison", "StackTraining", "compare_on_streams", "train_predictor_on", "train_stack", "without_lead"]

Progress = Callable[[float], None]

RIVALS_BESIDE = ("base", "lead", "kalman")
"""Who is always shown beside what was trained; the Kalman filter with the settings of the cell."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Agents on the same validation episodes, ranked by one cost.

    Attributes:
        figures: of every agent by name; what was trained comes last.
        cost: by which they are ranked.
    """

    figures: Mapping[str, Figures]
    cost: CostWeights

    @property
    def mine(self) -> str:
        """What was trained."""
        return list(self.figures)[-1]

    @property
    def best_other(self) -> str:
        """The best of the others."""
        return min(list(self.figures)[:-1], key=lambda name: self.cost.of_figures(self.figures[name]))

    @property
    def gained(self) -> bool:
        """Whether what was trained is better than each of the others."""
        return self.cost.of_figures(self.figures[self.mine]) < self.cost.of_figures(self.figures[self.best_other])


@dataclass(frozen=True, eq=False)
class StackTraining:
    """What training a residual policy on its stack gave.

    Attributes:
        trained: the policy and how it learnt.
        agents: every agent of the comparison.
        comparison: base, lead, tuned Kalman filter, what the policy stands on, and the policy.
    """

    trained: Trained
    agents: Mapping[str, Agent]
    comparison: Comparison


def train_stack(
    ground: Ground,
    config: ResidualConfig,
    *,
    base: Agent | None = None,
    predictor: PredictorConfig | None = None,
    seed: int = 0,
    folder: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> StackTraining:
    """Trains a residual policy on what its configuration says it stands on.

    Args:
        ground: motions, mapping and disturbances.
        config: hyper-parameters. ``config.base`` is ``"stack"`` (a predictor is trained first, on the Kalman filter
            with the settings of the cell) or the name of a rival.
        base: the agent below, instead of what the configuration names.
        predictor: hyper-parameters of the predictor.
        seed: of everything.
        folder: where checkpoints, logs and the predictor (``below``) go; nothing is written if left out.
        resume: go on from the checkpoint in ``folder``, on the predictor that lies there.
        progress: called with the share that is done.

    Raises:
        SydaError: bad options, nothing to resume, a base that does not fit.
    """
    tell = progress or (lambda share: None)
    train = ground.record_part("train", config.episodes, seed=2 * seed)
    validation = ground.record_part("validation", config.validation_episodes, seed=2 * seed + 1)
    place = None if folder is None else Path(folder) / "below"
    below, share = base, 0.0
    if below is None and config.base != STACK:
        below = make_rival(config.base, ground.interface, **config.base_settings)
    elif below is None and resume and place is not None and place.with_suffix(".json").is_file():
        below = load_agent(place, ground.interface)
    elif below is None:
        share = 0.3
        below = train_predictor_on(
            ground, tuned_rival("kalman", ground.interface, ground.options.disturbances), train, validation,
            predictor or PredictorConfig(), seed, lambda done: tell(share * done),
        )  # fmt: skip
        if place is not None:
            save_agent(below, place, mapping={}, training={"seed": seed}, figures={})
    trained = train_on_streams(
        below, train, validation, ground.rates, config, seed=seed, folder=folder, resume=resume,
        progress=lambda done: tell(share + (1.0 - share) * done),
    )  # fmt: skip
    agents = beside(ground, below) | {"residual": trained.agent}
    return StackTraining(trained, agents, compare_on_streams(agents, validation, ground, config.cost))


def train_predictor_on(
    ground: Ground,
    base: Agent,
    train: Streams,
    validation: Streams,
    config: PredictorConfig,
    seed: int,
    progress: Progress | None = None,
) -> Agent:
    """The predictor with the lead on top, on an agent whose own lead is left off."""
    below = without_lead(base)
    return train_predictor(below, train, validation, ground.rates, config, seed=seed, progress=progress).agent


def without_lead(agent: Agent) -> Agent:
    """An agent without the lead on its top; a predictor brings its own."""
    return agent.base if isinstance(agent, Lead) and agent.base is not None else agent


def beside(ground: Ground, below: Agent) -> dict[str, Agent]:
    """The agents that are always shown, and what was trained upon, under the name of what is learned in it."""
    agents = {name: tuned_rival(name, ground.interface, ground.options.disturbances) for name in RIVALS_BESIDE}
    own = without_lead(below).name
    name = own if own in ("predictor", *CONTACT_RIVALS) else " > ".join(below.stack[1:])
    if name and not any(_same(below, agent) for agent in agents.values()):
        agents[name if name not in agents else f"{name} (below)"] = below
    return agents


def compare_on_streams(
    agents: Mapping[str, Agent], streams: Streams, ground: Ground, cost: CostWeights | None = None
) -> Comparison:
    """Plays agents on the same streams; what was trained must come last."""
    weights = cost or CostWeights()
    capsules = capsule_model(ground.interface.robot) if weights.contact else None
    return Comparison(
        {name: score_streams(agent, streams, ground.rates, capsules=capsules) for name, agent in agents.items()},
        replace(weights),
    )


def _same(one: Agent, two: Agent) -> bool:
    from syda_gym.agents.stacks import stack_arrays, stack_spec

    return stack_spec(one) == stack_spec(two) and not stack_arrays(one) and not stack_arrays(two)
