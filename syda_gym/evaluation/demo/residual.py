"""The demo's short residual run: trained on the fitted actions, compared with its rivals on the held-out ones.

It is trained to follow what the mapping asks for, not the robot's recorded motion: the difference between the two is
the mapping's error, which on unseen actions no agent can know; a policy that is paid for it learns the errors of the
training actions and brings them to the others. It is judged beside base, lead, tuned Kalman filter and the predictor
that it stands on, on actions that neither they nor the mapping have seen.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.embodiments.embodiment import landmark_error
from syda_gym.evaluation.chains import Links
from syda_gym.evaluation.demo.residual_result import AgentResult, ResidualResult
from syda_gym.evaluation.episodes import Recording, figures_of_all, make_env, play_all
from syda_gym.motions.clip import Motions

if TYPE_CHECKING:
    from syda_gym.agents.agent import Agent
    from syda_gym.agents.residual.config import ResidualConfig
    from syda_gym.mappings.mapping import Mapping

__all__ = ["train_and_compare"]

PRESET = "short"
"""Hyper-parameters of the demo: less than a minute of training in the servo model, the predictor's included."""

_ITERATIONS = 150  # of the predictor


def train_and_compare(
    motions: Motions,
    route: Sequence[str],
    held_out: Sequence[str],
    seed: int = 0,
    *,
    config: ResidualConfig | None = None,
    iterations: int = _ITERATIONS,
    links: Links | None = None,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[float], None] | None = None,
) -> ResidualResult:
    """Trains a residual on all other actions and plays it beside the others on the held-out ones.

    Args:
        motions: the data set.
        route: the chain that gives the base command.
        held_out: actions for the comparison.
        seed: of the fits, the training and the episodes.
        config: hyper-parameters; the preset ``PRESET`` if ``None``.
        iterations: of the predictor, where the policy stands on one.
        links: fitted links to take the chain from; fitted anew if ``None``.
        folder: where ``residual.safetensors`` and ``residual.json`` are stored; nowhere if ``None``.
        progress: told the finished fraction.
    """
    from syda_gym.agents.agent import BaseAlone
    from syda_gym.agents.bundle import save_agent
    from syda_gym.agents.learned.policy import ResidualPolicy
    from syda_gym.agents.predictor.predictor_training import PredictorConfig
    from syda_gym.agents.residual.config import ResidualConfig
    from syda_gym.agents.streams.ground import Ground
    from syda_gym.agents.training import train_stack

    tell = progress or (lambda done: None)
    mapping = (links or Links(motions, seed=seed, groups=[tuple(held_out)])).chain(route, held_out)
    training = [name for name in motions.pair(route[0], route[-1]).action_names if name not in held_out]
    options: dict[str, Any] = {"operator": route[0], "robot": route[-1], "mapping": mapping, "motions": motions}
    settings = config or ResidualConfig.preset(PRESET)
    found = train_stack(
        Ground({**options, "actions": training, "reference": "mapped"}),
        settings,
        predictor=PredictorConfig(iterations=iterations, rounds=min(3, iterations)),
        seed=seed,
        progress=lambda done: tell(0.8 * done),
    )
    trained, agents = found.trained, found.agents
    interface = trained.agent.interface
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
            figures={"held_out": list(held_out), "change_j": result.change().to_dict()},
        )
    return result


def _played(
    mapping: Mapping, motions: Motions, held_out: Sequence[str], name: str, agent: Agent, seed: int
) -> AgentResult:
    """Plays the held-out actions in an environment of the agent's own."""
    from syda_gym.agents.figures import episode_figures

    env = make_env(mapping, motions, held_out, self_collision=True)
    try:
        recordings = tuple(play_all(env, agent, seed))
        tracking = tuple(float(landmark_error(env.robot, one.q, one.base).mean()) for one in recordings)
        costs = tuple(episode_figures(env.robot, one.q, one.base).objective for one in recordings)
        figures = tuple(figures_of_all(recordings, env.robot, mapping))
        return AgentResult(name, figures, tracking, costs, recordings)
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
