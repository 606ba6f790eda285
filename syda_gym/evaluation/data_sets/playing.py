"""Played: one episode as rows of what was seen before each step, what was commanded, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray

if TYPE_CHECKING:
    from syda_gym.agents.agent import Agent
    from syda_gym.envs.teleop import SydaTeleopEnv

__all__ = ["Played", "play"]


@dataclass(frozen=True, eq=False)
class Played:
    """One episode; row ``k`` is what was there *before* command ``k``, and the reward that followed it.

    Attributes:
        motion: name of the clip.
        action: what is done in it.
        seed: of the episode.
        q: joint angles ``(N, n)`` [rad].
        qd: joint speeds ``(N, n)`` [rad/s].
        operator: newest frame of the operator ``(N, F)``.
        base: what the mapping asks for ``(N, n)`` [rad].
        command: joint angles that the motors got ``(N, n)`` [rad].
        reward: ``(N,)``.
        success: as the environment judged the whole episode.
    """

    motion: str
    action: str
    seed: int
    q: FloatArray
    qd: FloatArray
    operator: FloatArray
    base: FloatArray
    command: FloatArray
    reward: FloatArray
    success: bool

    def __len__(self) -> int:
        return len(self.q)


def play(env: SydaTeleopEnv, agent: Agent, clip: int, seed: int) -> Played:
    """Plays one episode.

    Args:
        env: the environment.
        agent: made for it.
        clip: index.
        seed: of disturbances and agent.
    """
    observation, info = env.reset(seed=seed, options={"motion": clip})
    agent.reset(1, seed)
    motion, action_name = str(info["motion"]), str(info["motion_action"])
    seen: list[Any] = []
    rows: list[tuple[Any, ...]] = []
    done = False
    while not done:
        seen.append(observation)
        q, base = info["q"], info["base"]
        action = env.action_from_command(agent.act(observation[None])[0])
        observation, reward, terminated, truncated, info = env.step(np.asarray(action, dtype=np.float32))
        rows.append((q, base, info["command"], float(reward)))
        done = terminated or truncated
    observations = np.array(seen, dtype=np.float64)
    angles, bases, commands, rewards = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
    return Played(
        motion=motion,
        action=action_name,
        seed=seed,
        q=angles,
        qd=observations[:, env.layout["qd"]],
        operator=observations[:, env.layout["operator"]],
        base=bases,
        command=commands,
        reward=rewards,
        success=bool(info["is_success"]),
    )
