"""Rollout: agents played in the environment itself, clip by clip, under the same disturbances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent
from syda_gym.agents.figures import Figures, episode_figures, mean_figures
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.errors import AgentError

__all__ = ["EpisodeResult", "evaluate", "mean_of", "play_episode"]


@dataclass(frozen=True, eq=False)
class EpisodeResult:
    """One episode of one agent.

    Attributes:
        motion: name of the clip.
        action: what is done in it.
        figures: how well it was tracked.
        reward: sum of the environment's rewards.
        q: joint angles after each step ``(T, n)`` [rad].
        reference: where they should have been ``(T, n)`` [rad].
        command: what the agent asked for ``(T, n)`` [rad].
        contacts: touching pairs of links in each step ``(T,)``.
    """

    motion: str
    action: str
    figures: Figures
    reward: float
    q: FloatArray
    reference: FloatArray
    command: FloatArray
    contacts: FloatArray


def evaluate(
    options: TeleopOptions | Mapping[str, Any],
    agents: Mapping[str, Agent],
    *,
    clips: Sequence[int | str] | None = None,
    draws: int = 1,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> dict[str, list[EpisodeResult]]:
    """Plays agents on the same episodes.

    Args:
        options: of the environment; ``action_mode`` becomes ``position``, because agents give commands.
        agents: by the names under which results are returned.
        clips: which to play; all by default.
        draws: episodes per clip, each with disturbances of its own.
        seed: every agent meets the disturbances of ``seed``, clip and draw.
        progress: called with the share that is done.

    Returns:
        One list per agent, ordered by draw and clip.

    Raises:
        AgentError: an agent made for another robot, layout or rate.
    """
    given = options if isinstance(options, TeleopOptions) else TeleopOptions(**options)
    env = SydaTeleopEnv(options=TeleopOptions.of(given, {"action_mode": "position"}))
    try:
        for name, agent in agents.items():
            _check(env, name, agent)
        chosen = range(len(env.clip_names)) if clips is None else clips
        results: dict[str, list[EpisodeResult]] = {name: [] for name in agents}
        total = draws * len(list(chosen)) * max(len(agents), 1)
        for draw in range(draws):
            for place, clip in enumerate(chosen):
                for name, agent in agents.items():
                    episode_seed = int(np.random.SeedSequence([seed, draw, place]).generate_state(1)[0])
                    results[name].append(play_episode(env, agent, clip, seed=episode_seed))
                    if progress is not None:
                        progress(sum(len(found) for found in results.values()) / total)
        return results
    finally:
        env.close()


def play_episode(env: SydaTeleopEnv, agent: Agent, clip: int | str, *, seed: int) -> EpisodeResult:
    """One episode in an environment with ``action_mode="position"``.

    Args:
        env: the environment.
        agent: who acts; it is reset first.
        clip: name or index.
        seed: of the episode's disturbances.
    """
    observation, info = env.reset(seed=seed, options={"motion": clip})
    agent.reset(1, seed)
    rows: list[tuple[Any, ...]] = []
    reward, done = 0.0, False
    while not done:
        command = agent.act(observation[None])[0]
        observation, gained, terminated, truncated, info = env.step(env.action_from_command(command))  # type: ignore[arg-type]
        rows.append((info["q"], info["reference"], info["command"], info["contacts"]))
        reward += float(gained)
        done = terminated or truncated
    q, reference, sent, contacts = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
    return EpisodeResult(
        str(info["motion"]),
        str(info["motion_action"]),
        episode_figures(env.robot, q, reference, contacts),
        reward,
        q,
        reference,
        sent,
        contacts,
    )


def mean_of(results: Sequence[EpisodeResult]) -> Figures:
    """Mean figures over episodes."""
    return mean_figures([result.figures for result in results])


def _check(env: SydaTeleopEnv, name: str, agent: Agent) -> None:
    from syda_gym.agents.interface import Interface

    if not isinstance(agent, Agent):
        raise AgentError(f"{name!r} is a {type(agent).__name__}, expected an Agent; see syda_gym.agents")
    Interface.of(env).check(agent.interface.spec(), f"the agent {name!r}")
